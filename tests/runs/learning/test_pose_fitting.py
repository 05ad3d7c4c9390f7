"""Known poses found again from their markers, whole motions at a time."""

import numpy as np
import pytest
from moving_bodies import swinging

from studio.body.catalogue import load_body
from studio.runs.learning.pose_fitting import bad_frames, fit_poses
from studio.runs.learning.targets import Targets, of_poses


@pytest.mark.parametrize("name", ["human25", "human31"])
def test_known_poses_are_found_again(name: str) -> None:
    body = load_body(name)
    poses = swinging(body, 30, 30.0)
    steps: list[tuple[str, int, int]] = []
    found = fit_poses(body, of_poses(body, poses), 30.0, lambda *step: steps.append(step))
    assert np.sqrt(np.mean(found.rms_mm**2)) < 4.0
    assert not len(bad_frames(found.rms_mm))
    lower = np.array([entry.lower for entry in body.parameters])
    upper = np.array([entry.upper for entry in body.parameters])
    assert np.all((found.poses >= lower) & (found.poses <= upper))
    angles = np.array([entry.kind == "angle" for entry in body.parameters])
    assert np.degrees(np.abs(np.diff(found.poses[:, angles], axis=0)).max()) < 15.0
    assert steps[-1][1] == steps[-1][2]
    assert all(done <= total for _, done, total in steps)


def test_an_arm_that_circles_through_its_singular_position_does_not_jump() -> None:
    body = load_body("human25")
    names = [entry.name for entry in body.parameters]
    poses = np.tile(body.neutral, (40, 1))
    phase = np.linspace(0.0, 2.0 * np.pi, 40)
    # Past the side, where swing and twist turn about one axis: spread goes through 90 degrees.
    poses[:, names.index("left_shoulder_spread")] = np.radians(90.0 + 40.0 * np.sin(phase))
    poses[:, names.index("left_shoulder_swing")] = np.radians(30.0 * np.sin(2.0 * phase))
    poses[:, names.index("left_elbow")] = np.radians(25.0)
    found = fit_poses(body, of_poses(body, poses), 30.0)
    assert np.sqrt(np.mean(found.rms_mm**2)) < 6.0
    assert np.degrees(np.abs(np.diff(found.poses[:, 6:], axis=0)).max()) < 25.0


def test_lost_markers_are_bridged_and_named() -> None:
    body = load_body("human25")
    poses = swinging(body, 30, 30.0)
    whole = of_poses(body, poses)
    points = whole.points.copy()
    points[10:14] = np.nan
    points[:, 5] = np.nan
    points[22, whole.names.index("Hip")] += np.array([0.0, 600.0, 400.0])
    found = fit_poses(body, Targets(whole.names, points, whole.directions), 30.0)
    assert np.isnan(found.rms_mm[10:14]).all()
    bad = bad_frames(found.rms_mm).tolist()
    assert bad == [10, 11, 12, 13, 22]
    assert np.degrees(np.abs(found.poses[10:14, 6:] - poses[10:14, 6:]).max()) < 25.0
