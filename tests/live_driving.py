"""A live run driven by hand: a clock that only moves when it is told to, no threads."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from toy_session import true_poses

from studio.footage.capture.frame_clock import ReplayClock
from studio.runs.live.live_problems import LiveProblems
from studio.runs.live.live_run import LiveRun
from studio.runs.new_run import prepare_run
from studio.runs.problem_source import ProblemSource
from studio.runs.run_footage import footage_of
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

QUICK = {"particles": 40, "layers": 3, "start_repeats": 1}


class HandClock:
    """Seconds that pass when somebody sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def live_request(name: str = "live", **wanted: object) -> dict[str, Any]:
    """A quick live run of the toy session."""
    changes = {**QUICK, **wanted.pop("knobs", {})}  # pyright: ignore[reportGeneralTypeIssues]
    return dict(name=name, seed=7, start_pose=true_poses()[0], live=True, knobs=changes, **wanted)


def live_run(session: Session, name: str = "live", **wanted: object) -> StoredRun:
    """The same, on disk."""
    return prepare_run(session, **live_request(name, **wanted))


@dataclass
class Drive:
    """Tracks live, each frame's search taking so many seconds."""

    run: LiveRun
    problems: LiveProblems
    source: ReplayClock
    clock: HandClock

    def frame(self, seconds: float) -> int:
        """Track the newest frame, waiting for it; -1 where none will come, and the run is over."""
        after = self.run.next_frame - 1
        while not self.source.over(after):
            arrival = self.source.newest(after)
            if arrival is None:
                self.source.wait(after)
                continue
            self.run.take(self.problems.ready(arrival, self.run.latest_settings()[1]))
            self.clock.sleep(seconds)
            while self.run.next_frame == arrival.frame:
                self.run.step_layer()
            return arrival.frame
        self.run.end()
        return -1

    def to_end(self, seconds: float) -> None:
        """Track until no frame will come."""
        while not self.run.finished and self.frame(seconds) >= 0:
            pass


@contextmanager
def driving(session: Session, stored: StoredRun) -> Iterator[Drive]:
    """A live run, opened, its clock begun."""
    clock, record = HandClock(), stored.record
    problems = ProblemSource(session, stored.body(), stored.cameras(), footage=footage_of(session, stored))
    live = LiveProblems(problems, clock)
    run = LiveRun(stored, live, clock=clock)
    source = ReplayClock(record.fps, record.last, 1, clock=clock, sleep=clock.sleep)
    source.begin(run.next_frame)
    try:
        yield Drive(run, live, source, clock)
    finally:
        run.close()
        problems.close()
