"""A take that is being recorded as a live run's source of sets: follows what its recorder writes down.

Recorder and tracker may be two threads or two processes; they share the take's folder and the machine's clock.
"""

import time
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path

from studio.capture.frame_clock import PATIENCE_SECONDS, Arrival
from studio.sessions.takes import END, LIVE, SETS_NAME, is_being_recorded, let_go_on, taken_set

LOOK_SECONDS = 0.004
"""A new line is noticed after at most so long."""
LOCK_SECONDS = 1.0
"""How often it is looked whether the recorder still lives."""


class TakeFollower:
    """The newest set of a take. folder : the session's. sleep : lets so many seconds pass."""

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
        self._ended, self._looked = False, clock()

    def begin(self, frame: int) -> None:
        """Let the sets come; one that came before, to get ready with, is not tracked late."""
        self._look()
        self._before = self._newest.frame if self._newest else -1
        let_go_on(self._folder)

    def newest(self, after: int) -> Arrival | None:
        """The newest set."""
        self._look()
        found = self._newest
        return None if found is None or found.frame <= max(after, self._before) else found

    def wait(self, after: int) -> None:
        """Return when there is a set above `after`, or after a moment."""
        until = self._clock() + PATIENCE_SECONDS
        while self.newest(after) is None and not self._ended and self._clock() < until:
            self._sleep(LOOK_SECONDS)

    def over(self, after: int) -> bool:
        """Whether the recorder has ended, or died."""
        self._look()
        if not self._ended and self._clock() - self._looked > LOCK_SECONDS:
            self._looked = self._clock()
            self._ended = not is_being_recorded(self._folder)
        return self._ended and self.newest(after) is None

    def _look(self) -> None:
        """Read the lines that are new."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                content = file.read()
        except FileNotFoundError:
            return
        self._offset += len(content)
        *lines, self._rest = (self._rest + content).split(b"\n")
        for line in lines:
            row = line.decode().split(",")
            if row[0] == END:
                self._ended = True
            elif row[0].isdigit():
                found = taken_set(row)
                self._newest = Arrival(found.frame, tuple(found.times.values()))


class SetNumbers:
    """Which numbers of a take have a set, read on as its recorder writes. folder : the session's."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LIVE / SETS_NAME
        self._offset, self._rest = 0, b""
        self._numbers: list[int] = []

    @property
    def of_a_take(self) -> bool:
        """Whether the session is one: of footage, every number has its pictures."""
        return bool(self._numbers) or self._path.exists()

    @property
    def last(self) -> int:
        """The newest set's number, -1 before the first."""
        self._look()
        return self._numbers[-1] if self._numbers else -1

    def between(self, after: int, to: int) -> int:
        """How many sets there are of numbers above `after`, up to `to`."""
        self._look()
        return bisect_right(self._numbers, to) - bisect_right(self._numbers, after)

    def _look(self) -> None:
        """Read the lines that are new."""
        if not self._path.exists():
            return
        with self._path.open("rb") as file:
            file.seek(self._offset)
            content = file.read()
        self._offset += len(content)
        *lines, self._rest = (self._rest + content).split(b"\n")
        words = (line.partition(b",")[0] for line in lines)
        self._numbers += [int(word) for word in words if word.isdigit()]
