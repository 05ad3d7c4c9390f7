"""Recorded motion for recipes: a stretch of it, several clips joined, another performance of a whole.

A joined clip continues where the one before ends, with the same heading, and is blended with it in places, speeds and
turns.
"""

from dataclasses import dataclass

import msgspec
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from studio.body.mending import mended, with_hands_above_floor
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points, sampled
from studio.body.retargeting import above_floor, lowest_of_sole, on_skeleton
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.gait import eased
from studio.runs.learning.oversampling import smooth_noise, warped_times

# Another performance of a person's motion: the same movements in another tempo, every joint a little different, the
# feet where they stood.

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
"""Each segment's parent segment, parents first."""
HINGES = tuple(f"{side}_{part}" for side in SIDES for part in ("forearm", "shin"))
LESS = {"pelvis": 0.4, "head": 0.5, **{f"{side}_{part}": 0.5 for side in SIDES for part in ("hand", "foot")}}
TEMPO_PERIOD_S, TURN_PERIOD_S = 4.0, 3.0
LASTING, STILL_SHARE, FULL_SPREAD = 0.5, 0.25, np.radians(30.0)
STRAIGHT = 0.03  # a knee or elbow is not bent backwards: it keeps at least this angle, radians, or its own
STANDING_MM = 20.0  # a foot this much higher than the other counts less by e


@dataclass(frozen=True, slots=True)
class Variation:
    """Variation between performances, standard deviations. tempo : of the log speed. degrees : of joints."""

    tempo: float = 0.1
    degrees: float = 4.0


def performance(
    motion: PersonMotion, frames: int, fps: float, variation: Variation, rng: np.random.Generator
) -> PersonMotion:
    """`frames` frames at `fps` of another performance of the whole motion."""
    seconds = (motion.frame_count - 1) / motion.fps
    shown = sampled(motion, warped_times(rng, frames, seconds, variation.tempo, TEMPO_PERIOD_S), fps)
    turned = from_local(shown, _vary(to_local(shown), fps, np.radians(variation.degrees), rng))
    return above_floor(_standing_as(turned, shown))


def to_local(motion: PersonMotion) -> dict[str, Array]:
    """Each segment's rotation relative to its parent, (F, 3, 3); the pelvis's in the world."""
    turns = motion.turns
    return {
        name: np.swapaxes(turns[CARRIERS[name]], 1, 2) @ turn if name in CARRIERS else turn
        for name, turn in turns.items()
    }


def from_local(motion: PersonMotion, local: dict[str, Array]) -> PersonMotion:
    """The motion with other rotations, in the form of `to_local`."""
    turns = {"pelvis": local["pelvis"]}
    for name, carrier in CARRIERS.items():
        turns[name] = turns[carrier] @ local[name]
    return PersonMotion(motion.skeleton, motion.fps, motion.root, turns)


def _vary(local: dict[str, Array], fps: float, size: float, rng: np.random.Generator) -> dict[str, Array]:
    """The local turns with slow changes of about `size` radians; joints that hardly move change less."""
    changed: dict[str, Array] = {}
    for name, turn in local.items():
        slow = smooth_noise(rng, len(turn), 3, fps, TURN_PERIOD_S)
        noise = np.sqrt(1.0 - LASTING**2) * slow + LASTING * rng.standard_normal(3)
        own = Rotation.from_matrix(turn)
        spread = float(np.sqrt(np.mean((own * own.mean().inv()).magnitude() ** 2)))
        share = STILL_SHARE + (1.0 - STILL_SHARE) * min(spread / FULL_SPREAD, 1.0)
        noise = size * LESS.get(name, 1.0) * share * noise
        if name in HINGES:
            changed[name] = turn @ axis_turn(1, _bend_change(turn, noise[:, 1]))
        else:
            changed[name] = turn @ Rotation.from_rotvec(noise).as_matrix()
    return changed


def _bend_change(turn: Array, change: Array) -> Array:
    """(F,) the change of a hinge's angle, as far as it does not bend the joint backwards."""
    bend = np.arctan2(turn[:, 0, 2], turn[:, 0, 0])
    way = np.sign(np.median(bend))
    least = np.minimum(way * bend, STRAIGHT)
    return way * np.maximum(way * (bend + change), least) - bend


def _standing_as(motion: PersonMotion, before: PersonMotion) -> PersonMotion:
    """The motion moved in every frame so that the supporting foot is where it was before."""
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


# A stretch of a recorded motion for a recipe: start, speed, repetition, bend, and place in the room.


