"""Bodies: which there are, what each is made of, and those of one's own, made by changing another."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.requests import Arguments, MaybeName, body_of
from studio.operations.body_details import BodyDetail, BodyList, body_detail, edited_detail, list_with_own
from studio.operations.own_bodies import bodies_folder, discard_body, edit_body
from studio.sessions.session import Session

router = Router(prefix="/api/bodies", tags=["bodies"])


@dataclass(frozen=True, slots=True)
class DiscardedBody:
    """Where a body lies that was thrown away, in the workspace's trash."""

    trash: str


def session_or_none(
    app: App,
    session: Annotated[
        str,
        Query(max_length=64, description="A session, whose own bodies count too; its body is in its size."),
    ] = "",
) -> Session | None:
    """The session that a query names, as a dependency; None where it names none. Raises NotFoundError."""
    return app.workspace.session(session) if session else None


OfSession = Annotated[Session | None, Depends(session_or_none)]


@router.get("")
def bodies(app: App, session: OfSession) -> BodyList:
    """The bodies that are shipped, those of the workspace and of a session."""
    return list_with_own(app.workspace, session)


@router.get("/{name}")
def body(name: str, app: App, session: OfSession) -> BodyDetail:
    """A body with all that can be changed of it."""
    return body_detail(name, app.workspace, session)


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
    """Change a body, and save it where a name is given; a page sends its text with one change after the other."""
    session = session_or_none(app, arguments.more["session"] or "")
    edit = edit_body(name, **arguments, session=session, folder=bodies_folder(app.workspace, session))
    if edit.file is not None and session is not None:
        app.events.session_changed(session.name)
    return edited_detail(edit)


@router.delete("/{name}")
def discard(name: str, app: App, session: OfSession) -> DiscardedBody:
    """Move a body of one's own to the trash; runs keep the copy that they were made with."""
    return DiscardedBody(discard_body(app.workspace, session, name).name)
