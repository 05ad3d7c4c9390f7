"""The person in front of the cameras: by height, and fitted to the footage in the background (`subject` events)."""

import asyncio
from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import Query, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.job_routes import add_job_routes
from studio.app.server.picture_routes import Height
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Answer, Number, Numbers
from studio.app.server.session_routes import OpenSession
from studio.body.model import BodyModel
from studio.body.subject import SHORTEST_MM, TALLEST_MM, Subject
from studio.body.upright import LimbDrawing, limb_drawings
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError, NotFoundError
from studio.foundations.progress import unheard
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.operations.person import fit_subject
from studio.operations.person import subject as write_subject
from studio.results.overlay_pictures import compose_view, forget_composers
from studio.runs.drawing.overlay_drawing import encode_jpeg
from studio.runs.setup.subject_choice import body_of_choice, keep_fitted
from studio.runs.setup.subject_fitting import FittedSubject
from studio.sessions.provenance import origin_of
from studio.sessions.session import SUBJECT_NAME, Session

router = Router(prefix="/api", tags=["subject"])


class SubjectAnswer(Answer):
    """A session's person. dimensions: mm (ratios without unit), by the body's own names. source: of proportions.
    saved: whether the session has a subject at all; fitted: whether it was fitted to the footage.
    """

    body: str
    height_mm: Number
    dimensions: dict[str, float]
    notes: list[str]
    source: str
    limbs: list[Annotated[LimbDrawing, Shown]]
    saved: bool = False
    fitted: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class FitSoFar:
    """What a fit under way has: poses (F, D) of a body in F frames."""

    body: BodyModel
    frames: tuple[int, ...]
    poses: Array


class SizeLine(Answer):
    """A group of dimensions, mm. deviation: one standard deviation of `after`."""

    name: str
    kind: Literal["length", "radius"]
    before: Number
    after: Number
    deviation: Number


class FitSubjectState(NumberedJob):
    """How a fit stands. frames: those with a pose so far, which have pictures; looks: rises whenever these are other
    ones. overlap: f_s of each frame's silhouettes.
    limbs: of the body that was found. file: what it was kept as, "" where it is not.
    """

    body: str = ""
    frames: list[int] = Field(default_factory=list[int])
    looks: int = 0
    poses_from: str = ""
    sizes: list[SizeLine] = Field(default_factory=list[SizeLine])
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
) -> SubjectAnswer:
    """The session's person: every dimension of the body as a run would have it, and its limbs as it stands upright;
    with a height or body as a preview, nothing is written.
    """
    known = session.subject()
    if height_mm is None and not body:
        tree, notes = session.body_with_notes()
    else:
        known = Subject(body=body or session.manifest.body, height_mm=height_mm)
        tree, notes = body_of_choice(session, known)
    return SubjectAnswer(
        body=tree.name,
        height_mm=known.height_mm if known else None,
        dimensions=dict(tree.dimensions),
        notes=list(notes),
        source=tree.definition.source if tree.definition else "",
        limbs=limb_drawings(tree),
        saved=(session.path / SUBJECT_NAME).exists(),
        fitted=origin_of(session, "subject") is not None,
    )


@router.put("/sessions/{session}/subject")
def set_subject(
    session: OpenSession,
    arguments: Annotated[
        Arguments,
        body_of(
            write_subject,
            "SubjectRequest",
            without=("height_mm",),
            height_mm=(
                float | None,
                Field(
                    None,
                    ge=SHORTEST_MM,
                    le=TALLEST_MM,
                    description="Left out: a body alone, in its file's size.",
                ),
            ),
        ),
    ],
    app: App,
) -> SubjectAnswer:
    """Write down a height (and measured lengths); everything else follows by published proportions. A body that is
    named becomes the session's; without a height, as with animals, in its file's size.
    """
    if arguments.more["height_mm"] is None and not (arguments.get("body") or arguments.get("lengths_mm")):
        raise BodyError("Neither a height nor a body is given.", "Give one of them.")
    write_subject(session, **arguments, **arguments.more, progress=unheard)
    app.jobs.forget(SUBJECT, session.name)
    forget_composers()
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
            job.found = FitSoFar(body, frames, poses)
            job.change(
                frames=frames, looks=job.state.looks + 1 if isinstance(job.state, FitSubjectState) else 0
            )

        found = fit_subject(session, **arguments, progress=job.report_or_stop, shown=show)
        forget_composers()
        job.found = found
        file = found.file.name if found.file else ""
        body, limbs = found.body.name, limb_drawings(found.body)
        return SUBJECT.entries(found, body=body, limbs=limbs, file=file)

    return app.jobs.begin(SUBJECT, FitSubjectState(session=session.name), work)


add_job_routes(router, "/subject-fits/{identifier}", SUBJECT)


@router.post("/subject-fits/{identifier}/keep")
def keep_fit(identifier: str, app: App) -> FitSubjectState:
    """Keep what a fit found as the session's subject; the old one stays beside it."""
    found = _found(identifier, app)
    state = app.jobs.state(SUBJECT, identifier)
    place = keep_fitted(app.workspace.session(state.session), found)
    forget_composers()
    state = app.jobs.change(SUBJECT, identifier, file=place.name)
    app.events.session_changed(state.session)
    return state


@router.get("/subject-fits/{identifier}/frames/{frame}/views/{camera}.jpg", response_class=Response)
def fitted_picture(identifier: str, frame: int, camera: str, app: App, height: Height = None) -> Response:
    """The body that was found, or that is so far, over what a camera saw in a frame that was looked at."""
    found = app.jobs.found(SUBJECT, identifier)
    if not isinstance(found, FitSoFar):
        found = _found(identifier, app)
    if frame not in found.frames:
        listed = ", ".join(map(str, found.frames))
        raise NotFoundError(f"Frame {frame} was not looked at in this fit.", f"These were: {listed}.")
    session = app.workspace.session(app.jobs.state(SUBJECT, identifier).session)
    pose = found.poses[found.frames.index(frame)]
    picture = compose_view(
        session, None, frame, camera, ("outline", "mask"), pose, height=height, body=found.body
    )
    return files.picture(encode_jpeg(picture))


def _found(identifier: str, app: AppState) -> FittedSubject:
    """What a fit found. Raises NotFoundError."""
    found = app.jobs.found(SUBJECT, identifier)
    if not isinstance(found, FittedSubject):
        state = app.jobs.state(SUBJECT, identifier).state
        raise NotFoundError(f"This fit found no subject: it is {state}.", "Begin a new one.")
    return found
