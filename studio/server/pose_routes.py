"""Poses set by hand: start poses, dragging, mirroring, the search around a pose, and the editor in the scene."""

import math

import numpy as np
from fastapi import APIRouter

from studio.arrays import Array
from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel
from studio.errors import BodyError, SettingsError
from studio.jobs.job_runner import Job
from studio.runs.new_run import checked_frames
from studio.runs.pose_search import better_pose
from studio.runs.start_pose_file import keep_start_pose
from studio.server.app_state import App, Scene
from studio.server.job_routes import begin_job
from studio.server.pose_schemas import (
    BetterPoseRequest,
    DragRequest,
    EditRequest,
    EditState,
    GripView,
    MirrorRequest,
    PoseRequest,
    PoseView,
    StartPoseRequest,
)
from studio.server.session_routes import OpenSession
from studio.server.session_views import parameter_views
from studio.server.track_schemas import TrackJobState
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = APIRouter(prefix="/api", tags=["poses"])

SESSION = "/sessions/{session}"


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
    pose = _fitting(body, request.pose)
    keep_start_pose(session, body, pose, request.frame)
    app.events.session_changed(session.name)
    return _view(body, pose, stored=True, frame=session.start_pose_frame())


@router.post(SESSION + "/pose/drag")
def drag(session: OpenSession, request: DragRequest) -> PoseView:
    """The pose with a limb's end at a place; the rest of the body follows where it must."""
    body = _body(session, request)[0]
    found = Dragger(body).dragged(_fitting(body, request.pose), request.limb, np.array(request.target))
    return _view(body, found.pose, left_mm=found.left_mm)


@router.post(SESSION + "/pose/mirror")
def mirror(session: OpenSession, request: MirrorRequest) -> PoseView:
    """The pose with left and right exchanged."""
    body = _body(session, request)[0]
    found = Mirror(body)
    pose = _fitting(body, request.pose)
    return _view(body, found.mirrored(pose) if request.how == "in place" else found.turned_round(pose))


@router.post(SESSION + "/pose/refine", status_code=202)
async def begin_refining_pose(session: OpenSession, request: BetterPoseRequest, app: App) -> TrackJobState:
    """Begin a short search around the pose, with the weighting in use. `track` events report it."""
    checked_frames(session, request.frame, request.frame + 1)
    body, run = _body(session, request)
    pose = _fitting(body, request.pose)

    def work(job: Job) -> dict[str, object]:
        found = better_pose(
            session,
            request.frame,
            pose,
            run=run,
            seed=request.seed,
            progress=job.report_or_stop,
        )
        return {
            "pose": found.pose.tolist(),
            "gain": found.gain,
            "overlap_before": found.overlap_before,
            "overlap": found.overlap,
        }

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
        _fitting(run.body() if run else session.body(), request.pose)
    if request.frame is not None:
        checked_frames(session, request.frame, request.frame + 1)
    scene.poses.edit(session.name, run.name if run else "", request.frame, request.pose)


@router.delete("/scene/edit", status_code=202)
def leave(scene: Scene) -> None:
    """Leave off editing; what was not saved is gone when another run is opened."""
    scene.poses.leave()


def _body(session: Session, request: PoseRequest) -> tuple[BodyModel, StoredRun | None]:
    run = session.run(request.run) if request.run else None
    return (run.body() if run else session.body()), run


def _fitting(body: BodyModel, pose: list[float]) -> Array:
    """The pose (D,) if it is one of the body. Raises SettingsError."""
    if len(pose) != len(body.parameters) or not all(math.isfinite(value) for value in pose):
        raise SettingsError(
            f"A pose of {body.name} has {len(body.parameters)} finite numbers, the given one does not.",
            "Give radians and mm in the order of the body's parameters.",
        )
    return np.array(pose)


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
        has_sides=_has_sides(body),
    )


def _has_sides(body: BodyModel) -> bool:
    try:
        Mirror(body)
    except BodyError:
        return False
    return True
