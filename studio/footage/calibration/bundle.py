"""Bundle adjustment: all cameras and all boards at once, with a robust loss and a sparse Jacobian."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix, lil_matrix

from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.projection import distorted

LOSS_PX = 1.0
POSE, LENS = 6, 4
FOCAL_PRIOR, CENTRE_PRIOR = 0.005, 0.004
"""A lens that is refined may move by about this share of its focal length, its centre by this share of it."""
MOST_EVALUATIONS = 60
INNER_TOLERANCE, INNER_STEPS = 1e-10, 2000
"""Of the linear solver within a step; scipy's loose default costs three times the steps in all."""


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Corners as seen. camera, moment : (N,) indices. points : (N, 3) on the board, mm. pixels : (N, 2)."""

    camera: Indices
    moment: Indices
    points: Array
    pixels: Array

    def only(self, chosen: NDArray[np.bool_]) -> "Observations":
        """Those with a true entry in (N,)."""
        return Observations(
            self.camera[chosen], self.moment[chosen], self.points[chosen], self.pixels[chosen]
        )


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """The unknowns, as rotation vectors and translations (mm).

    cameras : (C, 6) camera_from_world; the first is fixed. boards : (M, 6) world_from_board. lenses : (C, 9) fx, fy,
    cx, cy, k1, k2, p1, p2, k3.
    """

    cameras: Array
    boards: Array
    lenses: Array


def rotated(vectors: Array, points: Array) -> Array:
    """(N, 3) points turned by (N, 3) rotation vectors (Rodrigues' formula)."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    axis = vectors / np.maximum(angle, 1e-12)
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.sum(axis * points, axis=1, keepdims=True)
    return cosine * points + sine * np.cross(axis, points) + (1.0 - cosine) * along * axis


def predicted(bundle: Bundle, seen: Observations) -> Array:
    """(N, 2) pixels where the corners should be."""
    board, camera = bundle.boards[seen.moment], bundle.cameras[seen.camera]
    world = rotated(board[:, :3], seen.points) + board[:, 3:]
    local = rotated(camera[:, :3], world) + camera[:, 3:]
    depth = np.maximum(local[:, 2], 1.0)
    x, y = local[:, 0] / depth, local[:, 1] / depth
    fx, fy, cx, cy, *lens = bundle.lenses[seen.camera].T
    across, down, _ = distorted(x, y, lens)
    return np.column_stack([fx * across + cx, fy * down + cy])


def errors_of(bundle: Bundle, seen: Observations) -> Array:
    """(N,) pixels between seen and predicted."""
    return np.linalg.norm(predicted(bundle, seen) - seen.pixels, axis=1)


def adjusted(start: Bundle, seen: Observations, refine_lenses: bool = False) -> Bundle:
    """The least robust residual (soft L1, one pixel) from a start.

    refine_lenses : let focal length, aspect, centre move a little too, held by a prior of half a percent.
    """
    layout = _Layout(len(start.cameras), len(start.boards), refine_lenses)
    problem = _Problem(start, seen, layout)
    solved = least_squares(
        problem.residuals,
        layout.packed(start),
        jac_sparsity=_sparsity(seen, layout),
        loss="soft_l1",
        f_scale=LOSS_PX,
        x_scale="jac",
        method="trf",
        ftol=1e-9,
        xtol=1e-10,
        max_nfev=MOST_EVALUATIONS,
        tr_options={"atol": INNER_TOLERANCE, "btol": INNER_TOLERANCE, "maxiter": INNER_STEPS},
    )
    return layout.unpacked(solved.x, start)


@dataclass(frozen=True, slots=True)
class _Layout:
    """Where each unknown lies: cameras but the first, boards, then lenses (fx, fy, cx, cy) where they are free."""

    cameras: int
    boards: int
    lenses: bool

    @property
    def count(self) -> int:
        return POSE * (self.cameras - 1 + self.boards) + (LENS * self.cameras if self.lenses else 0)

    def packed(self, bundle: Bundle) -> Array:
        parts = [bundle.cameras[1:].ravel(), bundle.boards.ravel()]
        return np.concatenate([*parts, bundle.lenses[:, :LENS].ravel()] if self.lenses else parts)

    def unpacked(self, values: Array, start: Bundle) -> Bundle:
        first = POSE * (self.cameras - 1)
        last = first + POSE * self.boards
        cameras = np.vstack([start.cameras[:1], values[:first].reshape(-1, POSE)])
        boards = values[first:last].reshape(-1, POSE)
        if not self.lenses:
            return Bundle(cameras, boards, start.lenses)
        lenses = start.lenses.copy()
        lenses[:, :LENS] = values[last:].reshape(-1, LENS)
        return Bundle(cameras, boards, lenses)


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    start: Bundle
    seen: Observations
    layout: _Layout

    def residuals(self, values: Array) -> Array:
        bundle = self.layout.unpacked(values, self.start)
        off = (predicted(bundle, self.seen) - self.seen.pixels).ravel()
        if not self.layout.lenses:
            return off
        focal = self.start.lenses[:, :1]
        scale = focal * np.array([FOCAL_PRIOR, FOCAL_PRIOR, CENTRE_PRIOR, CENTRE_PRIOR])
        moved = (bundle.lenses[:, :LENS] - self.start.lenses[:, :LENS]) / scale
        return np.concatenate([off, moved.ravel()])


def _sparsity(seen: Observations, layout: _Layout) -> csr_matrix:
    """Which residual depends on which unknown."""
    corners = 2 * len(seen.camera)
    priors = LENS * layout.cameras if layout.lenses else 0
    pattern = lil_matrix((corners + priors, layout.count), dtype=np.int8)
    rows = np.arange(corners)
    camera, moment = np.repeat(seen.camera, 2), np.repeat(seen.moment, 2)
    moved = camera > 0
    first = POSE * (layout.cameras - 1)
    last = first + POSE * layout.boards
    for column in range(POSE):
        pattern[rows[moved], POSE * (camera[moved] - 1) + column] = 1
        pattern[rows, first + POSE * moment + column] = 1
    for column in range(LENS if layout.lenses else 0):
        pattern[rows, last + LENS * camera + column] = 1
    if priors:
        pattern[corners + np.arange(priors), last + np.arange(priors)] = 1
    return csr_matrix(pattern)


def kept_inliers(bundle: Bundle, seen: Observations, limit_px: float) -> tuple[Observations, int]:
    """The corners whose view, as a whole, fits within `limit_px` (root mean square), and how many views do not."""
    views = seen.camera * len(bundle.boards) + seen.moment
    errors = errors_of(bundle, seen) ** 2
    names, place = np.unique(views, return_inverse=True)
    rms = np.sqrt(np.bincount(place, errors) / np.bincount(place))
    return seen.only(rms[place] <= limit_px), int(np.count_nonzero(rms > limit_px) if len(names) else 0)
