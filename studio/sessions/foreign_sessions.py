"""What is odd about a session's folder, a source of footage or an archive of one, said before anything is imported.

Nothing is unpacked, copied or changed, and no video is decoded: names, links, kinds of files, sizes, records and the
declarations of stores are looked at.
"""

import contextlib
import os
import stat
import zipfile
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

from studio.footage.capture.pictures import is_picture
from studio.foundations.arrays import LARGEST_ARCHIVE, MOST_ARRAYS
from studio.foundations.errors import NotFoundError, StudioError
from studio.foundations.foreign_files import (
    KINDS,
    LARGEST,
    LARGEST_RECORD,
    MANIFEST_NAME,
    check_inside,
    open_file,
)
from studio.sessions.archives import ArchiveLimits, check_archive, is_archive
from studio.sessions.atomic_files import PARTIAL_PREFIX
from studio.sessions.results_reader import FILE_NAME as RESULTS_NAME
from studio.sessions.run_record import FILE_NAME as RUN_RECORD
from studio.sessions.run_record import read_run_record
from studio.sessions.session import Session
from studio.sessions.session_databases import check_tables, open_database

RECORDS = frozenset((".json", ".toml"))
FOOTAGE = frozenset((".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mjpeg", ".sqlite"))
MOST_FILES = 1_000_000


@dataclass(frozen=True, slots=True)
class Oddity:
    """place : a path in the source. what : a clause. footage : a link to footage elsewhere, which is allowed."""

    place: str
    what: str
    footage: bool = False


@dataclass(frozen=True, slots=True)
class Inspection:
    """What a source holds.

    kind : "session", "footage" (a source to import) or "archive".
    files, bytes : in all; of an archive as its index says.
    oddities : in the order of their places.
    """

    kind: str
    files: int
    bytes: int
    oddities: tuple[Oddity, ...]

    @property
    def harmless(self) -> bool:
        """Whether nothing speaks against opening it."""
        return all(one.footage for one in self.oddities)


def inspect_place(place: Path) -> Inspection:
    """Look at a folder or an archive. Raises NotFoundError where there is none."""
    if place.is_dir():
        return _inspected(place)
    if place.is_file() and is_archive(place):
        return _archive(place)
    raise NotFoundError(
        f"There is no folder '{place}', nor an archive.",
        "Give a session's folder, or a zip or tar of footage.",
    )


def _archive(place: Path) -> Inspection:
    try:
        files, size = check_archive(place, ArchiveLimits())
    except StudioError as error:
        return Inspection(
            "archive", 0, place.stat().st_size, (Oddity(place.name, error.message.rstrip(".")),)
        )
    return Inspection("archive", files, size, ())


def _inspected(folder: Path) -> Inspection:
    session = None
    oddities: list[Oddity] = []
    is_session = os.path.lexists(folder / MANIFEST_NAME)
    if is_session:
        try:
            session = Session(folder)
        except StudioError as error:
            oddities.append(
                Oddity(MANIFEST_NAME, f"the session cannot be opened: {error.message.rstrip('.')}")
            )
    elsewhere = _footage_of(session)
    files = size = 0
    for path in _entries(folder):
        name = path.relative_to(folder).as_posix()
        try:
            status = path.lstat()
        except FileNotFoundError:
            # Something else works in the session: it is gone since the folder was listed.
            continue
        files, size = files + 1, size + (status.st_size if stat.S_ISREG(status.st_mode) else 0)
        if files > MOST_FILES:
            oddities.append(Oddity(".", f"more than {MOST_FILES} files"))
            break
        with contextlib.suppress(StopIteration, FileNotFoundError):
            oddities.append(next(_oddities(folder, path, name, status, elsewhere)))
    for name, place in elsewhere.items():
        if Path(place).is_absolute():
            oddities.append(Oddity(name, f"its footage lies elsewhere, at '{place}'", footage=True))
    kind = "session" if is_session else "footage"
    return Inspection(kind, files, size, tuple(sorted(oddities, key=lambda one: one.place)))


def _footage_of(session: Session | None) -> dict[str, str]:
    """Where the manifest says that footage, masks and backgrounds lie, by a name for each."""
    if session is None:
        return {}
    cameras = session.manifest.footage.cameras
    return {
        f"{MANIFEST_NAME}: {camera.name}, {what}": place
        for camera in cameras
        for what, place in zip(("footage", "masks", "background"), camera.places, strict=True)
        if place
    }


