"""The same attitude in other angles: a pose rewritten within its body's limits, where equivalent angles allow it.

One attitude of a body has several pose vectors: by whole turns; of three angles α, β, γ about three different axes
also α + π, π - β, γ + π; and a limb turned about its own axis by π whose hinge then bends the other way. Limits
such as "a knee bends backwards" admit one of these branches, and a pose from elsewhere may be on another (the Lee
walk's initial pose is, in both arms and the right leg).
"""

import math

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import TURN, BodyModel, Joint, kinematic_tables
from studio.foundations.arrays import Array

# Difference (mm; and share of a limb's cross-section) allowed to a rewritten body: rounding only.
SAME = 1e-6

# A limit where there is none.
BOUNDLESS = 1e12


def within_limits(body: BodyModel, pose: Array) -> Array:
    """(D,) the same attitude within the body's limits, or with the least excess among its branches.

    pose : (D,) radians and mm, finite. Joints within their limits are unchanged. Axes, ends and
    cross-sections of all drawn limbs and all markers stay where they are; frames may turn by π about a limb's axis.
    """
    lower, upper = _limits(body)
    best = _wound(np.asarray(pose, dtype=np.float64), lower, upper)
    attitude = _attitude(body, best)
    for spellings in _joint_branches(body):
        written = best
        for spelling in spellings:
            other = _wound(spelling(written), lower, upper)
            better = _excess(other, lower, upper) < _excess(best, lower, upper)
            if better and np.allclose(_attitude(body, other), attitude, rtol=0.0, atol=SAME):
                best = other
    return best


class _Branch:
    """One equivalent branch of a joint's angles: maps a pose to a pose."""

    def __init__(self, ball: tuple[int, ...], hinges: list[int], over: bool, turned: bool) -> None:
        self.ball, self.hinges, self.over, self.turned = ball, hinges, over, turned

    def __call__(self, pose: Array) -> Array:
        first, second, third = self.ball
        other = pose.copy()
        if self.over:
            other[first], other[second] = pose[first] + math.pi, math.pi - pose[second]
            other[third] += math.pi
        if self.turned:
            other[third] += math.pi
            other[self.hinges] = -pose[self.hinges]
        return other


def _joint_branches(body: BodyModel) -> list[list[_Branch]]:
    """Equivalent branches of each joint with three angles, parents first."""
    branches: list[list[_Branch]] = []
    for index, joint in enumerate(body.joints):
        ball = _ball(joint)
        if ball is None:
            continue
        hinges = [_hinge(child) for child in body.joints if child.parent == index]
        bends = [parameter for parameter in hinges if parameter >= 0]
        choices = [(True, False), (False, True), (True, True)] if bends else [(True, False)]
        branches.append([_Branch(ball, bends, over, turned) for over, turned in choices])
    return branches


def _ball(joint: Joint) -> tuple[int, ...] | None:
    """The parameters of three turns in a row about three different axes, None where there are none."""
    for first in range(len(joint.steps) - 2):
        steps = joint.steps[first : first + 3]
        driven = all(step.kind == TURN and step.parameter >= 0 for step in steps)
        if driven and len({step.axis for step in steps}) == 3:
            return tuple(step.parameter for step in steps)
    return None


def _hinge(joint: Joint) -> int:
    """The parameter of a joint that has one angle and no more, else -1."""
    driven = [step for step in joint.steps if step.parameter >= 0]
    return driven[0].parameter if len(driven) == 1 and driven[0].kind == TURN else -1


def _limits(body: BodyModel) -> tuple[Array, Array]:
    """(D,) lower and upper limits; lengths and angles limited on one side count as unbounded."""
    limited = body.bounded_angles
    return np.where(limited, body.lower, -BOUNDLESS), np.where(limited, body.upper, BOUNDLESS)


def _wound(pose: Array, lower: Array, upper: Array) -> Array:
    """The pose with every angle outside its limits moved by whole turns nearest to their middle."""
    middle = np.where((pose < lower) | (pose > upper), 0.5 * (lower + upper), pose)
    return pose - 2.0 * math.pi * np.round((pose - middle) / (2.0 * math.pi))


def _excess(pose: Array, lower: Array, upper: Array) -> float:
    """How far a pose lies outside the limits, the sum over all angles."""
    return float(np.maximum(np.maximum(lower - pose, pose - upper), 0.0).sum())


def _attitude(body: BodyModel, pose: Array) -> Array:
    """Limbs' ends, cross-sections and markers of a pose as one flat array."""
    tables = kinematic_tables(body)
    frames = joint_frames(body, pose)[0]
    limbs = frames[tables.limb_joint]
    ends = limbs[..., 3] + limbs[..., 2] * tables.limb_shape[:, :1]
    across = limbs[..., :2] * tables.limb_shape[:, None, 3:]
    sections = across @ across.transpose(0, 2, 1)
    return np.concatenate(
        [limbs[..., 3].ravel(), ends.ravel(), sections.ravel(), marker_points(body, pose).ravel()]
    )
