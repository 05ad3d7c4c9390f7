"""The banded solver against scipy's."""

import numpy as np
import pytest
from scipy.linalg import solveh_banded

from studio.search.trackers.banded_solving import solve_banded


@pytest.mark.parametrize(("count", "reach"), [(1, 0), (5, 4), (60, 1), (200, 17)])
def test_solution_is_scipys(count: int, reach: int) -> None:
    rng = np.random.default_rng(count)
    factor = np.tril(np.triu(rng.normal(size=(count, count)), -reach)) + 4.0 * np.eye(count)
    matrix, right = factor @ factor.T, rng.normal(size=count)
    lower, bands = np.zeros((count, reach + 1)), np.zeros((reach + 1, count))
    for off in range(reach + 1):
        diagonal = np.diagonal(matrix, -off)
        lower[off:, reach - off] = diagonal
        bands[off, : count - off] = diagonal
    wanted = solveh_banded(bands, right, lower=True)
    np.testing.assert_allclose(solve_banded(lower, right), wanted, rtol=1e-9, atol=1e-12)


def test_indefinite_matrices_are_refused_or_pivots_raised() -> None:
    singular = np.array([[0.0, 4.0], [4.0, 4.0]])
    with pytest.raises(FloatingPointError):
        solve_banded(singular.copy(), np.ones(2))
    assert np.isfinite(solve_banded(singular.copy(), np.ones(2), least=1e-12)).all()
