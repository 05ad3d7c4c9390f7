"""Bodies of one's own: TOML files in a workspace's or a session's folder `bodies`."""

from pathlib import Path

from studio.body.catalogue import SUFFIX, packaged_bodies
from studio.foundations.errors import BodyError
from studio.sessions.atomic_files import write_text, writing
from studio.sessions.names import checked_name
from studio.sessions.session import BODIES_NAME, Session
from studio.sessions.workspace import Workspace


def bodies_folder(workspace: Workspace, session: Session | None) -> Path:
    """Where own bodies lie: a session's, else the workspace's."""
    return (workspace.root if session is None else session.path) / BODIES_NAME


def body_folders(workspace: Workspace, session: Session | None = None) -> tuple[Path, ...]:
    """The folders in which bodies are sought, a session's first; only those that are there."""
    if session is not None:
        return session.body_folders
    folder = bodies_folder(workspace, None)
    return (folder,) if folder.is_dir() else ()


def own_body_file(name: str, folder: Path) -> Path:
    """The file of one's own body. Raises BodyError where there is none, NameRefused."""
    path = folder / f"{checked_name(name, 'body')}{SUFFIX}"
    if not path.is_file():
        raise BodyError(f"There is no body of your own '{name}'.", "Shipped bodies stay as they are.")
    return path


def discard_body(workspace: Workspace, name: str, folder: Path) -> Path:
    """Move one's own body to the trash; where it lies then. Runs keep the copy that they were made with.

    Raises BodyError where there is none, and while a session is to be tracked with it.
    """
    path = own_body_file(name, folder)
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


def save_body(text: str, name: str, folder: Path, replace: bool = False) -> Path:
    """Write a body file that was checked. Raises BodyError for a shipped body's name, and for one that is there unless
    it is replaced; NameRefused.
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
