"""Poses set by hand: start poses, dragging, mirroring, the search around a pose, and the editor in the scene."""

import asyncio
from contextlib import suppress
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter
from pydantic import Field

from studio.app.server.answers import Shown
from studio.app.server.app_state import App, Scene
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Answer, Number, Numbers, Request, RunName
from studio.app.server.session_routes import OpenSession
from studio.app.server.track_routes import TRACK, TrackJobState, begin_job
from studio.app.server.windows import Window
from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror, has_sides
from studio.body.model import BodyModel, checked_pose
from studio.foundations.arrays import Array
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import SettingsError, StudioError
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.operations.overview import ParameterView, parameter_views
from studio.operations.person import initialise
from studio.runs.new_run import checked_frames
from studio.runs.setup.pose_search import better_pose
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = APIRouter(prefix="/api", tags=["poses"])


class GripView(Answer):
    """A limb's end that can be dragged. place: where it is in the pose, mm."""

    name: str
    side: str
    place: list[float]


class PoseView(Answer):
    """A pose of the session's body: radians and mm in the order of `parameters`.

    stored: whether it is the session's start pose (else the rest pose); frame: that it is of. left_mm: after a drag,
    how far the limb's end still is from where it was dragged.
    """

    body: str
    parameters: tuple[Annotated[ParameterView, Shown], ...]
    pose: list[float]
    grips: list[GripView]
    stored: bool = False
    frame: int = 0
    left_mm: Number = None
    has_sides: bool = Field(False, description="Whether it can be mirrored.")


class StartPoseRequest(Request):
    """The session's start pose from now on; the one it had stays beside it. frame: that it is of, in which tracking
    begins; null: as before.
    """

    pose: list[float]
    frame: int | None = Field(None, ge=0, le=LARGEST)


class PoseRequest(Request):
    """A pose, of the session's body or of a run's (which then also says with what weighting it is judged)."""

    pose: list[float]
    run: RunName | None = None


class DragRequest(PoseRequest):
    """A limb's end that is dragged to a place (x, y, z, mm); the body follows, its limits kept."""

    limb: str = Field(max_length=64)
    target: tuple[float, float, float]


class MirrorRequest(PoseRequest):
    """How it is mirrored: `in place`, facing where it faces, or `turned round`, facing the other way as well."""

    how: Literal["in place", "turned round"] = "in place"


class BetterPoseRequest(PoseRequest):
    """A short search around the pose in a frame, then local refinement. keep: what is better becomes the session's
    start pose, whoever still waits for it.
    """

    frame: int = Field(0, ge=0, le=LARGEST)
    seed: int = Field(0, ge=0, le=LARGEST)
    keep: bool = False


class EditRequest(Request):
    """What the scene lets a person edit. run: null for the session's start pose, else `frame` of it is corrected. pose:
    to begin with, or to go on to; null: the one that is shown there.
    """

    session: RunName
    run: RunName | None = None
    frame: int | None = Field(None, ge=0, le=LARGEST)
    pose: list[float] | None = None


class EditState(Answer):
    """What is being edited in the scene; all null while nothing is. moved: whether it is another pose than it was.
    steps: changes that can be undone.
    """

    editing: bool = False
    session: str | None = None
    run: str | None = None
    frame: int | None = None
    pose: list[float] | None = None
    moved: bool = False
    steps: int = 0


SESSION = "/sessions/{session}"


class InitialisationState(NumberedJob):
    """How the search stands.

    pose: radians and mm, in the order of `parameters`. confidence: 0 to 1, that the body stands so and faces so.
    margin: log weight by which the best pose that faces the other way is beaten, null without one. overlap: of the
    silhouettes. file: that it was written to, in the session's folder.
    """

    frame: int
    body: str = ""
    parameters: list[str] = Field(default_factory=list)
    pose: Numbers | None = None
    confidence: Number = None
    margin: Number = None
    overlap: Number = None
    source: str = ""
    note: str = ""
    file: str = ""


START_POSE = JobKind(
    "initialise",
    "search for the start pose",
    InitialisationState,
    changes_session=True,
    at="/api/initialisations/{identifier}",
    page="/way?session={session}&step=start-pose",
)


@router.get(SESSION + "/start-pose")
def start_pose(session: OpenSession) -> PoseView:
    """The session's start pose, or its body's rest pose while it has none."""
    body = session.body()
    own = session.start_pose(body)
    pose = body.neutral if own is None else own
    return _view(body, pose, stored=own is not None, frame=session.start_pose_frame())


@router.put(SESSION + "/start-pose")
def put_start_pose(session: OpenSession, request: StartPoseRequest, app: App) -> PoseView:
    """Make a pose the session's start pose; the one it had stays beside it."""
    body = session.body()
    pose = checked_pose(body, request.pose, SettingsError)
    keep_start_pose(session, body, pose, request.frame)
    app.events.session_changed(session.name)
    return _view(body, pose, stored=True, frame=session.start_pose_frame())


