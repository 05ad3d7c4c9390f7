"""Thresholds of sums of squared distances against scipy's distribution and against drawn samples."""

import numpy as np
import pytest
from scipy.stats import chi2

from studio.evidence.volume.chi_square import fitted_thresholds, thresholds


@pytest.mark.parametrize("alpha", [0.5, 0.9, 0.99, 0.9999])
def test_thresholds_are_those_of_the_distribution(alpha: float) -> None:
    expected = chi2.ppf(alpha, df=3 * np.arange(1, 61))
    np.testing.assert_allclose(thresholds(60, alpha), expected, rtol=1e-9)


@pytest.mark.parametrize("most", [10, 30, 60])
def test_a_polynomial_of_second_order_is_near_them(most: int) -> None:
    polynomial = fitted_thresholds(most, 0.99)
    samples = np.arange(1, most + 1)
    a, b, c = polynomial.coefficients
    np.testing.assert_allclose(polynomial(samples), a + b * samples + c * samples**2)
    assert np.max(np.abs(polynomial(samples) / chi2.ppf(0.99, 3 * samples) - 1.0)) < 0.09
    assert polynomial.single == pytest.approx(chi2.ppf(0.99, 3))


def test_sums_of_background_pixels_stay_below_at_the_given_rate() -> None:
    rng = np.random.default_rng(0)
    for count in (1, 4, 20):
        sums = (rng.normal(size=(40_000, count, 3)) ** 2).sum(axis=(1, 2))
        assert np.mean(sums <= thresholds(count, 0.99)[-1]) == pytest.approx(0.99, abs=0.002)


def test_few_samples_still_make_a_polynomial() -> None:
    assert fitted_thresholds(1, 0.99)(1.0) == pytest.approx(chi2.ppf(0.99, 3), rel=1e-6)
