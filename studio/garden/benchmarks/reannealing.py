"""Latency of a moved slider: from the change to the arrival of the last new layer at the server."""

import statistics
import time
from dataclasses import dataclass

from studio.foundations.errors import RunError
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import Event, FrameFinished, StateChanged
from studio.operations.jobs.watchers import Subscription
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

PATIENCE_SECONDS = 120.0
SURVIVALS = (0.4, 0.5)


@dataclass(frozen=True, slots=True)
class Latency:
    """Milliseconds from the change of a setting to the arrival of a re-annealed frame's last layer.

    layers, particles : of the frame.
    """

    median_ms: float
    worst_ms: float
    repeats: int
    layers: int
    particles: int


def measure_reannealing(
    control: StudioControl, session: Session, run: StoredRun, repeats: int = 12
) -> Latency:
    """Track the run's frames, then move the survival rate `repeats` times and wait for each answer.

    The first answer, which may still compile, is not counted. Raises RunError without an answer.
    """
    watcher = control.subscribe()
    try:
        control.track(session.name, run.name)
        while True:
            event = watcher.get(timeout=PATIENCE_SECONDS)
            if isinstance(event, StateChanged) and event.state == "finished":
                break
            if isinstance(event, StateChanged) and event.state in ("failed", "lost"):
                raise RunError(event.message, event.hint)
        waits = [_answered(control, watcher, SURVIVALS[at % 2]) for at in range(repeats + 1)][1:]
    finally:
        watcher.close()
    settings = run.record.settings
    return Latency(
        round(statistics.median(waits), 1),
        round(max(waits), 1),
        repeats,
        int(settings["layers"]),
        int(settings["particles"]),
    )


def _answered(control: StudioControl, watcher: Subscription[Event], survival: float) -> float:
    """Milliseconds until a re-annealed frame has arrived, after all its layers."""
    began = time.perf_counter()
    control.change_settings(survival=survival)
    while True:
        event = watcher.get(timeout=PATIENCE_SECONDS)
        if isinstance(event, FrameFinished) and event.reannealed:
            return 1000.0 * (time.perf_counter() - began)
