"""A stretch of a recorded motion as a recipe asks for it: from when on, how fast, again and again, along a bend, and
where in the room.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from studio.errors import StudioError
from studio.geometry.rotations import axis_turn, rotation_from_vector, vector_from_rotation
from studio.synthesis.acclaim import read_acclaim
from studio.synthesis.bvh import read_bvh
from studio.synthesis.gait import eased, leg_to_ankle
from studio.synthesis.humanoid_arrays import read_humanoid_arrays
from studio.synthesis.person import SIDES, PersonMotion, Skeleton, joint_points
from studio.synthesis.recorded_motion import RecordedMotion
from studio.synthesis.retargeting import on_skeleton

Array = NDArray[np.float64]

CLIP_OPTIONS = {
    "start_s": 0.0,  # first moment of the recording that is shown
    "speed": 1.0,  # seconds of the recording a second of footage
    "cycle_s": 0.0,  # above 0: this much of the recording from start_s on is repeated, its ends joined
    "turn_degrees": 0.0,  # turns the way about the vertical, counter-clockwise
    "at_x_mm": 0.0,  # where the middle of the way lies
    "at_y_mm": 0.0,
    "radius_mm": 0.0,  # not 0: the recorded way, on the whole straight, is bent to a circle; above 0 to the left
    "bank": 0.0,  # 0...1: how far the person leans into the bend, as a share of what their speed demands
}
GRAVITY = 9810.0
UP = np.array([0.0, 0.0, 1.0])


def read_recording(path: Path, skeleton: Path | None = None) -> RecordedMotion:
    """The motion in a file, by its ending: .amc, .bvh or .npz. Raises StudioError naming the endings there are."""
    if path.suffix == ".amc":
        return read_acclaim(path, skeleton)
    readers = {".bvh": read_bvh, ".npz": read_humanoid_arrays}
    if path.suffix not in readers:
        raise StudioError(
            f"'{path.name}' is no motion file that can be read.", "Give an .amc, .bvh or .npz file."
        )
    return readers[path.suffix](path)


def recorded_person(
    recorded: RecordedMotion, skeleton: Skeleton, frames: int, fps: float, options: dict[str, float]
) -> PersonMotion:
    """`frames` frames at `fps` of the recording on the skeleton. options : of CLIP_OPTIONS.

    Raises StudioError for an unknown option, and where the recording is too short.
    """
    wanted = _checked(options)
    whole = on_skeleton(recorded, skeleton)
    times = wanted["start_s"] + wanted["speed"] * np.arange(frames) / fps
    if wanted["cycle_s"] > 0.0:
        motion = _repeated(_cycle(recorded, whole, wanted), times - wanted["start_s"], fps)
    else:
        _long_enough(recorded, times, wanted)
        motion = sampled(whole, times, fps)
    if wanted["radius_mm"] != 0.0:
        motion = bent(motion, wanted["radius_mm"], wanted["bank"])
    return _placed(motion, np.radians(wanted["turn_degrees"]), (wanted["at_x_mm"], wanted["at_y_mm"]))


def sampled(motion: PersonMotion, times: Array, fps: float) -> PersonMotion:
    """The motion at times (F,) in seconds from its first frame: places between frames on straight lines, turns along
    the shortest turn. fps : of the result.
    """
    known = np.arange(motion.frame_count) / motion.fps
    inside = np.clip(times, known[0], known[-1])
    root = np.stack([np.interp(inside, known, motion.root[:, axis]) for axis in range(3)], axis=-1)
    turns = {
        name: Slerp(known, Rotation.from_matrix(turn))(inside).as_matrix()
        for name, turn in motion.turns.items()
    }
    return PersonMotion(motion.skeleton, fps, root, turns)


def bent(motion: PersonMotion, radius: float, bank: float) -> PersonMotion:
    """A motion that goes straight on the whole, bent to a circle of `radius` mm (below 0: to the right).

    Every frame is moved and turned as a whole by its place along the way. The body above the feet leans into the bend
    by `bank` times the angle whose tangent is v^2 / (r g); the legs reach for the feet where these are.
    """
    first, last = motion.root[0, :2], motion.root[-1, :2]
    heading = float(np.arctan2(*(last - first)[::-1]))
    straight = _placed(motion, -heading, (0.0, 0.0))
    along = straight.root[:, 0]
    angle = along / radius
    way = np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), np.zeros_like(angle)], axis=-1)
    turn = axis_turn(2, angle)
    beside = straight.root * [0.0, 1.0, 1.0]
    root = way + (turn @ beside[..., None])[..., 0]
    turns = {name: turn @ own for name, own in straight.turns.items()}
    whole = PersonMotion(motion.skeleton, motion.fps, root, turns)
    speed = abs(along[-1] - along[0]) * motion.fps / max(len(along) - 1, 1)
    lean = bank * np.arctan2(speed**2, abs(radius) * GRAVITY) * np.sign(radius)
    return _leaning(whole, turn @ axis_turn(0, -lean) @ np.swapaxes(turn, 1, 2))


def _leaning(motion: PersonMotion, lean: Array) -> PersonMotion:
    """The body turned by `lean` (F, 3, 3) about the floor below the pelvis, with the feet left where they are."""
    feet = joint_points(motion)
    below = motion.root * [1.0, 1.0, 0.0]
    root = below + (lean @ (motion.root - below)[..., None])[..., 0]
    turns = {name: turn if name.endswith("_foot") else lean @ turn for name, turn in motion.turns.items()}
    leant = PersonMotion(motion.skeleton, motion.fps, root, turns)
    hips = joint_points(leant)
    for index, side in enumerate(SIDES):
        turns[f"{side}_thigh"], turns[f"{side}_shin"] = leg_to_ankle(
            hips[f"{side}_thigh"],
            feet[f"{side}_foot"],
            turns[f"{side}_thigh"][:, :, 0],
            motion.skeleton.thigh[index],
            motion.skeleton.shin[index],
        )
    return leant


def _placed(motion: PersonMotion, turn: float, middle: tuple[float, float]) -> PersonMotion:
    """Turned about the vertical, then moved until the middle of the way's extent lies at `middle`."""
    about = axis_turn(2, turn)
    root = motion.root @ about.T
    centre = 0.5 * (root[:, :2].min(axis=0) + root[:, :2].max(axis=0))
    root = root + np.array([middle[0] - centre[0], middle[1] - centre[1], 0.0])
    return PersonMotion(
        motion.skeleton, motion.fps, root, {name: about @ own for name, own in motion.turns.items()}
    )


