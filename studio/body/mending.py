"""Repair of recorded motion: jitter is smoothed, lost feet are placed on the floor.

In the dancers' clips the feet's markers were confused: their ankles jump between two angles 90 degrees apart, and stand
upside down for whole seconds. Such feet are replaced: on the floor as the ankle's height allows, flat or on the toes;
in the air stretched as a dancer's. In one of them a knee is on the wrong side for two seconds.
"""

import numpy as np
import scipy
from scipy.spatial.transform import Rotation

from studio.body.person import SIDES, PersonMotion, joint_points
from studio.body.retargeting import FLOOR_SHARE, above_floor, smooth_above
from studio.foundations.arrays import Array
from studio.foundations.geometry.rotations import axis_turn, nearest_rotation

SMOOTHING_S = 0.04
TURNED_OVER = 1.0  # trace of a turn by 90 degrees
STRETCHED = np.radians(35.0)  # of a foot in the air
STEEPEST = np.radians(70.0)  # of a foot on its toes
BENT_UP, BENT_DOWN = np.radians(-30.0), np.radians(65.0)
TOES = 0.70  # of the toes in front of the ankle, as a share of the foot's length
HAND_CLEARANCE, ARM_SPREAD_S = 40.0, 0.2  # mm of the fingers' ends above the floor
ON_TOES, IN_THE_AIR = (0.8, 1.4)  # of the toes' reach: greatest height of a standing ankle; least in the air
LOST_BELOW, LOST_ABOVE, LOST_SHARE = float(np.radians(-40.0)), float(np.radians(75.0)), 0.05


def mended(motion: PersonMotion) -> PersonMotion:
    """The motion smoothed (a Gaussian of SMOOTHING_S), level on the floor, with lost feet replaced."""
    lost = feet_lost(motion)
    smooth = smoothed(with_knees_forward(motion), SMOOTHING_S)
    return above_floor(with_feet_on_floor(_levelled(smooth)) if lost else smooth)


def feet_lost(motion: PersonMotion) -> bool:
    """Whether the ankles of a recording bend impossibly in more than LOST_SHARE of the frames."""
    bends = np.stack([ankle_bend(motion, side) for side in SIDES])
    return float(np.mean((bends < LOST_BELOW) | (bends > LOST_ABOVE))) > LOST_SHARE


def ankle_bend(motion: PersonMotion, side: str) -> Array:
    """(F,) radians by which a foot is stretched away from the right angle with its shin; below 0 towards the shin."""
    toes = (np.swapaxes(motion.turns[f"{side}_shin"], 1, 2) @ motion.turns[f"{side}_foot"])[:, :, 0]
    return np.arctan2(-toes[:, 2], toes[:, 0])


def with_knees_forward(motion: PersonMotion) -> PersonMotion:
    """Stretches in which a knee was recorded behind the line from hip to ankle, mirrored to the front of it.

    A stretch begins and ends where a thigh turns over from one frame to the next; every other stretch is mirrored, so
    that the knee points ahead of the pelvis on the whole. Hips and ankles stay where they are.
    """
    turns, points = dict(motion.turns), joint_points(motion)
    for side in SIDES:
        thigh = motion.turns[f"{side}_thigh"]
        begins = np.flatnonzero(np.trace(_steps(thigh), axis1=1, axis2=2) < TURNED_OVER) + 1
        ahead: Array = (thigh[:, :, 0] * motion.turns["pelvis"][:, :, 0]).sum(axis=1)
        odd = np.searchsorted(begins, np.arange(motion.frame_count), side="right") % 2 == 1
        behind = odd if np.where(odd, -ahead, ahead).sum() >= 0.0 else ~odd
        if not len(begins):
            continue
        line = points[f"{side}_foot"] - points[f"{side}_thigh"]
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        over = 2.0 * line[:, :, None] * line[:, None, :] - np.eye(3)
        for part in ("thigh", "shin"):
            own = turns[f"{side}_{part}"]
            turns[f"{side}_{part}"] = np.where(behind[:, None, None], over @ own, own)
    return PersonMotion(motion.skeleton, motion.fps, motion.root, turns)


def _steps(turns: Array) -> Array:
    """(F - 1, 3, 3) rotation of each frame against the one before."""
    return np.swapaxes(turns[:-1], 1, 2) @ turns[1:]


