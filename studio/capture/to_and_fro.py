"""Footage gone through forth and back without an end, so that a short clip can be replayed for long.

A body that jumped from a clip's end to its beginning could not be followed; at a turning point it only goes back the
way it came. Videos can only be decoded onwards, so on the way back stretches of frames are decoded at once and kept; a
stretch costs some ten frames' time, every now and then.
"""

from studio.arrays import Bytes
from studio.capture.footage import KEPT_BYTES, Footage
from studio.errors import NotFoundError

STRETCH = 24


def folded(frame: int, count: int) -> int:
    """The frame of `count` that is shown at place `frame` of a way forth and back: 0 1 2 1 0 1 … for three."""
    if count == 1:
        return 0
    place = frame % (2 * count - 2)
    return min(place, 2 * count - 2 - place)


class ToAndFro(Footage):
    """A session's footage with every frame under many numbers; `frame_count` still says how many it has."""

    _reached: dict[str, int] | None = None

    def picture(self, camera: str, frame: int) -> Bytes:
        """As `Footage.picture`; on the way back with the frames that come next."""
        reached = self._reached = {} if self._reached is None else self._reached
        index = self._checked(frame)
        before = reached.get(camera, -1)
        if index < before:
            source = self._by_name[camera]
            room = KEPT_BYTES // (3 * source.width * source.height)
            before = max(0, index - max(1, min(STRETCH, room // 2)) + 1)
            for earlier in range(before, index):
                super().picture(camera, earlier)
        turning = self._checked(frame + 1) > index
        reached[camera] = index if turning else before
        return super().picture(camera, index)

    def _checked(self, frame: int) -> int:
        if frame < 0:
            raise NotFoundError(f"There is no frame {frame}.", "Frames are counted from 0.")
        return folded(frame, self.frame_count)
