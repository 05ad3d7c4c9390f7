"""Checksums of the files of a folder (`.checksums.json` in it), to detect damage.

A file whose content changed but not its time is damaged; one whose time changed, too, was written again. Files that the
studio never rewrites (footage, a run's inputs) are damaged in either case. Results stores have
checksums of their own.
"""

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from studio.foundations.errors import SessionError
from studio.foundations.foreign_files import LARGEST, open_file
from studio.sessions.record_files import RecordFile

NAME = ".checksums.json"
RUNS = "runs"
BOUNDED = frozenset((".json", ".jsonl", ".toml", ".csv", ".trc", ".npz", ".png", ".jpg"))
"""Endings of files that are read whole (`foreign_files.LARGEST`)."""
STORES = "results."
WRITTEN_ONCE = (
    "videos/",
    "pictures/",
    "calibration/original",
    "run.json",
    "cameras.toml",
    "body/",
    "behaviour.model",
)
"""Beginnings of paths in a session or a run."""


class Noted(msgspec.Struct, frozen=True, array_like=True):
    """size : bytes. time : of the last change, ns. digest : BLAKE2b, hexadecimal."""

    size: int
    time: int
    digest: str


class NotedFiles(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file. files : by path in the folder. Version 1 was these alone."""

    schema: int = 2
    files: dict[str, Noted] = {}


_RECORD = RecordFile(
    NotedFiles,
    "checksums of files",
    "Remove it; new checksums are then made.",
    (f"There is no '{NAME}'.", "Note the files."),
    version=2,
    migrations={1: lambda entries: {"files": entries}},
)


@dataclass(frozen=True, slots=True)
class CheckedFiles:
    """count : files read. damaged : path in the folder and what is wrong with it. written_again : paths. new : paths of
    files without a checksum so far.
    """

    count: int
    damaged: dict[str, str]
    written_again: tuple[str, ...]
    new: tuple[str, ...]


def note_files(folder: Path) -> None:
    """Store the checksums of all files. Raises OSError."""
    _write(folder, {name: _note(path) for name, path in _files(folder)})


def forget_files(folder: Path, places: Iterable[str]) -> None:
    """Drop the checksums of files that were removed on purpose. places : paths in the folder, of files or folders."""
    known, readable = _read_sums(folder)
    gone = tuple(places)
    kept = {name: one for name, one in known.items() if not any(_is_at(name, place) for place in gone)}
    if readable and len(kept) < len(known):
        _write(folder, kept)


def note_again(folder: Path, name: str) -> None:
    """Store the checksum of a file that was written again on purpose, where the folder has checksums."""
    known, readable = _read_sums(folder)
    if readable and known:
        _write(folder, known | {name: _note(folder / name)})


def _is_at(name: str, place: str) -> bool:
    return name == place or name.startswith(f"{place}/")


def check_files(folder: Path, *, note: bool = True) -> CheckedFiles:
    """Compare the files with their checksums. note : store checksums of files that are new or were written again."""
    known, readable = _read_sums(folder)
    now: dict[str, Noted] = {}
    damaged: dict[str, str] = {} if readable else {NAME: "the checksums cannot be read"}
    again: list[str] = []
    new: list[str] = []
    for name, path in _files(folder):
        try:
            if path.suffix.lower() in BOUNDED and path.stat().st_size > LARGEST:
                damaged[name] = f"is larger than the {LARGEST >> 20} MB that such a file can have"
                continue
            current = _note(path)
        except FileNotFoundError:
            # Removed since the folder was listed, by other work in it.
            continue
        except OSError as error:
            damaged[name] = f"cannot be read ({error.strerror})"
            continue
        before = known.get(name)
        if before is None:
            new.append(name)
        elif current.digest != before.digest:
            if current.time == before.time or name.startswith(WRITTEN_ONCE):
                damaged[name] = "is not what was written"
                current = before
            else:
                again.append(name)
        now[name] = current
    for name in known.keys() - now.keys() - damaged.keys():
        if name.startswith(WRITTEN_ONCE):
            damaged[name] = "is gone"
            now[name] = known[name]
    count = len(now)
    if note and readable and now != known:
        # A disk that cannot be written is no reason not to compare.
        with suppress(SessionError):
            _write(folder, now)
    return CheckedFiles(count, damaged, tuple(again), tuple(new))


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        own = parts[0] != RUNS and not any(part.startswith((".", STORES)) for part in parts)
        if own and path.is_file() and not path.is_symlink():
            yield "/".join(parts), path


def _note(path: Path) -> Noted:
    status = path.stat()
    with open_file(path) as stream:
        digest = hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    return Noted(status.st_size, status.st_mtime_ns, digest)


def _read_sums(folder: Path) -> tuple[dict[str, Noted], bool]:
    """The stored checksums, and whether they can be read; empty without any."""
    try:
        return _RECORD.read(folder / NAME, NotedFiles()).files, True
    except SessionError:
        return {}, False


def _write(folder: Path, noted: dict[str, Noted]) -> None:
    _RECORD.write(folder / NAME, NotedFiles(files=noted))
