"""Ways that change direction: straight stretches, bends and turns on the spot, one after the other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]

GRID_MM = 5.0
LONG_ENOUGH_MM = 3000.0


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of a way. length : mm that would be walked at full speed in its time. turn : radians to the left while
    it lasts. onward : share of the speed that is left, 0 while turning on the spot.
    """

    length: float
    turn: float = 0.0
    onward: float = 1.0


class Journey:
    """A way made of stretches, straight on before the first and after the last: a `gait.Path` with a pace.

    start : mm; heading : radians, both where the first stretch begins. ease : mm over which one stretch goes over
    into the next (standard deviation of the smoothing).
    """

    def __init__(
        self, start: tuple[float, float], heading: float, stretches: tuple[Stretch, ...], ease: float
    ) -> None:
        total = sum(stretch.length for stretch in stretches)
        self._grid = np.arange(-LONG_ENOUGH_MM, total + LONG_ENOUGH_MM, GRID_MM)
        middles = self._grid + 0.5 * GRID_MM
        onward, rate, begin = np.ones_like(middles), np.zeros_like(middles), 0.0
        for stretch in stretches:
            inside = (middles >= begin) & (middles < begin + stretch.length)
            onward[inside] = stretch.onward
            # Spread over the cells that there are, so that the turn is whole whatever the grid.
            rate[inside] = stretch.turn / (GRID_MM * max(np.count_nonzero(inside), 1))
            begin += stretch.length
        self._onward: Array = gaussian_filter1d(onward, ease / GRID_MM, mode="nearest")
        rate = gaussian_filter1d(rate, ease / GRID_MM, mode="nearest")
        zero = int(np.searchsorted(self._grid, 0.0))
        turned = np.concatenate([[0.0], np.cumsum(rate[:-1] * GRID_MM)])
        self._heading: Array = heading + turned
        middle_heading = self._heading + 0.5 * rate * GRID_MM
        steps = (
            GRID_MM
            * self._onward[:, None]
            * np.stack([np.cos(middle_heading), np.sin(middle_heading)], axis=-1)
        )
        place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps[:-1], axis=0)])
        self._place: Array = place - place[zero] + np.array(start)

    def __call__(self, distance: Array) -> tuple[Array, Array]:
        """Position (F, 2) and heading (F,) after a distance (F,) that full speed would have covered, mm."""
        return (
            np.stack([np.interp(distance, self._grid, self._place[:, axis]) for axis in (0, 1)], axis=-1),
            np.interp(distance, self._grid, self._heading),
        )

    def pace(self, distance: Array) -> Array:
        """(F,) the share of full speed there."""
        return np.interp(distance, self._grid, self._onward)
