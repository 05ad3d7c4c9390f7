"""What the process says of its work: states, settings in use, log lines, each with the names of session and
run."""

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from studio.foundations.knobs import Value
from studio.operations.jobs.events import (
    Event,
    FrameFinished,
    LayerFinished,
    LogLine,
    RunState,
    SettingsApplied,
    StateChanged,
    nothing_open,
)
from studio.operations.jobs.open_run import OpenRun
from studio.operations.jobs.search_pace import SearchPace
from studio.runs.live.live_run import LiveRun, without_particles
from studio.runs.tracking_run import Stepped
from studio.search.settings import RunSettings, values

Place = tuple[str, str]
"""Folders of a session and of one of its runs, as text."""


class Reporter:
    """Makes events of what happened and posts them; `post` never waits.

    pace : how slowly the search goes. waiting : the runs to come.
    """

    def __init__(self, post: Callable[[Event], None], pace: SearchPace, waiting: Sequence[Place]) -> None:
        self.post = post
        self.state_name = RunState.IDLE
        self._pace, self._waiting = pace, waiting
        self._words = ("", "")
        self._values: dict[str, Value] = {}

    def state(self, run: OpenRun | None, name: RunState, message: str = "", hint: str = "") -> None:
        """Say where the search stands."""
        self.state_name, self._words = name, (message, hint)
        pace = self._pace.seconds_a_layer
        waiting = tuple((Path(session).name, Path(run).name) for session, run in self._waiting)
        if run is None:
            nothing = nothing_open(pace)
            self.post(replace(nothing, state=name, message=message, hint=hint, waiting=waiting))
            return
        tracking, record = run.tracking, run.stored.record
        progress = tracking.progress(pace)
        reannealing = run.reannealing
        self.post(
            StateChanged(
                *names_of(run),
                state=name,
                frame=reannealing.frame if reannealing else tracking.next_frame,
                layer=len(reannealing.layers) if reannealing else tracking.layers_done,
                first=record.first,
                last=record.last,
                done=tracking.done,
                frames_per_second=progress.frames_per_second,
                seconds_left=progress.seconds_left,
                message=message,
                hint=hint,
                waiting=waiting,
                selected=run.selected,
                seconds_a_layer=pace,
                live=tracking.standing if isinstance(tracking, LiveRun) else None,
            )
        )

    def state_again(self, run: OpenRun | None) -> None:
        """Say the same state with what is new beside it; the reason why a run failed stays."""
        self.state(run, self.state_name, *self._words)

    def settings(self, run: OpenRun, version: int, settings: RunSettings, frame: int, layer: int) -> None:
        """Say which settings are in use since (frame, layer), and which of them differ from those said before."""
        now = dict(values(settings))
        changed = tuple(name for name, value in now.items() if self._values.get(name, value) != value)
        self._values = now
        self.post(SettingsApplied(*names_of(run), version, frame, layer, now, changed))

    def stepped(self, run: OpenRun, stepped: Stepped, requested_at: float) -> None:
        """Say what a layer brought; of a frame once it is stored. requested_at : see `LayerFinished`."""
        record, result, tracking = stepped.record, stepped.result, run.tracking
        if stepped.applied is not None:
            self.settings(run, record.settings_version, stepped.applied, record.frame, record.layer)
        self.post(
            LayerFinished(
                *names_of(run),
                record,
                requested_at=requested_at,
                search_layers=stepped.search_layers,
                searches=stepped.searches,
            )
        )
        if result is None:
            return
        event = FrameFinished(*names_of(run), result)
        if isinstance(tracking, LiveRun):
            light = without_particles(result)
            event = FrameFinished(*names_of(run), light, latency_ms=tracking.latency_ms)
        run.when_stored(lambda: self.post(event))

    def log(self, run: OpenRun | None, level: str, text: str) -> None:
        """Write a line into the run's log and say it; a disk that refuses the line is no reason to stop."""
        stamp = time.time()
        if run is not None:
            with contextlib.suppress(OSError):
                stamp = run.log(level, text)
        self.post(LogLine(*names_of(run), level, stamp, text))


def names_of(run: OpenRun | None) -> tuple[str, str]:
    """Names of session and run, empty where none is open."""
    return (run.session_name, run.run_name) if run is not None else ("", "")


def unforeseen(error: Exception) -> str:
    """A fault of the program in one sentence."""
    return f"The tracking process met a fault it does not know: {type(error).__name__}: {error}."
