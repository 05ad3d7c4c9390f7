"""The smoother against a dense solution and closed forms; gaps, doubtful frames, angles and limits."""

import math

import numpy as np
import pytest
import scipy.linalg

from studio.body.catalogue import load_body
from studio.foundations.errors import SettingsError
from studio.runs.hierarchy import hierarchy_of
from studio.search.trackers.smoothing import (
    DIFFUSE,
    JERK,
    TRANSITION,
    Smoothed,
    SmoothingSettings,
    rms_second_difference,
    smooth,
)
from studio.search.trackers.tracker import LOST, NO_EVIDENCE, TRACKED, SearchSpace

FPS = 60.0


def space_of(lower: list[float], upper: list[float]) -> SearchSpace:
    size = len(lower)
    hierarchy = hierarchy_of(load_body("planar_arm4"))
    names = tuple(f"p{number}" for number in range(size))
    limbs = np.zeros(size, dtype=np.int64)
    return SearchSpace(names, np.array(lower), np.array(upper), np.ones(size), limbs, hierarchy)


def smoothed(
    poses: np.ndarray,
    frames: np.ndarray | None = None,
    confidence: np.ndarray | None = None,
    states: tuple[str, ...] | None = None,
    limit: float = math.inf,
    angles: bool = True,
    **knobs: float,
) -> Smoothed:
    count, size = poses.shape
    return smooth(
        np.arange(count) if frames is None else frames,
        poses,
        np.full(count, np.nan) if confidence is None else confidence,
        states or (TRACKED,) * count,
        space_of([-limit] * size, [limit] * size),
        np.full(size, angles),
        FPS,
        SmoothingSettings(**knobs),
    )


def dense(
    places: dict[int, float], noise: dict[int, float], count: int, frequency: float
) -> tuple[np.ndarray, np.ndarray]:
    """The most likely places of all frames and their variances, by one big least-squares problem."""
    process = np.linalg.inv((2.0 * math.pi * frequency / FPS) ** 6 * JERK)
    matrix, right = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    matrix[:3, :3] += np.eye(3) / DIFFUSE
    right[0] += places[0] / DIFFUSE
    for step in range(count - 1):
        block = np.concatenate([-TRANSITION, np.eye(3)], axis=1)
        at = slice(3 * step, 3 * step + 6)
        matrix[at, at] += block.T @ process @ block
    for frame, place in places.items():
        matrix[3 * frame, 3 * frame] += 1.0 / noise[frame]
        right[3 * frame] += place / noise[frame]
    return np.linalg.solve(matrix, right)[::3], np.linalg.inv(matrix)[::3, ::3].diagonal()


def test_the_model_is_that_of_white_jerk() -> None:
    """Solved in closed form for a frame: exp F, and the integral of what jerk at each moment has become at its end."""
    np.testing.assert_allclose(scipy.linalg.expm(np.eye(3, k=1)), TRANSITION)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    left = (1.0 + nodes) / 2.0
    effects = np.stack([left**2 / 2.0, left, np.ones(3)])
    np.testing.assert_allclose((weights / 2.0 * effects) @ effects.T, JERK, rtol=1e-12)


def test_it_is_the_dense_least_squares_solution_with_gaps_and_trust() -> None:
    rng = np.random.default_rng(3)
    frames = np.delete(np.arange(40), [11, 12, 13, 27])
    poses = np.cumsum(0.1 * rng.standard_normal((36, 2)), axis=0)
    confidence = rng.uniform(0.6, 1.0, 36)
    found = smoothed(poses, frames, confidence, angles=False, smoothing_frequency=5.0)
    noise = (np.median(confidence) / confidence) ** 2
    for column in range(2):
        places = dict(zip(frames.tolist(), poses[:, column], strict=True))
        wanted, variances = dense(places, dict(zip(frames.tolist(), noise, strict=True)), 40, 5.0)
        assert np.allclose(found.poses[:, column], wanted, atol=1e-5)
        assert np.allclose(found.spread[:, column], found.rests[column] * np.sqrt(variances), rtol=1e-3)
    assert np.flatnonzero(found.filled).tolist() == [11, 12, 13, 27]


