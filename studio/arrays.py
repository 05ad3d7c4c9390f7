"""Array types, what is often asked of arrays, and named arrays from npz archives, one archive at a time.

NumPy reads the head of each array with Python's own parser (`ast`), which counts its depth for the whole process: two
threads that parse at the same moment may both end in "AST constructor recursion depth mismatch" (seen with Python 3.11,
where four views of a frame are requested at once). Hence one lock.
"""

import threading
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_one_at_a_time = threading.Lock()


def runs_of(mask: Mask) -> list[tuple[int, int]]:
    """The runs of True in a mask (K,), each as its first row and one past its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def median_and_spread(values: Array) -> tuple[float, float]:
    """The median of values (K,), and their standard deviation by the median distance from it, were they normal."""
    median = float(np.median(values))
    return median, 1.4826 * float(np.median(np.abs(values - median)))


def evenly_spread(count: int, most: int) -> Indices:
    """Up to `most` of `count` rows, evenly spread, both ends included."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.int64))


def read_archive(source: Path | IO[bytes]) -> dict[str, NDArray[Any]]:
    """All arrays of an npz archive by name; nothing in it can run.

    Raises OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile for what is damaged or none; AttributeError or
    TypeError for a file of a single array.
    """
    if isinstance(source, Path):
        # What NumPy opens itself stays open where the archive is damaged.
        with source.open("rb") as stream:
            return read_archive(stream)
    with _one_at_a_time, np.load(source, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
