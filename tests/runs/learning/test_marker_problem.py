"""Residuals and slopes of the marker problem against the body's own kinematics and finite differences."""

import numpy as np
import pytest
from moving_bodies import swinging

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, marker_points
from studio.foundations.errors import BodyError, StudioError
from studio.runs.learning.marker_problem import MM_PER_RADIAN, POINTING_MM, MarkerProblem
from studio.runs.learning.targets import (
    Targets,
    directions,
    marker_names,
    of_poses,
    pointers_of,
    skeleton_of_body,
)


@pytest.mark.parametrize("name", ["human25", "human29", "human31", "human34"])
def test_slopes_are_those_of_the_bodys_kinematics(name: str) -> None:
    body = load_body(name)
    poses = swinging(body, 3, 5.0)
    targets = of_poses(body, poses + 0.2)
    problem = MarkerProblem(body, targets)
    path = poses / problem.scale
    pointers = [entry for entry in pointers_of(body, movable=True)]

    def residuals(scaled: np.ndarray) -> np.ndarray:
        real = scaled * problem.scale
        apart = marker_points(body, real) - targets.points
        along = directions(tuple(pointers), joint_frames(body, real))
        wanted = np.stack([targets.directions[entry.limb] for entry in pointers], axis=1)
        both = np.concatenate([apart, POINTING_MM * (along - wanted)], axis=1)
        return both.reshape(len(real), -1)

    np.testing.assert_allclose(problem.costs(path), (residuals(path) ** 2).sum(axis=1), rtol=1e-9)
    step, width = 1e-6, path.shape[1]
    ahead = [residuals(path + step * axis) - residuals(path - step * axis) for axis in np.eye(width)]
    slopes = np.stack(ahead, axis=1) / (2.0 * step)
    normal, right = problem.slopes(path)
    wanted = slopes @ slopes.transpose(0, 2, 1)
    np.testing.assert_allclose(normal, wanted, rtol=1e-5, atol=1e-6 * wanted.max())
    slope = (slopes @ residuals(path)[..., None])[..., 0]
    np.testing.assert_allclose(right, slope, rtol=1e-5, atol=1e-5 * np.abs(slope).max())


def test_missing_markers_neither_pull_nor_count() -> None:
    body = load_body("human25")
    poses = swinging(body, 4, 5.0)
    whole = of_poses(body, poses)
    points = whole.points + np.array([30.0, 0.0, 0.0])
    points[1, 3:] = np.nan
    points[2] = np.nan
    problem = MarkerProblem(body, Targets(whole.names, points, {}))
    rms = problem.rms(poses / problem.scale)
    np.testing.assert_allclose(rms[[0, 3]], 30.0)
    assert np.isnan(rms[[1, 2]]).all()
    assert problem.usable.tolist() == [True, False, False, True]
    np.testing.assert_allclose(problem.costs(poses / problem.scale), [15 * 900.0, 3 * 900.0, 0.0, 15 * 900.0])


def test_lengths_count_like_radians() -> None:
    body = load_body("human25")
    problem = MarkerProblem(body, of_poses(body, swinging(body, 2, 5.0)))
    kinds = [entry.kind for entry in body.parameters]
    assert problem.scale.tolist() == [MM_PER_RADIAN if kind == "length" else 1.0 for kind in kinds]


def test_the_skeleton_has_the_bodys_proportions() -> None:
    for name in ("human25", "human31", "human34"):
        body = load_body(name)
        bones = skeleton_of_body(body)
        points = dict(zip(marker_names(body), marker_points(body, body.neutral)[0], strict=True))
        assert bones.thigh[0] == pytest.approx(np.linalg.norm(points["LHip"] - points["LKnee"]))
        assert bones.forearm[1] == pytest.approx(np.linalg.norm(points["RElbow"] - points["RWrist"]))
        neck_to_shoulder = np.linalg.norm(points["LShoulder"] - points["Neck"])
        assert np.linalg.norm(bones.shoulder[0]) == pytest.approx(neck_to_shoulder)
        assert bones.shoulder[0][1] > 50.0
        assert bones.shoulder[1][1] > 50.0
        assert 1500.0 < bones.height < 2000.0


def test_bodies_without_a_persons_markers_and_empty_frames_are_refused() -> None:
    with pytest.raises(BodyError, match=r"'dog' has no marker"):
        skeleton_of_body(load_body("dog"))
    body = load_body("human25")
    nothing = Targets(("Hip", "Neck"), np.full((5, 2, 3), np.nan), {})
    with pytest.raises(StudioError, match="No frame has markers"):
        MarkerProblem(body, nothing)
