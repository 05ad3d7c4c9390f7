"""Sources of sets for a live run, and a clock that replays footage as if it were live.

A *set* is one picture of every camera, all of one moment. A live run needs little of its source
(`LiveSource`): the newest complete set, and to be woken by the next. Cameras give it from their pictures; `ReplayClock`
gives it for footage on disk, each frame at its time.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

PATIENCE_SECONDS = 0.05
"""Longest single wait in seconds, so that a waiting thread can be stopped."""


@dataclass(frozen=True, slots=True)
class Arrival:
    """A complete set. frame : its number; numbers rise, and those that are left out never became complete. times :
    seconds of the source's clock at which each camera's picture came, in the order of the cameras.
    """

    frame: int
    times: tuple[float, ...]

    @property
    def complete(self) -> float:
        """When the last of its pictures came, which is when the set could be looked at first."""
        return max(self.times)


class LiveSource(Protocol):
    """The source of sets of a live run; the pictures come from a `Footage`."""

    def begin(self, frame: int) -> None: ...

    def newest(self, after: int) -> Arrival | None:
        """The newest complete set, None unless its number is above `after`. Never waits."""
        ...

    def wait(self, after: int) -> None:
        """Return when there is a set above `after`, or after a moment (`PATIENCE_SECONDS`) without one."""
        ...

    def over(self, after: int) -> bool:
        """Whether no set above `after` will ever come."""
        ...


class ReplayClock:
    """Footage as if it were live: frame k comes (k - first) / fps seconds after the first.

    cameras : how many, which all take their pictures at the same time. last : the frame after the last one. clock :
    seconds, rising; sleep : waits for seconds.
    """

    def __init__(
        self,
        fps: float,
        last: int,
        cameras: int,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._fps, self._last, self._cameras = fps, last, cameras
        self._clock, self._sleep = clock, sleep
        self._first = 0
        self._began: float | None = None

    def begin(self, frame: int) -> None:
        self._first, self._began = frame, self._clock()

    def newest(self, after: int) -> Arrival | None:
        """The newest frame whose time has come."""
        if self._began is None:
            return None
        # A frame is there at its very moment, also where the clock's last digit says just before.
        passed = int((self._clock() - self._began) * self._fps + 1e-6)
        frame = min(self._first + passed, self._last - 1)
        return None if frame <= after else Arrival(frame, (self._due(frame),) * self._cameras)

    def wait(self, after: int) -> None:
        """Sleep until the frame after `after` is due."""
        left = PATIENCE_SECONDS if self._began is None else self._due(after + 1) - self._clock()
        if left > 0.0:
            self._sleep(min(left, PATIENCE_SECONDS))

    def over(self, after: int) -> bool:
        """Whether the footage has no frame above `after`."""
        return after >= self._last - 1

    def _due(self, frame: int) -> float:
        assert self._began is not None
        return self._began + (max(frame, self._first) - self._first) / self._fps
