"""Other performances of a motion: slow noise, warped time, joints a little different, feet where they stood."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.body.person import joint_points, marker_motion
from studio.body.retargeting import lowest_of_sole
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.recorded_clips import (
    CARRIERS,
    Variation,
    from_local,
    performance,
    to_local,
)
from studio.runs.learning.oversampling import smooth_noise, warped_times

BONES = skeleton_of_height(1760.0, np.random.default_rng(1))
WALK = make_motion("walk", BONES, 240, 60.0, {})


def test_slow_noise_has_the_given_size_and_period() -> None:
    noise = smooth_noise(np.random.default_rng(3), 60_000, 3, 30.0, 2.0)
    np.testing.assert_allclose(noise.std(axis=0), 1.0, atol=0.1)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=0.1)
    rises = np.sum((noise[:-1] < 0.0) & (noise[1:] >= 0.0), axis=0)
    np.testing.assert_allclose(60_000 / 30.0 / rises, 2.0, rtol=0.1)


def test_warped_times_rise_from_beginning_to_end() -> None:
    times = warped_times(np.random.default_rng(1), 300, 9.0, 0.2, 2.0)
    assert (times[0], times[-1]) == (0.0, pytest.approx(9.0))
    speed = np.diff(times) * 299 / 9.0
    assert 0.1 < np.log(speed).std() < 0.3
    assert speed.min() > 0.4
    np.testing.assert_allclose(
        warped_times(np.random.default_rng(1), 300, 9.0, 0.0, 2.0), np.linspace(0, 9, 300)
    )


def test_local_rotations_are_relative_to_the_parent() -> None:
    local = to_local(WALK)
    for name, carrier in CARRIERS.items():
        np.testing.assert_allclose(WALK.turns[carrier] @ local[name], WALK.turns[name], atol=1e-12)
    back = from_local(WALK, local)
    for name, turn in WALK.turns.items():
        np.testing.assert_allclose(back.turns[name], turn, atol=1e-12)


def test_a_performance_is_close_but_different_and_stands_in_the_same_places() -> None:
    made = performance(WALK, 130, 30.0, Variation(0.0, 4.0), np.random.default_rng(4))
    assert (made.frame_count, made.fps) == (130, 30.0)
    same = performance(WALK, 130, 30.0, Variation(0.0, 0.0), np.random.default_rng(4))
    away = np.linalg.norm(marker_motion(made).positions - marker_motion(same).positions, axis=2)
    assert 15.0 < np.sqrt(np.mean(away**2)) < 120.0
    turned = Rotation.from_matrix(np.swapaxes(same.turns["left_thigh"], 1, 2) @ made.turns["left_thigh"])
    assert 0.5 < np.degrees(np.sqrt(np.mean(turned.magnitude() ** 2))) < 12.0
    lowest = np.min([lowest_of_sole(made, side) for side in ("left", "right")], axis=0)
    assert lowest.min() > -1e-6
    assert np.quantile(lowest, 0.9) < 25.0
    for motion in (made, same):
        points = joint_points(motion)
        standing = np.stack([points[f"{side}_foot"] for side in ("left", "right")], axis=1)
        lower = np.argmin(standing[:, :, 2], axis=1)
        one_foot = lower[1:] == lower[:-1]
        slips = np.linalg.norm(np.diff(standing, axis=0)[np.arange(129), lower[1:], :2], axis=1)
        assert np.median(slips[one_foot]) < 15.0


def test_knees_and_elbows_never_bend_backwards() -> None:
    made = performance(WALK, 240, 60.0, Variation(0.1, 25.0), np.random.default_rng(8))
    for name, way in (
        ("left_shin", 1.0),
        ("right_shin", 1.0),
        ("left_forearm", -1.0),
        ("right_forearm", -1.0),
    ):
        local = to_local(made)[name]
        bend = way * np.arctan2(local[:, 0, 2], local[:, 0, 0])
        before = to_local(WALK)[name]
        assert way * np.median(np.arctan2(before[:, 0, 2], before[:, 0, 0])) > 0.0, name
        assert bend.min() > -0.02


def test_the_same_seed_gives_the_same_performance() -> None:
    one, other = (performance(WALK, 60, 30.0, Variation(), np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(one.root, other.root)
    np.testing.assert_array_equal(one.turns["head"], other.turns["head"])