def test_noise_goes_and_movement_stays() -> None:
    rng = np.random.default_rng(8)
    time = np.arange(300) / FPS
    truth = np.stack(
        [0.8 * np.sin(2 * np.pi * 0.9 * time), 0.3 * np.sin(2 * np.pi * 2.0 * time + 1.0)], axis=1
    )
    raw = truth + 0.03 * rng.standard_normal(truth.shape)
    found = smoothed(raw)
    inner = slice(20, -20)
    before, after = np.std((raw - truth)[inner]), np.std((found.poses - truth)[inner])
    assert after < 0.6 * before
    as_points = lambda poses: np.concatenate([1000.0 * poses, np.zeros((300, 1))], axis=1)[:, None]  # noqa: E731
    assert rms_second_difference(as_points(found.poses)) < 0.2 * rms_second_difference(as_points(raw))


@pytest.mark.parametrize("frequency", [3.0, 6.0])
def test_the_frequency_is_where_movement_is_halved(frequency: float) -> None:
    time = np.arange(600) / FPS
    for times, wanted in ((0.5, 1 / (1 + 0.5**6)), (1.0, 0.5), (2.0, 1 / (1 + 2.0**6))):
        wave = np.sin(2 * np.pi * times * frequency * time)[:, None]
        found = smoothed(0.2 * wave, smoothing_frequency=frequency).poses
        inner = slice(150, -150)
        assert np.dot(found[inner, 0], wave[inner, 0]) / np.dot(
            wave[inner, 0], wave[inner, 0]
        ) == pytest.approx(0.2 * wanted, abs=0.006)


def test_constant_acceleration_is_unchanged() -> None:
    time = np.arange(50) / FPS
    even = np.stack([3.0 - 2.0 * time + 4.0 * time**2, 100.0 * time], axis=1)
    found = smoothed(even, angles=False)
    assert np.allclose(found.poses, even, atol=1e-4)


def test_short_gaps_are_filled_with_growing_doubt_and_long_ones_stay() -> None:
    rng = np.random.default_rng(2)
    frames = np.concatenate([np.arange(30), np.arange(38, 60), np.arange(90, 120)])
    poses = 0.01 * rng.standard_normal((len(frames), 1)) + 0.02 * frames[:, None]
    found = smoothed(poses, frames, longest_gap=0.25)
    assert found.frames.tolist() == [*range(60), *range(90, 120)]
    assert found.frames[found.filled].tolist() == list(range(30, 38))
    doubt = found.spread[:60, 0]
    assert doubt[33] > 1.5 * doubt[29]
    assert doubt[33] > doubt[31] > doubt[29]
    assert np.allclose(found.poses[30:38, 0], 0.02 * np.arange(30, 38), atol=0.05)
    assert smoothed(poses, frames, longest_gap=0.0).frames.tolist() == frames.tolist()


def test_lost_and_doubtful_frames_are_no_measurements() -> None:
    poses = np.zeros((40, 1))
    poses[10], poses[20], poses[30] = 1.0, 1.0, 1.0
    states = [TRACKED] * 40
    states[10], states[20] = LOST, NO_EVIDENCE
    confidence = np.full(40, 0.9)
    confidence[30] = 0.2
    found = smoothed(poses, confidence=confidence, states=tuple(states), longest_gap=0.1)
    assert found.frames[found.filled].tolist() == [10, 20, 30]
    assert np.abs(found.poses).max() < 1e-6
    none_filled = smoothed(poses, confidence=confidence, states=tuple(states), longest_gap=0.0)
    assert none_filled.left_out.tolist() == [10, 20, 30]
    with pytest.raises(SettingsError, match="None of the track's 40 frames"):
        smoothed(poses, confidence=np.full(40, 0.1))


def test_a_turn_past_pi_is_smooth_and_a_jump_is_not_smeared() -> None:
    turning = (np.linspace(3.0, 3.5, 40)[:, None] + np.pi) % (2 * np.pi) - np.pi
    found = smoothed(turning).poses
    assert np.abs(np.diff(found[:, 0])).max() < 0.02
    jumping = np.where(np.arange(40) < 20, -1.0, 1.2)[:, None]
    kept = smoothed(jumping, limit=2.0).poses
    assert np.allclose(kept, jumping, atol=1e-4)


def test_limits_hold() -> None:
    poses = np.minimum(0.5, np.sin(np.arange(100) / 6.0))[:, None]
    found = smoothed(poses, limit=0.5001, smoothing_frequency=10.0).poses
    assert found.max() <= 0.5001


def test_second_difference_is_that_of_the_definition() -> None:
    points = np.zeros((4, 2, 3))
    points[:, 0, 0] = [0.0, 1.0, 4.0, 9.0]
    assert rms_second_difference(points) == pytest.approx(math.sqrt((4 + 4) / 4))
    assert rms_second_difference(points[:2]) == 0.0
