"""Fragmented MP4 that a kill, a crash or a full disk cut off: brought back to its last whole fragment."""

import os
from pathlib import Path

from studio.errors import FootageError
from studio.foreign_files import check_regular

HEADER, LONG_HEADER = 8, 16


def whole_boxes(path: Path) -> int:
    """Bytes of a file's boxes (ISO/IEC 14496-12, 4.2) up to the last fragment that is whole; a `moof` without its
    `mdat` does not count.
    """
    size, place, whole = path.stat().st_size, 0, 0
    with path.open("rb") as file:
        while place + HEADER <= size:
            file.seek(place)
            head = file.read(LONG_HEADER)
            length, kind = int.from_bytes(head[:4], "big"), head[4:8]
            if length == 1:
                length = int.from_bytes(head[8:16], "big")
            if length < HEADER or place + length > size:
                break
            place += length
            if kind != b"moof":
                whole = place
    return whole


def mend_recording(path: Path) -> int:
    """Cut a recording back to what is whole of it; returns the bytes that went. Raises FootageError if nothing is."""
    check_regular(path, FootageError)
    size, whole = path.stat().st_size, whole_boxes(path)
    if not whole:
        raise FootageError(f"'{path.name}' holds no whole piece of a recording.", "Leave that camera out.")
    if whole < size:
        os.truncate(path, whole)
    return size - whole
