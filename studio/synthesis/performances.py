"""Another performance of a person's motion: the same movements in another tempo, every joint a little different, the
feet where they stood.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.body.person import SIDES, PersonMotion, joint_points, sampled
from studio.body.retargeting import above_floor, lowest_of_sole
from studio.geometry.rotations import axis_turn
from studio.training.smooth_noise import smooth_noise, warped_times

Array = NDArray[np.float64]

CARRIERS = {
    "thorax": "pelvis",
    "head": "thorax",
    **{f"{side}_clavicle": "thorax" for side in SIDES},
    **{f"{side}_upper_arm": f"{side}_clavicle" for side in SIDES},
    **{f"{side}_forearm": f"{side}_upper_arm" for side in SIDES},
    **{f"{side}_hand": f"{side}_forearm" for side in SIDES},
    **{f"{side}_thigh": "pelvis" for side in SIDES},
    **{f"{side}_shin": f"{side}_thigh" for side in SIDES},
    **{f"{side}_foot": f"{side}_shin" for side in SIDES},
}
"""Which segment carries which, carriers first."""
HINGES = tuple(f"{side}_{part}" for side in SIDES for part in ("forearm", "shin"))
LESS = {"pelvis": 0.4, "head": 0.5, **{f"{side}_{part}": 0.5 for side in SIDES for part in ("hand", "foot")}}
TEMPO_PERIOD_S, TURN_PERIOD_S = 4.0, 3.0
LASTING, STILL_SHARE, FULL_SPREAD = 0.5, 0.25, np.radians(30.0)
STRAIGHT = 0.03  # a knee or elbow is not bent backwards: it keeps this angle, radians, or what it had
STANDING_MM = 20.0  # a foot this much higher than the other counts less by e


@dataclass(frozen=True, slots=True)
class Variation:
    """How much performances differ, standard deviations. tempo : of the logarithm of the speed. degrees : of joints."""

    tempo: float = 0.1
    degrees: float = 4.0


def performance(
    motion: PersonMotion, frames: int, fps: float, variation: Variation, rng: np.random.Generator
) -> PersonMotion:
    """`frames` frames at `fps` of another performance of the whole motion."""
    seconds = (motion.frame_count - 1) / motion.fps
    shown = sampled(motion, warped_times(rng, frames, seconds, variation.tempo, TEMPO_PERIOD_S), fps)
    turned = from_local(shown, _changed(to_local(shown), fps, np.radians(variation.degrees), rng))
    return above_floor(_standing_as(turned, shown))


def to_local(motion: PersonMotion) -> dict[str, Array]:
    """Each segment's turn against the one that carries it, (F, 3, 3); the pelvis's in the world."""
    turns = motion.turns
    return {
        name: np.swapaxes(turns[CARRIERS[name]], 1, 2) @ turn if name in CARRIERS else turn
        for name, turn in turns.items()
    }


def from_local(motion: PersonMotion, local: dict[str, Array]) -> PersonMotion:
    """The motion with other turns, given as `to_local` gives them."""
    turns = {"pelvis": local["pelvis"]}
    for name, carrier in CARRIERS.items():
        turns[name] = turns[carrier] @ local[name]
    return PersonMotion(motion.skeleton, motion.fps, motion.root, turns)


def _changed(local: dict[str, Array], fps: float, size: float, rng: np.random.Generator) -> dict[str, Array]:
    """The local turns with slow changes of about `size` radians; joints that hardly move change less."""
    found = {}
    for name, turn in local.items():
        slow = smooth_noise(rng, len(turn), 3, fps, TURN_PERIOD_S)
        noise = np.sqrt(1.0 - LASTING**2) * slow + LASTING * rng.standard_normal(3)
        own = Rotation.from_matrix(turn)
        spread = float(np.sqrt(np.mean((own * own.mean().inv()).magnitude() ** 2)))
        share = STILL_SHARE + (1.0 - STILL_SHARE) * min(spread / FULL_SPREAD, 1.0)
        noise = size * LESS.get(name, 1.0) * share * noise
        if name in HINGES:
            found[name] = turn @ axis_turn(1, _bend_change(turn, noise[:, 1]))
        else:
            found[name] = turn @ Rotation.from_rotvec(noise).as_matrix()
    return found


def _bend_change(turn: Array, change: Array) -> Array:
    """(F,) the change of a hinge's angle, as far as it does not bend the joint backwards."""
    bend = np.arctan2(turn[:, 0, 2], turn[:, 0, 0])
    way = np.sign(np.median(bend))
    least = np.minimum(way * bend, STRAIGHT)
    return way * np.maximum(way * (bend + change), least) - bend


def _standing_as(motion: PersonMotion, before: PersonMotion) -> PersonMotion:
    """The motion moved in every frame so that the foot that bears the person is where it was before."""
    heights = np.stack([lowest_of_sole(before, side) for side in SIDES], axis=1)
    weights = np.exp(-(heights - heights.min(axis=1, keepdims=True)) / STANDING_MM)
    weights /= weights.sum(axis=1, keepdims=True)
    then, now = joint_points(before), joint_points(motion)
    move = np.zeros_like(motion.root)
    for index, side in enumerate(SIDES):
        away = then[f"{side}_foot"] - now[f"{side}_foot"]
        away[:, 2] = lowest_of_sole(before, side) - lowest_of_sole(motion, side)
        move += weights[:, index : index + 1] * away
    return PersonMotion(motion.skeleton, motion.fps, motion.root + move, motion.turns)
