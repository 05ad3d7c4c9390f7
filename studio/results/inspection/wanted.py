"""Whether a view is still waited for: one that takes long ends between two of its steps when its request was broken
off, so that it does not hold up the one that is looked at.
"""

from collections.abc import Callable
from contextvars import ContextVar

IS_WANTED: ContextVar[Callable[[], bool]] = ContextVar("is_wanted", default=lambda: True)
"""Says of the answer that is computed in this context whether it is still waited for."""


class LeftError(Exception):
    """The request was broken off: there is no one to answer, and no cause or remedy to tell."""


def stop_if_left() -> None:
    """Raises LeftError where the answer is not waited for any more."""
    if not IS_WANTED.get()():
        raise LeftError
