"""How the rendered person carries themselves: trunk, arms, and how high the pelvis may be over the feet."""

import numpy as np
from numpy.typing import NDArray

from studio.body.person import Skeleton
from studio.geometry.rotations import axis_turn
from studio.synthesis.gait import FootTrack, leg_to_ankle
from studio.synthesis.person import yaw_pitch_roll

Array = NDArray[np.float64]
NEARLY_STRAIGHT = 0.994


def allowed_height(skeleton: Skeleton, root: Array, pelvis: Array, feet: list[FootTrack]) -> Array:
    """(F,) the height above `root` at which the pelvis still lets both ankles be reached without quite
    straightening a knee."""
    allowed = np.full(len(root), np.inf)
    for sign, index, track in ((1.0, 0, feet[0]), (-1.0, 1, feet[1])):
        leg = NEARLY_STRAIGHT * (skeleton.thigh[index] + skeleton.shin[index])
        hip = root + sign * skeleton.hip_half_width[index] * pelvis[:, :, 1]
        across = np.linalg.norm((track.ankle - hip)[:, :2], axis=1)
        above = np.sqrt(np.maximum(leg**2 - across**2, 0.0))
        allowed = np.minimum(allowed, track.ankle[:, 2] + above - hip[:, 2])
    return allowed


def trunk(
    heading: Array, pitch: Array | float, twist: Array | float, roll: Array | float
) -> dict[str, Array]:
    """Pelvis, thorax (twisted against the pelvis about its own axis) and head, which looks where the person goes."""
    level = np.zeros_like(heading)
    pelvis = yaw_pitch_roll(heading, level + 0.6 * pitch, level + roll)
    thorax = pelvis @ axis_turn(1, level + 0.4 * pitch) @ axis_turn(2, level + twist)
    head = thorax @ yaw_pitch_roll(-0.55 * (level + twist), level + 0.10, -0.6 * (level + roll))
    return {"pelvis": pelvis, "thorax": thorax, "head": head}


def add_arm(turns: dict[str, Array], side: str, forward: Array, outward: Array, bend: Array) -> None:
    """An arm swung `forward`, held `outward` and bent by `bend` at the elbow, radians; the clavicle gives
    way to it a little. Adds clavicle, upper arm, forearm and hand.
    """
    sign = 1.0 if side == "left" else -1.0
    clavicle = turns["thorax"] @ axis_turn(2, -sign * 0.08 * forward) @ axis_turn(0, sign * 0.06 * outward)
    upper = (
        turns["thorax"]
        @ axis_turn(1, -forward)
        @ axis_turn(0, sign * outward)
        @ axis_turn(2, -sign * 0.25 + 0.0 * bend)
    )
    forearm = upper @ axis_turn(1, -bend)
    turns |= {f"{side}_clavicle": clavicle, f"{side}_upper_arm": upper, f"{side}_forearm": forearm}
    turns[f"{side}_hand"] = (
        forearm @ axis_turn(2, -sign * 0.5 + 0.0 * bend) @ axis_turn(1, -0.15 + 0.0 * bend)
    )


def add_leg(
    turns: dict[str, Array],
    skeleton: Skeleton,
    side: str,
    root: Array,
    foot: tuple[Array, Array],
    ahead: Array,
) -> None:
    """A leg from the pelvis at `root` (F, 3) to a foot, the knee pointing `ahead`. foot : ankle (F, 3), turn (F, 3, 3).

    Adds thigh, shin and foot.
    """
    sign, index = (1.0, 0) if side == "left" else (-1.0, 1)
    hip = root + sign * skeleton.hip_half_width[index] * turns["pelvis"][:, :, 1]
    thigh, shin = leg_to_ankle(hip, foot[0], ahead, skeleton.thigh[index], skeleton.shin[index])
    turns |= {f"{side}_thigh": thigh, f"{side}_shin": shin, f"{side}_foot": foot[1]}


def frame_rate(times: Array) -> float:
    """Frames per second of evenly spaced times."""
    return float(1.0 / (times[1] - times[0])) if len(times) > 1 else 60.0
