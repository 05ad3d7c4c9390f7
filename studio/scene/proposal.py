"""Poses that somebody wants looked at: a start pose found for a session, until a person takes it or leaves it; a pose
to be edited.
"""

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


@dataclass(frozen=True, slots=True, eq=False)
class EditWish:
    """What is to be edited. editing : False leaves off. run : "" for the session's start pose, else `frame` of it is
    corrected. pose : (D,) to begin with; None: the one that is shown there.
    """

    editing: bool
    session: str = ""
    run: str = ""
    frame: int | None = None
    pose: NDArray[float64] | None = None
