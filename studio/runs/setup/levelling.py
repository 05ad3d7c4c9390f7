"""A session's world levelled: z along the vertical, z = 0 on the floor; by clicks, a run's feet, or the silhouettes.

A calibration of carried boards has no floor, and the usual world of aniposelib and FreeMoCap is the first camera's
frame. The vertical is that of the cameras, which stand level; of a run whose cameras do not, it is the body's own, from
the ankles to the head, in the mean of its frames. The floor lies under what is lowest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studio.body.forward_kinematics import limb_ends, marker_points
from studio.footage.calibration.extrinsics import moved_cameras
from studio.footage.calibration.floor import Clicks, clicked_floor
from studio.footage.calibration.standing import posture
from studio.footage.calibration.vertical import Vertical, common_vertical, level_world
from studio.footage.capture.sanity import quarter_turns
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rigid import rigid
from studio.foundations.progress import Progress, no_progress
from studio.runs.setup.person_hull import spread_frames
from studio.runs.setup.session_settings import masks_of
from studio.runs.setup.silhouette_faults import person_alone
from studio.runs.tracks import best_track, read_track
from studio.sessions.calibration_changes import CalibrationChange, NewCalibration, replace_calibration
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FRAMES = 16
LOWEST_SHARE = 0.1
"""The floor lies under this share of the frames' lowest points, so that neither a foot in the air nor a stray one
decides."""
ANKLES, HEAD = ("RAnkle", "LAnkle"), "Head"
CLICK = "Click floor points (step Calibration, or --clicks FILE), or calibrate with the board on the floor (--floor)."


@dataclass(frozen=True, slots=True, eq=False)
class LevelWorld:
    """A world for a session's cameras. new_from_old : (3, 4). tilted : degrees between the old Z and the vertical.
    lowered : mm of the old origin above the floor. how : by what, words.
    """

    new_from_old: Array
    cameras: tuple[Camera, ...]
    tilted: float
    lowered: float
    how: str


def level_by_clicks(session: Session, clicks: Clicks) -> LevelWorld:
    """By points of the floor that were clicked. Raises CalibrationError."""
    return _level(
        session, clicked_floor(clicks, session.cameras()).new_from_old, f"{len(clicks.points)} clicked points"
    )


def level_by_run(session: Session, run: StoredRun) -> LevelWorld:
    """By a run's feet, tracked in the session's present world. Raises CalibrationError."""
    if any(
        not np.allclose(now.translation, then.translation, atol=0.1)
        for now, then in zip(session.cameras(), run.cameras(), strict=False)
    ):
        raise CalibrationError(
            f"Run '{run.name}' was tracked with another calibration.",
            "Track again, or level by the silhouettes.",
        )
    body, track = run.body(), read_track(run, best_track(run).name)
    places = marker_points(body, track.poses)
    at = {marker.name: number for number, marker in enumerate(body.markers)}
    vertical = common_vertical(session.cameras())
    how = "the cameras' vertical"
    if (vertical is None or not vertical.level) and {HEAD, *ANKLES} <= set(at):
        upright = places[:, at[HEAD]] - places[:, [at[name] for name in ANKLES]].mean(axis=1)
        up = np.mean(upright / np.linalg.norm(upright, axis=1, keepdims=True), axis=0)
        vertical, how = Vertical(up / np.linalg.norm(up), 5.0, level=True), "the body's vertical"
    turn = level_world(_certain(vertical).up)
    feet = limb_ends(body, track.poses).reshape(len(track.poses), -1, 3) @ turn[2]
    return _lower(session, turn, feet.min(axis=1), f"{how} and the feet of run {run.name}")


def level_by_silhouettes(
    session: Session, frames: Sequence[int] = (), progress: Progress = no_progress
) -> LevelWorld:
    """By the cameras' vertical and the lowest of the person's hull, to some centimetres. Raises CalibrationError."""
    turn = level_world(_certain(common_vertical(session.cameras())).up)
    cameras = moved_cameras(session.cameras(), rigid(turn, np.zeros(3)))
    lowest: list[float] = []
    with masks_of(session) as maker:
        chosen = tuple(frames) or spread_frames(maker.footage.frame_count, FRAMES)
        for done, frame in enumerate(chosen):
            progress("reading silhouettes", done, len(chosen))
            views = {view.camera: person_alone(view.mask) for view in maker.evidence(frame).views}
            measured = posture(cameras, views)
            if measured is not None:
                lowest.append(measured.feet * measured.height_mm)
    progress("reading silhouettes", len(chosen), len(chosen))
    if not lowest:
        raise CalibrationError(
            "No frame shows the whole person in two cameras, so the silhouettes do not show the floor.", CLICK
        )
    return _lower(session, turn, np.array(lowest), "the cameras' vertical and the silhouettes")


def use_level_world(session: Session, level: LevelWorld) -> CalibrationChange:
    """Make it the session's; the calibration before is kept. Raises SessionError while a run is being tracked."""
    return replace_calibration(session, level_calibration(session, level))


def level_calibration(session: Session, level: LevelWorld) -> NewCalibration:
    source = session.manifest.calibration_source
    note = (
        f"The world was levelled by {level.how}: turned by {level.tilted:.1f} degrees, the old origin lies"
        f" {level.lowered:.0f} mm above the floor."
    )
    return NewCalibration(
        level.cameras,
        f"{source.split(LEVELLED)[0]}{LEVELLED}{level.how}",
        matching=session.manifest.matching,
        notes=(note,),
        floor=level.how,
    )


LEVELLED = ", floor from "
"""In the words on a calibration's origin: before what its floor was set by."""


def floor_was_set(session: Session) -> bool:
    """Whether the floor of the calibration in use was set in the studio."""
    return LEVELLED in session.manifest.calibration_source


def _certain(vertical: Vertical | None) -> Vertical:
    if vertical is None or not vertical.level:
        raise CalibrationError("The cameras' pictures are not level, so they show no vertical.", CLICK)
    return vertical


def _lower(session: Session, turn: Array, lowest: Array, how: str) -> LevelWorld:
    floor = float(np.quantile(lowest, LOWEST_SHARE))
    return _level(session, rigid(turn, np.array([0.0, 0.0, -floor])), how)


def _level(session: Session, new_from_old: Array, how: str) -> LevelWorld:
    moved = moved_cameras(session.cameras(), new_from_old)
    cameras = tuple(replace(camera, quarter_turns=quarter_turns(camera)) for camera in moved)
    tilted = float(np.degrees(np.arccos(np.clip(new_from_old[2, 2], -1.0, 1.0))))
    return LevelWorld(new_from_old, cameras, tilted, float(new_from_old[2, 3]), how)
