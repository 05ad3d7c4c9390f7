"""Eq. 5: threshold of a sum of squared Mahalanobis distances of background pixels.

Each of k background pixels contributes a χ² variable of 3 degrees of freedom (three colours), so their sum follows
χ² with 3 k. Thresholds come from the inverse of that distribution and, as in the paper, from a polynomial of
second order in k fitted to them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from studio.foundations.arrays import Array

COLOURS = 3


def thresholds(most_samples: int, alpha: float) -> Array:
    """(most_samples,) T_k(alpha) for k = 1 to most_samples: P(χ²(3 k) <= T_k) = alpha."""
    degrees = COLOURS * np.arange(1, most_samples + 1, dtype=np.float64)
    return np.asarray(chdtri(degrees, 1.0 - alpha), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class ThresholdPolynomial:
    """T_k ≈ a + b k + c k². coefficients : (3,) a, b, c. single : T_1 itself, for one sample (Eq. 6)."""

    coefficients: Array
    single: float

    def __call__(self, samples: Array | float) -> Array | float:
        """T of a number of samples, or of many."""
        a, b, c = self.coefficients
        return a + samples * (b + samples * c)


def fitted_thresholds(most_samples: int, alpha: float) -> ThresholdPolynomial:
    """The polynomial with the least squared relative error for k = 1 to most_samples (at least 3)."""
    exact = thresholds(max(most_samples, 3), alpha)
    samples = np.arange(1, len(exact) + 1, dtype=np.float64)
    powers = np.stack([np.ones_like(samples), samples, samples**2], axis=1)
    coefficients = np.linalg.lstsq(powers / exact[:, None], np.ones(len(exact)), rcond=None)[0]
    return ThresholdPolynomial(np.asarray(coefficients, dtype=np.float64), float(exact[0]))
