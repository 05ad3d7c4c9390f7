"""A path through F poses that fits every frame's targets and is steady: damped Gauss-Newton steps over all frames.

The equations couple a frame to the two before and after it alone, so they are solved as one banded system.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.search.trackers.banded_solving import solve_banded

DAMPING, LARGEST_DAMPING, SETTLED = 1e-3, 1e4, 1e-5
HELD, LEAST_PIVOT = 1e12, 1e-12


@dataclass(frozen=True, slots=True)
class Steadiness:
    """Costs of unsteadiness, in the residuals' unit (mm) for a unit (radian) from frame to frame.

    acceleration : of the second difference. speed : of the first. rest : of the distance from the rest pose.
    """

    acceleration: float
    speed: float
    rest: float

    def times(self, factor: float) -> "Steadiness":
        """The costs of changes times a factor; that of the distance from rest unchanged."""
        return Steadiness(factor * self.acceleration, factor * self.speed, self.rest)

    def at_rate(self, ratio: float) -> "Steadiness":
        """The costs that give the same for an angle's motion in time at `ratio` times as many frames a second."""
        return Steadiness(ratio**2 * self.acceleration, ratio * self.speed, self.rest)


class SmoothPath:
    """Paths (F, D) within lower, upper (D,).

    slopes(path) -> (J'J (F, D, D), J'r (F, D)) of the frames' own residuals; costs(path) -> their sums of squares (F,).
    """

    def __init__(
        self,
        slopes: Callable[[Array], tuple[Array, Array]],
        costs: Callable[[Array], Array],
        lower: Array,
        upper: Array,
        rest: Array,
        steadiness: Steadiness,
    ) -> None:
        self._slopes, self._own_costs = slopes, costs
        self._lower, self._upper, self._rest, self._steadiness = lower, upper, rest, steadiness

    def refined(self, path: Array, steps: int) -> Array:
        """The path after at most so many steps, each of which lowers the cost."""
        damping, now, bands = DAMPING, self._cost(path), self._bands(len(path))
        step = 0
        while step < steps and damping < LARGEST_DAMPING:
            normal, right = self._slopes(path)
            slope = right + self._steady_slope(path)
            held = ((path <= self._lower) & (slope > 0.0)) | ((path >= self._upper) & (slope < 0.0))
            settled = False
            while step < steps and damping < LARGEST_DAMPING:
                step += 1
                move = _solved(normal, bands, np.where(held, 0.0, -slope), held, damping)
                candidate = np.clip(path + move, self._lower, self._upper)
                then = self._cost(candidate)
                if then < now:
                    settled = now - then < SETTLED * now
                    path, now, damping = candidate, then, 0.2 * damping
                    break
                damping *= 10.0
            if settled:
                break
        return path

    def _cost(self, path: Array) -> float:
        own, weights = float(self._own_costs(path).sum()), self._steadiness
        own += weights.acceleration**2 * float((np.diff(path, 2, axis=0) ** 2).sum())
        own += weights.speed**2 * float((np.diff(path, axis=0) ** 2).sum())
        return own + weights.rest**2 * float(((path - self._rest) ** 2).sum())

    def _steady_slope(self, path: Array) -> Array:
        weights = self._steadiness
        slope = weights.rest**2 * (path - self._rest)
        for order, weight in ((1, weights.speed), (2, weights.acceleration)):
            if len(path) > order:
                slope += weight**2 * _transposed_difference(np.diff(path, order, axis=0), order)
        return slope

    def _bands(self, count: int) -> Array:
        """(3, F) coefficients that couple frame t to frames t, t + 1, t + 2, the same for every parameter."""
        weights, bands = self._steadiness, np.zeros((3, count))
        bands[0] += weights.rest**2
        for order, weight, stencil in (
            (1, weights.speed, (-1.0, 1.0)),
            (2, weights.acceleration, (1.0, -2.0, 1.0)),
        ):
            for first in range(order + 1):
                for second in range(first, order + 1):
                    at = slice(first, count - order + first)
                    if count > order:
                        bands[second - first, at] += weight**2 * stencil[first] * stencil[second]
        return bands


def _transposed_difference(values: Array, order: int) -> Array:
    """The transpose of np.diff along frames, `order` times."""
    for _ in range(order):
        edge = np.zeros((1, values.shape[1]))
        values = np.concatenate([edge, values]) - np.concatenate([values, edge])
    return values


def _solved(normal: Array, bands: Array, right: Array, held: NDArray[np.bool_], damping: float) -> Array:
    """(F, D) solving (normal on the diagonal + steadiness + damping) move = right; held entries do not move."""
    count, width = right.shape
    reach = max(min(2, count - 1) * width, width - 1)
    lower = np.zeros((count * width, reach + 1))
    for row in range(width):
        for column in range(row + 1):
            lower[row::width, reach + column - row] = normal[:, row, column]
    lower[:, reach] *= 1.0 + damping
    for steps in range(min(3, count)):
        coupling = np.repeat(bands[steps, : count - steps], width)
        lower[steps * width :, reach - steps * width] += coupling
    lower[:, reach] += np.where(held.ravel(), HELD, 0.0)
    return solve_banded(lower, right.ravel(), LEAST_PIVOT).reshape(count, width)
