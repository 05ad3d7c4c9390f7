"""How fast a run goes and how long it will take, measured over its last frames."""

from collections import deque
from collections.abc import Sequence
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
        self._frames: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED)

    def add(self, layers: Sequence[float]) -> None:
        """Note how many seconds each layer of a frame took, evidence and storing included."""
        self._frames.append(tuple(layers))

    def progress(self, done: int, total: int, least: float = 0.0) -> Progress:
        """The estimate, from the mean of the last frames. least : seconds that a layer is made to take from now
        on."""
        spent = sum(max(seconds, least) for layers in self._frames for seconds in layers)
        if spent <= 0.0:
            return Progress(done, total, float("nan"), float("nan"))
        rate = len(self._frames) / spent
        return Progress(done, total, rate, (total - done) / rate)
