"""Mirror images of poses: left and right limbs exchanged.

Twin parameters follow from their groups' names (left and right), their sign from the body: the rotation that a
parameter makes at rest, mirrored, is its twin's or its inverse. A body without sides has no mirror.
"""

import math

import numpy as np

from studio.body.branches import within_limits
from studio.body.dragging import root_joint
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.inverse_kinematics import MM_PER_RADIAN
from studio.body.least_squares import fitted_parameters, strictly_inside
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import BodyError
from studio.foundations.geometry.rotations import vector_from_rotation

SMALL = 1e-3
UNEVEN = 5.0
"""mm; limbs with a larger error are fitted one by one: the body's sides differ."""
PULL = 0.02
"""Residual (mm) of one radian: determines twists that no limb's end shows."""
LEVEL = 0.3
"""Least level part of a body's sideways axis for an upright mirror."""


def has_sides(body: BodyModel) -> bool:
    try:
        Mirror(body)
    except BodyError:
        return False
    return True


class Mirror:
    """Mirrors poses of one body. Raises BodyError for a body that has no left and right."""

    def __init__(self, body: BodyModel) -> None:
        self.body = body
        self.twins = _parameter_twins(body)
        """(D,) each parameter's place, or that of its like on the other side."""
        self.limb_twins = name_twins([limb.name for limb in body.drawn])
        sides = np.array([limb.side for limb in body.drawn])
        self.pairs = self.limb_twins != np.arange(len(sides))
        """(L,) which drawn limbs have a twin."""
        if not self.pairs.any() or not (sides == "left").any():
            raise BodyError(
                f"Body '{body.name}' has no left and right limbs to exchange.",
                "Choose a body whose limbs come in left and right.",
            )
        rest = limb_ends(body, body.neutral)[0]
        across = (rest[sides == "left"] - rest[self.limb_twins][sides == "left"]).mean(axis=(0, 1))
        self.across: Array = across / np.linalg.norm(across)
        """(3,) the body's left in its rest pose."""
        self._joint = root_joint(body)
        self._root = _parameters_of(body, self._joint)
        self.signs = self._signs()
        """(D,) ±1: how a parameter follows its twin."""

    def mirrored(self, pose: Array) -> Array:
        """The pose (D,) mirrored, with the same place and facing."""
        ends, sideways = limb_ends(self.body, pose)[0], self.sideways(pose)
        return self._place_root(self._exchanged(pose), self._reflected(ends, sideways))

    def turned_round(self, pose: Array) -> Array:
        """The pose (D,) facing the other way, left and right exchanged: from front and back it looks the same."""
        ends, sideways = limb_ends(self.body, pose)[0], self.sideways(pose)
        ahead = np.cross(sideways, [0.0, 0.0, 1.0])
        if np.linalg.norm(ahead) < SMALL:
            ahead = np.array([1.0, 0.0, 0.0])
        return self._place_root(self._exchanged(pose), self._reflected(ends, ahead / np.linalg.norm(ahead)))

    @property
    def turns(self) -> bool:
        """Whether the body's root can turn."""
        return any(self.body.parameters[int(at)].kind == "angle" for at in self._root)

    def exchanged(self, pose: Array, own: Indices, limbs: Indices) -> Array:
        """The pose (D,) with each of a pair's limbs (indices of drawn ones) where its twin is, as near as the pair's
        own parameters allow; all else unchanged.
        """
        target = limb_ends(self.body, pose)[0][self.limb_twins[limbs]]
        start = pose.copy()
        start[own] = self._exchanged(pose)[own]
        return self._fit(start, target, own, limbs)[0]

    def about_face(self, pose: Array) -> Array:
        """The pose (D,) facing the other way with every limb where its twin is, as near as joint limits allow."""
        target = limb_ends(self.body, pose)[0][self.limb_twins]
        rest = self.body.neutral
        rest[self._root] = pose[self._root]
        return self._place_root(rest, target, whole=True)

    def _exchanged(self, pose: Array) -> Array:
        rest = self.body.neutral
        swapped = rest + self.signs * (np.asarray(pose) - rest)[self.twins]
        swapped[self._root] = np.asarray(pose)[self._root]
        return swapped

    def _reflected(self, ends: Array, normal: Array) -> Array:
        """(L, 2, 3) target ends of the limbs: their twins' ends, mirrored in the plane through the root."""
        swapped = ends[self.limb_twins]
        middle = ends.reshape(-1, 3).mean(axis=0)
        return swapped - 2.0 * ((swapped - middle) @ normal)[..., None] * normal

    def sideways(self, pose: Array) -> Array:
        """(3,) the body's left, level if it can be."""
        if self._joint < 0:
            return self.across
        frames = joint_frames(self.body, np.stack([self.body.neutral, pose]))[:, self._joint, :, :3]
        own = frames[1] @ frames[0].T @ self.across
        level = own * [1.0, 1.0, 0.0]
        return level / np.linalg.norm(level) if np.linalg.norm(level) > LEVEL else own

    def _place_root(self, pose: Array, target: Array, *, whole: bool = False) -> Array:
        """The pose with its root where the limbs are nearest to `target`; an asymmetric body is fitted as a whole."""
        best, least = pose, math.inf
        for begin in self._beginnings(pose):
            fitted, cost = self._fit(begin, target, self._root)
            if cost < least:
                best, least = fitted, cost
        best = within_limits(self.body, best)
        if whole or math.sqrt(least / len(target)) > UNEVEN:
            best = self._fit(best, target, np.arange(len(best)))[0]
        return best

    def _fit(
        self, pose: Array, target: Array, free: Indices, limbs: Indices | None = None
    ) -> tuple[Array, float]:
        """The pose with its `free` parameters where the limbs are nearest to `target`, limits kept, and half the sum of
        squares that remains. limbs : which drawn ones, None for all.
        """
        if not len(free):
            return pose.copy(), 0.0
        scale = np.where(self.body.angles[free], 1.0, MM_PER_RADIAN)
        lower, upper = self.body.lower[free] / scale, self.body.upper[free] / scale
        begin = strictly_inside(pose[free] / scale, lower, upper)
        chosen = slice(None) if limbs is None else limbs

        def offsets(poses: Array) -> Array:
            return (limb_ends(self.body, poses)[:, chosen] - target).reshape(len(poses), -1)

        return fitted_parameters(
            pose,
            free,
            scale,
            begin,
            (lower, upper),
            offsets,
            lambda values: PULL * (values - begin),
            np.full(len(free), PULL),
            most=60,
        )

    def _beginnings(self, pose: Array) -> list[Array]:
        """The pose, and the pose with half a turn about each of the root's axes."""
        poses = [pose]
        for place in map(int, self._root):
            if self.body.parameters[place].kind == "angle":
                turned = pose.copy()
                turned[place] += math.pi
                poses.append(turned)
        return poses

    def _signs(self) -> Array:
        """(D,) ±1: how a parameter follows its twin."""
        body = self.body
        steps = SMALL * np.eye(len(body.parameters))
        frames = joint_frames(body, np.concatenate([body.neutral[None], body.neutral + steps]))[..., :3]
        turns = np.zeros((len(steps), 3))
        for joint, entry in enumerate(body.joints):
            for step in entry.steps:
                if step.parameter >= 0:
                    turn = frames[step.parameter + 1, joint] @ frames[0, joint].T
                    turns[step.parameter] += vector_from_rotation(turn)
        # A parameter that turns both sides against each other sums to zero, and is its own mirror image.
        # A turn is an axial vector: in the mirror its part along the mirror's normal stays.
        mirrored = 2.0 * (turns @ self.across)[:, None] * self.across - turns
        along = np.einsum("dk,dk->d", mirrored[self.twins], turns)
        return np.where(along < -0.01 * SMALL**2, -1.0, 1.0)


def name_twins(names: list[str]) -> Indices:
    """Each name's place, or that of the one that says left where it says right."""
    places = {name: at for at, name in enumerate(names)}
    twins: list[int] = []
    for at, name in enumerate(names):
        other = name.replace("left", "right") if "left" in name else name.replace("right", "left", 1)
        twins.append(places.get(other, at))
    return np.array(twins, dtype=np.int64)


def _parameter_twins(body: BodyModel) -> Indices:
    """Each parameter's place, or that of its like in the group of the other side (left arm, right arm)."""
    groups: dict[str, list[int]] = {}
    for at, entry in enumerate(body.parameters):
        groups.setdefault(entry.limb, []).append(at)
    names = list(groups)
    twins = np.arange(len(body.parameters))
    for name, other in zip(names, name_twins(names).tolist(), strict=True):
        if len(groups[name]) == len(groups[names[other]]):
            twins[groups[name]] = groups[names[other]]
    return twins


def _parameters_of(body: BodyModel, joint: int) -> Indices:
    return np.array(body.joints[joint].parameters if joint >= 0 else (), dtype=np.int64)
