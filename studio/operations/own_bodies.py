"""Bodies of one's own: one that is there is changed and saved under another name."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from studio.body.catalogue import SUFFIX, load_body
from studio.body.editing import edited
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.writing import body_text
from studio.foundations.declaring import Target, Terminal, Web, operation
from studio.operations.opening import SessionName, open_session
from studio.operations.progress import Reporting, say
from studio.sessions.own_bodies import bodies_folder, save_body
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

MOST_TEXT = 1_000_000
MOST_CHANGES = 2000


@dataclass(frozen=True, slots=True, eq=False)
class EditedBody:
    """A body as it is after a change. text : its file. notes : on what else followed. file : what it was saved as."""

    body: BodyModel
    text: str
    notes: tuple[str, ...] = ()
    file: Path | None = None


@operation
def edit_body(
    body: Annotated[
        str,
        Field(description="A body by its name, or the path of its file."),
        Terminal(metavar="BODY"),
    ],
    *,
    text: Annotated[
        str,
        Field(max_length=MOST_TEXT, description="A body file's text, in place of the file."),
        Terminal(left_out=True),
        Web(kind=str),
    ] = "",
    sizes: Annotated[
        Mapping[str, float] | None,
        Field(
            max_length=MOST_CHANGES,
            description="A dimension, or a limb's LIMB.length, .radius_start, .radius_end, .scale_x, .scale_y, mm.",
        ),
        Terminal("--size", "NAME=MM"),
    ] = None,
    limits: Annotated[
        Mapping[str, float] | None,
        Field(
            max_length=MOST_CHANGES,
            description="PARAMETER.lower, .upper, .neutral or .max_step, degrees or mm; inf for none.",
        ),
        Terminal("--limit", "NAME=DEGREES"),
    ] = None,
    markers: Annotated[
        Sequence[str],
        Field(max_length=MOST_CHANGES, description="NAME=JOINT,X,Y,Z, mm in the joint's frame."),
        Terminal("--marker", "NAME=JOINT,X,Y,Z"),
    ] = (),
    without_markers: Annotated[
        Sequence[str],
        Field(max_length=MOST_CHANGES, description="Markers that are taken away."),
        Terminal("--without-marker", "NAME"),
    ] = (),
    mirror: Annotated[
        Literal["", "left", "right"],
        Field(description="The side that is copied onto the other, last of all."),
    ] = "",
    title: Annotated[
        str, Field(max_length=200, description="What people see."), Terminal(metavar="WORDS"), Web(kind=str)
    ] = "",
    save_as: Annotated[
        str,
        Field(max_length=64, description="Name of the body of your own; default: nothing is saved."),
        Terminal("--as", "NAME"),
    ] = "",
    replace: Annotated[
        bool, Field(description="In place of the body of your own that has that name.")
    ] = False,
    session: Annotated[
        SessionName | None,
        Field(description="It becomes this session's; default: all sessions of the workspace may use it."),
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
) -> EditedBody:
    """Change a body's sizes, limits of joints and markers, mirror one side onto the other, and save it as your own.

    A session's own body begins in the size of its subject. What is saved can be used at once: `studio subject SESSION
    --body NAME`.

    Raises BodyError with the part that is wrong.
    """
    opened = None if session is None else open_session(session)
    place = bodies_folder(Workspace(), opened) if folder is None else Path(folder)
    begun = (
        parse_body(text, Path(body).stem, f"{body}{SUFFIX}") if text else body_to_edit(body, opened, place)
    )
    change = edited(
        begun,
        sizes=sizes,
        limits=limits,
        markers=markers,
        without_markers=without_markers,
        mirror=mirror,
        title=title,
    )
    found = EditedBody(change.body, body_text(change.body), change.notes)
    if save_as:
        file = save_body(found.text, save_as, place, replace)
        found = dataclasses.replace(found, body=parse_body(found.text, save_as, file.name), file=file)
    say(progress, found.notes)
    return found


def body_to_edit(body: str, session: Session | None, folder: Path) -> BodyModel:
    """A body as it is edited: a session's own in its subject's size. folder : of own bodies. Raises BodyError."""
    if session is not None and body == session.manifest.body:
        return session.body()
    return load_body(body, (folder, *(session.body_folders if session is not None else ())))
