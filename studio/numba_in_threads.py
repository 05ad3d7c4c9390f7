"""Numba as a program of several threads may use it. Everything imports it from here.

**Loaded whole.** Numba loads seventy of its modules when a kernel is first called. One of them adds to the table in
which another thread, on its way to Numba's own lock with a kernel of its own, may be looking up the type of a number:
"dictionary changed size during iteration" (numba 0.68, where two threads make a frame's masks). So they are loaded
here, before there is a kernel to call.

**One parallel kernel at a time.** Numba's plain thread pool aborts the process when two Python threads launch parallel
kernels at once, so whoever launches one (`with ONE_LAUNCH:`) holds this lock. A kernel may launch no other inside.
"""

import threading
from typing import Any

import numba
from numba import njit, prange
from numba.core import types
from numba.core.registry import cpu_target
from numba.extending import intrinsic

__all__ = ["ONE_LAUNCH", "intrinsic", "njit", "numba", "prange", "types"]

_everything_numba_loads: Any = cpu_target.target_context
_everything_numba_loads.refresh()

ONE_LAUNCH = threading.Lock()
