"""Footage gone through forth and back without an end, so that a short clip can be replayed for long.

A body that jumped from a clip's end to its beginning could not be followed; at a turning point it only goes back the
way it came.
"""

from studio.capture.footage import Footage
from studio.errors import NotFoundError


def folded(frame: int, count: int) -> int:
    """The frame of `count` that is shown at place `frame` of a way forth and back: 0 1 2 1 0 1 … for three."""
    if count == 1:
        return 0
    place = frame % (2 * count - 2)
    return min(place, 2 * count - 2 - place)


class ToAndFro(Footage):
    """A session's footage with every frame under many numbers; `frame_count` still says how many it has."""

    def _checked(self, frame: int) -> int:
        if frame < 0:
            raise NotFoundError(f"There is no frame {frame}.", "Frames are counted from 0.")
        return folded(frame, self.frame_count)
