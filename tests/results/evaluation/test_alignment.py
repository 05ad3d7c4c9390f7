"""Alignment against independent oracles: scipy's Procrustes and direct minimisation."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial import procrustes
from scipy.spatial.transform import Rotation

from studio.foundations.errors import TruthError
from studio.results.evaluation.errors import RIGID, SIMILARITY, laid_on, moved_to_root, similarity_aligned


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_an_exact_similarity_is_undone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    goal = rng.normal(0.0, 300.0, (15, 3))
    turn = Rotation.random(random_state=seed).as_matrix()
    points = (goal - 40.0) @ turn.T * 0.7 + rng.normal(0.0, 1000.0, 3)
    np.testing.assert_allclose(similarity_aligned(points, goal), goal, atol=1e-8)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_remaining_error_is_the_least_of_all_similarities(seed: int) -> None:
    rng = np.random.default_rng(seed)
    goal = rng.normal(0.0, 300.0, (12, 3))
    points = goal + rng.normal(0.0, 120.0, (12, 3))

    def residuals(values: np.ndarray) -> np.ndarray:
        laid = values[0] * Rotation.from_rotvec(values[1:4]).apply(points) + values[4:7]
        return (laid - goal).ravel()

    searched = least_squares(residuals, np.array([1.0, 0, 0, 0, 0, 0, 0]), xtol=1e-14, ftol=1e-14)
    found = np.sum((similarity_aligned(points, goal) - goal) ** 2)
    assert found == pytest.approx(2.0 * searched.cost, rel=1e-6)


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_the_disparity_is_scipys_where_no_mirroring_helps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    goal = rng.normal(0.0, 1.0, (15, 3))
    points = goal + rng.normal(0.0, 0.2, (15, 3))
    _, _, disparity = procrustes(goal, points)
    spread = np.sum((goal - goal.mean(axis=0)) ** 2)
    assert np.sum((similarity_aligned(points, goal) - goal) ** 2) / spread == pytest.approx(
        disparity, rel=1e-9
    )


def test_mirroring_is_not_used() -> None:
    goal = np.random.default_rng(8).normal(0.0, 300.0, (15, 3))
    mirrored = goal * np.array([-1.0, 1.0, 1.0])
    assert np.linalg.norm(similarity_aligned(mirrored, goal) - goal, axis=1).mean() > 30.0
    assert procrustes(goal, mirrored)[2] < 1e-12  # scipy's may mirror, so the case is a hard one


def test_points_on_one_place_are_only_moved() -> None:
    goal = np.random.default_rng(9).normal(0.0, 300.0, (4, 3))
    np.testing.assert_allclose(similarity_aligned(np.ones((4, 3)), goal), np.tile(goal.mean(axis=0), (4, 1)))


def test_root_alignment_moves_and_does_not_turn() -> None:
    goal = np.random.default_rng(10).normal(0.0, 300.0, (5, 3))
    np.testing.assert_allclose(moved_to_root(goal + np.array([5.0, -7.0, 9.0]), goal, 2), goal)


@pytest.mark.parametrize(("how", "scale"), [(RIGID, 1.0), (SIMILARITY, 1000.0)])
def test_a_truth_of_another_world_is_laid_on_the_run_by_one_motion(how: str, scale: float) -> None:
    rng = np.random.default_rng(11)
    found = rng.normal(0.0, 300.0, (6, 5, 3))
    turn = Rotation.random(random_state=11).as_matrix()
    truth = (found @ turn.T + rng.normal(0.0, 500.0, 3)) / scale
    seen = np.ones((6, 5), dtype=bool)
    seen[2, 3] = False
    truth[2, 3] = np.nan
    laid, words = laid_on(truth, found, seen, how)
    np.testing.assert_allclose(laid[seen], found[seen], atol=1e-6)
    assert "6 frames" in words
    assert "29 points" in words
    assert ("scaled by 1000" in words) == (how == SIMILARITY)


def test_a_rigid_motion_does_not_hide_a_wrong_size() -> None:
    found = np.random.default_rng(12).normal(0.0, 300.0, (6, 5, 3))
    laid, _ = laid_on(0.5 * found, found, np.ones((6, 5), dtype=bool), RIGID)
    assert np.linalg.norm(laid - found, axis=2).mean() > 100.0


def test_points_on_a_line_cannot_be_laid() -> None:
    line = np.linspace(0.0, 1.0, 5)[None, :, None] * np.array([1.0, 2.0, 3.0])
    for points in (line, line[:, :2]):
        with pytest.raises(TruthError, match="line"):
            laid_on(points, points, np.ones(points.shape[:2], dtype=bool), RIGID)