@router.post(SESSION + "/pose/drag")
def drag(session: OpenSession, request: DragRequest) -> PoseView:
    """The pose with a limb's end at a place; the rest of the body follows where it must."""
    body = _body(session, request)[0]
    found = Dragger(body).dragged(
        checked_pose(body, request.pose, SettingsError), request.limb, np.array(request.target)
    )
    return _view(body, found.pose, left_mm=found.left_mm)


@router.post(SESSION + "/pose/mirror")
def mirror(session: OpenSession, request: MirrorRequest) -> PoseView:
    """The pose with left and right exchanged."""
    body = _body(session, request)[0]
    found = Mirror(body)
    pose = checked_pose(body, request.pose, SettingsError)
    return _view(body, found.mirrored(pose) if request.how == "in place" else found.turned_round(pose))


@router.post(SESSION + "/pose/refine", status_code=202)
async def begin_refining_pose(session: OpenSession, request: BetterPoseRequest, app: App) -> TrackJobState:
    """Begin a short search around the pose, with the weighting in use. `track` events report it."""
    checked_frames(session, request.frame, request.frame + 1)
    body, run = _body(session, request)
    pose = checked_pose(body, request.pose, SettingsError)

    def work(job: Job) -> dict[str, object]:
        found = better_pose(
            session,
            request.frame,
            pose,
            run=run,
            seed=request.seed,
            progress=job.report_or_stop,
        )
        if request.keep and run is None and found.gain > 0.0:
            keep_start_pose(session, body, found.pose, request.frame)
            app.events.session_changed(session.name)
        return TRACK.entries(found, pose=found.pose.tolist())

    return begin_job(app, "pose", session, run, work)


@router.get("/scene/edit")
def editing(scene: Scene) -> EditState:
    """What is being edited in the asking window's scene, with the pose as it is now."""
    found = scene.poses.editing
    if found is None:
        return EditState()
    return EditState(
        editing=True,
        session=found.session,
        run=found.run or None,
        frame=found.frame,
        pose=[float(value) for value in found.pose],
        moved=found.moved,
        steps=found.steps,
    )


@router.post("/scene/edit", status_code=202)
def edit(request: EditRequest, app: App, scene: Scene) -> None:
    """Let a start pose, or a frame of a run, be edited in the scene."""
    session = app.workspace.session(request.session)
    run = session.run(request.run) if request.run else None
    if run is not None and request.frame is None:
        raise SettingsError(
            "A correction needs a frame.", "Name the frame of the run that is to be corrected."
        )
    if request.pose is not None:
        checked_pose(run.body() if run else session.body(), request.pose, SettingsError)
    if request.frame is not None:
        checked_frames(session, request.frame, request.frame + 1)
    scene.poses.edit(session.name, run.name if run else "", request.frame, request.pose)


@router.post("/scene/edit/undo", status_code=202)
def undo(scene: Scene) -> None:
    """Take the newest change of the edited pose back; without one nothing happens."""
    scene.poses.undo()


@router.delete("/scene/edit", status_code=202)
def leave(scene: Scene) -> None:
    """Leave off editing; what was not saved is gone when another run is opened."""
    scene.poses.leave()


def _body(session: Session, request: PoseRequest) -> tuple[BodyModel, StoredRun | None]:
    run = session.run(request.run) if request.run else None
    return (run.body() if run else session.body()), run


def _view(
    body: BodyModel, pose: Array, *, stored: bool = False, frame: int = 0, left_mm: float | None = None
) -> PoseView:
    dragger = Dragger(body)
    places = dragger.points(pose)
    grips = [
        GripView(name=grip.name, side=grip.side, place=place.tolist())
        for grip, place in zip(dragger.grips, places, strict=True)
    ]
    return PoseView(
        body=body.name,
        parameters=parameter_views(body),
        pose=pose.tolist(),
        grips=grips,
        stored=stored,
        frame=frame,
        left_mm=left_mm,
        has_sides=has_sides(body),
    )


@router.post("/sessions/{session}/initialise", status_code=202)
async def begin_initialisation(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(initialise, "InitialisationRequest", without=("keep",))],
    app: App,
    window: Window = "",
) -> InitialisationState:
    """Begin to look for the pose in a frame. Ask for its state, or wait for `initialise` events."""
    frame = arguments["frame"]
    checked_frames(session, frame, frame + 1)
    await asyncio.to_thread(session.body, arguments.get("body"))
    if "weighting" in arguments:
        WEIGHTINGS[arguments["weighting"]]

    def work(job: Job) -> dict[str, object]:
        found = initialise(session, **arguments, progress=job.report_or_stop)
        with suppress(StudioError):  # without room for a scene the pose is found all the same
            scene = app.scenes.scene(window)
            scene.poses.propose(session.name, found.pose.tolist(), found.source, found.frame)
        file = found.file.name if found.file else ""
        return START_POSE.entries(found, parameters=found.names, file=file)

    state = InitialisationState(session=session.name, frame=frame)
    return app.jobs.begin(START_POSE, state, work)


add_job_routes(router, "/initialisations/{identifier}", START_POSE)
