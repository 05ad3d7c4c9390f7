"""A limb's end dragged to a place: the pose follows by inverse kinematics, limits kept.

First the chain from the root to the limb moves, its outer joints more readily than its inner ones; the root stays.
Where the chain does not reach, the whole body follows, the other ends held in place, and then the chain moves the
rest. Least squares (trust region, scipy) from the present pose, so that a drag is smooth.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from studio.body.branches import within_limits
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.inverse_kinematics import MM_PER_RADIAN
from studio.body.least_squares import fitted_parameters, strictly_inside
from studio.body.model import BodyModel, extremities, joints_upwards
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import BodyError
from studio.foundations.geometry.reach import within_reach

REACHED = 1.0
"""mm; at this distance the chain has reached the target and the rest of the body stays."""
PULL, PULL_INWARDS = 0.3, 3.0
"""Residual (mm) of one radian off the present pose, of the outermost joint and more with every joint inwards."""
ROOT_PULL = 20.0
"""The same of the root while the whole body follows."""
HOLD = 0.2
"""Weight of the other ends' places while the whole body follows."""
BEND = 0.4
"""Share of the way to the middle of its limits by which a chain that did not reach is bent."""
MOST_STEPS = 40


@dataclass(frozen=True, slots=True)
class Grip:
    """A point to drag: the far end of a drawn limb. limb : its index. root : whether only the root moves it."""

    name: str
    limb: int
    side: str
    root: bool


@dataclass(frozen=True, slots=True, eq=False)
class Dragged:
    """pose : (D,). left_mm : distance of the grip from its target."""

    pose: Array
    left_mm: float


