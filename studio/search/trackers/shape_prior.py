"""Prior of a body's size: published proportions, and the height as reported.

A shape (`body.shape_space`) is a few logarithms. Lengths vary by a common factor (tall and short people) and each on
its own; radii each on its own. The reported height has a Cauchy distribution of the reported deviation: a report that
is off by many deviations costs little more than one off by a few, so that silhouettes overrule it. (A real man of 1.72
m, reported as 1.80 m: 1.77 m with a Student's t of three degrees of freedom, 1.76 m with Cauchy's, 1.75 m from his
silhouettes alone; for people whose height was reported within 3 cm both give the same.)

Flesh off the bone (offsets) has its spread up to FARTHEST, and a wall there: silhouettes hardly tell hair behind a head
from a head before its hair, and a fit once put hair five spreads behind a head that was 52 mm before the true one.
"""

from dataclasses import dataclass

import numpy as np

from studio.body.scale import rest_height
from studio.body.shape_space import OFFSET_SIGMA, ShapeSpace
from studio.body.subject import REPORTED_SPREAD
from studio.foundations.arrays import Array

STEP = 1e-4
FARTHEST, WALL = 3.0, 25.0
"""Standard deviations of an offset from which on it is held, and by what the square of those beyond counts (-2 log)."""


@dataclass(frozen=True, slots=True)
class ShapeSpreads:
    """Standard deviations: of each length and each radius as shares (uniform within ±10 % is 0.058), of the factor
    common to all lengths, of the height in mm.
    """

    length: float = 0.06
    radius: float = 0.15
    size: float = 0.05
    height: float = REPORTED_SPREAD


class ShapePrior:
    """The prior of shapes of a space. height : mm, of the standing body, None where it is not known."""

    def __init__(self, space: ShapeSpace, spreads: ShapeSpreads, height: float | None) -> None:
        is_length = np.array([group.kind == "length" for group in space.groups])
        of_kind = {"length": spreads.length, "radius": spreads.radius, "offset": OFFSET_SIGMA}
        self.sigma = np.array([of_kind.get(group.kind, group.spread) for group in space.groups])
        """(S,) standard deviations without the common factor."""
        self._is_offset = np.array([group.kind == "offset" for group in space.groups])
        together = np.where(is_length, spreads.size, 0.0)
        self._precision = np.linalg.inv(np.diag(np.square(self.sigma)) + np.outer(together, together))
        self._height, self._spread = height, spreads.height
        self._own_height, self._slope = height_of(space)

    def log(self, shapes: Array) -> Array:
        """(M,) log-densities of shapes (M, S), up to a constant."""
        found = -0.5 * np.einsum("ms,st,mt->m", shapes, self._precision, shapes)
        found -= 0.5 * WALL * np.square(self._beyond(shapes)).sum(axis=1)
        if self._height is not None:
            away = self._away(shapes)
            found -= 0.5 * np.log1p(np.square(away))
        return found

    def equations(self, shape: Array) -> tuple[float, Array, Array]:
        """-2 log of a shape (S,), and the Gauss-Newton gradient (S,) and matrix (S, S) of half of it."""
        pull, matrix = self._precision @ shape, self._precision.copy()
        beyond = self._beyond(shape)
        loss = float(shape @ pull + WALL * beyond @ beyond)
        pull += WALL * beyond / self.sigma
        matrix += np.diag(np.where(beyond != 0.0, WALL / np.square(self.sigma), 0.0))
        if self._height is not None:
            away, slope = float(self._away(shape)), self._slope / self._spread
            eased = 1.0 + away * away
            loss += float(np.log(eased))
            pull = pull + slope * away / eased
            matrix += np.outer(slope, slope) / eased
        return loss, pull, matrix

    def height(self, shape: Array) -> float:
        """Standing height of a shape (S,), mm."""
        return float(self._own_height + shape @ self._slope)

    def _beyond(self, shapes: Array) -> Array:
        """(..., S) by how many standard deviations offsets of shapes (..., S) lie beyond FARTHEST, 0 within it."""
        away = shapes / self.sigma
        return np.where(self._is_offset, away - np.clip(away, -FARTHEST, FARTHEST), 0.0)

    def _away(self, shapes: Array) -> Array:
        """(M,) deviations from the reported height, in its standard deviation."""
        reported = 0.0 if self._height is None else self._height
        return (self._own_height + shapes @ self._slope - reported) / self._spread


def height_of(space: ShapeSpace) -> tuple[float, Array]:
    """The height of the rest pose (which stands on the floor), mm, and its slope (S,) over the shape."""

    def height(shape: Array) -> float:
        return rest_height(space.body_of(shape))

    size = len(space.groups)
    own = height(np.zeros(size))
    return own, np.array([(height(STEP * unit) - own) / STEP for unit in np.eye(size)])
