"""What the process says of its work: states, settings in use, log lines, each with the names of session and
run."""

import math
import time
from collections.abc import Callable

from studio.knobs import Value
from studio.settings import RunSettings, values
from studio.worker.events import Event, LogLine, SettingsApplied, StateChanged
from studio.worker.open_run import OpenRun

IDLE = "idle"


class Reporter:
    """Makes events of what happened and posts them; `post` never waits."""

    def __init__(self, post: Callable[[Event], None]) -> None:
        self.post = post
        self.state_name = IDLE
        self._values: dict[str, Value] = {}

    def state(
        self,
        run: OpenRun | None,
        name: str,
        waiting: tuple[tuple[str, str], ...] = (),
        message: str = "",
        hint: str = "",
    ) -> None:
        """Say where the search stands. waiting : names of the sessions and runs to come."""
        self.state_name = name
        if run is None:
            self.post(StateChanged("", "", name, 0, 0, 0, 0, 0, math.nan, math.nan, message, hint, waiting))
            return
        tracking, record = run.tracking, run.stored.record
        progress = tracking.progress()
        question = run.question
        self.post(
            StateChanged(
                *names_of(run),
                state=name,
                frame=question.frame if question else tracking.next_frame,
                layer=len(question.layers) if question else tracking.layers_done,
                first=record.first,
                last=record.last,
                done=tracking.done,
                frames_per_second=progress.frames_per_second,
                seconds_left=progress.seconds_left,
                message=message,
                hint=hint,
                waiting=waiting,
                selected=run.selected,
            )
        )

    def settings(self, run: OpenRun, version: int, settings: RunSettings, frame: int, layer: int) -> None:
        """Say which settings are in use since (frame, layer), and which of them differ from those said
        before."""
        now = dict(values(settings))
        changed = tuple(name for name, value in now.items() if self._values.get(name, value) != value)
        self._values = now
        self.post(SettingsApplied(*names_of(run), version, frame, layer, now, changed))

    def log(self, run: OpenRun | None, level: str, text: str) -> None:
        """Write a line into the run's log and say it."""
        stamp = run.log(level, text) if run is not None else time.time()
        self.post(LogLine(*names_of(run), level, stamp, text))


def names_of(run: OpenRun | None) -> tuple[str, str]:
    """Names of session and run, empty where none is open."""
    return (run.session_name, run.run_name) if run is not None else ("", "")
