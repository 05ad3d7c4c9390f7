"""Memory that a video's decoder has let go of, given back to the system.

A frame that was asked for its side data is part of a cycle, so it stays, 3 MB of full HD, until Python collects cycles,
which it does seldom where few objects are made (`video` asks one frame of each file that it opens); and glibc keeps
what threads freed for those threads.
"""

import ctypes
import gc
import sys

_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None


OF_LATE = 1
"""Generation up to which objects are young."""


def give_back_freed_memory(*, of_late: bool = False) -> None:
    """Collect what is in no use any more, and have the allocator let go of it (under glibc); 0.2 s in a server, whose
    many objects are all looked at, milliseconds where only those made of late are.
    """
    gc.collect(OF_LATE if of_late else 2)
    trim = getattr(_LIBC, "malloc_trim", None)
    if trim is not None:
        trim(0)
