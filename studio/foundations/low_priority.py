"""Threads that step back: what they compute is only looked at, and a search beside it must not wait.

A thread that lowered its priority cannot raise it again, so such work has threads of its own. Where a system knows no
priorities of threads, only the limit of one core holds.
"""

import contextlib
import contextvars
import functools
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from studio.foundations.numba_in_threads import numba

NICENESS = 10
THREADS = 2

_Returned = TypeVar("_Returned")
_Arguments = ParamSpec("_Arguments")


def step_back() -> None:
    """Limit this thread to one core at low priority, for good."""
    numba.set_num_threads(1)
    if hasattr(os, "setpriority"):
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


def at_low_priority(
    function: Callable[_Arguments, _Returned], *arguments: _Arguments.args, **named: _Arguments.kwargs
) -> Future[_Returned]:
    """Call a function in a thread that steps back, in its caller's context; what it gives or raises is the future's."""
    called = functools.partial(function, *arguments, **named)
    return _threads().submit(contextvars.copy_context().run, called)


@functools.cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(THREADS, thread_name_prefix="low-priority", initializer=step_back)
