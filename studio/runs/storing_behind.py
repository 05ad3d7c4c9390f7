"""Results written in the order they came, a moment later, so that the search does not wait for the disk."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future

MOST_WAITING = 60
"""Frames that may wait to be stored; beyond that the search waits for the disk."""


class StoringBehind:
    """Stores results in order in another thread. executor : of one thread; None: at once. most : results that may
    wait. Not thread-safe.
    """

    def __init__(self, executor: Executor | None, most: int = MOST_WAITING) -> None:
        self._executor, self._most = executor, most
        self._waiting: deque[Future[None]] = deque()
        self._failed: BaseException | None = None

    def do(self, action: Callable[[], None]) -> None:
        """Queue an action. Raises the error of an earlier one; actions queued after a failed one are not done."""
        if self._executor is None:
            action()
            return
        while self._waiting and (self._waiting[0].done() or len(self._waiting) >= self._most):
            self._next_done()
        self._waiting.append(self._executor.submit(self._done_unless_failed, action))

    def wait(self) -> None:
        """Wait for all actions. Raises the error of one that failed."""
        while self._waiting:
            self._next_done()

    def _done_unless_failed(self, action: Callable[[], None]) -> None:
        """Do an action in the executor's thread, unless an earlier one failed."""
        if self._failed is None:
            try:
                action()
            except BaseException as problem:
                self._failed = problem

    def _next_done(self) -> None:
        """Wait for the oldest action; if it failed, for all of them, and raise its error."""
        self._waiting.popleft().result()
        if self._failed is not None:
            while self._waiting:
                self._waiting.popleft().result()
            problem, self._failed = self._failed, None
            raise problem
