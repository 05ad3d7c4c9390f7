"""Local refinement of many frames at once, coupled by a penalty on accelerations.

What one frame's silhouettes leave open (a shoulder beside the neck, how far the trunk leans towards a camera, the twist
of a straight arm) the frames before and after often show. So the losses of `refinement` are summed over the frames of a
stretch and the accelerations of the body's points are added:

    Σ_t loss(x_t) + w Σ_t Σ_j |p_j(x_t-1) - 2 p_j(x_t) + p_j(x_t+1)|²,    w = (σ_r / σ_a)²

p_j are the two ends of every limb and a point at its side, which shows its twist; so it does not matter by which
angles a pose is written. σ_a is a usual acceleration over three frames, σ_r the deviation of a border point's residual.
Gauss-Newton on all poses together, damped as Levenberg and Marquardt do; its equations are banded, as a frame meets
only two on each side. Long stretches are solved in windows, the last poses of one held still in the next. Each window
begins with a stiffer movement, so that frames in neighbouring valleys come into one before details count.

The papers name a local search as further work; this is one for whole movements, in the manner of B. Triggs, P.
McLauchlan, R. Hartley and A. Fitzgibbon, "Bundle adjustment - a modern synthesis" (1999).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.search.trackers.banded_solving import solve_banded
from studio.search.trackers.refinement import (
    DAMPING,
    DIFFERENCE,
    EASED,
    MOST_DAMPING,
    TIGHTENED,
    FrameLoss,
    Refiner,
)

WINDOW, OVERLAP = 40, 12
"""Frames that are solved together, and how many of them are solved again in the next window."""
HELD = 2
"""Frames before a window that fix its beginning."""
RESIDUAL_MM = 150.0
"""σ_r: errors of neighbouring border points are correlated (flesh is no cone), so a single one has little weight."""
SIDE_MM = 100.0
"""mm from a limb's axis to the point that shows its twist."""
STIFFER = (30.0, 5.0, 1.0)
"""Factors of w in successive rounds."""
ENOUGH = 1e-4
"""A share of the loss; a step that gains less ends a round."""
CHANGE = np.array([1.0, -2.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Frames that follow each other. starts : (F, D) poses to begin with. losses : of the frames. held : (0 to 2, D)
    poses of the frames before, kept fixed.
    """

    starts: Array
    losses: Sequence[FrameLoss]
    held: Array


class MovementRefiner:
    """Refines the poses of frames that follow each other."""

    def __init__(self, refiner: Refiner, fps: float, acceleration: float) -> None:
        """refiner : what is to stay as it is stays. acceleration : σ_a, m/s², above 0."""
        self._refiner, self._body = refiner, refiner.body
        usual = acceleration * 1000.0 / fps**2
        self._weight = (RESIDUAL_MM / usual) ** 2 / len(body_points(self._body, refiner.body.neutral)[0])

    def refine(self, window: Window) -> Array:
        """The window's poses (F, D) refined."""
        poses = window.starts.copy()
        for stiffer in STIFFER:
            poses = self._descended(poses, window, stiffer * self._weight)
        return poses

    def _descended(self, poses: Array, window: Window, weight: float) -> Array:
        refiner, damping = self._refiner, DAMPING
        here = self.equations(poses, window, weight)
        for _ in range(refiner.settings.refinement_steps):
            if damping > MOST_DAMPING:
                break
            offered = self._stepped(poses, here, damping)
            there = self.equations(offered, window, weight)
            gained = here.loss - there.loss
            if gained >= 0.0:
                poses, here, damping = offered, there, damping * EASED
                if gained < ENOUGH * here.loss:
                    break
            else:
                damping *= TIGHTENED
        return poses

    def equations(self, poses: Array, window: Window, weight: float) -> "MovementEquations":
        """Loss, gradient and the blocks of its matrix."""
        count, size = poses.shape
        loss, gradient = 0.0, np.zeros((count, size))
        blocks = np.zeros((3, count, size, size))
        for t, (pose, of_frame) in enumerate(zip(poses, window.losses, strict=True)):
            own, gradient[t], blocks[0, t] = of_frame(pose)
            loss += own
        points, slopes = self._points(np.concatenate([window.held, poses]))
        held = len(window.held)
        for first in range(len(points) - 2):
            change = weight * np.tensordot(CHANGE, points[first : first + 3], axes=1)
            loss += float(change @ change) / weight
            moving = [k for k in range(3) if first + k >= held]
            for k in moving:
                t = first + k - held
                gradient[t] += CHANGE[k] * (slopes[first + k].T @ change)
                for earlier in moving:
                    if earlier <= k:
                        both = slopes[first + k].T @ slopes[first + earlier]
                        blocks[k - earlier, t] += weight * CHANGE[k] * CHANGE[earlier] * both
        return MovementEquations(loss, gradient, blocks)

    def _points(self, poses: Array) -> tuple[Array, Array]:
        """The body's points of poses, (F, P), and their slopes, (F, P, D) per unit of each parameter."""
        unit, size = self._refiner.unit, poses.shape[1]
        steps = DIFFERENCE * np.diag(unit)
        moved = np.concatenate([poses[:, None] + steps, poses[:, None] - steps], axis=1)
        points = body_points(self._body, moved.reshape(-1, size)).reshape(len(poses), 2, size, -1)
        slopes = (points[:, 0] - points[:, 1]) / (2.0 * DIFFERENCE)
        return body_points(self._body, poses), np.swapaxes(slopes, 1, 2)

    def _stepped(self, poses: Array, here: "MovementEquations", damping: float) -> Array:
        """One damped step inside the limits; parameters that press against a limit stay there."""
        refiner, (count, size) = self._refiner, poses.shape
        held = ((poses <= refiner.lower) & (here.gradient > 0.0)) | (
            (poses >= refiner.upper) & (here.gradient < 0.0)
        )
        held |= refiner.still
        free = np.where(held, 0.0, 1.0)
        diagonal = np.einsum("tii->ti", here.blocks[0])
        lift = damping * diagonal + 1e-9 * diagonal.mean() + 1e-12
        rows = np.zeros((count * size, 3 * size))
        for apart in range(3):
            for t in range(apart, count):
                block = here.blocks[apart, t] * free[t][:, None] * free[t - apart]
                if apart == 0:
                    block = block + np.diag(lift[t] * free[t] + held[t])
                place_block(rows, block, t * size, (t - apart) * size)
        step = solve_banded(rows, -(here.gradient * free).ravel())
        moved = np.clip(poses + step.reshape(count, size) * refiner.unit, refiner.lower, refiner.upper)
        return np.where(refiner.still, poses, moved)


@dataclass(frozen=True, slots=True, eq=False)
class MovementEquations:
    """loss. gradient : (F, D) of half of it. blocks : (3, F, D, D), that of frames t and t - k at [k, t]."""

    loss: float
    gradient: Array
    blocks: Array


def windows(count: int) -> list[tuple[int, int, int]]:
    """Windows of `count` frames: first frame, one past the last, one past the last that is kept."""
    found, first = list[tuple[int, int, int]](), 0
    while first < count:
        after = min(first + WINDOW, count)
        kept = count if after == count else after - OVERLAP
        found.append((first, after, kept))
        first = kept
    return found


def body_points(body: BodyModel, poses: Array) -> Array:
    """Of poses (N, D) the points by which movement is measured, (N, P) mm: a limb's ends and one at its side."""
    frames = limb_frames(body, poses)
    length = kinematic_tables(body).limb_shape[:, :1]
    middle, side = frames[..., 3] + 0.5 * length * frames[..., 2], SIDE_MM * scale_of(body)
    points = np.stack(
        [frames[..., 3], frames[..., 3] + length * frames[..., 2], middle + side * frames[..., 0]], axis=2
    )
    return points.reshape(len(points), -1)


def place_block(rows: Array, block: Array, row: int, column: int) -> None:
    """Put the lower half of a block (D, D) that begins at (row, column) of a matrix into that matrix's rows, as
    `solve_banded` wants them.
    """
    i, j = np.mgrid[row : row + len(block), column : column + len(block)]
    below = i >= j
    rows[i[below], (j - i + rows.shape[1] - 1)[below]] = block[below]
