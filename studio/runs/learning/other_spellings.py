"""Paths on the other branch: three rotations in a row can be written by two sets of angles, and a fit that follows a
movement from frame to frame stays on the branch it began with, pressed against a limit where the other continues.

About three different axes, turns by α, β, γ are the turns by α + π, π - β, γ + π. The second branch has its middle
turn beyond a right angle where the first has not; an arm that goes overhead sideways changes from one to the other.
The three may belong to one joint, or to a joint of two turns and the first turn of a joint straight behind it (a
shoulder that swings and spreads, with the twist at the elbow).
"""

import math

import numpy as np

from studio.body.model import MOVE, TURN, BodyModel, Joint, Step
from studio.foundations.arrays import Array

Triple = tuple[int, int, int]


def triples(body: BodyModel) -> tuple[Triple, ...]:
    """Parameters of every three turns in a row about three axes; the root's, which have no limits, are left out."""
    triples: list[Triple] = []
    for index, joint in enumerate(body.joints):
        if joint.parent < 0:
            continue
        own = _turns(joint)
        carried = [
            _turns(child)[:1] for child in body.joints if child.parent == index and _straight_behind(child)
        ]
        rows = [own[:3]] if len(own) >= 3 else [own + first for first in carried if len(own) == 2 and first]
        for row in rows:
            if len({step.axis for step in row}) == 3:
                triples.append((row[0].parameter, row[1].parameter, row[2].parameter))
                break
    return tuple(triples)


def on_branch(body: BodyModel, path: Array, beyond: bool) -> Array:
    """The path (F, D), in radians, with every triple written so that its middle turn is beyond a right angle, or so
    that it never is; clamped to the limits where that branch lies outside.
    """
    lower, upper = body.lower, body.upper
    respelled = path.copy()
    for triple in triples(body):
        first, second, third = triple
        wrong = (np.abs(path[:, second]) > 0.5 * math.pi) != beyond
        other = path[:, triple] + math.pi
        other[:, 1] = math.pi - path[:, second]
        for place, parameter in enumerate((first, second, third)):
            wound = _wound(other[:, place], lower[parameter], upper[parameter])
            respelled[:, parameter] = np.where(wrong, wound, path[:, parameter])
    return respelled


def _wound(angles: Array, lower: float, upper: float) -> Array:
    """Angles moved by whole turns nearest to the middle of their limits, then clamped to them."""
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return np.arctan2(np.sin(angles), np.cos(angles))
    middle = 0.5 * (lower + upper)
    return np.clip(angles - 2.0 * math.pi * np.round((angles - middle) / (2.0 * math.pi)), lower, upper)


def _straight_behind(joint: Joint) -> bool:
    """Whether a joint is moved only along its own first turn's axis before it turns."""
    for place, step in enumerate(joint.steps):
        if step.kind == TURN:
            return all(before.kind == MOVE and before.axis == step.axis for before in joint.steps[:place])
    return False


def _turns(joint: Joint) -> list[Step]:
    """The joint's turns that parameters drive."""
    return [step for step in joint.steps if step.kind == TURN and step.parameter >= 0]
