"""Fitness of many bodies of different sizes to the silhouettes of some frames, each body in its own poses.

A likelihood is prepared for one body, and preparing it costs more than weighing a pose. Here the body is a variable:
the fixed motions between a body's joints and its cones' sizes are linear in its dimensions (a `KinematicProgram` folds
constant turns and moves, only the moves have dimensions in them), so a body's program is the first body's plus a sum,
and sixteen poses of each body are one block of the outline kernel. The fit is the exact bidirectional silhouette
measure f_s of Fleischmann et al. 2012 (`silhouette_areas`).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studio.body.dimensions import with_dimensions
from studio.body.model import BodyModel, kinematic_tables
from studio.body.shape_space import ShapeSpace
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.evidence_check import check_views
from studio.search.likelihood.kinematic_program import KinematicProgram, compile_program
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.silhouette_areas import HALF, Silhouettes

POSES = 16
"""Poses of a body that are evaluated together."""
STEP = 10.0
"""mm by which a dimension is changed to measure its effect; the effect is linear, so any step will do."""


ROUND = np.pi / 4.0
"""Extension of a limb beyond a ball joint, as a share of its radius there: flesh is round at shoulders and hips, where
a cone ends flat; a rectangle of this depth has a half-disc's area. Without it a fit moves these joints inwards, and
upper arms and thighs become 25 to 55 mm too long."""


class ShapePrograms:
    """The kinematic programs of all shapes of a space."""

    def __init__(self, space: ShapeSpace) -> None:
        """Raises BodyError for a space of dimensions that do not all move something."""
        self.space = space
        names = self._names = [name for group in space.groups for name in group.dimensions]
        offsets = {name for group in space.groups if group.kind == "offset" for name in group.dimensions}
        # A move of zero would be left out of the program.
        away = {name: space.body.dimensions[name] + STEP for name in offsets}
        body = with_dimensions(space.body, away) if away else space.body
        self._first = compile_program(kinematic_tables(body))
        self._own = np.array([body.dimensions[name] for name in names])
        fixed, limbs = list[Array](), list[Array]()
        for name in names:
            other = compile_program(
                kinematic_tables(with_dimensions(body, {name: body.dimensions[name] + STEP}))
            )
            if other.fixed.shape != self._first.fixed.shape:
                raise BodyError(
                    f"Dimension '{name}' changes the body's structure.", "Leave it out of the fit."
                )
            fixed.append((other.fixed.astype(np.float64) - self._first.fixed) / STEP)
            limbs.append((other.limb_shape.astype(np.float64) - self._first.limb_shape) / STEP)
        self._fixed, self._limbs = np.array(fixed), np.array(limbs)

    def program(self, shape: Array) -> KinematicProgram:
        """The program of a shape (S,)."""
        sizes = self.space.dimensions(shape)
        more = np.array([sizes[name] for name in self._names]) - self._own
        return self._first._replace(
            fixed=(self._first.fixed + np.tensordot(more, self._fixed, 1)).astype(np.float32),
            limb_shape=np.ascontiguousarray(
                self._first.limb_shape + np.tensordot(more, self._limbs, 1), dtype=np.float32
            ),
        )


class ShapeSilhouettes:
    """Some frames as a function of shapes and poses."""

    def __init__(
        self, space: ShapeSpace, cameras: tuple[Camera, ...], frames: Sequence[FrameEvidence]
    ) -> None:
        """Raises FootageError where masks do not fit the cameras."""
        for evidence in frames:
            check_views(cameras, evidence, edges=False)
        self.programs = ShapePrograms(space)
        self._projector = OutlineProjector.of_body(space.body, cameras)
        self._rounded = limbs_of_ball_joints(space.body)
        self._frames = tuple(Silhouettes(evidence, HALF) for evidence in frames)
        self.seen = np.array([[np.count_nonzero(v.mask) > 0 for v in evidence.views] for evidence in frames])

    @property
    def frame_count(self) -> int:
        """Number of frames, F."""
        return len(self._frames)

    def fitness(self, shapes: Array, poses: Array) -> Array:
        """(M, F, 16) the mean of f_s over the views that see something.

        shapes : (M, S). poses : (M, F, 16, D), sixteen of each shape in each frame.
        """
        count, frames = poses.shape[:2]
        found = np.empty((count, frames, POSES))
        projectors = [self._projector.with_program(self.programs.program(shape)) for shape in shapes]
        for k, silhouettes in enumerate(self._frames):
            outlines = np.concatenate([one.blocks(poses[m, k]) for m, one in enumerate(projectors)])
            round_off(outlines, self._rounded)
            fits = silhouettes.areas(outlines, count * POSES).fitness()
            weights = self.seen[k] / max(1, np.count_nonzero(self.seen[k]))
            found[:, k] = (fits @ weights).reshape(count, POSES)
        return found


def limbs_of_ball_joints(body: BodyModel) -> NDArray[np.int64]:
    """Numbers of the drawn limbs, trunk and head left out, that begin in a ball joint."""
    if body.definition is None:
        return np.empty(0, dtype=np.int64)
    balls = {joint.name for joint in body.definition.joints if joint.type == "ball"}
    joints = {limb.name: limb.joint for limb in body.definition.limbs}
    chosen = [
        number for number, limb in enumerate(body.drawn) if not limb.part and joints.get(limb.name) in balls
    ]
    return np.array(chosen, dtype=np.int64)


def round_off(outlines: NDArray[np.float32], limbs: NDArray[np.int64], depth: float = ROUND) -> None:
    """Extend limbs of outlines (B, V, L, 160) backwards by a share of their radius at the start; in place."""
    rows = outlines.reshape(*outlines.shape[:3], -1, POSES)
    for limb in limbs:
        corners = rows[:, :, limb, :8].reshape(*rows.shape[:2], 4, 2, POSES)
        first, far, other, second = (corners[:, :, number] for number in range(4))  # A0, A1, B1, B0
        along = 0.5 * (first + second - far - other)
        length = np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-3)
        radius = 0.5 * np.linalg.norm(first - second, axis=2, keepdims=True)
        shift = depth * radius * along / length
        first += shift
        second += shift