def _cycle(recorded: RecordedMotion, whole: PersonMotion, wanted: dict[str, float]) -> PersonMotion:
    """One cycle whose last frame has the pose of its first: what they differ by is spread over the cycle."""
    count = max(2, round(wanted["cycle_s"] * whole.fps) + 1)
    times = wanted["start_s"] + np.arange(count) / whole.fps
    _long_enough(recorded, times, wanted)
    cycle = sampled(whole, times, whole.fps)
    share = eased(np.linspace(0.0, 1.0, count))[:, None]
    turns = {}
    for name, turn in cycle.turns.items():
        missing = vector_from_rotation(turn[-1].T @ turn[0])
        turns[name] = turn @ rotation_from_vector(share * missing)
    root = cycle.root.copy()
    root[:, 2:] += share * (root[0, 2] - root[-1, 2])
    return PersonMotion(cycle.skeleton, cycle.fps, root, turns)


def _repeated(cycle: PersonMotion, times: Array, fps: float) -> PersonMotion:
    """The cycle again and again, each time starting where it ended."""
    length = (cycle.frame_count - 1) / cycle.fps
    rounds = np.floor(times / length)
    motion = sampled(cycle, times - rounds * length, fps)
    onward = (cycle.root[-1] - cycle.root[0]) * [1.0, 1.0, 0.0]
    return PersonMotion(cycle.skeleton, fps, motion.root + rounds[:, None] * onward, motion.turns)


def _checked(options: dict[str, float]) -> dict[str, float]:
    unknown = sorted(set(options) - set(CLIP_OPTIONS))
    if unknown:
        raise StudioError(
            f"A recorded motion has no option '{unknown[0]}'.", f"It has {', '.join(CLIP_OPTIONS)}."
        )
    wanted = CLIP_OPTIONS | options
    if not 0.01 <= wanted["speed"] <= 100.0:
        raise StudioError(f"options.speed is {wanted['speed']:g}, not 0.01 to 100.", "Correct the entry.")
    if wanted["start_s"] < 0.0 or not 0.0 <= wanted["bank"] <= 1.0:
        raise StudioError("options.start_s is below 0, or options.bank not 0 to 1.", "Correct the entry.")
    return wanted


def _long_enough(recorded: RecordedMotion, times: Array, wanted: dict[str, float]) -> None:
    """Raises StudioError where the recording ends before the last of `times`."""
    if times[-1] > recorded.seconds + 0.5 / recorded.fps:
        raise StudioError(
            f"'{recorded.source}' lasts {recorded.seconds:.2f} s; the recipe shows it up to {times[-1]:.2f} s.",
            "Ask for fewer frames, an earlier start_s, a lower speed, or a cycle_s that repeats it.",
        )
