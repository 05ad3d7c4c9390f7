"""What was uploaded, out of its zip and its wrapping. A zip is not believed: counted, limited, and nothing leads out.

Sizes in an archive's index are claims, so the bytes are counted as they are written. Links, encrypted
entries, names that lead out and names that appear twice are refused before anything is written.
"""

import shutil
import zipfile
from collections.abc import Collection
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from studio.errors import StudioError
from studio.web.safe_paths import is_link, place_in, relative_path

CHUNK = 1 << 20
GIGABYTE = 1 << 30
ZIP, UNPACKED = ".zip", "unpacked"
LITTER = frozenset(("__MACOSX", "Thumbs.db", "desktop.ini"))


class ArchiveError(StudioError):
    """An archive that cannot be unpacked safely."""

    status, code = 422, "archive"


@dataclass(frozen=True, slots=True)
class ArchiveLimits:
    """entries : files and folders. total : bytes unpacked. ratio : of unpacked to packed, beyond `free`
    bytes.
    """

    entries: int = 20_000
    total: int = 40 * GIGABYTE
    ratio: float = 200.0
    free: int = 64 << 20


def only_zip(folder: Path) -> Path | None:
    """The zip that is all a folder holds, None where it is none or there is more."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return files[0] if len(files) == 1 and files[0].suffix.lower() == ZIP else None


def unpack_upload(folder: Path) -> Path:
    """An upload's folder, or what its only zip holds, which is removed then. Raises ArchiveError, PathRefused."""
    archive = only_zip(folder)
    if archive is None:
        return folder
    target = folder / UNPACKED
    target.mkdir()
    try:
        unpack_zip(archive, target)
    except StudioError:
        shutil.rmtree(target, ignore_errors=True)
        raise
    archive.unlink()
    return target


def unwrapped(folder: Path, parts: Collection[str]) -> Path:
    """The folder itself, without folders that hold nothing but it. parts : patterns of names (small letters) that are
    no wrapping, even of a folder that stands alone.
    """
    while len(inside := [path for path in folder.iterdir() if not is_litter(path.name)]) == 1:
        if not inside[0].is_dir() or any(fnmatch(inside[0].name.lower(), part) for part in parts):
            break
        folder = inside[0]
    return folder


def is_litter(name: str) -> bool:
    """Whether a name is something that systems leave in folders."""
    return name.startswith(".") or name in LITTER


def unpack_zip(archive: Path, folder: Path, limits: ArchiveLimits | None = None) -> int:
    """Unpack into `folder`, which must be empty, and return the bytes written.

    Raises ArchiveError, PathRefused; what was written until then is the caller's to remove.
    """
    allowed = limits or ArchiveLimits()
    try:
        with zipfile.ZipFile(archive) as opened:
            entries = opened.infolist()
            _check(entries, allowed)
            most = min(allowed.total, max(allowed.free, int(archive.stat().st_size * allowed.ratio)))
            most = min(most, shutil.disk_usage(folder).free - GIGABYTE)
            written = 0
            for entry in entries:
                place = place_in(folder, relative_path(entry.filename.rstrip("/")))
                if entry.is_dir():
                    place.mkdir(parents=True, exist_ok=True)
                    continue
                place.parent.mkdir(parents=True, exist_ok=True)
                written += _unpack_one(opened, entry, place, most - written)
            return written
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, FileExistsError) as error:
        raise ArchiveError(
            f"'{archive.name}' is not a zip that can be unpacked ({error}).", "Pack the folder again."
        ) from None


def _check(entries: list[zipfile.ZipInfo], limits: ArchiveLimits) -> None:
    if len(entries) > limits.entries:
        raise ArchiveError(
            f"The archive has {len(entries)} entries.", f"Keep it under {limits.entries}, or import by path."
        )
    seen: set[str] = set()
    for entry in entries:
        name = str(relative_path(entry.filename.rstrip("/"))).lower()
        if is_link(entry.external_attr >> 16):
            raise ArchiveError(f"'{entry.filename}' in the archive is a link.", "Pack the file itself.")
        if entry.flag_bits & 1:
            raise ArchiveError(
                f"'{entry.filename}' in the archive is encrypted.", "Pack it without a password."
            )
        if name in seen:
            raise ArchiveError(f"'{entry.filename}' is in the archive twice.", "Pack the folder again.")
        seen.add(name)


def _unpack_one(opened: zipfile.ZipFile, entry: zipfile.ZipInfo, place: Path, most: int) -> int:
    """Write one file, refusing to go beyond `most` bytes."""
    written = 0
    with opened.open(entry) as source, place.open("xb") as target:
        while chunk := source.read(CHUNK):
            written += len(chunk)
            if written > most:
                raise ArchiveError(
                    f"The archive unpacks to more than is allowed (at '{entry.filename}').",
                    "Import the folder by its path, or pack less.",
                )
            target.write(chunk)
    return written