class Dragger:
    """Drags one body; immutable. About 10 ms a drag of a person."""

    def __init__(self, body: BodyModel) -> None:
        self.body = body
        self._lower, self._upper = body.lower, body.upper
        self._scale = np.where(body.angles, 1.0, MM_PER_RADIAN)
        self._ends = extremities(body)
        self._joint = root_joint(body)
        root = body.joints[self._joint].parameters if self._joint >= 0 else ()
        self._root = np.isin(np.arange(len(body.parameters)), root)
        self._chains = [self._chain(limb.joint) for limb in body.drawn]
        self.grips = tuple(
            Grip(limb.name, at, limb.side, not len(self._chains[at])) for at, limb in enumerate(body.drawn)
        )

    def points(self, pose: Array) -> Array:
        """(G, 3) positions of the grips, mm."""
        return limb_ends(self.body, pose)[0, :, 1]

    def grip(self, name: str) -> Grip:
        """The grip of a name. Raises BodyError."""
        match = next((grip for grip in self.grips if grip.name == name), None)
        if match is None:
            listed = ", ".join(grip.name for grip in self.grips)
            raise BodyError(f"Body '{self.body.name}' has no limb '{name[:64]}'.", f"Its limbs: {listed}.")
        return match

    def dragged(self, pose: Array, name: str, target: Array) -> Dragged:
        """The pose (D,) with the grip at `target` (3,) mm, or as near as limits allow. Raises BodyError for an unknown
        grip and for numbers that do not fit.
        """
        grip, goal = self.grip(name), np.asarray(target, dtype=np.float64)
        given = np.asarray(pose, dtype=np.float64)
        fits = given.shape == (len(self.body.parameters),) and goal.shape == (3,)
        if not fits or not within_reach(given) or not within_reach(goal):
            raise BodyError(
                f"A drag of body '{self.body.name}' needs {len(self.body.parameters)} numbers and a place.",
                "Give a finite pose in the order of its parameters, and x, y, z in mm.",
            )
        start = np.clip(within_limits(self.body, given), self._lower, self._upper)
        fitted = self._pull(start, start, grip, goal)
        if not self._reaches(fitted, grip, goal):
            bent = self._pull(self._bend(start, grip), start, grip, goal)
            fitted = (
                bent
                if self._distance_left(bent, grip, goal) < self._distance_left(fitted, grip, goal)
                else fitted
            )
        if not self._reaches(fitted, grip, goal):
            everything = np.arange(len(start))
            fitted = self._fit(fitted, start, everything, self._whole_pull(), grip, goal, self._ends)
            fitted = self._pull(fitted, fitted, grip, goal)
        return Dragged(fitted, self._distance_left(fitted, grip, goal))

    def root_frame(self, pose: Array) -> Array | None:
        """(3, 4) world from root, mm; None for a body that is fixed to the world."""
        return None if self._joint < 0 else joint_frames(self.body, pose)[0, self._joint]

    def with_root(self, pose: Array, frame: Array) -> Array:
        """The pose with its root as near to `frame` (3, 4) as its parameters allow; all else unchanged."""
        if self._joint < 0:
            return np.asarray(pose, dtype=np.float64).copy()
        free = np.flatnonzero(self._root)
        scale = self._scale[free]
        goal = np.concatenate([frame[:, :3].T * MM_PER_RADIAN + frame[:, 3], frame[None, :, 3]])

        def full(values: Array) -> Array:
            poses = np.repeat(np.asarray(pose, dtype=np.float64)[None], len(values), axis=0)
            poses[:, free] = values * scale
            return poses

        def residuals(values: Array) -> Array:
            root = joint_frames(self.body, full(values[None]))[0, self._joint]
            points = np.concatenate([root[:, :3].T * MM_PER_RADIAN + root[:, 3], root[None, :, 3]])
            return (points - goal).ravel()

        begin = np.asarray(pose)[free] / scale
        limits = (self._lower[free] / scale, self._upper[free] / scale)
        answer = least_squares(residuals, begin, bounds=limits, max_nfev=MOST_STEPS)
        return full(answer.x[None])[0]

    def _pull(self, pose: Array, start: Array, grip: Grip, goal: Array) -> Array:
        """Only the chain moves."""
        chain = self._chains[grip.limb]
        if not len(chain):
            return pose
        inwards = np.arange(len(chain))[::-1] / max(1, len(chain) - 1)
        pull = PULL + (PULL_INWARDS - PULL) * inwards
        return self._fit(pose, start, chain, pull, grip, goal, ())

    def _reaches(self, pose: Array, grip: Grip, goal: Array) -> bool:
        return not grip.root and self._distance_left(pose, grip, goal) < REACHED

    def _bend(self, start: Array, grip: Grip) -> Array:
        """The pose with the chain part of the way to the middle of its limits: a stretched one cannot bend."""
        chain = self._chains[grip.limb]
        bounded = chain[np.isfinite(self._lower[chain]) & np.isfinite(self._upper[chain])]
        bent = start.copy()
        bent[bounded] += BEND * (0.5 * (self._lower[bounded] + self._upper[bounded]) - start[bounded])
        return bent

    def _whole_pull(self) -> Array:
        return np.where(self._root, ROOT_PULL, PULL_INWARDS)

    def _distance_left(self, pose: Array, grip: Grip, goal: Array) -> float:
        return float(np.linalg.norm(self.points(pose)[grip.limb] - goal))

    def _fit(
        self,
        pose: Array,
        start: Array,
        free: Indices,
        pull: Array,
        grip: Grip,
        goal: Array,
        held: tuple[int, ...],
    ) -> Array:
        """The pose with its `free` parameters fitted: the grip at `goal`, the held ends and all else near `start`."""
        held = tuple(at for at in held if at != grip.limb)
        weights = np.array([1.0, *[HOLD] * len(held)])[:, None]
        places = np.concatenate([goal[None], self.points(start)[list(held)]])
        limbs = [grip.limb, *held]
        scale, lower, upper = self._scale[free], self._lower[free], self._upper[free]
        home = start[free] / scale

        def offsets(poses: Array) -> Array:
            ends = limb_ends(self.body, poses)[:, limbs, 1]
            return ((ends - places) * weights).reshape(len(poses), -1)

        fitted, _ = fitted_parameters(
            pose,
            free,
            scale,
            strictly_inside(pose[free], lower, upper) / scale,
            (lower / scale, upper / scale),
            offsets,
            lambda values: pull * (values - home),
            pull,
            most=MOST_STEPS,
            tolerance=1e-6,
        )
        fitted[free] = np.clip(fitted[free], lower, upper)
        return fitted

    def _chain(self, joint: int) -> Indices:
        """The parameters that move a joint's frame, root's left out, from the root outwards."""
        outwards = reversed(list(joints_upwards(self.body, joint)))
        moving = [place for at in outwards for place in self.body.joints[at].parameters]
        return np.array([place for place in moving if not self._root[place]], dtype=np.int64)


def root_joint(body: BodyModel) -> int:
    """The joint that carries the body through the world; -1 where it is fixed to it."""
    for at, joint in enumerate(body.joints):
        used = [body.parameters[place] for place in joint.parameters]
        if used:
            free = any(entry.kind == "length" and not math.isfinite(entry.lower) for entry in used)
            return at if free else -1
    return -1
