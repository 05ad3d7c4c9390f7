"""Array types, and named arrays from npz archives, one archive at a time.

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
