"""Some parameters of a pose fitted by least squares (trust region, scipy), limits kept."""

from collections.abc import Callable

import numpy as np
import scipy.optimize

from studio.foundations.arrays import Array, Indices

DIFFERENCE = 1e-5
"""Step of the central differences, of scaled parameters."""


def fitted_parameters(
    pose: Array,
    free: Indices,
    scale: Array,
    begin: Array,
    limits: tuple[Array, Array],
    offsets: Callable[[Array], Array],
    pulled: Callable[[Array], Array],
    pull: Array,
    *,
    most: int,
    tolerance: float = 1e-8,
) -> tuple[Array, float]:
    """The pose (D,) with its `free` parameters (P,) at the least squares, and half the sum of squares that remains.

    scale, begin, limits : (P,) of the free ones; begin and limits in units of the scale, begin strictly inside.
    offsets : residuals (N, K) of poses (N, D). pulled : further residuals (P,) of the scaled parameters, whose slopes
    are pull (P,). most : evaluations. tolerance : of steps and cost.
    """

    def placed(values: Array) -> Array:
        poses = np.repeat(pose[None], len(values), axis=0)
        poses[:, free] = values * scale
        return poses

    def residuals(values: Array) -> Array:
        return np.concatenate([offsets(placed(values[None]))[0], pulled(values)])

    def slopes(values: Array) -> Array:
        steps = DIFFERENCE * np.eye(len(free))
        ahead, behind = offsets(placed(values + steps)), offsets(placed(values - steps))
        return np.concatenate([(ahead - behind).T / (2.0 * DIFFERENCE), np.diag(pull)])

    answer = scipy.optimize.least_squares(
        residuals, begin, slopes, limits, max_nfev=most, xtol=tolerance, ftol=tolerance
    )
    return placed(answer.x[None])[0], float(answer.cost)


def strictly_inside(values: Array, lower: Array, upper: Array) -> Array:
    """The values as scipy wants a start: not on a limit."""
    inside = np.where(np.isfinite(upper - lower), 1e-9 * (upper - lower), 1e-9)
    return np.clip(values, lower + inside, upper - inside)