CLIP_OPTIONS = {
    "start_s": 0.0,  # first moment of the recording
    "speed": 1.0,  # seconds of the recording a second of footage
    "cycle_s": 0.0,  # above 0: this much of the recording from start_s on is repeated, its ends joined
    "turn_degrees": 0.0,  # turns the way about the vertical, counter-clockwise
    "at_x_mm": 0.0,  # where the middle of the way lies
    "at_y_mm": 0.0,
    "radius_mm": 0.0,  # not 0: the recorded way, on the whole straight, is bent to a circle; above 0 to the left
    "bank": 0.0,  # 0...1: how far the person leans into the bend, as a share of what their speed demands
}
GRAVITY = 9810.0


def recorded_person(
    recorded: RecordedMotion, skeleton: Skeleton, frames: int, fps: float, options: dict[str, float]
) -> PersonMotion:
    """`frames` frames at `fps` of the recording on the skeleton. options : of CLIP_OPTIONS.

    Raises StudioError for an unknown option, and where the recording is too short.
    """
    chosen = _checked_clip(options)
    whole = on_skeleton(recorded, skeleton)
    times: Array = chosen["start_s"] + chosen["speed"] / fps * np.arange(frames, dtype=np.float64)
    if chosen["cycle_s"] > 0.0:
        motion = _repeated(_cycle(recorded, whole, chosen), times - chosen["start_s"], fps)
    else:
        _long_enough(recorded, times, chosen)
        motion = sampled(whole, times, fps)
    if chosen["radius_mm"] != 0.0:
        motion = bent(motion, chosen["radius_mm"], chosen["bank"])
    return placed(motion, np.radians(chosen["turn_degrees"]), (chosen["at_x_mm"], chosen["at_y_mm"]))


def bent(motion: PersonMotion, radius: float, bank: float) -> PersonMotion:
    """A straight motion bent to a circle of `radius` mm (below 0: to the right).

    Every frame is moved and turned as a whole by its place along the way, and leans into the bend about the floor below
    the pelvis by `bank` times the angle whose tangent is v^2 / (r g).
    """
    first, last = motion.root[0, :2], motion.root[-1, :2]
    heading = float(np.arctan2(*(last - first)[::-1]))
    straight = placed(motion, -heading, (0.0, 0.0))
    along = straight.root[:, 0]
    angle = along / radius
    way = np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), np.zeros_like(angle)], axis=-1)
    speed = abs(along[-1] - along[0]) * motion.fps / max(len(along) - 1, 1)
    lean = -bank * np.arctan2(speed**2, abs(radius) * GRAVITY) * np.sign(radius)
    about = axis_turn(2, angle)
    level = straight.root * [0.0, 1.0, 0.0]
    risen = (axis_turn(0, lean) @ (straight.root * [0.0, 0.0, 1.0])[..., None])[..., 0]
    root = way + (about @ (level + risen)[..., None])[..., 0]
    turns = {name: about @ axis_turn(0, lean) @ own for name, own in straight.turns.items()}
    return above_floor(PersonMotion(motion.skeleton, motion.fps, root, turns))


def placed(motion: PersonMotion, turn: float, middle: tuple[float, float]) -> PersonMotion:
    """The motion turned about the vertical, then moved so that the middle of its extent is at `middle`."""
    about = axis_turn(2, turn)
    root = motion.root @ about.T
    centre = 0.5 * (root[:, :2].min(axis=0) + root[:, :2].max(axis=0))
    root = root + np.array([middle[0] - centre[0], middle[1] - centre[1], 0.0])
    return PersonMotion(
        motion.skeleton, motion.fps, root, {name: about @ own for name, own in motion.turns.items()}
    )


def with_defaults(options: dict[str, float], known: dict[str, float]) -> dict[str, float]:
    """All known options, given or default. Raises StudioError for an unknown one."""
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise StudioError(f"The motion has no option '{unknown[0]}'.", f"It has {', '.join(known)}.")
    return known | options


def _cycle(recorded: RecordedMotion, whole: PersonMotion, chosen: dict[str, float]) -> PersonMotion:
    """One cycle whose last frame has the pose of its first: the difference is spread over the cycle."""
    count = max(2, round(chosen["cycle_s"] * whole.fps) + 1)
    times: Array = chosen["start_s"] + np.arange(count, dtype=np.float64) / whole.fps
    _long_enough(recorded, times, chosen)
    cycle = sampled(whole, times, whole.fps)
    share = eased(np.linspace(0.0, 1.0, count))[:, None]
    turns: dict[str, Array] = {}
    for name, turn in cycle.turns.items():
        missing = Rotation.from_matrix(turn[-1].T @ turn[0]).as_rotvec()
        turns[name] = turn @ Rotation.from_rotvec(share * missing).as_matrix()
    root = cycle.root.copy()
    root[:, 2:] += share * (root[0, 2] - root[-1, 2])
    return PersonMotion(cycle.skeleton, cycle.fps, root, turns)


