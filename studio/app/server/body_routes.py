"""Bodies: which there are, what each is made of, and those of one's own, made by changing another."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Query
from pydantic import Field

from studio.app.server.app_state import App, AppState
from studio.app.server.requests import Arguments, MaybeName, body_of
from studio.app.server.schemas import Answer, Number
from studio.app.server.subject_routes import LimbDrawing, limb_drawings
from studio.body.catalogue import body_files, list_bodies, load_body
from studio.body.definition import BodyDefinition, split_sign
from studio.body.editing import SIZES
from studio.body.mirroring import has_sides
from studio.body.model import BodyModel
from studio.body.writing import body_text
from studio.foundations.errors import BodyError, StudioError
from studio.operations.own_bodies import body_to_edit, edit_body
from studio.sessions.own_bodies import bodies_folder, body_folders, discard_body
from studio.sessions.session import Session

router = APIRouter(prefix="/api/bodies", tags=["bodies"])


class BodyEntry(Answer):
    """A body that can be tracked. own: whose it is: the workspace's, a session's, "" for one that is shipped.
    problem: why its file cannot be read, "" if it can.
    """

    name: str
    title: str
    parameters: int
    limbs: int
    own: Literal["", "workspace", "session"]
    problem: str = ""


class BodyList(Answer):
    """All bodies by name. chosen: the session's, "" without one."""

    bodies: list[BodyEntry]
    chosen: str = ""


class SizeView(Answer):
    """A size of a limb: mm, or for a scale without unit. dimension: its name in the body's file, "" where the limb has
    a number of its own.
    """

    value: float
    dimension: str


class LimbSizes(Answer):
    """A limb that can be changed."""

    name: str
    joint: str
    side: str
    length: SizeView
    radius_start: SizeView
    radius_end: SizeView
    scale_x: SizeView
    scale_y: SizeView


class DimensionView(Answer):
    """A dimension that is no limb's size: where joints and markers lie. unit: "mm", or "" for a ratio."""

    name: str
    value: float
    unit: Literal["mm", ""]


class LimitView(Answer):
    """A parameter: degrees or mm. lower, upper: null where there is none. neutral: null where it follows from sizes."""

    name: str
    label: str
    kind: Literal["angle", "length"]
    limb: str
    lower: Number
    upper: Number
    neutral: Number
    max_step: float


class MarkerView(Answer):
    """A named point, mm in its joint's frame."""

    name: str
    joint: str
    at: list[float]


class BodyDetail(Answer):
    """A body with all that can be changed. text: its file. sided: whether it has a left and a right. drawings: its
    limbs as it stands. saved: what it was saved as, "" where it was not.
    """

    name: str
    title: str
    source: str
    text: str
    sided: bool
    limbs: list[LimbSizes]
    dimensions: list[DimensionView]
    limits: list[LimitView]
    markers: list[MarkerView]
    joints: list[str]
    drawings: list[LimbDrawing]
    notes: list[str] = Field(default_factory=list)
    saved: str = ""


class DiscardedBody(Answer):
    """Where a body lies that was thrown away, in the workspace's trash."""

    trash: str


OfSession = Annotated[
    str, Query(max_length=64, description="A session, whose own bodies count too; its body is in its size.")
]


@router.get("")
def bodies(app: App, session: OfSession = "") -> BodyList:
    """The bodies that are shipped, those of the workspace and of a session."""
    opened = _session(app, session)
    own, workspace = (_names(bodies_folder(app.workspace, one)) for one in (opened, None))
    folders = body_folders(app.workspace, opened)
    entries: list[BodyEntry] = []
    for name in list_bodies(folders):
        whose = "session" if opened and name in own else "workspace" if name in workspace else ""
        try:
            found = load_body(name, folders)
        except StudioError as problem:
            entries.append(
                BodyEntry(name=name, title=name, parameters=0, limbs=0, own=whose, problem=str(problem))
            )
            continue
        entries.append(
            BodyEntry(
                name=name,
                title=found.title,
                own=whose,
                parameters=len(found.parameters),
                limbs=len(found.drawn),
            )
        )
    return BodyList(bodies=entries, chosen=opened.manifest.body if opened else "")


