import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import marker_points
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.foundations.errors import BodyError


def _names(body: BodyModel) -> tuple[str, ...]:
    return tuple(marker.name for marker in body.markers)


def _pose(body: BodyModel, seed: int) -> np.ndarray:
    """A pose within the limits, the root far from the rest pose and facing any way."""
    rng = np.random.default_rng(seed)
    pose = body.neutral
    for place, entry in enumerate(body.parameters):
        if entry.kind == "length":
            pose[place] += rng.normal(0.0, 1500.0)
        elif np.isinf(entry.upper):
            pose[place] += rng.normal(0.0, 0.3)
        else:
            pose[place] = np.clip(pose[place] + rng.normal(0.0, 0.35), entry.lower + 0.01, entry.upper - 0.01)
    headings = [
        place for place, entry in enumerate(body.parameters) if entry.name in ("heading", "pelvis_rz")
    ]
    pose[headings] = rng.uniform(-np.pi, np.pi)
    return pose


@pytest.mark.parametrize("name", list_bodies())
def test_markers_are_met_from_the_rest_pose_within_the_limits(name: str) -> None:
    body = load_body(name)
    lower = np.array([entry.lower for entry in body.parameters])
    upper = np.array([entry.upper for entry in body.parameters])
    for seed in range(4):
        points = marker_points(body, _pose(body, seed))[0]
        pose, rms = pose_from_markers(body, _names(body), points, body.neutral)
        np.testing.assert_allclose(marker_points(body, pose)[0], points, atol=0.5)
        assert rms < 0.5
        assert ((pose >= lower) & (pose <= upper)).all()


def test_missing_markers_are_ignored_and_any_order_will_do() -> None:
    body = load_body("human31")
    truth = _pose(body, 3)
    names = tuple(reversed(_names(body)))
    points = marker_points(body, truth)[0][::-1].copy()
    points[names.index("RWrist")] = np.nan
    points[names.index("Hip"), 1] = np.nan
    pose, rms = pose_from_markers(body, names, points, body.neutral)
    assert rms < 0.5
    seen = np.isfinite(points).all(axis=1)
    np.testing.assert_allclose(marker_points(body, pose)[0][::-1][seen], points[seen], atol=0.5)


def test_noise_is_spread_not_followed() -> None:
    body = load_body("human31")
    points = marker_points(body, _pose(body, 1))[0]
    noise = 10.0 * np.random.default_rng(9).standard_normal(points.shape)
    pose, rms = pose_from_markers(body, _names(body), points + noise, body.neutral)
    size = np.sqrt((noise**2).sum(axis=1).mean())
    # The truth leaves the whole noise: the best pose leaves no more, so it is at most twice that away.
    assert rms <= size
    away = marker_points(body, pose)[0] - points
    assert np.sqrt((away**2).sum(axis=1).mean()) <= 2.0 * size


def test_points_out_of_reach_leave_the_nearest_pose() -> None:
    body = load_body("planar_arm4")
    points = np.array([[0.0, 0.0, 5000.0]])
    pose, rms = pose_from_markers(body, ("Tip",), points, np.full(4, 0.3))
    np.testing.assert_allclose(pose, 0.0, atol=1e-3)
    assert rms == pytest.approx(4000.0, abs=1e-3)


def test_the_same_points_give_the_same_pose() -> None:
    body = load_body("human25")
    points = marker_points(body, _pose(body, 6))[0] + 5.0
    first, _ = pose_from_markers(body, _names(body), points, body.neutral)
    again, _ = pose_from_markers(body, _names(body), points, body.neutral)
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(("names", "points", "start", "words"), [
    (("Tip", "Nose"), np.zeros((2, 3)), np.zeros(4), "no marker 'Nose'"),
    (("Tip",), np.full((1, 3), np.nan), np.zeros(4), "No marker has a position"),
    (("Tip",), np.zeros((2, 3)), np.zeros(4), "do not fit"),
    (("Tip",), np.zeros((1, 3)), np.zeros(5), "do not fit"),
    (("Tip",), np.zeros((1, 3)), np.full(4, np.nan), "NaN"),
])  # fmt: skip
def test_wrong_input_is_refused(
    names: tuple[str, ...], points: np.ndarray, start: np.ndarray, words: str
) -> None:
    with pytest.raises(BodyError, match=words):
        pose_from_markers(load_body("planar_arm4"), names, points, start)
