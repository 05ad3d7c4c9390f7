"""A live run: of the sets that arrive while a frame is searched, only the newest is tracked.

Which frames are tracked depends on the machine and its load. Nothing else does: the results store lists the tracked
frames, and given these every pose follows bit for bit from the run's record (`live_replay` tracks them again and
compares). `frame_steps` has the effect of dropped frames on the search.

Frames are set by `take` and searched by `step_layer`. An executor stores the results in order, a moment later.
"""

import dataclasses
import time
from collections.abc import Callable
from concurrent.futures import Executor

from studio.foundations.errors import RunError
from studio.runs.live.live_problems import LiveProblems, Ready
from studio.runs.live.live_summary import LiveMeter, LiveStanding
from studio.runs.live.set_following import SetNumbers
from studio.runs.pace import Progress
from studio.runs.tracking_run import TrackingRun
from studio.search.settings import RunSettings
from studio.search.trackers.frame_loop import FrameSearch
from studio.search.trackers.tracker import FrameResult
from studio.sessions.stored_run import StoredRun

OVER = "finished"
REHEARSALS = 3
"""A behaviour model predicts from the two frames before."""


class LiveRun(TrackingRun):
    """Tracks a stored live run. storing : an executor of one thread that writes results; None: they are written at
    once. clock : that of the arrivals, seconds.
    """

    def __init__(
        self,
        run: StoredRun,
        problems: LiveProblems,
        storing: Executor | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock, self._live_problems = clock, problems
        self._came: tuple[int, float] | None = None
        self.latency_ms = float("nan")
        super().__init__(run, problems, storing)
        self._measure_again()

    @property
    def standing(self) -> LiveStanding:
        """Dropped frames, rate and latency now."""
        return self.meter.standing

    @property
    def finished(self) -> bool:
        """Whether the last frame was tracked or dropped."""
        return self._over or super().finished

    @property
    def between_frames(self) -> bool:
        return self._astray or self._search is None

    def take(self, ready: Ready) -> None:
        """Make a frame the next one to search; the frames between are dropped."""
        if self._astray:
            self._load_again()
        self._live_problems.take(ready)
        self.next_frame = ready.frame
        self._came = (ready.frame, ready.arrival.complete)

    def go_to(self, frame: int) -> None:
        """Search `frame` next, however old it is. Raises RunError inside another frame."""
        if not self.between_frames and frame != self.next_frame:
            raise RunError(f"Frame {self.next_frame} is not finished.", "Do its remaining layers first.")
        self.next_frame, self._came = frame, None

    def end(self) -> None:
        """End the run: no further frame will arrive."""
        self.meter.passed(self.record.last - 1)
        self._wait_for_disk()
        self._over = True
        self._writer.mark_ended(OVER)

    def save(self) -> None:
        self._came = None
        self.meter.paused()
        super().save()

    def mark_going_on(self) -> None:
        """Note that a cancelled run is resumed."""
        super().mark_going_on()
        self._over = False

    def progress(self, least: float = 0.0) -> Progress:
        """The run's progress by frame number; it takes as long as its footage."""
        passed, total = self.next_frame - self.record.first, self.record.frame_count
        passed = total if self.finished else passed
        return Progress(self.done, total, self.standing.frames_per_second, (total - passed) / self.record.fps)

    def rehearse(self) -> None:
        """Search the next frame several times and discard the results, so that everything is compiled and loaded."""
        version, settings = self.settings_source()
        frame = min(self.next_frame, self.record.last - 1)
        carried = self.carried_into(frame)
        problem = self.problems.problem(frame, settings)
        for _ in range(REHEARSALS):
            search = FrameSearch(
                self.tracker, carried, self._behaviour.space, seed=self.record.seed, frame=frame
            )
            while not search.finished:
                search.step(problem, version, settings.tracker)
            carried = self.result_of(search, settings, ()).carried

    def _next(self, result: FrameResult) -> None:
        super()._next(result)
        if self.next_frame >= self.record.last:
            self.end()

    def _store(
        self, result: FrameResult, settings: RunSettings, came: tuple[float, float] | None = None
    ) -> None:
        at_hand, ready = self._came, self._clock()
        times = came
        if at_hand is not None and at_hand[0] == result.frame:
            times = (at_hand[1], ready)
            self.meter.tracked(result.frame, *times)
        else:
            # Continued after a pause: its latency does not count.
            self.meter.passed(result.frame)
        self.latency_ms = 1e3 * (times[1] - times[0]) if times else float("nan")
        super()._store(result, settings, times)

    def _load_again(self) -> None:
        super()._load_again()
        self._measure_again()

    def _measure_again(self) -> None:
        self.meter = LiveMeter(self._reader.frames(), SetNumbers(self.run.folder.parents[1]))
        self._over = self._reader.ended() == OVER


def without_particles(result: FrameResult) -> FrameResult:
    """The result without its particles, which are large and which viewers do not need."""
    carried = dataclasses.replace(result.carried, particles=None, memory={})
    return dataclasses.replace(result, carried=carried)
