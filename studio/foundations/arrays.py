"""Array types, what is often asked of arrays, and named arrays from npz archives, one archive at a time.

NumPy reads the head of each array with Python's own parser (`ast`), which counts its depth for the whole process: two
threads that parse at the same moment may both end in "AST constructor recursion depth mismatch" (seen with Python 3.11,
where four views of a frame are requested at once). Hence one lock.
"""

import io
import itertools
import math
import threading
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from studio.foundations.foreign_files import open_file

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

LARGEST_ARCHIVE, MOST_ARRAYS = 256 << 20, 1000
"""Bytes, unpacked, and arrays of an archive."""
CHUNK = 1 << 20

_one_at_a_time = threading.Lock()


def runs_of(mask: Mask) -> list[tuple[int, int]]:
    """The runs of True in a mask (K,), each as its first row and one past its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def consecutive(frames: Indices) -> tuple[slice, ...]:
    """Slices of rows whose frames (K,) are consecutive."""
    breaks = np.flatnonzero(np.diff(frames) != 1) + 1
    edges = [0, *breaks.tolist(), len(frames)]
    return tuple(slice(first, last) for first, last in itertools.pairwise(edges) if last > first)


def median_and_spread(values: Array) -> tuple[float, float]:
    """The median of values (K,), and their standard deviation by the median distance from it, were they normal."""
    median = float(np.median(values))
    return median, 1.4826 * float(np.median(np.abs(values - median)))


def evenly_spread(count: int, most: int) -> Indices:
    """Up to `most` of `count` rows, evenly spread, both ends included."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.int64))


def read_archive(source: Path | IO[bytes], most: int = LARGEST_ARCHIVE) -> dict[str, NDArray[Any]]:
    """All arrays of an npz archive by name; nothing in it can run, and it takes at most `most` bytes of memory.

    Raises OSError, ValueError, EOFError, zipfile.BadZipFile for what is damaged, too large, or no such archive.
    """
    if isinstance(source, Path):
        # What zipfile opens itself stays open where the archive is damaged.
        with open_file(source) as stream:
            return read_archive(stream, most)
    with zipfile.ZipFile(source) as archive:
        members = archive.infolist()
        # The index's sizes are upheld below: no more than that is read of a member.
        if len(members) > MOST_ARRAYS or sum(member.file_size for member in members) > most:
            raise ValueError(f"it holds more than {MOST_ARRAYS} arrays or {most >> 20} MB")
        return {member.filename.removesuffix(".npy"): _array(archive, member) for member in members}


def read_array(content: bytes) -> NDArray[Any]:
    """The array of a npy file's bytes; nothing in it can run. Raises ValueError, EOFError for what is no such array."""
    return _read_array(io.BytesIO(content), "it", len(content))


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(member) as stream:
        return _read_array(stream, f"'{member.filename}'", member.file_size)


def _read_array(stream: IO[bytes], what: str, size: int) -> NDArray[Any]:
    """size : bytes that the file has in all."""
    with _one_at_a_time:
        version = np.lib.format.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"{what} has the unknown version {version}")
        head = (
            np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        )
        shape, by_column, kind = head(stream)
    count = math.prod(shape)
    if kind.hasobject or min(shape, default=0) < 0 or count * max(1, kind.itemsize) > size:
        raise ValueError(f"{what} is not an array of its size")
    content = bytearray()
    # Its checksum is compared at its end.
    while chunk := stream.read(CHUNK):
        content += chunk
    if len(content) != count * kind.itemsize:
        raise ValueError(f"{what} has {len(content)} bytes, which is not an array's size")
    return np.ndarray(shape, kind, content, order="F" if by_column else "C")
