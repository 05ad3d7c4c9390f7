"""How fast a run goes and how long it will take, measured over its last frames."""

from collections import deque
from dataclasses import dataclass

REMEMBERED = 30


@dataclass(frozen=True, slots=True)
class Progress:
    """done of total frames; frames_per_second and seconds_left are NaN while unknown."""

    done: int
    total: int
    frames_per_second: float
    seconds_left: float


class Pace:
    """Remembers how long the last frames took. Time spent paused is never told to it."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=REMEMBERED)

    def add(self, seconds: float) -> None:
        """Note that a frame took so long, evidence and storing included."""
        self._seconds.append(seconds)

    def progress(self, done: int, total: int) -> Progress:
        """The estimate, from the mean of the last frames."""
        spent = sum(self._seconds)
        if spent <= 0.0:
            return Progress(done, total, float("nan"), float("nan"))
        rate = len(self._seconds) / spent
        return Progress(done, total, rate, (total - done) / rate)
