"""Whether the cameras agree on the silhouettes: measured in the background (`alignment` events), turned, and back."""

import asyncio
from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from studio.app.server.app_state import App, AppState, release
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Answer, Number
from studio.app.server.session_routes import OpenSession
from studio.foundations.errors import NotFoundError, RunError
from studio.operations.cameras import Alignment, align
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.results.overlay_pictures import forget_composers
from studio.runs.setup.aligning import SessionAlignment
from studio.runs.setup.turned_cameras import is_of, turn_back, turn_cameras, turned_from
from studio.sessions.calibration_changes import CalibrationChange
from studio.sessions.session import Session

router = APIRouter(prefix="/api/sessions/{session}/alignment", tags=["calibration"])


class AlignmentLine(Answer):
    """One camera. before_px, after_px: by which the silhouettes miss, as it stands and turned (median, null where
    nothing shows); turn_degrees: by which it would be turned.
    """

    camera: str
    before_px: Number
    after_px: Number
    turn_degrees: Number


class AlignmentJob(SessionJob):
    """How comparing the cameras stands, and what came of it. needed: the misses matter; better: turning the cameras
    explains them; words: a sentence; kept: the session uses the turned cameras.
    """

    cameras: list[AlignmentLine] = Field(default_factory=list[AlignmentLine])
    frames: list[int] = Field(default_factory=list[int])
    needed: bool = False
    better: bool = False
    words: str = ""
    kept: bool = False


ALIGNMENT = JobKind(
    "alignment",
    "comparison of the cameras",
    AlignmentJob,
    page="/way?session={session}&step=background",
)


class AlignmentAnswer(Answer):
    """possible: there are several calibrated cameras. job: under way, or the last one with the calibration in use.
    turned: the cameras in use were turned from an earlier calibration, which can be had back. notes: what a change just
    made means for what is there.
    """

    session: str
    possible: bool
    job: AlignmentJob | None
    turned: bool
    notes: list[str] = Field(default_factory=list)


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
        job.found = aligned.found
        return _result(aligned)

    return app.jobs.begin(ALIGNMENT, AlignmentJob(session=session.name), work)


@router.delete("", status_code=202)
def cancel(session: OpenSession, app: App) -> AlignmentAnswer:
    """Stop measuring."""
    app.jobs.cancel(ALIGNMENT, session.name)
    return _answer(session, app)


@router.post("/keep")
async def keep(session: OpenSession, app: App) -> AlignmentAnswer:
    """Use the turned cameras from now on; the calibration before is kept, what becomes stale is said. Refused while a
    run of the session is being tracked, or where the calibration is another one than that which was measured.
    """
    found = _found(session, app)
    if found is None:
        raise NotFoundError(f"The cameras of '{session.name}' were not compared.", "Measure first.")
    release(app, session.name)
    change = await asyncio.to_thread(turn_cameras, session, found)
    app.jobs.change(ALIGNMENT, session.name, kept=True)
    return _changed(change, app)


@router.post("/undo")
async def undo(session: OpenSession, app: App) -> AlignmentAnswer:
    """Use the calibration again that the cameras in use were turned from."""
    release(app, session.name)
    change = await asyncio.to_thread(turn_back, session)
    if app.jobs.known(ALIGNMENT, session.name) is not None:
        app.jobs.change(ALIGNMENT, session.name, kept=False)
    return _changed(change, app)


def _changed(change: CalibrationChange, app: AppState) -> AlignmentAnswer:
    forget_composers()
    app.events.session_changed(change.session.name)
    return _answer(change.session, app, change.notes)


def _answer(session: Session, app: AppState, notes: Sequence[str] = ()) -> AlignmentAnswer:
    turned = bool(turned_from(session))
    job = app.jobs.known(ALIGNMENT, session.name)
    if job is not None and job.state == "done" and not (job.kept and turned):
        found = _found(session, app)
        job = job if found is not None and is_of(session, found) else None
    possible = session.is_calibrated and len(session.manifest.footage.cameras) > 1
    return AlignmentAnswer(session=session.name, possible=possible, job=job, turned=turned, notes=list(notes))


def _found(session: Session, app: AppState) -> SessionAlignment | None:
    if app.jobs.known(ALIGNMENT, session.name) is None:
        return None
    found = app.jobs.found(ALIGNMENT, session.name)
    return found if isinstance(found, SessionAlignment) else None


def _result(aligned: Alignment) -> dict[str, object]:
    return {
        "cameras": [
            AlignmentLine(
                camera=name, before_px=before, after_px=aligned.after[name], turn_degrees=aligned.turns[name]
            )
            for name, before in aligned.before.items()
        ],
        "frames": list(aligned.found.found.frames),
        "needed": aligned.needed,
        "better": aligned.better,
        "words": aligned.words,
    }
