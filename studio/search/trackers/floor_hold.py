"""Who stands on the floor, z = 0, does not stand in it: what lies below is pulled up, in poses and a fitted shape.

Silhouettes hardly show soles: they end in shadows, which masks take or leave, and a toe that points into the floor has
nearly the outline of one that lies on it. On a drawn crouch the soles of refined poses lay 20 to 100 mm below the
floor, with the pull none lies more than a few below; markers gain little, as ankles are nearly right without it.

A foot that is fixed to its shin (`rigid_limbs`: the papers' bodies) is left out. Its ankle cannot bend, so its toe lies
30 to 70 mm below the floor whenever a heel is lifted, and pulled out it lifted the whole body: the bundled walk with
human31 was 24.9 mm off instead of 9.9, all joints 20 mm too high.

The pull is that of a border's point times WEIGHT at each end of a cone that lies below, robust as theirs. Where the
floor is not at z = 0 it must do nothing: a body that lies DEEPEST_MM below it anywhere is not pulled at all, also not
by a foot in the air. A drawn walk (human35, 60 frames) whose floor lies 0, 30, 60, 100 and 200 mm below z = 0 is 12.9,
11.8, 12.6, 13.0 and 13.4 mm off; with c = 100 and every end pulled it was 12.7, 11.8, 17.5, 29.4 and 86.7.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.dimensions import follows_height, with_dimensions
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, rigid_limbs
from studio.body.scale import scale_of
from studio.body.shape_space import ShapeSpace
from studio.foundations.arrays import Array, Mask

WEIGHT = 20.0
SCALE_MM, DEEPEST_MM = 30.0, 90.0
"""mm at a person's size: c of the robust loss, and the depth of any end from which on none is pulled: the floor is
elsewhere."""
STEP = 10.0
"""mm by which a dimension is changed to measure its effect on heights, which is linear."""


def has_floor(body: BodyModel) -> bool:
    """Whether a body stands on the world's floor, as a person or a dog: it is sized by its height above that."""
    return follows_height(body)


class Heights:
    """How high the ends of a body's cones, but of rigid ones, lie above the floor; immutable."""

    def __init__(self, body: BodyModel, scale: float) -> None:
        """scale : the body's, of a person's size."""
        self._body, self._scale = body, scale
        self._held = np.flatnonzero(~rigid_limbs(body))
        limbs = [body.drawn[number] for number in self._held]
        self._radii = np.array([(limb.radius_start, limb.radius_end) for limb in limbs])

    def of(self, poses: Array) -> Array:
        """(N, 2 K) mm at a person's size of the lowest points of the K cones' ends, at poses (N, D)."""
        ends = limb_ends(self._body, poses)[:, self._held]
        along = ends[:, :, 1] - ends[:, :, 0]
        upward = along[..., 2] / np.maximum(np.linalg.norm(along, axis=2), 1e-9)
        drop = self._radii * np.sqrt(np.clip(1.0 - upward**2, 0.0, 1.0))[..., None]
        return ((ends[..., 2] - drop) / self._scale).reshape(len(poses), -1)

    def slopes(self, pose: Array, unit: Array, step: float) -> Array:
        """(D, 2 K) slopes of the heights at a pose (D,), per unit (D,) of each parameter. step : of the differences, in
        units.
        """
        moves = step * np.diag(unit)
        above, below = np.split(self.of(np.concatenate([pose + moves, pose - moves])), 2)
        return (above - below) / (2.0 * step)


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """A loss, and gradient (D,) and matrix (D, D) of half of it per unit of each unknown."""

    loss: float
    gradient: Array
    matrix: Array


def is_pulled(heights: Array) -> Mask:
    """Which ends of bodies are pulled out of the floor. heights : (..., 2 K) mm."""
    return (heights < 0.0) & (heights.min(axis=-1, keepdims=True) > -DEEPEST_MM)


def pull_of(depths: Array, slopes: Array) -> Pull:
    """The pull on ends below the floor. depths : (K,) mm, negative. slopes : (D, K) of them."""
    share = SCALE_MM**2 / (SCALE_MM**2 + depths**2)
    weights = WEIGHT * share**2
    return Pull(
        float(WEIGHT * (share * depths**2).sum()), slopes @ (weights * depths), (slopes * weights) @ slopes.T
    )


class FloorHold:
    """Pulls poses of a body out of the floor; immutable. unit, step : as of `Heights.slopes`."""

    def __init__(self, body: BodyModel, unit: Array, step: float) -> None:
        self._heights, self._unit, self._step = Heights(body, scale_of(body)), unit, step

    def of(self, pose: Array) -> Pull | None:
        """The pull on a pose (D,) per unit; None where nothing lies below the floor."""
        heights = self._heights.of(pose[None])[0]
        low = np.flatnonzero(is_pulled(heights))
        if not len(low):
            return None
        return pull_of(heights[low], self._heights.slopes(pose, self._unit, self._step)[:, low])


class FloorHoldOfShapes:
    """Pulls bodies of one space, with their poses, out of the floor; immutable. For one pose heights are linear in the
    dimensions, as are lengths and radii. unit, step : as of `Heights.slopes`.
    """

    def __init__(self, space: ShapeSpace, unit: Array, step: float) -> None:
        self._space, self._unit, self._step = space, unit, step
        body = space.body
        self._names = [name for group in space.groups for name in group.dimensions]
        self._scale = scale_of(body)
        self._heights = Heights(body, self._scale)
        self._larger = [
            Heights(with_dimensions(body, {name: body.dimensions[name] + STEP}), self._scale)
            for name in self._names
        ]

    def of(self, shape: Array, poses: Array) -> Sequence[Pull | None]:
        """By frame the pull on a shape (S,) in its pose there, poses (F, D): its unknowns are the pose's, then the
        shape's.
        """
        here = Heights(self._space.body_of(shape), self._scale)
        heights = here.of(poses)
        pulls: list[Pull | None] = [None] * len(poses)
        pulled = is_pulled(heights)
        low = np.flatnonzero(pulled.any(axis=1))
        if not len(low):
            return pulls
        first = self._heights.of(poses[low])
        by_size = np.array([(other.of(poses[low]) - first) / STEP for other in self._larger])
        by_shape = np.tensordot(self._sizes_by_shape(shape), by_size, 1)
        for number, pose in enumerate(low.tolist()):
            ends = np.flatnonzero(pulled[pose])
            by_pose = here.slopes(poses[pose], self._unit, self._step)
            slopes = np.concatenate([by_pose[:, ends], by_shape[:, number, ends]])
            pulls[pose] = pull_of(heights[pose, ends], slopes)
        return pulls

    def _sizes_by_shape(self, shape: Array) -> Array:
        """(S, K) slopes of the K dimensions that a shape (S,) changes."""

        def sizes(other: Array) -> Array:
            by_name = self._space.dimensions(other)
            return np.array([by_name[name] for name in self._names])

        steps = self._step * np.eye(len(shape))
        return np.array([(sizes(shape + one) - sizes(shape - one)) / (2.0 * self._step) for one in steps])
