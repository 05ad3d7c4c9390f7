"""Your own bodies: an existing one is changed and saved under another name, or moved to the trash.

They are TOML files in a workspace's or a session's folder `bodies`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from studio.body.catalogue import SUFFIX, load_body, packaged_bodies
from studio.body.editing import edited
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.writing import body_text
from studio.foundations.declaring import Target, Terminal, Web, operation, taking
from studio.foundations.errors import BodyError
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, say
from studio.sessions.atomic_files import write_text, writing
from studio.sessions.names import checked_name
from studio.sessions.session import BODIES_NAME, Session
from studio.sessions.workspace import Workspace

MOST_TEXT = 1_000_000
MOST_CHANGES = 2000


@dataclass(frozen=True, slots=True, eq=False)
class EditedBody:
    """A body after a change.

    body : the body.
    text : its file.
    notes : on what else followed from the change.
    file : where it was saved.
    """

    body: BodyModel
    text: str
    notes: tuple[str, ...] = ()
    file: Path | None = None


@dataclass(frozen=True, slots=True)
class BodyChanges:
    """What is changed of a body: first sizes, limits and markers, then one side is copied onto the other."""

    sizes: Annotated[
        Mapping[str, float] | None,
        Field(
            max_length=MOST_CHANGES,
            description="A dimension, or a limb's LIMB.length, .radius_start, .radius_end, .scale_x, .scale_y, mm.",
        ),
        Terminal("--size", "NAME=MM"),
    ] = None
    limits: Annotated[
        Mapping[str, float] | None,
        Field(
            max_length=MOST_CHANGES,
            description="PARAMETER.lower, .upper, .neutral or .max_step, degrees or mm; inf for none.",
        ),
        Terminal("--limit", "NAME=DEGREES"),
    ] = None
    markers: Annotated[
        Sequence[str],
        Field(max_length=MOST_CHANGES, description="NAME=JOINT,X,Y,Z, mm in the joint's frame."),
        Terminal("--marker", "NAME=JOINT,X,Y,Z"),
    ] = ()
    without_markers: Annotated[
        Sequence[str],
        Field(max_length=MOST_CHANGES, description="Markers to remove."),
        Terminal("--without-marker", "NAME"),
    ] = ()
    mirror: Annotated[
        Literal["", "left", "right"],
        Field(description="The side that is copied onto the other, after all other changes."),
    ] = ""
    title: Annotated[
        str,
        Field(max_length=200, description="The title that people see."),
        Terminal(metavar="WORDS"),
        Web(kind=str),
    ] = ""
    save_as: Annotated[
        str,
        Field(max_length=64, description="Name of the body of your own; default: nothing is saved."),
        Terminal("--as", "NAME"),
    ] = ""
    replace: Annotated[bool, Field(description="Replace your own body of that name.")] = False


@operation
@taking(BodyChanges)
@keeping_in_place
def edit_body(
    body: Annotated[
        str, Field(description="A body by its name, or the path of its file."), Terminal(metavar="BODY")
    ],
    *,
    text: Annotated[
        str,
        Field(max_length=MOST_TEXT, description="Text of a body file, instead of the file."),
        Terminal(left_out=True),
        Web(kind=str),
    ] = "",
    session: Annotated[
        SessionName | None,
        Field(
            description="Session that the body belongs to; default: all sessions of the workspace may use it."
        ),
        Target(""),
        Web(left_out=True),
        Terminal("--session", "SESSION", kind=str),
    ] = None,
    folder: Annotated[
        str | Path | None,
        Field(description="Folder of own bodies; default: the session's, else the workspace's."),
        Terminal(kind=Path),
    ] = None,
    progress: Reporting = None,
    **changes: Any,  # noqa: ANN401 - of the types that are declared
) -> EditedBody:
    """Change a body's sizes, limits of joints and markers, mirror one side onto the other, and save it as your own.

    A session's own body begins in the size of its subject. A saved body can be used at once: `studio subject SESSION
    --body NAME`.

    Raises BodyError naming the part that is wrong.
    """
    opened = None if session is None else open_session(session)
    place = bodies_folder(Workspace(), opened) if folder is None else Path(folder)
    begun = (
        parse_body(text, Path(body).stem, f"{body}{SUFFIX}") if text else body_to_edit(body, opened, place)
    )
    wanted = BodyChanges(**changes)
    change = edited(
        begun,
        sizes=wanted.sizes,
        limits=wanted.limits,
        markers=wanted.markers,
        without_markers=wanted.without_markers,
        mirror=wanted.mirror,
        title=wanted.title,
    )
    made, written, file = change.body, body_text(change.body), None
    if wanted.save_as:
        file = save_body(written, wanted.save_as, place, replace=wanted.replace)
        made = parse_body(written, wanted.save_as, file.name)
    say(progress, change.notes)
    return EditedBody(made, written, change.notes, file)


def body_to_edit(body: str, session: Session | None, folder: Path) -> BodyModel:
    """A body for editing: a session's own in its subject's size. folder : of own bodies. Raises BodyError."""
    if session is not None and body == session.manifest.body:
        return session.body()
    return load_body(body, (folder, *(session.body_folders if session is not None else ())))


def discard_body(workspace: Workspace, session: Session | None, name: str) -> Path:
    """Move an own body to the trash; returns where it lies then. Runs keep the copy that they were made with.

    Raises BodyError where it does not exist, and while a session is set to be tracked with it; NameRefused.
    """
    folder = bodies_folder(workspace, session)
    path = folder / f"{checked_name(name, 'body')}{SUFFIX}"
    if not path.is_file():
        raise BodyError(f"There is no body of your own '{name}'.", "Shipped bodies stay as they are.")
    users = [
        entry.name
        for entry in workspace.sessions()
        if entry.body == name
        and folder in (workspace.root / BODIES_NAME, workspace.root / entry.name / BODIES_NAME)
    ]
    if users:
        raise BodyError(
            f"Session '{users[0]}' is tracked with body '{name}'.", "Choose another body for it first."
        )
    return workspace.to_trash(path, f"body-{name}")


def bodies_folder(workspace: Workspace, session: Session | None) -> Path:
    """The folder of own bodies: a session's, else the workspace's."""
    return (workspace.root if session is None else session.path) / BODIES_NAME


def body_folders(workspace: Workspace, session: Session | None = None) -> tuple[Path, ...]:
    """The folders that are searched for own bodies, a session's first; only existing ones."""
    if session is not None:
        return session.body_folders
    folder = bodies_folder(workspace, None)
    return (folder,) if folder.is_dir() else ()


def save_body(text: str, name: str, folder: Path, *, replace: bool) -> Path:
    """Write a body file that was checked; returns where it lies.

    Raises BodyError for a shipped body's name, and for an existing one unless it is replaced; NameRefused.
    """
    path = folder / f"{checked_name(name, 'body')}{SUFFIX}"
    if name in packaged_bodies():
        raise BodyError(f"'{name}' is a body that is shipped.", "Save yours under another name.")
    if path.exists() and not replace:
        raise BodyError(f"There is a body '{name}' already.", "Choose another name, or replace it.")
    folder.mkdir(parents=True, exist_ok=True)
    with writing("The body", path):
        write_text(path, text)
    return path
