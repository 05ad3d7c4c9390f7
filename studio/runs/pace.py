"""How fast a run goes and how long it will take, measured over its last frames."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from studio.progress import time_left

REMEMBERED, RECENT = 200, 30
"""Frames that the time left is estimated from, and those that the rate on screen is of."""


@dataclass(frozen=True, slots=True)
class Progress:
    """done of total frames; frames_per_second and seconds_left are NaN while unknown."""

    done: int
    total: int
    frames_per_second: float
    seconds_left: float


class Pace:
    """Remembers how long the last frames took. Time spent paused is not counted."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED)

    def add(self, layers: Sequence[float]) -> None:
        """Note how many seconds each layer of a frame took, evidence and storing included."""
        self._frames.append(tuple(layers))

    def progress(self, done: int, total: int, least: float = 0.0) -> Progress:
        """The rate and the estimate. least : seconds that a layer is made to take from now on."""
        taken = [sum(max(seconds, least) for seconds in layers) for layers in self._frames]
        recent = taken[-RECENT:]
        rate = len(recent) / sum(recent) if sum(recent) > 0.0 else math.nan
        left = time_left([(seconds, 1) for seconds in taken], total - done)
        return Progress(done, total, rate, math.nan if left is None else left)
