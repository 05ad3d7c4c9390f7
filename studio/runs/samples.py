"""The sessions that travel with the studio, and how one gets into a workspace."""

import shutil
from pathlib import Path

import studio
from studio.errors import NotFoundError, SessionError
from studio.sessions import atomic_files
from studio.sessions.manifest import FILE_NAME
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


def sample_folder(name: str = "walk") -> Path:
    """Where a sample lies: in an installed package beside the sessions room, in a checkout in
    `sample_sessions`.

    Raises NotFoundError if it is not there.
    """
    package = Path(studio.__file__).resolve().parent
    for place in (package / "sessions" / "samples" / name, package.parent / "sample_sessions" / name):
        if (place / FILE_NAME).is_file():
            return place
    raise NotFoundError(f"The sample '{name}' did not come with this studio.", "Install the package again.")


def install_sample(workspace: Workspace, name: str = "walk", into: str = "") -> Session:
    """The sample as a session of the workspace (named `into`, or like itself), copied whole or not at all; one that is
    there is left alone.
    """
    place = workspace.root / (into or name)
    if (place / FILE_NAME).is_file():
        return workspace.session(place.name)
    if place.exists():
        raise SessionError(
            f"'{place}' is in the way of the sample session.",
            "Move it elsewhere, or choose another workspace.",
        )
    source = sample_folder(name)
    workspace.root.mkdir(parents=True, exist_ok=True)
    folder = atomic_files.new_folder_beside(place)
    try:
        shutil.copytree(source, folder, dirs_exist_ok=True)
        atomic_files.move_into_place(folder, place)
    except OSError as error:
        raise SessionError(
            f"The sample '{name}' cannot be copied ({error.strerror or error}).",
            "Check the disk's free space.",
        ) from None
    finally:
        atomic_files.discard(folder)
    return workspace.session(place.name)
