"""The person in front of the cameras: by height, and fitted to the footage in the background (`subject` events)."""

import asyncio
from typing import Annotated

from fastapi import Query, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.job_routes import add_job_routes
from studio.app.server.picture_routes import Height
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Numbers
from studio.app.server.session_routes import OpenSession
from studio.body.model import BodyModel
from studio.body.upright import LimbDrawing, limb_drawings
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError, NotFoundError
from studio.foundations.progress import no_progress
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.operations.person import FitSoFar, SubjectInUse, fit_subject, subject_in_use
from studio.operations.person import keep_fit as keep_fitted
from studio.operations.person import subject as write_subject
from studio.operations.pictures import View, fit_picture
from studio.runs.setup.subject_fitting import FittedSize, FittedSubject
from studio.sessions.session import Session

router = Router(prefix="/api", tags=["subject"])


class FitSubjectState(NumberedJob):
    """How a fit stands. frames: those with a pose so far, which have pictures; looks: rises whenever these are other
    ones. overlap: f_s of each frame's silhouettes.
    limbs: of the fitted body. file: what it was kept as, "" where it is not.
    """

    body: str = ""
    frames: list[int] = Field(default_factory=list[int])
    looks: int = 0
    poses_from: str = ""
    sizes: Annotated[tuple[FittedSize, ...], Shown] = ()
    overlap_before: Numbers | None = None
    overlap: Numbers | None = None
    limbs: list[Annotated[LimbDrawing, Shown]] = Field(default_factory=list[LimbDrawing])
    file: str = ""


SUBJECT = JobKind(
    "subject",
    "fit of the subject",
    FitSubjectState,
    changes_session=True,
    at="/api/subject-fits/{identifier}",
    page="/way?session={session}&step=subject",
)


@router.get("/sessions/{session}/subject")
def subject(
    session: OpenSession,
    height_mm: Annotated[float | None, Query(description="As if the person were so tall.")] = None,
    body: Annotated[str, Query(max_length=64, description="As if it were this kinematic tree.")] = "",
) -> SubjectInUse:
    """The session's person: every dimension of the body as a run would have it, and its limbs as it stands upright;
    with a height or body as a preview, nothing is written.
    """
    return subject_in_use(session, height_mm, body)


@router.put("/sessions/{session}/subject")
def set_subject(
    session: OpenSession,
    arguments: Annotated[
        Arguments,
        body_of(write_subject, "SubjectRequest"),
    ],
    app: App,
) -> SubjectInUse:
    """Write down a height (and measured lengths); everything else follows by published proportions. A body that is
    named becomes the session's; without a height, as with animals, in its file's size.
    """
    if not any(arguments.get(name) for name in ("height_mm", "body", "lengths_mm")):
        raise BodyError("Neither a height nor a body is given.", "Give one of them.")
    write_subject(session, **arguments, progress=no_progress)
    app.jobs.forget(SUBJECT, session.name)
    app.events.session_changed(session.name)
    return subject(Session(session.path))


@router.post("/sessions/{session}/fit-subject", status_code=202)
async def begin_fit(
    session: OpenSession, arguments: Annotated[Arguments, body_of(fit_subject, "FitSubjectRequest")], app: App
) -> FitSubjectState:
    """Begin to fit lengths and radii. Ask for its state, or wait for `subject` events."""
    await asyncio.to_thread(session.body, arguments.get("body"))

    def work(job: Job) -> dict[str, object]:
        def show(body: BodyModel, frames: tuple[int, ...], poses: Array) -> None:
            job.result = FitSoFar(body, frames, poses)
            job.change(
                frames=frames, looks=job.state.looks + 1 if isinstance(job.state, FitSubjectState) else 0
            )

        fitted = fit_subject(session, **arguments, progress=job.report_or_stop, shown=show)
        job.result = fitted
        file = fitted.file.name if fitted.file else ""
        return SUBJECT.entries(fitted, body=fitted.body.name, limbs=limb_drawings(fitted.body), file=file)

    return app.jobs.begin(SUBJECT, FitSubjectState(session=session.name), work)


add_job_routes(router, "/subject-fits/{identifier}", SUBJECT)


@router.post("/subject-fits/{identifier}/keep")
def keep_fit(identifier: str, app: App) -> FitSubjectState:
    """Keep what a fit found as the session's subject; the old one stays beside it."""
    fitted = _fit_of(identifier, app)
    state = app.jobs.state(SUBJECT, identifier)
    kept = keep_fitted(app.workspace.session(state.session), fitted)
    state = app.jobs.change(SUBJECT, identifier, file=kept.file.name if kept.file else "")
    app.events.session_changed(state.session)
    return state


@router.get("/subject-fits/{identifier}/frames/{frame}/views/{camera}.jpg", response_class=Response)
def fitted_picture(identifier: str, frame: int, camera: str, app: App, height: Height = None) -> Response:
    """The fitted body, or the one that is so far, over what a camera saw in a frame that was looked at."""
    known = app.jobs.result(SUBJECT, identifier)
    fit = known if isinstance(known, FitSoFar) else _fit_of(identifier, app)
    session = app.workspace.session(app.jobs.state(SUBJECT, identifier).session)
    return files.picture(fit_picture(session, fit, View(frame, camera, height=height)))


def _fit_of(identifier: str, app: AppState) -> FittedSubject:
    """What a fit gave. Raises NotFoundError."""
    fitted = app.jobs.result(SUBJECT, identifier)
    if not isinstance(fitted, FittedSubject):
        state = app.jobs.state(SUBJECT, identifier).state
        raise NotFoundError(f"This fit found no subject: it is {state}.", "Begin a new one.")
    return fitted
