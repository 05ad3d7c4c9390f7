"""The bodies, and everything that can be changed of one."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from studio.body.catalogue import body_files, list_bodies, load_body
from studio.body.definition import BodyDefinition, split_sign
from studio.body.editing import SIZES
from studio.body.mirroring import has_sides
from studio.body.model import BodyModel
from studio.body.stretching import with_slides
from studio.body.upright import LimbDrawing, limb_drawings
from studio.body.writing import body_text
from studio.foundations.errors import BodyError, StudioError
from studio.operations.own_bodies import EditedBody, bodies_folder, body_folders, body_to_edit
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@dataclass(frozen=True, slots=True)
class BodyEntry:
    """A body that can be tracked.

    own : whose it is: the workspace's, a session's, "" for a shipped one.
    problem : why its file cannot be read, "" if it can.
    """

    name: str
    title: str
    parameters: int
    limbs: int
    own: Literal["", "workspace", "session"]
    problem: str = ""


@dataclass(frozen=True, slots=True)
class BodyList:
    """All bodies by name.

    chosen : the session's, "" without one.
    """

    bodies: list[BodyEntry]
    chosen: str = ""


@dataclass(frozen=True, slots=True)
class SizeView:
    """A size of a limb: mm, or a scale without unit.

    dimension : its name in the body's file, "" where the limb has a number of its own.
    """

    value: float
    dimension: str


@dataclass(frozen=True, slots=True)
class LimbSizes:
    """A limb that can be changed."""

    name: str
    joint: str
    side: str
    length: SizeView
    radius_start: SizeView
    radius_end: SizeView
    scale_x: SizeView
    scale_y: SizeView


@dataclass(frozen=True, slots=True)
class DimensionView:
    """A dimension that is no limb's size: where joints and markers lie.

    unit : "mm", or "" for a ratio.
    """

    name: str
    value: float
    unit: Literal["mm", ""]


@dataclass(frozen=True, slots=True)
class LimitView:
    """A parameter: degrees or mm.

    lower, upper : null where there is none.
    neutral : null where it follows from sizes.
    """

    name: str
    label: str
    kind: Literal["angle", "length"]
    limb: str
    lower: float
    upper: float
    neutral: float
    max_step: float


@dataclass(frozen=True, slots=True)
class MarkerView:
    """A named point, mm in its joint's frame."""

    name: str
    joint: str
    at: list[float]


@dataclass(frozen=True, slots=True)
class BodyDetail:
    """A body with everything that can be changed.

    text : its file.
    sided : whether it has a left and a right.
    drawings : its limbs as it stands.
    saved : where it was saved, "" for nowhere.
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
    notes: tuple[str, ...] = ()
    saved: str = ""


def list_with_own(workspace: Workspace, session: Session | None) -> BodyList:
    """The shipped bodies, and those of the workspace and of a session."""
    folders = body_folders(workspace, session)
    own, shared = (_names(workspace, one) for one in (session, None))
    entries: list[BodyEntry] = []
    for name in list_bodies(folders):
        owner = "session" if session and name in own else "workspace" if name in shared else ""
        try:
            body = load_body(name, folders)
        except StudioError as problem:
            entries.append(BodyEntry(name, name, 0, 0, owner, str(problem)))
        else:
            entries.append(BodyEntry(name, body.title, len(body.parameters), len(body.drawn), owner))
    return BodyList(entries, session.manifest.body if session else "")


def _names(workspace: Workspace, session: Session | None) -> set[str]:
    """The own bodies of a folder; one with a shipped body's name takes its place."""
    folder = bodies_folder(workspace, session)
    return {path.stem for path in body_files(folder)} if folder.is_dir() else set()


def body_detail(name: str, workspace: Workspace, session: Session | None) -> BodyDetail:
    """A body with everything that can be changed; a session's own is in its subject's size. Raises BodyError."""
    body = body_to_edit(name, session, bodies_folder(workspace, None))
    return edited_detail(EditedBody(body, body_text(body)))


def edited_detail(edit: EditedBody) -> BodyDetail:
    """A body after a change. Raises BodyError."""
    body = edit.body
    definition = body.definition
    if definition is None:
        raise BodyError(f"Body '{body.name}' was not read from a file.", "Choose a body that was.")
    limbs = _limbs(body, definition)
    sized = {getattr(limb, key).dimension for limb in limbs for key in SIZES}
    return BodyDetail(
        name=body.name,
        title=body.title,
        source=definition.source,
        text=edit.text,
        sided=has_sides(body),
        limbs=limbs,
        dimensions=[
            DimensionView(name, value, "" if definition.dimensions[name].ratio is not None else "mm")
            for name, value in body.dimensions.items()
            if name not in sized
        ],
        limits=_limits(body, definition),
        markers=[
            MarkerView(one.name, body.joints[one.joint].name, one.offset.tolist()) for one in body.markers
        ],
        joints=[joint.name for joint in body.joints],
        drawings=limb_drawings(body),
        notes=edit.notes,
        saved=edit.file.stem if edit.file else "",
    )


def _limbs(body: BodyModel, definition: BodyDefinition) -> list[LimbSizes]:
    limbs: list[LimbSizes] = []
    for entry in definition.limbs:
        sizes: dict[str, SizeView] = {}
        for key in SIZES:
            written = getattr(entry, key)
            name = split_sign(written)[1] if isinstance(written, str) else ""
            sizes[key] = SizeView(abs(body.dimensions[name] if name else float(written)), name)
        limbs.append(LimbSizes(entry.name, entry.joint, entry.side, **sizes))
    return limbs


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
        for entry, model in zip(
            with_slides(definition, body.dimensions).parameters, body.parameters, strict=True
        )
    ]
