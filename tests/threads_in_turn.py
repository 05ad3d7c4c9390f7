"""Numba's simulator of a card with the threads of a block taken in turn.

The simulator has a thread of the system for each of the card's, which spend nine tenths of the time waiting for one
another. Greenlets do the same: each runs to its next `syncthreads`, first in ascending order, then in descending, so
that a missing one shows, and shows every time.
"""

from collections.abc import Callable
from types import FrameType, SimpleNamespace
from typing import Any

import numpy as np
from greenlet import getcurrent, greenlet


def take_threads_in_turn() -> None:
    """Have the simulator do so from now on, in this process."""
    from numba.cuda.simulator import kernel, kernelapi  # noqa: PLC0415 - where a card is simulated

    class Taken(greenlet):
        """A thread of the card, with what the simulator asks of its own."""

        syncthreads_count = kernel.BlockThread.syncthreads_count
        syncthreads_and = kernel.BlockThread.syncthreads_and
        syncthreads_or = kernel.BlockThread.syncthreads_or

        def __init__(self, run: Callable[[], None], manager: Any, block: Any, thread: Any) -> None:  # noqa: ANN401
            super().__init__(run)
            self._manager = manager
            self.blockIdx, self.threadIdx = kernel.Dim3(*block), kernel.Dim3(*thread)
            wide = kernel.Dim3(*manager._block_dim)
            x, y, z = thread
            self.thread_id = x + wide.x * (y + wide.y * z)

        def syncthreads(self) -> None:
            self.parent.switch()

    def run(manager: Any, block: Any, *arguments: object) -> None:  # noqa: ANN401
        def whole() -> None:
            manager._f(*arguments)

        waiting = [Taken(whole, manager, block, thread) for thread in np.ndindex(*manager._block_dim)]
        while waiting:
            for thread in waiting:
                thread.switch()
            waiting = [thread for thread in reversed(waiting) if not thread.dead]

    kernel.BlockManager.run = run
    kernelapi.threading = SimpleNamespace(current_thread=getcurrent)
    kernelapi.traceback = SimpleNamespace(extract_stack=_two_frames)


def _two_frames(frame: FrameType) -> list[tuple[str, int]]:
    """Of a whole stack, what the simulator looks at to tell shared memories apart: the line that asks for one."""
    caller = frame.f_back
    assert caller is not None
    return [(caller.f_code.co_filename, caller.f_lineno), (frame.f_code.co_filename, frame.f_lineno)]