def _repeated(cycle: PersonMotion, times: Array, fps: float) -> PersonMotion:
    """The cycle repeated, each time starting where it ended."""
    length = (cycle.frame_count - 1) / cycle.fps
    rounds = np.floor(times / length)
    motion = sampled(cycle, times - rounds * length, fps)
    onward = (cycle.root[-1] - cycle.root[0]) * [1.0, 1.0, 0.0]
    return PersonMotion(cycle.skeleton, fps, motion.root + rounds[:, None] * onward, motion.turns)


def _checked_clip(options: dict[str, float]) -> dict[str, float]:
    chosen = with_defaults(options, CLIP_OPTIONS)
    if not 0.01 <= chosen["speed"] <= 100.0:
        raise StudioError(f"options.speed is {chosen['speed']:g}, not 0.01 to 100.", "Correct the entry.")
    if chosen["start_s"] < 0.0 or not 0.0 <= chosen["bank"] <= 1.0:
        raise StudioError("options.start_s is below 0, or options.bank not 0 to 1.", "Correct the entry.")
    return chosen


def _long_enough(recorded: RecordedMotion, times: Array, chosen: dict[str, float]) -> None:
    """Raises StudioError where the recording ends before the last of `times`."""
    if times[-1] > recorded.seconds + 0.5 / recorded.fps:
        raise StudioError(
            f"'{recorded.source}' lasts {recorded.seconds:.2f} s; the recipe shows it up to {times[-1]:.2f} s.",
            "Give fewer frames, an earlier start_s, a lower speed, or a cycle_s that repeats it.",
        )


RATE = 120.0
WAY_SMOOTHING_S = 0.2
JOINED_OPTIONS = {
    "turn_degrees": 0.0,  # turns the way about the vertical, counter-clockwise
    "at_x_mm": 0.0,  # where the middle of the way lies
    "at_y_mm": 0.0,
    "performance": 0.0,  # 0: as recorded; a number from 1 on: that performance, whole, in as many frames as there are
    "tempo_change": 0.1,  # of a performance: standard deviation of the speed's logarithm
    "angle_change_degrees": 4.0,  # of a performance: standard deviation of the joints' turns
}