@router.get("/{name}")
def body(name: str, app: App, session: OfSession = "") -> BodyDetail:
    """A body with all that can be changed of it."""
    opened = _session(app, session)
    found = body_to_edit(name, opened, bodies_folder(app.workspace, None))
    return body_detail(found, body_text(found))


@router.post("/{name}/edit")
def edit(
    name: str,
    arguments: Annotated[
        Arguments,
        body_of(
            edit_body,
            "BodyEdit",
            without=("body",),
            session=(MaybeName, Field(None, description="Whose body it is, and to whom it is saved.")),
        ),
    ],
    app: App,
) -> BodyDetail:
    """Change a body, and save it as one's own where a name is given; a page sends the text that it has, with one change
    after the other.
    """
    session = _session(app, arguments.more["session"] or "")
    folder = bodies_folder(app.workspace, session)
    found = edit_body(name, **arguments, session=session, folder=folder)
    if found.file is not None and session is not None:
        app.events.session_changed(session.name)
    saved = found.file.stem if found.file else ""
    return body_detail(found.body, found.text, list(found.notes), saved)


@router.delete("/{name}")
def discard(name: str, app: App, session: OfSession = "") -> DiscardedBody:
    """Move a body of one's own to the trash; runs keep the copy that they were made with."""
    folder = bodies_folder(app.workspace, _session(app, session))
    return DiscardedBody(trash=discard_body(app.workspace, name, folder).name)


def body_detail(body: BodyModel, text: str, notes: list[str] | None = None, saved: str = "") -> BodyDetail:
    """A body as the page shows it. text : its file."""
    definition = body.definition
    if definition is None:
        raise BodyError(f"Body '{body.name}' was not read from a file.", "Choose a body that was.")
    limbs = _limbs(body, definition)
    sized = {getattr(limb, key).dimension for limb in limbs for key in SIZES}
    markers = [
        MarkerView(name=one.name, joint=body.joints[one.joint].name, at=one.offset.tolist())
        for one in body.markers
    ]
    return BodyDetail(
        name=body.name,
        title=body.title,
        source=definition.source,
        text=text,
        sided=has_sides(body),
        limbs=limbs,
        dimensions=[
            DimensionView(
                name=name, value=value, unit="" if definition.dimensions[name].ratio is not None else "mm"
            )
            for name, value in body.dimensions.items()
            if name not in sized
        ],
        limits=_limits(body, definition),
        markers=markers,
        joints=[joint.name for joint in body.joints],
        drawings=limb_drawings(body),
        notes=notes or [],
        saved=saved,
    )


def _limbs(body: BodyModel, definition: BodyDefinition) -> list[LimbSizes]:
    found: list[LimbSizes] = []
    for entry, limb in zip(definition.limbs, body.limbs, strict=True):
        sizes: dict[str, SizeView] = {}
        for key in SIZES:
            written = getattr(entry, key)
            name = split_sign(written)[1] if isinstance(written, str) else ""
            sizes[key] = SizeView(value=abs(float(getattr(limb, key))), dimension=name)
        found.append(LimbSizes(name=entry.name, joint=entry.joint, side=entry.side, **sizes))
    return found


def _limits(body: BodyModel, definition: BodyDefinition) -> list[LimitView]:
    return [
        LimitView(
            name=entry.name,
            label=model.label,
            kind=entry.kind,
            limb=entry.limb,
            lower=entry.lower,
            upper=entry.upper,
            neutral=np.nan if isinstance(entry.neutral, tuple) else entry.neutral,
            max_step=entry.max_step,
        )
        for entry, model in zip(definition.parameters, body.parameters, strict=True)
    ]


def _session(app: AppState, name: str) -> Session | None:
    return app.workspace.session(name) if name else None


def _names(folder: Path) -> set[str]:
    """The own bodies of a folder; one that shadows a shipped body is that folder's."""
    return {path.stem for path in body_files(folder)} if folder.is_dir() else set()
