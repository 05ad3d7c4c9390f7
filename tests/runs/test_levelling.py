"""A world that is a camera's frame, levelled by the silhouettes and by clicks."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from nudged_camera import make_nudged_session, true_cameras
from store_records import record_of

import studio
from studio.body.forward_kinematics import limb_ends
from studio.footage.calibration.extrinsics import moved_cameras
from studio.footage.calibration.vertical import level_world
from studio.footage.capture.calibration_files import read_calibration, with_up, write_calibration
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import rigid
from studio.runs.setup.levelling import level_by_silhouettes
from studio.runs.setup.workflow import calibration_step
from studio.runs.tracks import Track, write_track
from studio.sessions.session import CAMERAS_PATH, Session


@pytest.fixture
def askew(tmp_path: Path) -> Session:
    """The world of the first camera, which looks down by 12 degrees, its minus Y taken for up."""
    session = make_nudged_session(tmp_path / "askew", 0.0)
    first = true_cameras()[0]
    cameras = moved_cameras(true_cameras(), rigid(first.rotation, first.translation))
    read = dataclasses.replace(read_calibration(session.path / CAMERAS_PATH), cameras=cameras)
    write_calibration(with_up(read, "-y").cameras, session.path / CAMERAS_PATH)
    return Session(session.path)


def tilt(session: Session) -> float:
    """Degrees between the session's vertical and the true one, by how high the cameras lie over one another."""
    ups = np.array([camera.rotation[:, 2] for camera in session.cameras()])
    true = np.array([camera.rotation[:, 2] for camera in true_cameras()])
    return float(np.degrees(np.arccos(np.clip((ups * true).sum(axis=1), -1.0, 1.0))).max())


@pytest.mark.slow
def test_the_world_is_levelled_by_cameras_and_silhouettes(askew: Session) -> None:
    step = calibration_step(askew)
    assert step.state == "stale"
    assert "degrees off the cameras' common vertical" in step.why
    assert "lens of camera cam1" in step.why
    assert "studio level" in step.why
    assert tilt(askew) > 11.0
    found = studio.level(askew, keep=False)
    assert not found.changed
    assert found.tilted == pytest.approx(tilt(askew), abs=0.1)
    levelled = studio.level(askew)
    assert tilt(levelled.session) < 0.1
    assert calibration_step(levelled.session).state == "done"
    lowest = level_by_silhouettes(levelled.session)
    assert abs(lowest.lowered) < 1.0
    assert all(1000.0 < camera.centre[2] < 1800.0 for camera in levelled.session.cameras())


def test_clicked_points_set_the_floor(askew: Session, tmp_path: Path) -> None:
    corners = np.array([[0.0, 0.0, 0.0], [900.0, 0.0, 0.0], [0.0, 900.0, 0.0], [-600.0, 500.0, 0.0]])
    seen = {camera.name: project(camera, corners)[0].tolist() for camera in true_cameras()}
    points = [{"pixels": {name: pixels[at] for name, pixels in seen.items()}} for at in range(len(corners))]
    (tmp_path / "clicks.json").write_text(json.dumps({"points": points}))
    session = studio.level(askew, clicks=tmp_path / "clicks.json").session
    assert tilt(session) < 0.1
    for camera in session.cameras():
        assert camera.centre[2] == pytest.approx(1700.0, abs=1.0)


def test_the_feet_of_a_run_set_the_floor(tmp_path: Path) -> None:
    """Somebody who stands 400 mm above z = 0 in every frame, one foot now and then in the air."""
    session = make_nudged_session(tmp_path / "high", 0.0)
    body = session.body()
    poses = np.tile(body.neutral, (20, 1))
    feet = limb_ends(body, poses).reshape(20, -1, 3)[..., 2].min()
    poses[:, [entry.name for entry in body.parameters].index("pelvis_z")] += 400.0 - feet
    run = session.new_run(record_of(session, "stood"))
    states = ("tracked",) * 20
    write_track(
        run, Track("refined", np.arange(20), poses, np.ones(20), states, {"verb": "made", "from": "raw"})
    )
    found = studio.level(session, run="stood")
    assert found.how == "the cameras' vertical and the feet of run stood"
    assert found.lowered == pytest.approx(-400.0, abs=5.0)
    for camera, before in zip(found.session.cameras(), true_cameras(), strict=True):
        assert camera.centre[2] == pytest.approx(before.centre[2] - 400.0, abs=5.0)
    with pytest.raises(studio.StudioError, match="another calibration"):
        studio.level(found.session, run="stood")


def test_pictures_that_are_not_level_show_no_vertical(askew: Session) -> None:
    cameras = [
        dataclasses.replace(camera, rotation=roll @ camera.rotation, translation=roll @ camera.translation)
        for camera, degrees in zip(askew.cameras(), (40.0, -35.0, 50.0, -20.0), strict=True)
        for roll in [level_world(np.array([0.0, 0.0, 1.0])) @ turned(degrees)]
    ]
    write_calibration(tuple(cameras), askew.path / CAMERAS_PATH)
    with pytest.raises(studio.StudioError, match="show no vertical"):
        studio.level(Session(askew.path))


def turned(degrees: float) -> np.ndarray:
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
