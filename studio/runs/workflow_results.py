"""The steps of the guided set-up from tracking on: track, check, export."""

from collections.abc import Sequence
from dataclasses import dataclass

from studio.runs.checking import kept_check
from studio.runs.tracks import best_track
from studio.runs.workflow_step import StepStatus, counted, enumerated
from studio.sessions.footage_changes import stale_runs
from studio.sessions.run_record import CAMERAS_NAME
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.stored_run import StoredRun, damage_in_words


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """A file exported from the newest run. stale : why it is out of date, a clause; "" if it is not."""

    name: str
    stale: str = ""


NOT_EVERYWHERE = "It does not fit everywhere: check the marked frames."


def newest_run(session: Session) -> StoredRun | None:
    """The run of the guided set-up: the newest one that plays its footage once; None without one."""
    runs = [run for run in session.runs() if not run.record.ping_pong]
    return runs[-1] if runs else None


def run_changes(session: Session, run: StoredRun) -> list[str]:
    """The inputs of a run that have changed since, in words."""
    changed: list[str] = []
    if run.name in stale_runs(session):
        changed.append("the footage's offsets or turns")
    calibration = session.path / CAMERAS_PATH
    if calibration.is_file() and calibration.read_bytes() != (run.folder / CAMERAS_NAME).read_bytes():
        changed.append("the calibration")
    measured = run.record.subject_dimensions or run.record.dimensions
    if session.body(run.record.body).dimensions != measured:
        changed.append("the subject's measures")
    return changed


def track_step(session: Session) -> StepStatus:
    """The newest run, and whether its inputs are unchanged."""
    run = newest_run(session)
    if run is None:
        return StepStatus("track", "ready", "nothing tracked yet")
    summary = run.summary()
    words = f"{run.name}: {summary.done} of {counted(run.record.frame_count, 'frame')}"
    if summary.status == "tracking":
        return StepStatus("track", "running", words)
    if not summary.done:
        return StepStatus("track", "ready", f"{run.name} has not begun")
    if summary.damaged:
        return StepStatus("track", "stale", words, damage_in_words(summary.damaged))
    changed = run_changes(session, run)
    if changed:
        why = f"{run.name} was tracked before {enumerated(changed)} changed: track again."
        return StepStatus("track", "stale", words, why)
    missing = run.record.frame_count - summary.done
    why = (
        f"{counted(missing, 'frame')} of it {'is' if missing == 1 else 'are'} not tracked." if missing else ""
    )
    return StepStatus("track", "done", words, why)


def check_step(session: Session) -> StepStatus:
    """The check of the newest run."""
    run = newest_run(session)
    if run is None:
        return StepStatus("check", "blocked", "", "It needs a run.")
    name = best_track(run).name
    check = kept_check(run, name)
    if check is None:
        return StepStatus("check", "ready", f"{run.name}, track {name}: not checked yet")
    words = f"{name}: {check.in_words()}"
    changed = run_changes(session, run)
    if changed:
        return StepStatus("check", "stale", words, f"Measured before {enumerated(changed)} changed.")
    return StepStatus("check", "done", words, "" if check.good else NOT_EVERYWHERE)


def export_step(session: Session, exports: Sequence[ExportedFile]) -> StepStatus:
    """The files exported from the newest run, and whether they are up to date."""
    run = newest_run(session)
    if run is None or not exports:
        return StepStatus("export", "ready", "no file yet")
    words = f"{counted(len(exports), 'file')} of {run.name}"
    old = [file for file in exports if file.stale]
    if old:
        why = f"{'; '.join(f'{file.name}: {file.stale}' for file in old[:3])}{' …' if len(old) > 3 else ''}."
        return StepStatus("export", "stale", words, f"{why} Export again, or delete what is old.")
    return StepStatus("export", "done", words)
