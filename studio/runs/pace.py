"""The rate of a run and its time left, measured over its last frames."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from studio.progress import time_left

REMEMBERED, RECENT = 200, 30
"""Frames for the estimate of the time left, and for the rate on screen."""


@dataclass(frozen=True, slots=True)
class Progress:
    """done of total frames; frames_per_second and seconds_left are NaN while unknown."""

    done: int
    total: int
    frames_per_second: float
    seconds_left: float


class Pace:
    """The durations of the last frames, without pauses."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED)

    def add(self, layers: Sequence[float]) -> None:
        """Add the seconds of each layer of a frame, evidence and storing included."""
        self._frames.append(tuple(layers))

    def progress(self, done: int, total: int, least: float = 0.0) -> Progress:
        """The rate and the estimate. least : seconds that a layer is slowed down to from now on."""
        taken = [sum(max(seconds, least) for seconds in layers) for layers in self._frames]
        recent = taken[-RECENT:]
        rate = len(recent) / sum(recent) if sum(recent) > 0.0 else math.nan
        left = time_left([(seconds, 1) for seconds in taken], total - done)
        return Progress(done, total, rate, math.nan if left is None else left)