def _entries(folder: Path) -> Iterator[Path]:
    """Everything below a folder but folders themselves; links are not followed."""
    for parent, folders, names in os.walk(folder):
        links = [name for name in folders if os.path.islink(os.path.join(parent, name))]
        left = [name for name in folders if name.startswith(PARTIAL_PREFIX)]
        folders[:] = sorted(name for name in folders if name not in links and name not in left)
        yield from (Path(parent, name) for name in sorted((*names, *links, *left)))


def _oddities(
    folder: Path, path: Path, name: str, status: os.stat_result, elsewhere: dict[str, str]
) -> Iterator[Oddity]:
    """What is odd about an entry, the worst first."""
    kind = next((words for is_kind, words in KINDS if is_kind(status.st_mode)), "")
    if kind:
        yield Oddity(name, f"{kind} and no regular file")
    if stat.S_ISLNK(status.st_mode):
        yield from _link(folder, path, name, elsewhere)
        return
    if any(ord(letter) < 32 or 127 <= ord(letter) < 160 for letter in name):
        yield Oddity(name, "a name with control characters")
    if path.name.startswith(PARTIAL_PREFIX):
        yield Oddity(name, "left by interrupted work (studio verify --repair removes it)")
        return
    suffix = path.suffix.lower()
    most = LARGEST_RECORD if suffix in RECORDS else LARGEST
    if status.st_size > most and suffix not in FOOTAGE and not path.name.startswith(RESULTS_NAME):
        yield Oddity(name, f"{status.st_size >> 20} MB, where at most {most >> 20} are read")
    if suffix == ".npz":
        yield from _arrays(path, name)
    if path.name == RESULTS_NAME:
        yield from _store(path, name)
    if path.name == RUN_RECORD and name.startswith("runs/"):
        with _in_clauses(path) as problems:
            read_run_record(path.parent)
        yield from (Oddity(name, words) for words in problems)
    if status.st_mode & 0o111 and not is_picture(path) and suffix not in FOOTAGE:
        yield Oddity(name, "a file that can be run; the studio runs none")


def _link(folder: Path, path: Path, name: str, elsewhere: dict[str, str]) -> Iterator[Oddity]:
    target = os.readlink(path)
    of_footage = any(
        f"{place}/".startswith(f"{name}/") or name.startswith(f"{place}/") for place in elsewhere.values()
    )
    try:
        check_inside(path)
        outside = not path.resolve().is_relative_to(folder.resolve())
    except (StudioError, OSError, RuntimeError):
        outside = True
    if outside and of_footage:
        yield Oddity(name, f"a link to footage elsewhere, at '{target}'", footage=True)
    elif outside:
        yield Oddity(name, f"a link that leads out, to '{target}'; it is not followed")
    elif not path.exists():
        yield Oddity(name, f"a link to nothing, '{target}'")


def _arrays(path: Path, name: str) -> Iterator[Oddity]:
    try:
        with open_file(path) as stream, zipfile.ZipFile(stream) as packed:
            members = packed.infolist()
    except (StudioError, OSError, ValueError, zipfile.BadZipFile) as error:
        yield Oddity(name, f"no archive of arrays ({error})")
        return
    size = sum(member.file_size for member in members)
    if len(members) > MOST_ARRAYS or size > LARGEST_ARCHIVE:
        yield Oddity(
            name, f"{len(members)} arrays of {size >> 20} MB, where at most {LARGEST_ARCHIVE >> 20} are read"
        )


def _store(path: Path, name: str) -> Iterator[Oddity]:
    with _in_clauses(path) as problems, contextlib.closing(open_database(path, "immutable")) as store:
        check_tables(store, path)
    yield from (Oddity(name, words) for words in problems)


@contextlib.contextmanager
def _in_clauses(path: Path) -> Generator[list[str]]:
    """What is raised inside, as clauses."""
    problems: list[str] = []
    try:
        yield problems
    except StudioError as error:
        problems.append(error.message.rstrip(".").replace(f"'{path}'", "it"))
    except Exception as error:  # of a damaged store
        problems.append(f"it cannot be read ({error})")
