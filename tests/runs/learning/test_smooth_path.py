"""Steady paths against a dense solution, their limits, and the splicing of several."""

import numpy as np
import pytest

from studio.runs.learning.path_splicing import spliced
from studio.runs.learning.smooth_path import SmoothPath, Steadiness

FREE = np.full(2, np.inf)


def path_through(points: np.ndarray, weights: np.ndarray, steadiness: Steadiness, upper: float) -> SmoothPath:
    """The frames' residuals are weights (F, 1) times the distance from points (F, 2)."""

    def slopes(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        normal = weights[:, :, None] ** 2 * np.eye(2)
        return normal, weights**2 * (path - points)

    def costs(path: np.ndarray) -> np.ndarray:
        return (weights**2 * (path - points) ** 2).sum(axis=1)

    return SmoothPath(slopes, costs, -FREE, np.full(2, upper), np.zeros(2), steadiness)


@pytest.mark.parametrize("frames", [1, 2, 3, 40])
def test_the_steadiest_path_is_the_least_squares_solution(frames: int) -> None:
    rng = np.random.default_rng(frames)
    points, weights = rng.normal(size=(frames, 2)), rng.uniform(0.0, 3.0, (frames, 1))
    steadiness = Steadiness(acceleration=2.0, speed=0.7, rest=0.3)
    matrix = np.diag(weights[:, 0] ** 2 + 0.3**2)
    for order, weight in ((1, 0.7), (2, 2.0)):
        if frames > order:
            change = np.diff(np.eye(frames), order, axis=0)
            matrix += weight**2 * change.T @ change
    wanted = np.linalg.solve(matrix, weights**2 * points)
    found = path_through(points, weights, steadiness, np.inf).refined(np.zeros((frames, 2)), 40)
    np.testing.assert_allclose(found, wanted, atol=1e-3)


def test_limits_hold_and_the_rest_adapts_to_them() -> None:
    times = np.linspace(0.0, 2.0 * np.pi, 60)
    points = np.stack([np.sin(times), np.cos(times)], axis=1)
    steadiness = Steadiness(acceleration=1.0, speed=0.0, rest=0.0)
    found = path_through(points, np.ones((60, 1)), steadiness, 0.5).refined(np.zeros((60, 2)), 60)
    assert found.max() == pytest.approx(0.5)
    free = points.max(axis=1) < 0.3
    np.testing.assert_allclose(found[free], points[free], atol=0.1)


def test_faster_footage_costs_the_same_for_the_same_motion() -> None:
    steadiness = Steadiness(3.0, 2.0, 1.0)
    for ratio in (2.0, 4.0):
        times = np.arange(int(30 * ratio) * 2) / (30.0 * ratio)
        fast = np.sin(times)
        other = steadiness.at_rate(ratio)
        cost = other.acceleration**2 * np.mean(np.diff(fast, 2) ** 2)
        slow = steadiness.acceleration**2 * np.mean(np.diff(np.sin(np.arange(60) / 30.0), 2) ** 2)
        assert cost == pytest.approx(slow, rel=0.05)
    assert steadiness.times(2.0) == Steadiness(6.0, 4.0, 1.0)


def test_the_best_stretches_of_each_limb_are_joined() -> None:
    truth = np.stack([np.linspace(0.0, 1.0, 50), np.linspace(1.0, -1.0, 50)], axis=1)
    one, other = truth.copy(), truth.copy()
    one[:20, 0] += 2.0
    one[30:, 1] -= 3.0
    other[25:, 0] += 2.0
    other[:35, 1] -= 3.0
    groups = [np.array([0]), np.array([1])]

    def costs(path: np.ndarray) -> np.ndarray:
        return ((path - truth) ** 2).sum(axis=1)

    found = spliced([one, other], groups, costs, jump=0.1)
    np.testing.assert_allclose(found[:20, 0], truth[:20, 0])
    np.testing.assert_allclose(found[25:, 0], truth[25:, 0])
    np.testing.assert_allclose(found[:30, 1], truth[:30, 1])
    np.testing.assert_allclose(found[35:, 1], truth[35:, 1])


def test_a_change_that_costs_more_than_it_gains_is_not_made() -> None:
    low, high = np.zeros((30, 1)), np.ones((30, 1))

    def costs(path: np.ndarray) -> np.ndarray:
        wanted = np.where(np.abs(np.arange(30) - 15) <= 2, 1.0, 0.0)
        return (path[:, 0] - wanted) ** 2

    groups = [np.array([0])]
    assert np.array_equal(spliced([low, high], groups, costs, jump=3.0), low)
    both = spliced([low, high], groups, costs, jump=0.5)
    assert both[:, 0].tolist() == [0.0] * 13 + [1.0] * 5 + [0.0] * 12
