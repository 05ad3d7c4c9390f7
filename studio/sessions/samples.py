"""The sessions that travel with the studio, and how one gets into a workspace."""

import shutil
import tarfile
from contextlib import suppress
from pathlib import Path

from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.package import package_folder
from studio.sessions import atomic_files
from studio.sessions.manifest import FILE_NAME
from studio.sessions.session import RUNS_NAME, Session
from studio.sessions.workspace import Workspace

PREPARED = "prepared"
"""Folder of the runs that travel with samples, packed: one archive a sample."""


def sample_folder(name: str = "walk") -> Path:
    """Where a sample lies. Raises NotFoundError if it is not there."""
    return _find(f"{name}/{FILE_NAME}", f"The sample '{name}'").parent


def _find(path: str, words: str) -> Path:
    """A file of the samples: in an installed package beside the sessions room, in a checkout in `sample_sessions`."""
    package = package_folder()
    for place in (package / "sessions" / "samples" / path, package.parent / "sample_sessions" / path):
        if place.is_file():
            return place
    raise NotFoundError(f"{words} did not come with this studio.", "Install the package again.")


def install_prepared_runs(session: Session, sample: str) -> None:
    """Put the runs that travel with a sample into a session of it; those that are there are left alone.

    Raises NotFoundError, SessionError.
    """
    packed = _find(f"{PREPARED}/{sample}.tar.xz", f"The runs of sample '{sample}'")
    runs = session.path / RUNS_NAME
    runs.mkdir(exist_ok=True)
    folder = atomic_files.new_folder_beside(runs / sample)
    try:
        with tarfile.open(packed) as archive:
            archive.extractall(folder, filter="data")
        for run in sorted(folder.iterdir()):
            with suppress(FileExistsError):
                atomic_files.move_into_place(run, runs / run.name)
    except (OSError, tarfile.TarError) as error:
        raise SessionError(
            f"The runs of sample '{sample}' cannot be unpacked ({error}).", "Check the disk's free space."
        ) from None
    finally:
        atomic_files.discard(folder)


def install_sample(workspace: Workspace, name: str = "walk", into: str = "") -> Session:
    """The sample as a session of the workspace (named `into`, or like itself); an existing one is left alone."""
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