class Clip(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stretch of a recorded motion. file : as a recipe names files. seconds : 0: to its end. turn_degrees : even
    bend of the path. blend_s : length of the blend with the clip before.
    """

    file: str
    skeleton_file: str = ""
    start_s: float = 0.0
    seconds: float = 0.0
    turn_degrees: float = 0.0
    blend_s: float = 0.5


def joined_person(
    recordings: list[tuple[Clip, RecordedMotion]],
    skeleton: Skeleton,
    frames: int,
    fps: float,
    options: dict[str, float],
) -> PersonMotion:
    """`frames` frames at `fps` of the clips one after the other. options : of JOINED_OPTIONS.

    Raises StudioError for an unknown option, clips that are too short, and fewer frames of motion than requested.
    """
    chosen = _checked_joining(options)
    whole = joined([(clip, _stretch(clip, recorded, skeleton)) for clip, recorded in recordings])
    seconds = (whole.frame_count - 1) / RATE
    if chosen["performance"] > 0.0:
        variation = Variation(chosen["tempo_change"], chosen["angle_change_degrees"])
        rng = np.random.default_rng(int(chosen["performance"]))
        motion = performance(whole, frames, fps, variation, rng)
    elif (frames - 1) / fps > seconds + 0.5 / RATE:
        raise StudioError(
            f"The clips last {seconds:.2f} s together, the recipe shows {(frames - 1) / fps:.2f} s.",
            f"Give at most {int(seconds * fps) + 1} frames, or more clips.",
        )
    else:
        motion = sampled(whole, np.arange(frames) / fps, fps)
    motion = with_hands_above_floor(motion)
    return placed(motion, np.radians(chosen["turn_degrees"]), (chosen["at_x_mm"], chosen["at_y_mm"]))


def joined(clips: list[tuple[Clip, PersonMotion]]) -> PersonMotion:
    """The motions (all at one rate) as one. Raises StudioError for one that is shorter than its blends."""
    whole = clips[0][1]
    for clip, motion in clips[1:]:
        overlap = round(clip.blend_s * motion.fps)
        if not 2 <= overlap < min(whole.frame_count, motion.frame_count):
            raise StudioError(
                f"Clip '{clip.file}': a blend of {clip.blend_s:g} s is longer than the clips, or has no frames.",
                "Correct blend_s, or take longer clips.",
            )
        whole = _blended(whole, _facing_as(whole, motion, overlap), overlap)
    return above_floor(whole)


def wound(motion: PersonMotion, turn: float) -> PersonMotion:
    """The motion with its path bent evenly by `turn` radians in all; it does not turn while standing."""
    smooth = gaussian_filter1d(motion.root[:, :2], WAY_SMOOTHING_S * motion.fps, axis=0, mode="nearest")
    covered = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))])
    angle = turn * covered / max(float(covered[-1]), 1e-9)
    steps = np.diff(motion.root, axis=0)
    turned = (axis_turn(2, 0.5 * (angle[1:] + angle[:-1])) @ steps[..., None])[..., 0]
    root = motion.root[:1] + np.concatenate([np.zeros((1, 3)), np.cumsum(turned, axis=0)])
    about = axis_turn(2, angle)
    return PersonMotion(
        motion.skeleton, motion.fps, root, {name: about @ own for name, own in motion.turns.items()}
    )


def _stretch(clip: Clip, recorded: RecordedMotion, skeleton: Skeleton) -> PersonMotion:
    """The clip on the skeleton at RATE."""
    last = clip.start_s + clip.seconds if clip.seconds > 0.0 else recorded.seconds
    if clip.start_s < 0.0 or not clip.start_s < last <= recorded.seconds + 0.5 / recorded.fps:
        raise StudioError(
            f"Clip '{clip.file}' lasts {recorded.seconds:.2f} s; {clip.start_s:g} to {last:g} s are requested.",
            "Correct start_s or seconds of the clip.",
        )
    times = clip.start_s + np.arange(int((last - clip.start_s) * RATE + 1e-6) + 1) / RATE
    motion = mended(sampled(on_skeleton(recorded, skeleton), times, RATE))
    return wound(motion, np.radians(clip.turn_degrees))


def _facing_as(before: PersonMotion, after: PersonMotion, overlap: int) -> PersonMotion:
    """`after` turned about the vertical so that both headings agree in the middle of the overlap."""
    theirs = _heading(before.turns["pelvis"][before.frame_count - overlap + overlap // 2])
    turn = axis_turn(2, np.array(theirs - _heading(after.turns["pelvis"][overlap // 2])))
    return PersonMotion(
        after.skeleton,
        after.fps,
        after.root @ turn.T,
        {name: turn @ own for name, own in after.turns.items()},
    )


def _heading(pelvis: Array) -> float:
    return float(np.arctan2(pelvis[1, 0], pelvis[0, 0]))


def _blended(before: PersonMotion, after: PersonMotion, overlap: int) -> PersonMotion:
    """Both motions as one: places from blended speeds; heights and joint rotations blended directly."""
    share = eased(np.linspace(0.0, 1.0, overlap))
    at = before.frame_count - overlap
    steps = [np.diff(motion.root[part, :2], axis=0) for motion, part in _parts(before, after, overlap)]
    between = 0.5 * (share[1:] + share[:-1])[:, None]
    way = np.cumsum((1.0 - between) * steps[0] + between * steps[1], axis=0)
    root = np.concatenate([before.root[:at], np.zeros((overlap, 3)), after.root[overlap:]])
    root[at : at + overlap, :2] = before.root[at, :2] + np.concatenate([np.zeros((1, 2)), way])
    heights = [motion.root[part, 2] for motion, part in _parts(before, after, overlap)]
    root[at : at + overlap, 2] = (1.0 - share) * heights[0] + share * heights[1]
    root[at + overlap :, :2] += root[at + overlap - 1, :2] - after.root[overlap - 1, :2]
    first, second = to_local(before), to_local(after)
    turns: dict[str, Array] = {}
    for name, turn in first.items():
        both = turn[at:], second[name][:overlap]
        missing = Rotation.from_matrix(np.swapaxes(both[0], 1, 2) @ both[1]).as_rotvec()
        mixed = both[0] @ Rotation.from_rotvec(share[:, None] * missing).as_matrix()
        turns[name] = np.concatenate([turn[:at], mixed, second[name][overlap:]])
    return from_local(PersonMotion(before.skeleton, before.fps, root, {}), turns)


def _parts(
    before: PersonMotion, after: PersonMotion, overlap: int
) -> tuple[tuple[PersonMotion, slice], tuple[PersonMotion, slice]]:
    return (before, slice(before.frame_count - overlap, None)), (after, slice(0, overlap))


def _checked_joining(options: dict[str, float]) -> dict[str, float]:
    chosen = with_defaults(options, JOINED_OPTIONS)
    if chosen["performance"] < 0.0 or chosen["performance"] != int(chosen["performance"]):
        raise StudioError(
            f"options.performance is {chosen['performance']:g}, not a whole number from 0 on.",
            "Correct the entry.",
        )
    if not (0.0 <= chosen["tempo_change"] <= 1.0 and 0.0 <= chosen["angle_change_degrees"] <= 45.0):
        raise StudioError(
            "options.tempo_change is not 0 to 1, or options.angle_change_degrees not 0 to 45.",
            "Correct the entry.",
        )
    return chosen
