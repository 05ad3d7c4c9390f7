"""Poses of a session set by hand: its start pose, a limb's end that is dragged, the search around a pose."""

from dataclasses import dataclass

import numpy as np
from pydantic import FiniteFloat

from studio.body.dragging import Dragger
from studio.body.mirroring import has_sides
from studio.body.model import BodyModel, checked_pose
from studio.foundations.arrays import Array
from studio.foundations.errors import SettingsError
from studio.foundations.progress import Progress, no_progress
from studio.operations.overview import ParameterView, parameter_views
from studio.runs.setup.pose_search import BetterPose, better_pose
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@dataclass(frozen=True, slots=True, eq=False)
class GripView:
    """A limb's end that can be dragged. place : (3,) where it is in the pose, mm."""

    name: str
    side: str
    place: Array


@dataclass(frozen=True, slots=True, eq=False)
class PoseView:
    """A pose (D,) of a body: radians and mm in the order of `parameters`.

    stored : whether it is the session's start pose (else the rest pose).
    frame : that it is of.
    left_mm : after a drag, how far the limb's end still is from its target.
    has_sides : whether it can be mirrored.
    """

    body: str
    parameters: tuple[ParameterView, ...]
    pose: list[FiniteFloat]
    grips: tuple[GripView, ...]
    stored: bool
    frame: int
    left_mm: float | None
    has_sides: bool


def pose_view(
    body: BodyModel, pose: Array, *, stored: bool = False, frame: int = 0, left_mm: float | None = None
) -> PoseView:
    """A pose (D,) of a body for a page."""
    dragger = Dragger(body)
    places = dragger.points(pose)
    grips = (GripView(grip.name, grip.side, place) for grip, place in zip(dragger.grips, places, strict=True))
    return PoseView(
        body.name, parameter_views(body), pose.tolist(), tuple(grips), stored, frame, left_mm, has_sides(body)
    )


def start_pose(session: Session) -> PoseView:
    """A session's start pose, or its body's rest pose if it has none. Raises BodyError."""
    body = session.body()
    own = session.start_pose(body)
    pose = body.neutral if own is None else own
    return pose_view(body, pose, stored=own is not None, frame=session.start_pose_frame())


def set_start_pose(
    session: Session, pose: list[float], frame: int | None = None, *, body: BodyModel | None = None
) -> PoseView:
    """Make a pose the session's start pose; the old one is kept beside it.

    frame : that it is of, None: as before.
    body : whose pose it is, None: the session's.

    Raises SettingsError for a pose that does not fit the body, RunError for another body than the session's or a frame
    outside the footage.
    """
    body = body or session.body()
    keep_start_pose(session, body, checked_pose(body, pose, SettingsError), frame)
    return start_pose(session)


def dragged_pose(body: BodyModel, pose: Array, limb: str, target: tuple[float, float, float]) -> PoseView:
    """The pose with a limb's end at a place (x, y, z, mm), or as near as limits allow. Raises BodyError."""
    dragged = Dragger(body).dragged(pose, limb, np.array(target))
    return pose_view(body, dragged.pose, left_mm=dragged.left_mm)


@dataclass(frozen=True, slots=True, eq=False)
class PoseSearch:
    """A short search around a pose (D,), then local refinement.

    run : whose body and likelihood are used, None: the session's.
    keep : whether a better pose becomes the session's start pose.
    """

    frame: int
    pose: Array
    run: StoredRun | None = None
    seed: int = 0
    keep: bool = False


def improve_pose(session: Session, search: PoseSearch, progress: Progress = no_progress) -> BetterPose:
    """The best pose near a given one in a frame. Raises RunError where nothing is to be seen in the frame."""
    better = better_pose(
        session, search.frame, search.pose, run=search.run, seed=search.seed, progress=progress
    )
    if search.keep and search.run is None and better.gain > 0.0:
        keep_start_pose(session, session.body(), better.pose, search.frame)
    return better
