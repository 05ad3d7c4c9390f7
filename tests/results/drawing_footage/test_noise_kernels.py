"""Hashed noise: the right spread, no pattern, the same on any number of threads."""

import numba
import numpy as np
import pytest
from scipy import stats

from studio.results.drawing_footage.noise_kernels import add_sensor_noise, hashed, value_noise


def noisy(level: float, deviation: float, stream: int) -> np.ndarray:
    picture = np.full((120, 160, 3), level, np.float32)
    out = np.zeros(picture.shape, np.uint8)
    add_sensor_noise(picture, deviation, stream, out)
    return out


def test_hashes_are_uniform_and_unlike_their_neighbours() -> None:
    grid = np.array([[hashed(x, y, 5) for x in range(80)] for y in range(80)])
    assert stats.kstest(grid.ravel(), "uniform").pvalue > 0.01
    assert abs(np.corrcoef(grid[:, :-1].ravel(), grid[:, 1:].ravel())[0, 1]) < 0.05
    assert abs(np.corrcoef(grid[:-1].ravel(), grid[1:].ravel())[0, 1]) < 0.05


def test_value_noise_is_smooth_and_takes_the_lattice_values() -> None:
    assert value_noise(3.0, -2.0, 7.0) == pytest.approx(hashed(3, -2, 7))
    walk = np.array([value_noise(0.01 * step, 0.4, -0.7) for step in range(1000)])
    assert walk.min() >= 0.0
    assert walk.max() <= 1.0
    assert np.abs(np.diff(walk)).max() < 0.02


def test_the_noise_has_the_given_deviation_at_mid_grey() -> None:
    found = noisy(127.4, 3.0, 11).astype(float)
    assert found.mean() == pytest.approx(127.4, abs=0.1)
    assert found.std() == pytest.approx(3.0, rel=0.04)
    assert noisy(20.0, 3.0, 11).std() < 0.8 * found.std()
    assert np.ptp(noisy(100.0, 0.0, 1)) == 0


def test_streams_differ_and_threads_do_not_matter() -> None:
    first = noisy(127.0, 3.0, 4)
    assert np.mean(first != noisy(127.0, 3.0, 5)) > 0.7
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        np.testing.assert_array_equal(first, noisy(127.0, 3.0, 4))
    finally:
        numba.set_num_threads(threads)
