"""A start pose that somebody found for a session, until a person takes it or leaves it."""

from dataclasses import dataclass

from numpy import float64
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """pose : (D,) radians and mm. said : how sure it is, in words. frame : that it was found in, None unknown."""

    session: str
    pose: NDArray[float64]
    said: str
    frame: int | None = None
