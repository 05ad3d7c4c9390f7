"""A handstand: hands on the floor, kick up one leg after the other, hold with a sway, come down again."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points
from studio.geometry.rotations import axis_turn

Array = NDArray[np.float64]

# Key poses: share of the motion's length; degrees from upright of pelvis and thorax leaning forward (180 =
# upside down), of the arms' lean, of the thighs swung backwards from hanging straight down (180 = straight
# up), and knees.
KEYS = np.array(
    [
        # share pelvis thorax arms thigh_l thigh_r knee_l knee_r
        (0.00, 108.0, 128.0, 4.0, 22.0, 28.0, 4.0, 30.0),
        (0.10, 110.0, 130.0, 2.0, 30.0, 24.0, 6.0, 22.0),
        (0.35, 158.0, 164.0, -3.0, 150.0, 70.0, 4.0, 26.0),
        (0.50, 177.0, 179.0, -1.0, 182.0, 150.0, 4.0, 20.0),
        (0.60, 181.0, 181.0, 0.0, 184.0, 180.0, 4.0, 5.0),
        (0.78, 179.0, 180.0, 0.0, 178.0, 182.0, 5.0, 4.0),
        (1.00, 150.0, 160.0, -2.0, 120.0, 140.0, 10.0, 6.0),
    ]
)


def handstand(skeleton: Skeleton, times: Array, options: dict[str, float]) -> PersonMotion:
    """Kick-up to a handstand: options heading_degrees, hands_apart_mm. The wrists stay where they stand."""
    length = times[-1] if len(times) > 1 and times[-1] > 0.0 else 1.0
    shares = times / length
    angles = np.radians(PchipInterpolator(KEYS[:, 0], KEYS[:, 1:])(shares))
    pelvis, thorax, arms, thigh_left, thigh_right, knee_left, knee_right = angles.T
    heading = axis_turn(2, np.full(len(times), np.radians(options.get("heading_degrees", 20.0))))
    sway = 0.015 * np.sin(2.0 * np.pi * 1.3 * times)
    turns = {
        "pelvis": heading @ axis_turn(1, pelvis + sway),
        "thorax": heading @ axis_turn(1, thorax + 0.5 * sway),
        "head": heading @ axis_turn(1, thorax - 0.45),
    }
    half_apart = 0.5 * options.get("hands_apart_mm", 480.0)
    for side, thigh, knee in zip(SIDES, (thigh_left, thigh_right), (knee_left, knee_right), strict=True):
        sign = 1.0 if side == "left" else -1.0
        turns[f"{side}_thigh"] = (
            heading @ axis_turn(1, thigh + sway) @ axis_turn(0, np.full(len(times), sign * 0.05))
        )
        turns[f"{side}_shin"] = turns[f"{side}_thigh"] @ axis_turn(1, knee)
        turns[f"{side}_foot"] = turns[f"{side}_shin"] @ axis_turn(
            1, 0.25 + 0.5 * np.clip(thigh - 0.6, 0.0, 1.0)
        )
        _add_supporting_arm(turns, skeleton, side, heading, arms, half_apart)
    free = PersonMotion(skeleton, float(1.0 / (times[1] - times[0])), np.zeros((len(times), 3)), turns)
    points = joint_points(free)
    hands = 0.5 * (points["left_hand"] + points["right_hand"])
    return PersonMotion(skeleton, free.fps, np.array([0.0, 0.0, 55.0]) - hands, turns)


def _add_supporting_arm(
    turns: dict[str, Array], skeleton: Skeleton, side: str, heading: Array, lean: Array, half_apart: float
) -> None:
    """An arm that stands on its palm: nearly straight, spread so that the wrists are `half_apart` from the middle."""
    sign, index = (1.0, 0) if side == "left" else (-1.0, 1)
    turns[f"{side}_clavicle"] = turns["thorax"] @ axis_turn(0, np.full(len(lean), sign * 0.25))
    length = skeleton.upper_arm[index] + skeleton.forearm[index]
    spread = np.full(
        len(lean), sign * np.arcsin(np.clip((half_apart - skeleton.shoulder[index][1]) / length, -0.5, 0.5))
    )
    upper = heading @ axis_turn(1, lean) @ axis_turn(0, spread)
    turns[f"{side}_upper_arm"] = upper
    turns[f"{side}_forearm"] = upper @ axis_turn(1, np.full(len(lean), -0.06))
    turns[f"{side}_hand"] = heading @ axis_turn(1, np.full(len(lean), -1.45))
