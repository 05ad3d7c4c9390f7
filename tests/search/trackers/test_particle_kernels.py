"""The passes over small sets are NumPy's own calls, bit for bit."""

import numpy as np
import pytest

from studio.search.trackers.particle_kernels import children, drawn, moments, root_of, standardised

SHAPES = [(1, 3), (2, 2), (7, 1), (33, 40), (100, 31), (2000, 7)]


@pytest.mark.parametrize(("count", "size"), SHAPES)
def test_moments(count: int, size: int) -> None:
    rng = np.random.default_rng(count)
    poses = rng.normal(rng.normal(0.0, 1000.0, size), rng.exponential(10.0, size), (count, size))
    if size > 1:  # NumPy adds a single column in pairs
        assert np.array_equal(moments(poses).mean, poses.mean(axis=0))
        assert np.array_equal(moments(poses).variance, poses.var(axis=0))
    assert np.allclose(moments(poses).mean, poses.mean(axis=0))
    assert np.allclose(moments(poses).variance, poses.var(axis=0))


@pytest.mark.parametrize("count", [1, 2, 33, 1000])
def test_drawn(count: int) -> None:
    rng = np.random.default_rng(count)
    weights = rng.exponential(size=count) * (rng.random(count) < 0.7)
    weights[count // 2] = 1.0
    for marks in (rng.random(500), (np.arange(count) + rng.random()) / count, np.array([0.0, 1.0 - 1e-16])):
        cumulated = np.cumsum(weights)
        cumulated /= cumulated[-1]
        found = np.searchsorted(cumulated, marks, side="right")
        assert np.array_equal(drawn(weights, marks), np.minimum(found, np.flatnonzero(weights)[-1]))


@pytest.mark.parametrize("limbs", [[1, 2, 3, 4, 5], [1, 1, 2, 2, 2, 3, 4, 4], [1]])
def test_children(limbs: list[int]) -> None:
    rng, place = np.random.default_rng(3), np.array(limbs)
    first, second = rng.normal(size=(2, 300, len(place)))
    chosen, shares = rng.random(300) < 0.5, rng.random((300, 2))
    cuts = np.sort(1 + np.floor(shares * place[-1]).astype(np.int64), axis=1)
    taken = (place > cuts[:, :1]) & (place <= cuts[:, 1:]) & chosen[:, None]
    made, crossed = children(first, second, place, chosen, shares)
    assert np.array_equal(made, np.where(taken, second, first))
    assert np.array_equal(crossed, taken.any(axis=1))


def test_what_a_root_makes_of_rows_is_undone_in_the_directions_that_vary() -> None:
    rng = np.random.default_rng(2)
    drawn = rng.normal(size=(40, 4))
    drawn[:, 2] = 0.0
    root = root_of(drawn.T @ drawn / 40.0)
    standard = rng.normal(size=(6, 4))
    standard[:, 2] = 0.0
    np.testing.assert_allclose(standardised(root, standard @ root.T), standard, atol=1e-12)
    assert not standardised(root, np.ones((3, 4)))[:, 2].any()
