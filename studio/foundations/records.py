"""Records made of other records."""

import inspect
from collections.abc import Callable
from typing import TypeVar

R = TypeVar("R")


def extended(kind: Callable[..., R], record: object, /, **own: object) -> R:
    """A record of a kind that has more entries than another: those of the other one, and its `own`."""
    names = [name for name in inspect.signature(kind).parameters if name not in own]
    return kind(**{name: getattr(record, name) for name in names}, **own)
