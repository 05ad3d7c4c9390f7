"""Playing stored frames: which frame is shown as time goes by. Pure arithmetic; the presenter owns the
clock.
"""

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True, slots=True)
class Playback:
    """playing, speed (1 is real time), loop. debt : shown time that has not made a whole frame yet, in
    frames.
    """

    playing: bool = False
    speed: float = 1.0
    loop: bool = True
    debt: float = 0.0

    def advanced(
        self, seconds: float, fps: float, frame: int | None, frames: Sequence[int]
    ) -> tuple["Playback", int | None]:
        """The playback and the frame to show after some seconds. frames : the stored ones, ascending.

        At the end it starts over (loop) or stops; a frame between two stored ones takes the next one.
        """
        if not self.playing or not frames:
            return self, frame
        if frame is None:
            return self, frames[0]
        due = self.debt + seconds * fps * self.speed
        steps = int(due)
        if steps == 0:
            return replace(self, debt=due), frame
        place = bisect.bisect_left(frames, frame) + steps
        if place < len(frames):
            return replace(self, debt=due - steps), frames[place]
        if self.loop:
            return replace(self, debt=due - steps), frames[place % len(frames)]
        return replace(self, playing=False, debt=0.0), frames[-1]


def stepped(frame: int | None, frames: Sequence[int], steps: int) -> int | None:
    """The stored frame so many places further on (back: negative), held at both ends."""
    if not frames:
        return frame
    if frame is None:
        return frames[0]
    place = bisect.bisect_left(frames, frame)
    return frames[max(0, min(len(frames) - 1, place + steps))]


def nearest(frame: int, frames: Sequence[int]) -> int | None:
    """The stored frame nearest to `frame`, None where nothing is stored."""
    return min(frames, key=lambda stored: abs(stored - frame)) if frames else None
