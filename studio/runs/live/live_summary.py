"""A live run's dropped frames, rate and latency."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError
from studio.runs.live.set_following import SetNumbers
from studio.sessions.live_recordings import read_sets
from studio.sessions.stored_run import StoredRun

WATCHED = 60
"""Frames over which rate and latency on screen are computed."""


@dataclass(frozen=True, slots=True)
class LiveStanding:
    """A live run now. dropped : frames that arrived and were not tracked. dropped_share : of all arrived frames.
    latency_ms : median over the last frames, NaN before the first. frames_per_second : over the same, NaN before the
    second. incomplete : moments of a recording at which a camera's picture was missing, so that nothing could be
    tracked.
    """

    dropped: int
    dropped_share: float
    latency_ms: float
    frames_per_second: float
    incomplete: int = 0

    @property
    def in_words(self) -> str:
        """The text of a status line."""
        parts = ["live"]
        if self.frames_per_second == self.frames_per_second:
            parts.append(f"{self.frames_per_second:.1f} fps")
        if self.latency_ms == self.latency_ms:
            parts.append(f"latency {self.latency_ms:.0f} ms")
        lacking = [f"{self.incomplete} incomplete"] if self.incomplete else []
        return " · ".join([*parts, f"{self.dropped} dropped", *lacking])


class LiveMeter:
    """Measures rate and latency of a live run."""

    def __init__(self, tracked: Sequence[int] = (), sets: SetNumbers | None = None) -> None:
        """tracked : frames done already. sets : of a recording, where a number without a set was incomplete; None:
        every number has its pictures.
        """
        self._sets = sets if sets is not None and sets.of_a_recording else None
        self._came, self._incomplete = 0, 0
        self._tracked, self._newest = len(tracked), tracked[0] - 1 if tracked else None
        if tracked:
            self.passed(tracked[-1])
        self._last: deque[tuple[float, float]] = deque(maxlen=WATCHED)

    def passed(self, frame: int) -> None:
        """Frames up to this one arrived; it need not be tracked."""
        before = frame - 1 if self._newest is None else self._newest
        if self._sets is not None:
            # A recording may end early: there is nothing after the last set.
            frame = min(frame, self._sets.last)
        passed = max(0, frame - before)
        came = passed if self._sets is None else self._sets.between(before, max(frame, before))
        self._came += came
        self._incomplete += passed - came
        self._newest = max(frame, before)

    def tracked(self, frame: int, came: float, ready: float) -> None:
        """Add a tracked frame. came, ready : times of its pictures and of its pose, seconds."""
        self.passed(frame)
        self._tracked += 1
        self._last.append((came, ready))

    def paused(self) -> None:
        """Restart the measurement of the rate: the pause does not count."""
        self._last.clear()

    @property
    def standing(self) -> LiveStanding:
        """The run's current figures."""
        times = np.array(self._last).reshape(-1, 2)
        dropped = self._came - self._tracked
        return LiveStanding(
            dropped=dropped,
            dropped_share=dropped / self._came if self._came else 0.0,
            latency_ms=1e3 * float(np.median(times[:, 1] - times[:, 0])) if len(times) else float("nan"),
            frames_per_second=rate_of(times[:, 1]),
            incomplete=self._incomplete,
        )


@dataclass(frozen=True, slots=True, eq=False)
class LiveSummary:
    """Figures of a stored live run. tracked, dropped, incomplete : frame numbers, ascending; together all from the
    first tracked one to the last that arrived; at incomplete ones a camera's picture was missing. frames_per_second :
    of tracked frames from the first pose to the last without pauses; NaN for fewer than two. latencies (K,) : ms from
    the last picture of a set to its pose, by frame.
    """

    tracked: tuple[int, ...]
    dropped: tuple[int, ...]
    frames_per_second: float
    latencies: Array
    incomplete: tuple[int, ...] = ()

    @property
    def dropped_share(self) -> float:
        """Of all frames that arrived."""
        came = len(self.tracked) + len(self.dropped)
        return len(self.dropped) / came if came else 0.0

    def latency(self, share: float) -> float:
        """The latency (ms) at a quantile `share` of the frames; NaN without frames."""
        return float(np.quantile(self.latencies, share)) if len(self.latencies) else float("nan")


def summary_of(run: StoredRun) -> LiveSummary:
    """The figures of a stored live run. Raises NotFoundError for a run that was not live."""
    if not run.record.live:
        raise NotFoundError(f"Run '{run.name}' was not tracked live.", "Choose a live run.")
    with run.results() as results:
        tracked, over = results.frames(), results.ended() == "finished"
        _, times = results.arrivals()
    incomplete: tuple[int, ...] = ()
    came = range(tracked[0], run.record.last if over else tracked[-1] + 1) if tracked else range(0)
    known, sets = set(tracked), read_sets(run.folder.parents[1]).sets
    if sets and tracked:
        # Of a recording, only the sets that exist: numbers between them only mark the time.
        came = [one.frame for one in sets if one.frame >= tracked[0]]
        arrived = set(came)
        incomplete = tuple(frame for frame in range(tracked[0], came[-1]) if frame not in arrived)
    return LiveSummary(
        tracked=tuple(tracked),
        dropped=tuple(frame for frame in came if frame not in known),
        frames_per_second=rate_of(times[:, 1]),
        latencies=1e3 * (times[:, 1] - times[:, 0]),
        incomplete=incomplete,
    )


def rate_of(ready: Array) -> float:
    """Frames a second, from the times (K,) at which they were ready, seconds; gaps over a second are pauses."""
    gaps = np.diff(ready)
    gaps = gaps[(gaps > 0.0) & (gaps <= PAUSE_SECONDS)]
    return len(gaps) / float(gaps.sum()) if len(gaps) else float("nan")


def in_words(dropped: Sequence[int], most: int = 8) -> str:
    """Frame numbers as text with ranges: "3, 7-9"."""
    runs: list[tuple[int, int]] = []
    for frame in dropped:
        if runs and frame == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], frame)
        else:
            runs.append((frame, frame))
    words = [f"{first}" if first == last else f"{first}-{last}" for first, last in runs]
    return ", ".join(words[:most]) + (f" and {len(words) - most} more gaps" if len(words) > most else "")


PAUSE_SECONDS = 1.0
