"""A prepared run tracked in the test's own process, without a tracking process around it."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from studio.runs.problem_source import ProblemSource
from studio.runs.tracking_run import TrackingRun
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@contextmanager
def opened(session: Session, run: StoredRun, storing: Executor | None = None) -> Iterator[TrackingRun]:
    """The run, opened for tracking on its session's footage."""
    problems = ProblemSource(session, run.body(), run.cameras())
    tracking = TrackingRun(run, problems, storing)
    try:
        yield tracking
    finally:
        tracking.close()
        problems.close()


def abandon(tracking: TrackingRun) -> None:
    """Leave it as a killed process does: nothing of the frame at hand is saved."""
    tracking._writer.close()
    tracking._reader.close()
    tracking.close = lambda: None


def poses_of(run: StoredRun) -> NDArray[np.float64]:
    """(K, D) what it found so far."""
    with run.results() as results:
        return results.poses()[1]


def finish(session: Session, run: StoredRun, layers: int | None = None) -> NDArray[np.float64]:
    """Track so many layers, or all that are left, and close it; what it found so far."""
    with opened(session, run) as tracking:
        while not tracking.finished and layers != 0:
            tracking.step_layer()
            layers = None if layers is None else layers - 1
    return poses_of(run)
