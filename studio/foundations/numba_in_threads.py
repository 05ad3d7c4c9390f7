"""Numba as a program of several threads uses it: kernels, their options and their threads come from here.

**Types known.** Numba loads seventy of its modules when a kernel is first called. One of them that adds to the table
in which another thread, on its way to Numba's own lock with a kernel of its own, is looking up the type of a number
ends in "dictionary changed size during iteration" (numba 0.68, where two threads make a frame's masks). So those that
add to it are loaded here, before there is a kernel to call; the rest, a third of a second, waits for the first kernel.

**Plain threads.** `parallel_blocks` runs a kernel on Python's threads, which it lets go of the interpreter for. Numba's
own parallel kernels would have to be compiled a second time, abort the process when two threads launch them at once,
and wait for a thread that a busy machine has no core for.
"""

import functools
import importlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numba
from numba import prange
from numba.core import config, types
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic

from studio.foundations.kernel_cache import KernelCache

__all__ = [
    "CONTRACTED",
    "CONTRACTED_INLINED",
    "EXACT",
    "EXACT_INLINED",
    "FAST",
    "FAST_INLINED",
    "KERNEL",
    "intrinsic",
    "njit",
    "numba",
    "parallel_blocks",
    "prange",
    "types",
]

_Function = TypeVar("_Function", bound=Callable[..., object])

for _place in ("function_type", "jitclass.boxing"):
    importlib.import_module(f"numba.experimental.{_place}")

KERNEL: dict[str, Any] = {"nogil": True}
"""Options of every kernel: other threads run meanwhile."""
EXACT: dict[str, Any] = {**KERNEL, "error_model": "numpy"}
"""Dividing by zero gives infinity, as in NumPy."""
CONTRACTED: dict[str, Any] = {**EXACT, "fastmath": {"contract", "nsz"}}
"""Products and sums may be rounded together."""
FAST: dict[str, Any] = {**EXACT, "fastmath": {"contract", "reassoc", "nsz", "arcp", "afn"}}
"""Sums may be made in any order, so that all of it vectorises. Not a number and infinity keep their meaning (no
`nnan`, `ninf`): a point that cannot be projected must compare as unseen."""
EXACT_INLINED: dict[str, Any] = {**EXACT, "forceinline": True}
CONTRACTED_INLINED: dict[str, Any] = {**CONTRACTED, "forceinline": True}
FAST_INLINED: dict[str, Any] = {**FAST, "forceinline": True}


def njit(**options: Any) -> "Callable[[_Function], Dispatcher[_Function]]":  # noqa: ANN401 - Numba's
    """Numba's decorator, for a kernel that is compiled once on a machine.

    Where another kernel calls it, it is compiled without what calls from Python and C need, which takes a seventh of
    the time that compiling takes.
    """

    def decorated(function: _Function) -> "Dispatcher[_Function]":
        if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
            return numba.njit(**options)(function)
        kernel = _kept_on_disk(function, **options, no_cfunc_wrapper=True)
        inner = _kept_on_disk(function, **options, no_cfunc_wrapper=True, no_cpython_wrapper=True)
        kernel.get_call_template = inner.get_call_template  # pyright: ignore[reportAttributeAccessIssue]
        kernel.get_overload = inner.get_overload  # pyright: ignore[reportAttributeAccessIssue]
        return kernel

    return decorated


def _kept_on_disk(function: _Function, **options: Any) -> "Dispatcher[_Function]":  # noqa: ANN401 - Numba's
    kernel = numba.njit(**options)(function)
    kernel._cache = KernelCache(kernel)  # pyright: ignore[reportAttributeAccessIssue]
    return kernel


TURNS = 4
"""How often each thread takes blocks, if all are equally quick."""


def parallel_blocks(kernel: Callable[..., None], blocks: int, least: int, *arguments: object) -> None:
    """Run kernel(first, last, *arguments) over blocks 0 to `blocks` - 1, on as many threads as
    `numba.get_num_threads()` says and get enough of them. What comes out of a block may not depend on the others.

    least : blocks that are worth a thread. Threads take a few at a time; one that is scheduled late (a browser that
    draws the scene may have all cores) finds them done by the others and is not waited for.
    """
    threads = blocks // least
    if threads > 1:
        threads = min(int(numba.get_num_threads()), threads)
    if threads <= 1:
        kernel(0, blocks, *arguments)
        return
    step = -(-blocks // (TURNS * threads))
    firsts = iter(range(0, blocks, step))

    def work() -> None:
        for first in firsts:
            kernel(first, min(first + step, blocks), *arguments)

    helpers = [_helpers().submit(work) for _ in range(threads - 1)]
    work()
    for helper in helpers:
        if not helper.cancel():
            helper.result()


@functools.cache
def _helpers() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_name_prefix="kernel")