def smoothed(motion: PersonMotion, seconds: float) -> PersonMotion:
    """Places and turns smoothed over time by a Gaussian of that standard deviation."""
    width = seconds * motion.fps
    turns = {name: nearest_rotation(_smooth(turn, width)) for name, turn in motion.turns.items()}
    return PersonMotion(motion.skeleton, motion.fps, _smooth(motion.root, width), turns)


def _smooth(values: Array, width: float) -> Array:
    """Values (F, ...) smoothed along frames; both ends are extrapolated, so that movement does not slow down there."""
    margin = min(int(np.ceil(4.0 * width)), len(values) - 1)
    before = 2.0 * values[:1] - values[margin:0:-1]
    after = 2.0 * values[-1:] - values[-2 : -margin - 2 : -1]
    extended = np.concatenate([before, values, after])
    return scipy.ndimage.gaussian_filter1d(extended, width, axis=0, mode="nearest")[
        margin : margin + len(values)
    ]


def with_feet_on_floor(motion: PersonMotion) -> PersonMotion:
    """Feet hinged at their ankles: flat or on the toes where the floor is in reach, else stretched."""
    bones, points, turns = motion.skeleton, joint_points(motion), dict(motion.turns)
    reach = TOES * bones.foot
    for side in SIDES:
        shin = motion.turns[f"{side}_shin"]
        height = (points[f"{side}_foot"][:, 2] - bones.ankle_height) / reach
        flat = np.arcsin(np.clip(height, 0.0, np.sin(STEEPEST)))
        forward, up = shin[:, 2, 0], shin[:, 2, 2]
        # The foot's axis in the shin's frame is (cos p, 0, -sin p); in the world it is to go down by sin(flat).
        size = np.maximum(np.hypot(forward, up), 1e-9)
        standing = np.arccos(np.clip(-np.sin(flat) / size, -1.0, 1.0)) - np.arctan2(up, forward)
        share = np.clip((height - ON_TOES) / (IN_THE_AIR - ON_TOES), 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        bend = np.clip((1.0 - share) * standing + share * STRETCHED, BENT_UP, BENT_DOWN)
        bend = scipy.ndimage.gaussian_filter1d(bend, SMOOTHING_S * motion.fps, mode="nearest")
        turns[f"{side}_foot"] = shin @ axis_turn(1, bend)
    return PersonMotion(bones, motion.fps, motion.root, turns)


def with_hands_above_floor(motion: PersonMotion) -> PersonMotion:
    """The motion with arms raised at the shoulders while their fingers would be in the floor."""
    turns, points = dict(motion.turns), joint_points(motion)
    spread = max(1, round(ARM_SPREAD_S * motion.fps))
    for side in SIDES:
        arm = points[f"{side}_fingers"] - points[f"{side}_upper_arm"]
        below = np.maximum(HAND_CLEARANCE - points[f"{side}_fingers"][:, 2], 0.0)
        lift = smooth_above(below, spread)
        length = np.maximum(np.linalg.norm(arm, axis=1), 1e-9)
        now = np.arcsin(np.clip(arm[:, 2] / length, -1.0, 1.0))
        angle = np.arcsin(np.clip((arm[:, 2] + lift) / length, -1.0, 1.0)) - now
        # About the horizontal across the arm, which raises it; an arm straight down goes up ahead of the thorax.
        flat = arm * [1.0, 1.0, 0.0] + 1e-3 * motion.turns["thorax"][:, :, 0]
        across = np.cross(flat, np.array([0.0, 0.0, 1.0]))
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        raised = Rotation.from_rotvec(angle[:, None] * across).as_matrix()
        for part in ("upper_arm", "forearm", "hand"):
            turns[f"{side}_{part}"] = raised @ turns[f"{side}_{part}"]
    return PersonMotion(motion.skeleton, motion.fps, motion.root, turns)


def _levelled(motion: PersonMotion) -> PersonMotion:
    """The motion moved up or down as a whole until the lower ankle mostly is as high as one on a flat foot."""
    points = joint_points(motion)
    lower = np.min([points[f"{side}_foot"][:, 2] for side in SIDES], axis=0)
    lift = motion.skeleton.ankle_height - float(np.quantile(lower, FLOOR_SHARE))
    root = motion.root + np.array([0.0, 0.0, lift])
    return PersonMotion(motion.skeleton, motion.fps, root, motion.turns)
