"""Poses set by hand: start poses, dragging, mirroring, the search around a pose, and the editor in the scene."""

import asyncio
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from studio.app.server.answers import Router
from studio.app.server.app_state import App, Scene
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Number, Numbers, Request, RunName
from studio.app.server.session_routes import OpenSession
from studio.app.server.track_routes import TRACK, TrackJobState, begin_job
from studio.app.server.windows import Window
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel, checked_pose
from studio.foundations.arrays import Array
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import SettingsError, StudioError
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.operations.person import initialise
from studio.operations.poses import (
    PoseSearch,
    PoseView,
    dragged_pose,
    improve_pose,
    pose_view,
    set_start_pose,
)
from studio.operations.poses import start_pose as start_pose_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = Router(prefix="/api", tags=["poses"])


class StartPoseRequest(Request):
    """The session's new start pose; the old one is kept beside it. frame: that it is of; null: as before."""

    pose: list[float]
    frame: int | None = Field(None, ge=0, le=LARGEST)


class PoseRequest(Request):
    """A pose, of the session's body or of a run's (which then also gives the likelihood)."""

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
    start pose, whether or not a page still waits for it.
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


@dataclass(frozen=True, slots=True)
class EditState:
    """What is being edited in the scene; all null while nothing is. moved : whether it is another pose than it was.
    steps : changes that can be undone.
    """

    editing: bool = False
    session: str | None = None
    run: str | None = None
    frame: int | None = None
    pose: list[FiniteFloat] | None = None
    moved: bool = False
    steps: int = 0


SESSION = "/sessions/{session}"


class InitialisationState(NumberedJob):
    """How the search stands.

    pose: radians and mm, in the order of `parameters`. confidence: 0 to 1, that the body stands so and faces so;
    unsure: it is so low that the pose is to be looked at before it is tracked from.
    margin: log weight by which the best pose that faces the other way is beaten, null without one. overlap: of the
    silhouettes. file: that it was written to, in the session's folder.
    """

    frame: int
    body: str = ""
    parameters: list[str] = Field(default_factory=list)
    pose: Numbers | None = None
    confidence: Number = None
    unsure: bool = False
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
    return start_pose_of(session)


@router.put(SESSION + "/start-pose")
def put_start_pose(session: OpenSession, request: StartPoseRequest, app: App) -> PoseView:
    """Make a pose the session's start pose; the one it had stays beside it."""
    kept = set_start_pose(session, request.pose, request.frame)
    app.events.session_changed(session.name)
    return kept


@router.post(SESSION + "/pose/drag")
def drag(session: OpenSession, request: DragRequest) -> PoseView:
    """The pose with a limb's end at a place; the rest of the body follows where it must."""
    body, pose, _ = _read_pose(session, request)
    return dragged_pose(body, pose, request.limb, request.target)


@router.post(SESSION + "/pose/mirror")
def mirror(session: OpenSession, request: MirrorRequest) -> PoseView:
    """The pose with left and right exchanged."""
    body, pose, _ = _read_pose(session, request)
    other = Mirror(body)
    turned = other.mirrored(pose) if request.how == "in place" else other.turned_round(pose)
    return pose_view(body, turned)


@router.post(SESSION + "/pose/refine", status_code=202)
async def begin_refining_pose(session: OpenSession, request: BetterPoseRequest, app: App) -> TrackJobState:
    """Begin a short search around the pose, with the weighting in use. `track` events report it."""
    session.checked_frames(request.frame, request.frame + 1)
    _, pose, run = _read_pose(session, request)
    search = PoseSearch(request.frame, pose, run, request.seed, request.keep)

    def work(job: Job) -> dict[str, object]:
        better = improve_pose(session, search, job.report_or_stop)
        if request.keep and run is None and better.gain > 0.0:
            app.events.session_changed(session.name)
        return TRACK.entries(better, pose=better.pose.tolist())

    return begin_job(app, "pose", session, run, work)


@router.get("/scene/edit")
def editing(scene: Scene) -> EditState:
    """What is being edited in the asking window's scene, with the pose as it is now."""
    edited = scene.poses.editing
    if edited is None:
        return EditState()
    pose = [float(value) for value in edited.pose]
    return EditState(True, edited.session, edited.run or None, edited.frame, pose, edited.moved, edited.steps)


@router.post("/scene/edit", status_code=202)
def edit(request: EditRequest, app: App, scene: Scene) -> None:
    """Let a start pose, or a frame of a run, be edited in the scene."""
    session = app.workspace.session(request.session)
    run = session.run(request.run) if request.run else None
    if run is not None and request.frame is None:
        raise SettingsError("A correction needs a frame.", "Name the frame of the run to correct.")
    if request.pose is not None:
        checked_pose(run.body() if run else session.body(), request.pose, SettingsError)
    if request.frame is not None:
        session.checked_frames(request.frame, request.frame + 1)
    scene.poses.edit(session.name, run.name if run else "", request.frame, request.pose)


@router.post("/scene/edit/undo", status_code=202)
def undo(scene: Scene) -> None:
    """Take the newest change of the edited pose back; without one nothing happens."""
    scene.poses.undo()


@router.delete("/scene/edit", status_code=202)
def leave(scene: Scene) -> None:
    """Leave off editing; what was not saved is gone when another run is opened."""
    scene.poses.leave()


def _read_pose(session: Session, request: PoseRequest) -> tuple[BodyModel, Array, StoredRun | None]:
    """The body and (D,) pose of a request, and the run that they are of. Raises SettingsError, NotFoundError."""
    run = session.run(request.run) if request.run else None
    body = run.body() if run else session.body()
    return body, checked_pose(body, request.pose, SettingsError), run


@router.post("/sessions/{session}/initialise", status_code=202)
async def begin_initialisation(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(initialise, "InitialisationRequest", without=("keep",))],
    app: App,
    window: Window = "",
) -> InitialisationState:
    """Begin to look for the pose in a frame. Ask for its state, or wait for `initialise` events."""
    frame = arguments["frame"]
    session.checked_frames(frame, frame + 1)
    await asyncio.to_thread(session.body, arguments.get("body"))
    if "weighting" in arguments:
        WEIGHTINGS[arguments["weighting"]]

    def work(job: Job) -> dict[str, object]:
        first = initialise(session, **arguments, progress=job.report_or_stop)
        with suppress(StudioError):  # without room for a scene the pose is kept all the same
            scene = app.scenes.scene(window)
            scene.poses.propose(session.name, first.pose.tolist(), first.source, first.frame)
        return START_POSE.entries(first, parameters=first.names, file=first.file.name if first.file else "")

    state = InitialisationState(session=session.name, frame=frame)
    return app.jobs.begin(START_POSE, state, work)


add_job_routes(router, "/initialisations/{identifier}", START_POSE)
