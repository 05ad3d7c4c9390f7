"""Bodies: which there are, what each is made of, and those of one's own, made by changing another."""

from pathlib import Path
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query
from pydantic import Field

from studio.body.catalogue import body_files, list_bodies, load_body
from studio.body.definition import BodyDefinition, split_sign
from studio.body.editing import SIZES
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel
from studio.body.writing import body_text
from studio.errors import BodyError, StudioError
from studio.operations.own_bodies import body_to_edit, edit_body
from studio.server.app_state import App, AppState
from studio.server.body_schemas import (
    BodyDetail,
    BodyEntry,
    BodyList,
    DimensionView,
    DiscardedBody,
    LimbSizes,
    LimitView,
    MarkerView,
    SizeView,
)
from studio.server.requests import Arguments, MaybeName, body_of
from studio.server.subject_routes import limb_drawings
from studio.sessions.own_bodies import bodies_folder, body_folders, discard_body
from studio.sessions.session import Session

router = APIRouter(prefix="/api/bodies", tags=["bodies"])

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
        sided=_has_sides(body),
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


def _has_sides(body: BodyModel) -> bool:
    try:
        Mirror(body)
    except BodyError:
        return False
    return True


def _session(app: AppState, name: str) -> Session | None:
    return app.workspace.session(name) if name else None


def _names(folder: Path) -> set[str]:
    """The own bodies of a folder; one that shadows a shipped body is that folder's."""
    return {path.stem for path in body_files(folder)} if folder.is_dir() else set()
