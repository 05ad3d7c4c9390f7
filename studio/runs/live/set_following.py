"""Follows a recording in progress: its sets are the source of a live run.

Recorder and tracker may be two threads or two processes; they share the recording's folder and the machine's clock.
"""

import time
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path

from studio.footage.capture.frame_clock import PATIENCE_SECONDS, Arrival
from studio.foundations.foreign_files import open_file
from studio.sessions.live_recordings import END, LIVE, SETS_NAME, is_being_recorded, recorded_set, start_sets

LOOK_SECONDS = 0.004
"""Polling interval for new lines, seconds."""
MOST_AT_ONCE = 64 << 20
"""Bytes of new lines; the rest is read at the next look."""
LOCK_SECONDS = 1.0
"""Interval between checks that the recorder is alive, seconds."""


class SetFollower:
    """The newest set of a recording. folder : the session's. sleep : waits for seconds."""

    def __init__(
        self,
        folder: Path,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._folder, self._path = folder, folder / LIVE / SETS_NAME
        self._clock, self._sleep = clock, sleep
        self._offset, self._rest = 0, b""
        self._newest: Arrival | None = None
        self._before = -1
        self._ended, self._checked = False, clock()

    def begin(self, frame: int) -> None:
        """Start the sets; an earlier one, for warming up, is not tracked."""
        self._look()
        self._before = self._newest.frame if self._newest else -1
        start_sets(self._folder)

    def newest(self, after: int) -> Arrival | None:
        self._look()
        newest = self._newest
        return None if newest is None or newest.frame <= max(after, self._before) else newest

    def wait(self, after: int) -> None:
        """Return when there is a set above `after`, or after a moment."""
        until = self._clock() + PATIENCE_SECONDS
        while self.newest(after) is None and not self._ended and self._clock() < until:
            self._sleep(LOOK_SECONDS)

    def over(self, after: int) -> bool:
        """Whether the recorder has ended, or died."""
        self._look()
        if not self._ended and self._clock() - self._checked > LOCK_SECONDS:
            self._checked = self._clock()
            self._ended = not is_being_recorded(self._folder)
        return self._ended and self.newest(after) is None

    def _look(self) -> None:
        """Read the lines that are new."""
        try:
            with open_file(self._path) as file:
                file.seek(self._offset)
                content = file.read(MOST_AT_ONCE)
        except FileNotFoundError:
            return
        self._offset += len(content)
        *lines, self._rest = (self._rest + content).split(b"\n")
        for line in lines:
            row = line.decode().split(",")
            if row[0] == END:
                self._ended = True
            elif row[0].isdigit():
                recorded = recorded_set(row)
                self._newest = Arrival(recorded.frame, tuple(recorded.times.values()))


class SetNumbers:
    """The numbers of a recording that have a set, read as its recorder writes. folder : the session's."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LIVE / SETS_NAME
        self._offset, self._rest = 0, b""
        self._numbers: list[int] = []

    @property
    def of_a_recording(self) -> bool:
        """Whether the session is a recording; in other footage every number has its pictures."""
        return bool(self._numbers) or self._path.exists()

    @property
    def last(self) -> int:
        """The newest set's number, -1 before the first."""
        self._look()
        return self._numbers[-1] if self._numbers else -1

    def between(self, after: int, to: int) -> int:
        """The number of sets above `after` up to `to`."""
        self._look()
        return bisect_right(self._numbers, to) - bisect_right(self._numbers, after)

    def _look(self) -> None:
        """Read the lines that are new."""
        if not self._path.exists():
            return
        with open_file(self._path) as file:
            file.seek(self._offset)
            content = file.read(MOST_AT_ONCE)
        self._offset += len(content)
        *lines, self._rest = (self._rest + content).split(b"\n")
        words = (line.partition(b",")[0] for line in lines)
        self._numbers += [int(word) for word in words if word.isdigit()]
