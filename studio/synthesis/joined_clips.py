"""Several recorded clips as one motion: each goes on where the one before ends, facing the same way, with a blend in
which both are seen; what one clip leaves out in speed and heading, the next takes up.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from studio.body.mending import mended, with_hands_above_floor
from studio.body.person import PersonMotion, Skeleton, sampled
from studio.body.retargeting import above_floor, on_skeleton
from studio.errors import StudioError
from studio.geometry.rotations import axis_turn
from studio.motion_files.recorded_motion import RecordedMotion
from studio.synthesis.gait import eased
from studio.synthesis.performances import Variation, from_local, performance, to_local
from studio.synthesis.recorded_clip import placed, with_defaults

Array = NDArray[np.float64]

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
    """A stretch of a recorded motion. file : as a recipe names files. seconds : 0: to its end. turn_degrees : the way
    bends by this much, evenly along it. blend_s : how long this clip and the one before it are seen together.
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

    Raises StudioError for an unknown option, clips that are too short, and fewer frames of motion than asked for.
    """
    wanted = _checked(options)
    whole = joined([(clip, _stretch(clip, recorded, skeleton)) for clip, recorded in recordings])
    seconds = (whole.frame_count - 1) / RATE
    if wanted["performance"] > 0.0:
        variation = Variation(wanted["tempo_change"], wanted["angle_change_degrees"])
        rng = np.random.default_rng(int(wanted["performance"]))
        motion = performance(whole, frames, fps, variation, rng)
    elif (frames - 1) / fps > seconds + 0.5 / RATE:
        raise StudioError(
            f"The clips last {seconds:.2f} s together, the recipe shows {(frames - 1) / fps:.2f} s.",
            f"Ask for at most {int(seconds * fps) + 1} frames, or give more clips.",
        )
    else:
        motion = sampled(whole, np.arange(frames) / fps, fps)
    motion = with_hands_above_floor(motion)
    return placed(motion, np.radians(wanted["turn_degrees"]), (wanted["at_x_mm"], wanted["at_y_mm"]))


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
    """The way bent by `turn` radians in all, evenly along it; who stands does not turn."""
    smooth = gaussian_filter1d(motion.root[:, :2], WAY_SMOOTHING_S * motion.fps, axis=0, mode="nearest")
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))])
    angle = turn * gone / max(float(gone[-1]), 1e-9)
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
            f"Clip '{clip.file}' lasts {recorded.seconds:.2f} s; {clip.start_s:g} to {last:g} s are asked for.",
            "Correct start_s or seconds of the clip.",
        )
    times = clip.start_s + np.arange(int((last - clip.start_s) * RATE + 1e-6) + 1) / RATE
    motion = mended(sampled(on_skeleton(recorded, skeleton), times, RATE))
    return wound(motion, np.radians(clip.turn_degrees))


def _facing_as(before: PersonMotion, after: PersonMotion, overlap: int) -> PersonMotion:
    """`after` turned about the vertical until both face the same way in the middle of the overlap."""
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
    """Both motions as one: places by blended speeds, heights and the joints' turns blended themselves."""
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
    turns = {}
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


def _checked(options: dict[str, float]) -> dict[str, float]:
    wanted = with_defaults(options, JOINED_OPTIONS)
    if wanted["performance"] < 0.0 or wanted["performance"] != int(wanted["performance"]):
        raise StudioError(
            f"options.performance is {wanted['performance']:g}, not a whole number from 0 on.",
            "Correct the entry.",
        )
    if not (0.0 <= wanted["tempo_change"] <= 1.0 and 0.0 <= wanted["angle_change_degrees"] <= 45.0):
        raise StudioError(
            "options.tempo_change is not 0 to 1, or options.angle_change_degrees not 0 to 45.",
            "Correct the entry.",
        )
    return wanted
