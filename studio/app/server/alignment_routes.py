"""Whether the cameras agree on the silhouettes: measured in the background (`alignment` events), turned, and back."""

import asyncio
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, AppState, release
from studio.app.server.requests import Arguments, body_of
from studio.app.server.session_routes import OpenSession
from studio.foundations.errors import NotFoundError, RunError
from studio.foundations.records import extended
from studio.operations.cameras import (
    AlignmentLine,
    CamerasInUse,
    align,
    cameras_in_use,
    use_turned,
    use_unturned,
)
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.runs.setup.aligning import SessionAlignment
from studio.sessions.calibration_changes import CalibrationChange
from studio.sessions.session import Session

router = Router(prefix="/api/sessions/{session}/alignment", tags=["calibration"])


class AlignmentJob(SessionJob):
    """How comparing the cameras stands, and what came of it. needed: the misses matter; better: turning the cameras
    explains them; words: a sentence; kept: the session uses the turned cameras.
    """

    cameras: Annotated[tuple[AlignmentLine, ...], Shown] = ()
    frames: list[int] = Field(default_factory=list[int])
    needed: bool = False
    better: bool = False
    words: str = ""
    kept: bool = False


ALIGNMENT = JobKind(
    "alignment", "comparison of the cameras", AlignmentJob, page="/way?session={session}&step=background"
)


@dataclass(frozen=True, slots=True)
class AlignmentAnswer(CamerasInUse):
    """Whether the cameras can be compared, and whether they were turned. job : under way, or the last one with the
    calibration in use. notes : what a change just made means for what is there.
    """

    job: AlignmentJob | None
    notes: tuple[str, ...]


@router.get("")
def alignment(session: OpenSession, app: App) -> AlignmentAnswer:
    """How far the silhouettes miss, as it was measured last, and whether the cameras in use were turned."""
    return _answer(session, app)


@router.post("", status_code=202)
async def begin(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(align, "AlignmentRequest", without=("keep",))],
    app: App,
) -> AlignmentJob:
    """Begin to measure; nothing is changed. Ask `GET …/alignment` how it stands, or wait for `alignment` events."""
    if app.jobs.going(ALIGNMENT, session.name):
        raise RunError(
            f"The cameras of '{session.name}' are being compared.", "Wait until it is done, or cancel it."
        )
    session.cameras()

    def work(job: Job) -> dict[str, object]:
        aligned = align(session, **arguments, keep=False, progress=job.report_or_stop)
        job.result = aligned.alignment
        return ALIGNMENT.entries(aligned)

    return app.jobs.begin(ALIGNMENT, AlignmentJob(session=session.name), work)


@router.delete("", status_code=202)
def cancel(session: OpenSession, app: App) -> AlignmentAnswer:
    """Stop measuring."""
    app.jobs.cancel(ALIGNMENT, session.name)
    return _answer(session, app)


@router.post("/keep")
async def keep(session: OpenSession, app: App) -> AlignmentAnswer:
    """Use the turned cameras from now on; the earlier calibration is kept, stale runs are named. Refused while a
    run of the session is being tracked, or where the calibration is another one than that which was measured.
    """
    aligned = _aligned(session, app)
    if aligned is None:
        raise NotFoundError(f"The cameras of '{session.name}' were not compared.", "Measure first.")
    release(app, session.name)
    change = await asyncio.to_thread(use_turned, session, aligned)
    app.jobs.change(ALIGNMENT, session.name, kept=True)
    return _changed_answer(change, app)


@router.post("/undo")
async def undo(session: OpenSession, app: App) -> AlignmentAnswer:
    """Use the calibration again that the cameras in use were turned from."""
    release(app, session.name)
    change = await asyncio.to_thread(use_unturned, session)
    if app.jobs.known(ALIGNMENT, session.name) is not None:
        app.jobs.change(ALIGNMENT, session.name, kept=False)
    return _changed_answer(change, app)


def _changed_answer(change: CalibrationChange, app: AppState) -> AlignmentAnswer:
    app.events.session_changed(change.session.name)
    return _answer(change.session, app, change.notes)


def _answer(session: Session, app: AppState, notes: tuple[str, ...] = ()) -> AlignmentAnswer:
    cameras, job = cameras_in_use(session), app.jobs.known(ALIGNMENT, session.name)
    if job is not None and job.state == "done" and not (job.kept and cameras.turned):
        aligned = _aligned(session, app)
        job = job if aligned is not None and aligned.is_of(session) else None
    return extended(AlignmentAnswer, cameras, job=job, notes=notes)


def _aligned(session: Session, app: AppState) -> SessionAlignment | None:
    if app.jobs.known(ALIGNMENT, session.name) is None:
        return None
    aligned = app.jobs.result(ALIGNMENT, session.name)
    return aligned if isinstance(aligned, SessionAlignment) else None
