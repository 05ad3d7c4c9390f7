"""A stretch of a recorded motion as a recipe asks for it: from when on, how fast, again and again, along a bend, and
where in the room.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.body.person import PersonMotion, Skeleton, sampled
from studio.body.retargeting import above_floor, on_skeleton
from studio.errors import StudioError
from studio.geometry.rotations import axis_turn
from studio.motion_files.recorded_motion import RecordedMotion
from studio.synthesis.gait import eased

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


def recorded_person(
    recorded: RecordedMotion, skeleton: Skeleton, frames: int, fps: float, options: dict[str, float]
) -> PersonMotion:
    """`frames` frames at `fps` of the recording on the skeleton. options : of CLIP_OPTIONS.

    Raises StudioError for an unknown option, and where the recording is too short.
    """
    wanted = _checked(options)
    whole = on_skeleton(recorded, skeleton)
    times: Array = wanted["start_s"] + wanted["speed"] / fps * np.arange(frames, dtype=np.float64)
    if wanted["cycle_s"] > 0.0:
        motion = _repeated(_cycle(recorded, whole, wanted), times - wanted["start_s"], fps)
    else:
        _long_enough(recorded, times, wanted)
        motion = sampled(whole, times, fps)
    if wanted["radius_mm"] != 0.0:
        motion = bent(motion, wanted["radius_mm"], wanted["bank"])
    return placed(motion, np.radians(wanted["turn_degrees"]), (wanted["at_x_mm"], wanted["at_y_mm"]))


def bent(motion: PersonMotion, radius: float, bank: float) -> PersonMotion:
    """A motion that goes straight on the whole, bent to a circle of `radius` mm (below 0: to the right).

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
    """Turned about the vertical, then moved until the middle of the way's extent lies at `middle`."""
    about = axis_turn(2, turn)
    root = motion.root @ about.T
    centre = 0.5 * (root[:, :2].min(axis=0) + root[:, :2].max(axis=0))
    root = root + np.array([middle[0] - centre[0], middle[1] - centre[1], 0.0])
    return PersonMotion(
        motion.skeleton, motion.fps, root, {name: about @ own for name, own in motion.turns.items()}
    )


def with_defaults(options: dict[str, float], known: dict[str, float]) -> dict[str, float]:
    """All known options, as asked for or as usual. Raises StudioError for one that is not known."""
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise StudioError(f"The motion has no option '{unknown[0]}'.", f"It has {', '.join(known)}.")
    return known | options


def _cycle(recorded: RecordedMotion, whole: PersonMotion, wanted: dict[str, float]) -> PersonMotion:
    """One cycle whose last frame has the pose of its first: what they differ by is spread over the cycle."""
    count = max(2, round(wanted["cycle_s"] * whole.fps) + 1)
    times: Array = wanted["start_s"] + np.arange(count, dtype=np.float64) / whole.fps
    _long_enough(recorded, times, wanted)
    cycle = sampled(whole, times, whole.fps)
    share = eased(np.linspace(0.0, 1.0, count))[:, None]
    turns = {}
    for name, turn in cycle.turns.items():
        missing = Rotation.from_matrix(turn[-1].T @ turn[0]).as_rotvec()
        turns[name] = turn @ Rotation.from_rotvec(share * missing).as_matrix()
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
    wanted = with_defaults(options, CLIP_OPTIONS)
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
