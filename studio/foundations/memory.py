"""Memory that a process no longer needs."""

import ctypes
import gc
import sys

_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None
OF_LATE = 1
"""Generation up to which objects are young."""


def give_back_freed_memory(*, of_late: bool = False) -> None:
    """Collect garbage and return freed memory to the system (under glibc); takes 0.2 s in a server with many objects,
    milliseconds where only recent ones are collected.
    """
    gc.collect(OF_LATE if of_late else 2)
    trim = getattr(_LIBC, "malloc_trim", None)
    if trim is not None:
        trim(0)
