"""The rate of a run and its time left, measured over its last frames; the expected time of a run, from a stored one."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from studio.foundations.errors import StudioError
from studio.foundations.progress import time_left
from studio.sessions.results_reader import Timeline, TimeTaken
from studio.sessions.session import Session

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


@dataclass(frozen=True, slots=True)
class StoredPace:
    """How fast a stored run was tracked. run : its name. milliseconds : that an evaluated pose took, and beside the
    search each frame (its evidence above all; 0 where that is not known). threads : of its process, 0 where not known.
    """

    run: str
    milliseconds: float
    frame_milliseconds: float
    threads: int

    def seconds(self, evaluations: float, frames: int) -> float:
        """Seconds that so many frames with so many evaluations in all take at that pace."""
        return (self.milliseconds * evaluations + self.frame_milliseconds * frames) / 1000.0


def stored_pace(session: Session, tracker: str, weighting: str, evaluations: float) -> StoredPace | None:
    """The pace of a stored run of the session with that likelihood: of the same tracker where there is one, and of the
    number of evaluations a frame that comes nearest. None without such a run. Live runs wait for their frames and
    do not count.
    """
    best: tuple[tuple[bool, float], StoredPace] | None = None
    for run in reversed(session.runs()):
        try:
            record = run.record
            if record.live or record.weighting != weighting:
                continue
            with run.results() as results:
                line, taken = results.timeline(), results.time_taken()
        except StudioError:
            continue
        total = float(line.evaluations.sum())
        if total <= 0.0:
            continue
        away = abs(math.log(total / len(line.frames) / max(evaluations, 1.0)))
        rank = (record.tracker != tracker, away)
        if best is None or rank < best[0]:
            best = rank, _pace(run.name, line, taken)
    return best[1] if best else None


def _pace(run: str, line: Timeline, taken: TimeTaken | None) -> StoredPace:
    search = float(line.milliseconds.sum())
    beside = 1000.0 * taken.seconds / taken.frames - search / len(line.frames) if taken else 0.0
    threads = taken.threads if taken else 0
    return StoredPace(run, search / float(line.evaluations.sum()), max(0.0, beside), threads)
