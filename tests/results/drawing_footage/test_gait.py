"""Steps and legs by their geometry."""

import numpy as np
import pytest

from studio.results.drawing_footage.gait import (
    Gait,
    circle_path,
    foot_track,
    leg_to_ankle,
    line_path,
    winding_path,
)
from studio.results.drawing_footage.person import skeleton_of_height

GAIT = Gait(speed=900.0, cadence=2.0, duty=0.6, foot_spacing=160.0, lift=40.0, heel_rise=0.45)
BONES = skeleton_of_height(1760.0, np.random.default_rng(1))


@pytest.mark.parametrize(
    "path", [circle_path(900.0, 0.3), line_path((10.0, -20.0), 0.7), winding_path(1000.0, 80.0, 2.0)]
)
def test_the_heading_is_the_paths_direction(path: object) -> None:
    distance = np.linspace(0.0, 3000.0, 50)
    place, heading = path(distance)  # type: ignore[operator]
    ahead = path(distance + 0.5)[0] - path(distance - 0.5)[0]  # type: ignore[operator]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    np.testing.assert_allclose(ahead, np.stack([np.cos(heading), np.sin(heading)], axis=1), atol=1e-3)
    assert place.shape == (50, 2)


@pytest.mark.parametrize("left", [True, False])
def test_a_foot_stands_still_under_the_path_and_swings_ahead(left: bool) -> None:
    times = np.arange(0.0, 3.0, 1.0 / 240.0)
    track = foot_track(GAIT, line_path((0.0, 0.0), 0.0), times, BONES, left=left)
    standing = track.swing == 0.0
    assert np.mean(standing) == pytest.approx(GAIT.duty, abs=0.02)
    flat = standing & (np.abs(track.turn[:, 2, 0]) < 1e-6)
    steps = np.abs(np.diff(track.ankle[:, 0]))[flat[1:] & flat[:-1]]
    assert flat.sum() > 100
    assert steps.max() < 1e-6
    np.testing.assert_allclose(track.ankle[flat, 2], BONES.ankle_height)
    np.testing.assert_allclose(track.ankle[flat, 1], 80.0 if left else -80.0)
    assert np.diff(track.ankle[:, 0]).min() > -1.5
    assert track.ankle[:, 2].min() >= BONES.ankle_height - 1e-6


def test_the_stance_is_centred_under_the_hip() -> None:
    times = np.arange(0.0, 2.0, 1.0 / 600.0)
    track = foot_track(GAIT, line_path((0.0, 0.0), 0.0), times, BONES, left=True)
    first = (times < GAIT.duty * GAIT.cycle) & (np.abs(track.turn[:, 2, 0]) < 1e-6)
    assert track.ankle[first, 0].mean() == pytest.approx(GAIT.speed * 0.5 * GAIT.duty * GAIT.cycle)


def test_an_obstacle_is_cleared() -> None:
    times = np.arange(0.0, 3.0, 1.0 / 120.0)

    def obstacle(places: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        assert np.all(begin[:, 0] <= places[:, 0] + 1e-9)
        assert np.all(places[:, 0] <= end[:, 0] + 1e-9)
        return np.where(np.abs(places[:, 0] - 1000.0) < 300.0, 200.0, 0.0)

    path = line_path((0.0, 0.0), 0.0)
    bare = foot_track(GAIT, path, times, BONES, left=True)
    lifted = foot_track(GAIT, path, times, BONES, left=True, obstacle=obstacle)
    over = (np.abs(bare.ankle[:, 0] - 1000.0) < 100.0) & (bare.swing > 0.3) & (bare.swing < 0.7)
    assert over.any()
    assert (lifted.ankle[over, 2] - bare.ankle[over, 2]).min() > 150.0


@pytest.mark.parametrize("seed", range(5))
def test_legs_reach_the_ankle_with_the_knee_ahead(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hip = rng.normal(0.0, 100.0, (40, 3)) + np.array([0.0, 0.0, 900.0])
    down = rng.normal(0.0, 0.3, (40, 3)) - np.array([0.0, 0.0, 1.0])
    ankle = hip + down / np.linalg.norm(down, axis=1, keepdims=True) * rng.uniform(400.0, 840.0, (40, 1))
    forward = np.tile(np.array([1.0, 0.0, 0.0]), (40, 1))
    thigh, shin = leg_to_ankle(hip, ankle, forward, 430.0, 425.0)
    knee = hip + thigh @ np.array([0.0, 0.0, -430.0])
    np.testing.assert_allclose(knee + shin @ np.array([0.0, 0.0, -425.0]), ankle, atol=1e-9)
    line = (
        hip
        + (ankle - hip)
        * (np.sum((knee - hip) * (ankle - hip), axis=1) / np.sum((ankle - hip) ** 2, axis=1))[:, None]
    )
    assert np.all((knee - line)[:, 0] > 0.0)
    np.testing.assert_allclose(np.swapaxes(thigh, 1, 2) @ thigh, np.tile(np.eye(3), (40, 1, 1)), atol=1e-12)
    relative = np.swapaxes(thigh, 1, 2) @ shin
    np.testing.assert_allclose(
        relative[:, :, 1], np.tile([0.0, 1.0, 0.0], (40, 1)), atol=1e-9
    )  # a hinge about y


def test_an_ankle_out_of_reach_is_approached() -> None:
    hip, ankle = np.array([[0.0, 0.0, 1000.0]]), np.array([[0.0, 0.0, 0.0]])
    thigh, shin = leg_to_ankle(hip, ankle, np.array([[1.0, 0.0, 0.0]]), 430.0, 425.0)
    end = hip + thigh @ np.array([0.0, 0.0, -430.0]) + shin @ np.array([0.0, 0.0, -425.0])
    np.testing.assert_allclose(end, [[0.0, 0.0, 1000.0 - 0.998 * 855.0]], atol=1e-9)
