"""Whether whoever asked for a view still waits for it: one that takes long ends between two of its steps when nobody
does, so that it does not hold up those that somebody looks at.
"""

from collections.abc import Callable
from contextvars import ContextVar

from studio.errors import StudioError

IS_WANTED: ContextVar[Callable[[], bool]] = ContextVar("is_wanted", default=lambda: True)
"""Says of the answer that is computed in this context whether it is still waited for."""


class LeftError(StudioError, status=499, code="left"):
    """Whoever asked has gone; the answer reaches nobody."""


def stop_if_left() -> None:
    """Raises LeftError where the answer is not waited for any more."""
    if not IS_WANTED.get()():
        raise LeftError("Nobody waits for this any more.")
