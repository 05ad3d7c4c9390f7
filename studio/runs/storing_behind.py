"""Results written in the order they came, a moment later, so that the search does not wait for the disk."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future

MOST_WAITING = 60
"""Frames that may wait to be stored: then the search waits for the disk after all."""


class StoringBehind:
    """executor : of one thread, which keeps the order; None: everything is done at once. Used by one thread."""

    def __init__(self, executor: Executor | None) -> None:
        self._executor = executor
        self._waiting: deque[Future[None]] = deque()
        self._failed: BaseException | None = None

    def do(self, action: Callable[[], None]) -> None:
        """Do something after all that was asked before. Raises what one of those failed with; then none of what was
        asked after that one is done, as it follows from it.
        """
        if self._executor is None:
            action()
            return
        while self._waiting and (self._waiting[0].done() or len(self._waiting) >= MOST_WAITING):
            self._next_done()
        self._waiting.append(self._executor.submit(self._done_unless_failed, action))

    def wait(self) -> None:
        """Return when all is done. Raises what one of it failed with."""
        while self._waiting:
            self._next_done()

    def _done_unless_failed(self, action: Callable[[], None]) -> None:
        """In the executor's thread."""
        if self._failed is None:
            try:
                action()
            except BaseException as problem:
                self._failed = problem

    def _next_done(self) -> None:
        """Wait for the oldest; where it failed, for all of them, and raise what it failed with."""
        self._waiting.popleft().result()
        if self._failed is not None:
            while self._waiting:
                self._waiting.popleft().result()
            problem, self._failed = self._failed, None
            raise problem
