"""Joint refinement of a body's size and its poses in a few frames: Gauss-Newton on the silhouettes' borders.

The population of `shape_search` finds the valley only: areas barely distinguish a knee ten millimetres higher from one
that is bent a little more. The border's points do: the sides of a bent limb's two cones are lines that meet at the
joint. So the residuals of `refinement` (points of the border to the outline that explains them, Geman &
McClure's loss) are minimised over one shape and all poses by Levenberg-Marquardt. Given the shape, frames are
independent, so each frame's pose is eliminated first (Schur complement; B. Triggs et al., "Bundle adjustment - a modern
synthesis", 1999, section 6) and the remaining system has the size of the shape.

Errors of neighbouring border points are correlated (flesh is no cone), so that `ALIKE` of them count as one, whose
variance is estimated from the residuals: where clothes hang loose or masks are rough, the prior has more weight. From
the same equations comes the covariance of the shape, poses integrated out.

Measured on rendered people with lengths drawn ± 10 % (`tests/search/trackers/test_shape_search.py` has the results).
Joints that bear no cone (collar-bones) move little, `HIDDEN_SPREAD`: left free, they move shoulders anywhere
inside the trunk, and upper arms are off by 18 mm instead of 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import free_ends, rigid_limbs
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.shape_silhouettes import ShapePrograms
from studio.search.trackers.floor_hold import FloorHoldOfShapes, has_floor
from studio.search.trackers.refinement import (
    DAMPING,
    DIFFERENCE,
    EASED,
    FEWEST_PIXELS,
    MM_PER_RADIAN,
    MOST_DAMPING,
    TIGHTENED,
    Distances,
    hidden_angles,
    mm_at,
)
from studio.search.trackers.refinement_kernels import normal_equations
from studio.search.trackers.shape_prior import ShapePrior

HELD = 0.5
"""Scale of the Cauchy distribution, in an angle's usual spread, that holds it where flesh may lie off the bone:
silhouettes hardly tell a nod from a head before its bone, yet who bends it far is not pulled back."""
SCALE_MM = 50.0
"""c of the loss: from this distance on a point of the border may not be body."""
ALIKE = 9.0
"""Border points that count as one: chosen so that the deviations have their nominal coverage, see
`ShapeRefiner.refine`."""
FIRST_VARIANCE = 180.0
"""mm²: initial variance of a border point's residual (flesh of rendered people against cones)."""
LEAST_VARIANCE = 10.0
ANGLE_SPREAD, HIDDEN_SPREAD = 1.0, 0.15
"""rad: deviation of bounded angles from the rest pose, of joints that bear a cone and of those that bear none."""
OUTSIDE = 0.5
"""Pixels from the centre of a border's pixel to the border."""
STEPS, ENOUGH = 60, 1e-5
"""Most steps of a descent, and the share of the loss that a step must gain."""
NO_MAP = np.zeros(1, dtype=np.float32)
HOPS, SHAKEN_SHAPE, SHAKEN_POSE, SHAKEN_PLACE = 4, 0.04, 0.05, 6.0
"""Restarts of the descent from perturbed results, and the perturbation: share, rad, mm. The edge that explains a border
point jumps, so the loss has small local minima."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedShape:
    """shape, deviation : (S,) logarithms. poses : (F, D). loss : twice the negative log-posterior. residual : mm
    at a person's size, root mean square of the border's points, outliers counted as c.
    """

    shape: Array
    deviation: Array
    poses: Array
    loss: float
    residual: float


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """A frame's border, as `normal_equations` takes it. border : (K, 4). views : (V, 7). mm, scales : (V,)."""

    border: Array
    views: NDArray[np.int64]
    mm: Array
    scales: Array


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A shape, its poses and the equations there. frames : (F, D + S, D + S). own, matrix : (S,), (S, S) of the prior.

    borders : (F,) the loss of the border's points alone, mm².
    """

    shape: Array
    poses: Array
    loss: float
    borders: Array
    gradients: Array
    frames: Array
    own: Array
    matrix: Array


class ShapeRefiner:
    """Descends to shapes of one space in some frames."""

    def __init__(
        self,
        programs: ShapePrograms,
        cameras: tuple[Camera, ...],
        silhouettes: Sequence[Sequence[Distances]],
        prior: ShapePrior,
        *,
        lengths_known: bool,
        above_floor: bool = True,
    ) -> None:
        """silhouettes : of each frame, one a camera. above_floor : poses are pulled out of the floor
        (`floor_hold`). lengths_known : the limbs' lengths are not fitted; then rigid
        hands and feet do not pull the limbs above them (`rigid_limbs`). Else only the hand shows where the forearm
        ends: without its pull the upper arms of five rendered people came out 33 mm too short on the mean, else 1.
        """
        body = programs.space.body
        self._programs, self._cameras, self._prior = programs, cameras, prior
        self._silhouettes = silhouettes
        self._projector = OutlineProjector.of_body(body, cameras)
        self._body, self._ends = body, free_ends(body)
        self._still = rigid_limbs(body) & lengths_known
        scale = scale_of(body)
        self._unit = np.where(body.angles, 1.0, MM_PER_RADIAN * scale)
        self._shaken = np.where(body.angles, SHAKEN_POSE, SHAKEN_PLACE * scale)
        self._limits = np.stack([body.lower, body.upper])
        spread = np.where(hidden_angles(body), HIDDEN_SPREAD, ANGLE_SPREAD)
        usual = np.isfinite(body.spread)
        off_bone = any(group.kind == "offset" for group in programs.space.groups)
        spread = np.where(usual, (HELD if off_bone else 1.0) * body.spread, spread)
        self.stiffness = np.where(body.bounded_angles | usual, 1.0 / np.square(spread), 0.0)
        self._eased = usual & off_bone
        self._variance = FIRST_VARIANCE
        on_floor = above_floor and has_floor(body)
        self._floor = FloorHoldOfShapes(programs.space, self._unit, DIFFERENCE) if on_floor else None

    def refine(
        self, shape: Array, poses: Array, seed: int = 0, *, others: Sequence[Array] = ()
    ) -> RefinedShape:
        """The shape and the poses, from a shape (S,) and poses (F, D) in the right valley; `others` are alternative
        poses, and each frame takes the better one.

        The deviations were checked on eleven rendered people (six whose first poses were off by 0.05 rad a joint, five
        of whom only pictures were known): 0.75 of their four limbs lay within one deviation of the truth (a normal law:
        0.68), all within two. Forearms are off by more (0.45 within one): nothing shows where a straight wrist
        is, and what a forearm lacks the hand has.
        """
        rng = np.random.default_rng(np.random.SeedSequence((seed, 0x5AC)))
        starts = [np.clip(start, *self._limits) for start in (poses, *others)]
        frames = [self._frame(pose, views) for pose, views in zip(starts[0], self._silhouettes, strict=True)]
        points = max(1, sum(len(frame.border) for frame in frames))
        self._variance = FIRST_VARIANCE
        best = self._descended(shape, starts[0], frames)
        for start in starts[1:]:
            best = self._better(best, self._descended(best.shape, start, frames), frames)
        self._variance = max(LEAST_VARIANCE, float(best.borders.sum()) / points)
        best = self._descended(best.shape, best.poses, frames)
        for _ in range(HOPS):
            moved = best.shape + SHAKEN_SHAPE * rng.normal(size=len(shape))
            turned = best.poses + self._shaken * rng.normal(size=poses.shape)
            other = self._descended(moved, np.clip(turned, *self._limits), frames)
            best = self._better(best, other, frames)
        matrix, _, _ = self._without_poses(best, 0.0)
        deviation = np.sqrt(np.diag(np.linalg.inv(matrix)))
        residual = float(np.sqrt(best.borders.sum() / points))
        return RefinedShape(best.shape, deviation, best.poses, best.loss, residual)

    def _better(self, best: _State, other: _State, frames: Sequence[_Frame]) -> _State:
        """The best of both states and of a descent from each frame's better pose."""
        taken = other.borders < best.borders
        first = other if other.loss < best.loss else best
        if taken.all() or not taken.any():
            return first
        poses = np.where(taken[:, None], other.poses, best.poses)
        both = self._descended(first.shape, poses, frames)
        return both if both.loss < first.loss else first

    def _frame(self, pose: Array, views: Sequence[Distances]) -> _Frame:
        mm = np.array(mm_at(self._body, self._cameras, pose))
        points = [np.concatenate([v.border + OUTSIDE * v.outward, v.outward], axis=1) for v in views]
        last = np.cumsum([len(part) for part in points])
        parts = np.zeros((len(points), 7), dtype=np.int64)
        parts[:, 3], parts[:, 4] = last - [len(part) for part in points], last
        scales = np.maximum(SCALE_MM, FEWEST_PIXELS * mm)
        return _Frame(np.ascontiguousarray(np.concatenate(points)), parts, mm, scales)

    def _descended(self, shape: Array, poses: Array, frames: Sequence[_Frame]) -> _State:
        """The state after Levenberg-Marquardt."""
        here, damping = self._state(shape, poses, frames), DAMPING
        for _ in range(STEPS):
            if damping > MOST_DAMPING:
                break
            there = self._state(*self._stepped(here, damping), frames)
            gained = here.loss - there.loss
            if gained < 0.0:
                damping *= TIGHTENED
                continue
            enough = gained >= ENOUGH * here.loss
            here, damping = there, EASED * damping
            if not enough:
                break
        return here

    def _stepped(self, here: _State, damping: float) -> tuple[Array, Array]:
        """Shape and poses after one damped step inside the limits."""
        matrix, gradient, eliminated = self._without_poses(here, damping)
        step = -np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient)
        poses = here.poses.copy()
        for pose, (free, slope, rest) in zip(poses, eliminated, strict=True):
            pose[free] -= (rest + slope @ step) * self._unit[free]
        return here.shape + step, np.clip(poses, *self._limits)

    def _without_poses(
        self, here: _State, damping: float
    ) -> tuple[Array, Array, list[tuple[NDArray[np.int64], Array, Array]]]:
        """Matrix (S, S) and gradient (S,) of the shape with the poses eliminated; and for each frame the parameters
        that do not press against a limit, their slopes over the shape, and their step at a fixed shape.
        """
        size = here.poses.shape[1]
        matrix, gradient, eliminated = (
            here.matrix.copy(),
            here.own.copy(),
            list[tuple[NDArray[np.int64], Array, Array]](),
        )
        pose: Array
        own: Array
        whole: Array
        for pose, own, whole in zip(here.poses, here.gradients, here.frames, strict=True):
            pressed = ((pose <= self._limits[0]) & (own[:size] > 0.0)) | (
                (pose >= self._limits[1]) & (own[:size] < 0.0)
            )
            free = np.flatnonzero(~pressed)
            part, across = whole[np.ix_(free, free)], whole[free, size:]
            lift = damping * np.diag(part) + 1e-9 * np.trace(whole) / len(whole) + 1e-12
            right = np.column_stack([across, own[free]])
            solved = np.asarray(np.linalg.solve(part + np.diag(lift), right), dtype=np.float64)
            slope, rest = solved[:, :-1], solved[:, -1]
            matrix += whole[size:, size:] - across.T @ slope
            gradient += own[size:] - across.T @ rest
            eliminated.append((free, slope, rest))
        return matrix, gradient, eliminated

    def _state(self, shape: Array, poses: Array, frames: Sequence[_Frame]) -> _State:
        (count, size), own = poses.shape, len(shape)
        gradients, matrices = np.zeros((count, size + own)), np.zeros((count, size + own, size + own))
        by_shape, borders = self._slopes_of_shape(shape, poses), np.zeros(count)
        projector = self._projector.with_program(self._programs.program(shape))
        steps = DIFFERENCE * np.diag(self._unit)
        for k, (pose, frame) in enumerate(zip(poses, frames, strict=True)):
            corners, _ = projector.corners(np.concatenate([pose[None], pose + steps, pose - steps]))
            by_pose = (corners[1 : size + 1] - corners[size + 1 :]) / (2.0 * DIFFERENCE)
            by_pose[:, :, self._still] = 0.0
            slopes = np.moveaxis(np.concatenate([by_pose, by_shape[:, k]]), 0, -1)
            borders[k] = normal_equations(
                *(corners[0].copy(), np.ascontiguousarray(slopes), self._ends, np.zeros(len(self._ends))),
                *(
                    NO_MAP,
                    frame.views,
                    np.ascontiguousarray(frame.views[:, 5:]),
                    frame.border,
                    frame.mm,
                    frame.scales,
                    0.0,
                ),
                *(matrices[k], gradients[k]),
            )
        held = 0.0
        for k, pull in enumerate(self._floor.of(shape, poses) if self._floor is not None else ()):
            if pull is not None:
                held += pull.loss
                gradients[k] += pull.gradient
                matrices[k] += pull.matrix
        worth = 1.0 / (ALIKE * self._variance)
        gradients, matrices = worth * gradients, worth * matrices
        away = (poses - self._body.neutral) / self._unit
        squares = self.stiffness * np.square(away)
        eased = np.where(self._eased, 1.0 + squares, 1.0)
        gradients[:, :size] += self.stiffness * away / eased
        matrices[:, np.arange(size), np.arange(size)] += self.stiffness / eased
        loss, pull, matrix = self._prior.equations(shape)
        own_pulls = float(np.where(self._eased, np.log(eased), squares).sum())
        loss += worth * (float(borders.sum()) + held) + own_pulls
        return _State(shape, poses, loss, borders, gradients, matrices, pull, matrix)

    def _slopes_of_shape(self, shape: Array, poses: Array) -> Array:
        """(S, F, V, L, 4, 2) slopes of the corners over the shape."""

        def corners(other: Array) -> Array:
            return self._projector.with_program(self._programs.program(other)).corners(poses)[0]

        steps = DIFFERENCE * np.eye(len(shape))
        return np.stack(
            [(corners(shape + step) - corners(shape - step)) / (2.0 * DIFFERENCE) for step in steps]
        )
