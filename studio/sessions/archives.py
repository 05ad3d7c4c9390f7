"""Unpacks footage from an archive. Archives are untrusted: sizes are limited, and no path leads outside.

Sizes in an archive's index are claims, so the bytes are counted as they are written. Links, devices, encrypted entries,
names that lead out and names that appear twice are refused before anything is written.
"""

import contextlib
import shutil
import stat
import tarfile
import zipfile
from collections.abc import Callable, Collection, Generator, Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import IO

from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import foreign_file
from studio.sessions.atomic_files import discard, new_folder_beside
from studio.sessions.names import place_in, relative_path

CHUNK = 1 << 20
GIGABYTE = 1 << 30
UNPACKED = "unpacked"
TARS = (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tar.xz")
ENDINGS = (".zip", *TARS)
FOOTAGE_PARTS = ("videos", "pictures", "calibration")
"""Folders that are part of a source even where they stand alone in it."""
LITTER = frozenset(("__MACOSX", "Thumbs.db", "desktop.ini"))


class ArchiveError(StudioError, status=422, code="archive"):
    """An archive that cannot be unpacked safely."""


@dataclass(frozen=True, slots=True)
class ArchiveLimits:
    """entries : files and folders. total : bytes unpacked. ratio : of unpacked to packed, beyond `free` bytes."""

    entries: int = 20_000
    total: int = 40 * GIGABYTE
    ratio: float = 200.0
    free: int = 64 << 20


@dataclass(frozen=True, slots=True)
class _Entry:
    """name : with forward slashes. mode : its file mode, 0 if unknown. claimed : bytes, as the index says."""

    name: str
    is_folder: bool
    mode: int
    encrypted: bool
    claimed: int
    open: Callable[[], IO[bytes]]


def is_archive(path: Path) -> bool:
    """Whether a file's name is that of an archive which can be unpacked."""
    return path.name.lower().endswith(ENDINGS)


def only_archive(folder: Path) -> Path | None:
    """The archive that is the only content of a folder, else None."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return files[0] if len(files) == 1 and is_archive(files[0]) else None


def unwrapped(folder: Path, parts: Collection[str]) -> Path:
    """The folder without wrapping folders that contain only one folder. parts : name patterns (lower case) of folders
    that do not wrap, even alone.
    """
    while len(inside := [path for path in folder.iterdir() if not is_litter(path.name)]) == 1:
        if not inside[0].is_dir() or any(fnmatch(inside[0].name.lower(), part) for part in parts):
            break
        folder = inside[0]
    return folder


def is_litter(name: str) -> bool:
    """Whether a name is one of the files that systems leave in folders."""
    return name.startswith(".") or name in LITTER


def unpack(archive: Path, folder: Path, limits: ArchiveLimits | None = None) -> int:
    """Unpack a zip or tar into `folder`, which must be empty, and return the bytes written.

    Raises ArchiveError, PathRefused; the caller then removes what was written.
    """
    allowed = limits or ArchiveLimits()
    words = ("an archive that can be unpacked", "Pack the folder again.")
    with foreign_file(archive, ArchiveError, *words), _entries(archive) as listed_entries:
        entries = _check(listed_entries, allowed)
        most = min(allowed.total, max(allowed.free, int(archive.stat().st_size * allowed.ratio)))
        most = min(most, shutil.disk_usage(folder).free - GIGABYTE)
        written = 0
        for entry in entries:
            place = place_in(folder, relative_path(entry.name))
            if entry.is_folder:
                place.mkdir(parents=True, exist_ok=True)
                continue
            place.parent.mkdir(parents=True, exist_ok=True)
            written += _unpack_one(entry, place, most - written)
        return written


def check_archive(archive: Path, limits: ArchiveLimits) -> tuple[int, int]:
    """The number of an archive's files and their bytes, by its index. Raises ArchiveError, PathRefused."""
    words = ("an archive that can be unpacked", "Pack the folder again.")
    with foreign_file(archive, ArchiveError, *words), _entries(archive) as listed_entries:
        entries = [entry for entry in _check(listed_entries, limits) if not entry.is_folder]
        size = sum(entry.claimed for entry in entries)
        if size > max(limits.free, int(archive.stat().st_size * limits.ratio)):
            raise _too_much(max(entries, key=lambda entry: entry.claimed))
        return len(entries), size


def unpacked(folder: Path) -> Path:
    """A folder, or the content of its only archive, which is removed then. Raises ArchiveError, PathRefused."""
    archive = only_archive(folder)
    if archive is None:
        return folder
    target = folder / UNPACKED
    target.mkdir()
    try:
        unpack(archive, target)
    except StudioError:
        shutil.rmtree(target, ignore_errors=True)
        raise
    archive.unlink()
    return target


@contextlib.contextmanager
def folder_of(source: Path, parts: Collection[str], beside: Path) -> Generator[Path]:
    """A source's folder: itself, or the content of an archive, unpacked beside `beside` while it is in use.

    parts : as of `unwrapped`. Raises ArchiveError, PathRefused.
    """
    if not (source.is_file() and is_archive(source)):
        yield source
        return
    folder = new_folder_beside(beside)
    inside = folder / (source.name.partition(".")[0] or UNPACKED)
    try:
        inside.mkdir()
        unpack(source, inside)
        yield unwrapped(inside, parts)
    finally:
        discard(folder)


@contextlib.contextmanager
def _entries(archive: Path) -> Generator[Iterator[_Entry]]:
    if archive.name.lower().endswith(TARS):
        with tarfile.open(archive) as tar:
            yield (_tar_entry(tar, member) for member in tar if member.name not in (".", "./"))
    else:
        with zipfile.ZipFile(archive) as packed:
            yield (_zip_entry(packed, info) for info in packed.infolist())


def _zip_entry(packed: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Entry:
    return _Entry(
        # Some Windows programs write folders with backslashes, against the format.
        (info.filename if "/" in info.filename else info.filename.replace("\\", "/")).rstrip("/"),
        info.is_dir() or info.filename.endswith("\\"),
        info.external_attr >> 16,
        bool(info.flag_bits & 1),
        info.file_size,
        lambda: packed.open(info),
    )


def _tar_entry(tar: tarfile.TarFile, member: tarfile.TarInfo) -> _Entry:
    def content() -> IO[bytes]:
        opened = tar.extractfile(member)
        if opened is None:
            raise tarfile.TarError(f"'{member.name}' has no content")
        return opened

    known = member.isfile() or member.isdir()
    mode = 0 if known else stat.S_IFLNK
    name = member.name.removeprefix("./").rstrip("/")
    return _Entry(name, member.isdir(), mode, False, member.size, content)


def _check(listed_entries: Iterator[_Entry], limits: ArchiveLimits) -> list[_Entry]:
    """All entries. A tar's index is spread over the file, so it is refused as soon as it claims too much."""
    entries: list[_Entry] = []
    seen: set[str] = set()
    claimed = 0
    for entry in listed_entries:
        entries.append(entry)
        claimed += entry.claimed
        if len(entries) > limits.entries:
            raise ArchiveError(
                f"The archive has more than {limits.entries} entries.",
                f"Keep it under {limits.entries}, or import by path.",
            )
        if claimed > limits.total:
            raise _too_much(entry)
        name = str(relative_path(entry.name)).lower()
        if stat.S_IFMT(entry.mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise ArchiveError(f"'{entry.name}' in the archive is a link.", "Pack the file itself.")
        if entry.encrypted:
            raise ArchiveError(f"'{entry.name}' in the archive is encrypted.", "Pack it without a password.")
        if name in seen:
            raise ArchiveError(f"'{entry.name}' is in the archive twice.", "Pack the folder again.")
        seen.add(name)
    return entries


def _unpack_one(entry: _Entry, place: Path, most: int) -> int:
    written = 0
    with entry.open() as source, place.open("xb") as target:
        while chunk := source.read(CHUNK):
            written += len(chunk)
            if written > most:
                raise _too_much(entry)
            target.write(chunk)
    return written


def _too_much(entry: _Entry) -> ArchiveError:
    return ArchiveError(
        f"The archive unpacks to more than is allowed (at '{entry.name}').",
        "Import the folder by its path, or pack less.",
    )
