"""The guided set-up: the status of each step of a session, computed from its files.

A step is "done", "ready" to be done, "blocked" by an earlier one, "stale" if its inputs have changed since, or
"running". The status is not stored; `sessions.made_from` and the snapshots in the runs' folders have the inputs of a
result.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from studio.errors import StudioError
from studio.runs.workflow_results import ExportedFile, check_step, export_step, track_step
from studio.runs.workflow_setup import (
    background_step,
    calibration_step,
    footage_step,
    start_pose_step,
    subject_step,
)
from studio.runs.workflow_step import STEPS, StepName, StepStatus
from studio.sessions.session import Session

NEEDS: Mapping[str, tuple[str, ...]] = {
    "footage": (),
    "calibration": ("footage",),
    "background": ("footage",),
    "subject": ("footage", "calibration"),
    "start-pose": ("footage", "calibration"),
    "track": ("footage", "calibration"),
    "check": ("track",),
    "export": ("track",),
}
"""Steps that have to be done (stale counts) before a step."""


@dataclass(frozen=True, slots=True)
class Workflow:
    """All steps in order. next : the first that needs work, "" if none does."""

    steps: tuple[StepStatus, ...]
    next: str


def workflow_of(
    session: Session, running: Mapping[str, str] | None = None, exports: Sequence[ExportedFile] | None = None
) -> Workflow:
    """The status of a session. running : step to the progress of its job. exports : files exported from the newest run,
    None if unknown.

    Never raises for a part that cannot be read: its step reports it.
    """
    makers: dict[StepName, Callable[[], StepStatus]] = {
        "footage": lambda: footage_step(session),
        "calibration": lambda: calibration_step(session),
        "background": lambda: background_step(session),
        "subject": lambda: subject_step(session),
        "start-pose": lambda: start_pose_step(session),
        "track": lambda: track_step(session),
        "check": lambda: check_step(session),
        "export": lambda: export_step(session, exports or ()),
    }
    steps: dict[str, StepStatus] = {}
    for step in STEPS:
        steps[step] = _status(step, makers[step], steps, running or {})
    return Workflow(tuple(steps.values()), _next(tuple(steps.values())))


def _status(
    step: StepName,
    make: Callable[[], StepStatus],
    before: Mapping[str, StepStatus],
    running: Mapping[str, str],
) -> StepStatus:
    lacking = next((need for need in NEEDS[step] if before[need].state not in ("done", "stale")), None)
    if lacking is not None:
        return StepStatus(step, "blocked", "", f"It needs {LACKING[lacking]}.")
    try:
        status = make()
    except StudioError as error:
        status = StepStatus(step, "ready", "", str(error))
    return replace(status, state="running", words=running[step]) if step in running else status


LACKING = {"footage": "footage", "calibration": "a calibration", "track": "a run that has frames"}


def _next(steps: Sequence[StepStatus]) -> str:
    """The first step to do or redo; else the first optional one that is ready."""
    pressing = [
        step.step for step in steps if not step.optional and step.state in ("stale", "ready", "running")
    ]
    return pressing[0] if pressing else next((step.step for step in steps if step.state == "stale"), "")
