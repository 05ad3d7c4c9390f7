"""When and where each foot stands on a walk that may halt: a plan of steps instead of an endless cycle.

A plan holds the stances of one foot in order. Between two stances the foot travels as in `gait.py`; how far it
lifts and how much the ankle turns shrinks with the step, so that the short steps into and out of a halt are low.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.person import Skeleton
from studio.geometry.rotations import axis_turn
from studio.synthesis.gait import FootTrack, Gait, Path, eased, swung

Array = NDArray[np.float64]

# Shares of an ordinary stance: rolling down from the heel at its beginning, up over the ball at its end.
ROLL_DOWN, ROLL_UP = 0.18, 0.38
LANDING_PITCH = 0.28
BALL, HEEL = 0.66, -0.20


@dataclass(frozen=True, slots=True, eq=False)
class Footfalls:
    """One foot's stances, in order.

    down, up : (S,) seconds of landing and lift-off. rise : (S,) seconds before lift-off in which the heel rises. at :
    (S,) mm along the path.
    """

    down: Array
    up: Array
    rise: Array
    at: Array


def planned_track(
    plan: Footfalls, gait: Gait, path: Path, times: Array, skeleton: Skeleton, *, left: bool, toes_out: float
) -> FootTrack:
    """The foot's journey over the stances of a plan.

    times : (F,) seconds, between the first landing and the last lift-off. toes_out : radians that the foot is turned
    outward against the path.
    """
    stance = np.clip(np.searchsorted(plan.down, times, side="right") - 1, 0, len(plan.down) - 2)
    swing = np.clip((times - plan.up[stance]) / (plan.down[stance + 1] - plan.up[stance]), 0.0, 1.0)
    along = plan.at[stance] + swung(swing) * (plan.at[stance + 1] - plan.at[stance])
    step = np.clip(np.diff(plan.at) / (gait.speed * gait.cycle), 0.0, 1.0)
    coming = step[stance]
    last = np.concatenate([[1.0], step])[stance]
    ordinary = gait.duty * gait.cycle
    push = eased(1.0 + (times - plan.up[stance]) / plan.rise[stance])
    push *= np.where(swing > 0.0, 1.0 - eased(swing / 0.7), 1.0) * coming
    land = eased((swing - 0.6) / 0.4) * (swing > 0.0) * coming
    land += (1.0 - eased((times - plan.down[stance]) / (ROLL_DOWN * ordinary))) * (swing == 0.0) * last
    pitch = gait.heel_rise * push - LANDING_PITCH * land
    sign = 1.0 if left else -1.0
    centre, heading = path(along)
    beside = 0.5 * gait.foot_spacing * sign * np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    ankle = _rolled(centre + beside, heading + sign * toes_out, pitch, skeleton)
    ankle.ankle[:, 2] += gait.lift * (0.4 + 0.6 * coming) * eased(swing / 0.5) * eased((1.0 - swing) / 0.5)
    return FootTrack(ankle.ankle, ankle.turn, swing)


def _rolled(ground: Array, heading: Array, pitch: Array, skeleton: Skeleton) -> FootTrack:
    """A foot over `ground` (F, 2) turned by `pitch` about its ball (up) or heel (down), which stay where they
    are.
    """
    ball = np.array([BALL * skeleton.foot, 0.0, -skeleton.ankle_height])
    heel = np.array([HEEL * skeleton.foot, 0.0, -skeleton.ankle_height])
    level = axis_turn(2, heading)
    tilted = level @ axis_turn(1, pitch)
    pivot = np.where((pitch > 0.0)[:, None], ball, heel)
    flat = np.concatenate([ground, np.full((len(ground), 1), skeleton.ankle_height)], axis=1)
    ankle = flat + (level @ pivot[..., None])[..., 0] - (tilted @ pivot[..., None])[..., 0]
    return FootTrack(ankle, tilted, np.zeros(len(ground)))
