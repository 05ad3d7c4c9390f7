"""The motions that footage can be made of, each a set of smooth curves on the synthetic skeleton.

A motion takes the skeleton, the frame times (F,) in seconds and its options, and returns a `PersonMotion`.
All were written for this project; none is recorded from a person.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from studio.body.person import SIDES, PersonMotion, Skeleton
from studio.errors import StudioError
from studio.geometry.rotations import axis_turn
from studio.synthesis.circuit import circuit
from studio.synthesis.exercises import crouch, sit
from studio.synthesis.gait import (
    Gait,
    Obstacle,
    Path,
    circle_path,
    foot_track,
    line_path,
    winding_path,
)
from studio.synthesis.handstand import handstand
from studio.synthesis.journeys import Journey, Stretch
from studio.synthesis.posture import add_arm, add_leg, allowed_height, frame_rate, trunk

Array = NDArray[np.float64]
Options = dict[str, float]
BOB, RUNNING_BOB, RISE_S = 0.6, 0.018, 0.5

MotionMaker = Callable[[Skeleton, Array, Options], PersonMotion]


def walk(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A walk in a circle with turns: options radius_mm, sway_mm (how far the path leaves the circle),
    speed_mm_s, cadence, start_degrees.
    """
    radius = options.get("radius_mm", 950.0)
    path = winding_path(
        radius, options.get("sway_mm", 80.0), 2.0, np.radians(options.get("start_degrees", -120.0))
    )
    gait = Gait(
        speed=options.get("speed_mm_s", 900.0),
        cadence=options.get("cadence", 1.85),
        duty=0.60,
        foot_spacing=0.09 * skeleton.height,
        lift=35.0,
        heel_rise=0.45,
    )
    return _along(skeleton, times, gait, path, swing=0.33, elbow=0.40, lean=0.05)


def run(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A run in a circle: options radius_mm, speed_mm_s, cadence, start_degrees."""
    path = circle_path(options.get("radius_mm", 1150.0), np.radians(options.get("start_degrees", -150.0)))
    gait = Gait(options.get("speed_mm_s", 2200.0), options.get("cadence", 2.7), 0.32, 110.0, 170.0, 0.6)
    return _along(skeleton, times, gait, path, swing=0.62, elbow=1.35, lean=0.13)


def box(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """Walking straight and stepping over a box at the origin: options height_mm of the box, speed_mm_s, cadence.

    With turn_after_mm above 0 the person turns 180 degrees on the spot that far behind the box and steps over it
    again (Deutscher & Reid 2005, Fig. 10); turn_steps is how many whole steps more than the way takes they turn in,
    before_mm how far before the box the footage begins.
    """
    speed = options.get("speed_mm_s", 900.0)
    gait = Gait(speed, options.get("cadence", 1.6), 0.60, 0.11 * skeleton.height, 50.0, 0.45)
    # A left footprint's toes end as far before the box's middle as the next right one's heel is behind it.
    toes, heel = 0.70 * skeleton.foot, 0.28 * skeleton.foot
    before = 0.5 * (speed / gait.cadence + toes - heel)
    start = -before - speed * gait.cycle * (0.5 * gait.duty + 1.0)
    clearance = options.get("height_mm", 120.0) + 150.0

    def obstacle(places: Array, begin: Array, end: Array) -> Array:
        over = np.where(begin[:, 0] * end[:, 0] < 0.0, clearance, 0.0)
        return over * np.exp(-((places[:, 0] / 480.0) ** 4))

    path, after = line_path((start, 0.0), 0.0), options.get("turn_after_mm", 0.0)
    if after > 0.0:
        step = speed / gait.cadence
        # Whole steps between the two crossings, so that the feet stand about the box alike.
        turning = (np.ceil(2.0 * after / step) + options.get("turn_steps", 3.0)) * step - 2.0 * after
        on_the_spot = Stretch(turning, turn=np.pi, onward=0.0)
        path = Journey((start, 0.0), 0.0, (Stretch(after - start), on_the_spot), ease=0.18 * step)
    sooner = max(-start - options["before_mm"], 0.0) / speed if "before_mm" in options else 0.0
    return _along(skeleton, times + sooner, gait, path, swing=0.28, elbow=0.5, lean=0.07, obstacle=obstacle)


def turning_walk(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A walk to and fro with bends and two quick turns on the spot (as in Deutscher & Reid 2005, Fig. 21): options
    speed_mm_s, cadence, start_degrees of the first heading, start_x_mm, start_y_mm, start_s (how much of the beginning
    is left out).
    """
    times = times + options.get("start_s", 0.0)
    speed = options.get("speed_mm_s", 950.0)
    gait = Gait(speed, options.get("cadence", 1.95), 0.60, 0.10 * skeleton.height, 40.0, 0.45)
    step = speed / gait.cadence
    stretches = (
        Stretch(1.7 * step, turn=np.radians(-25.0)),
        Stretch(2.4 * step, turn=np.radians(150.0), onward=0.05),
        Stretch(2.6 * step, turn=np.radians(70.0)),
        Stretch(2.8 * step, turn=np.radians(-170.0), onward=0.0),
        Stretch(3.0 * step, turn=np.radians(-60.0)),
    )
    start = (options.get("start_x_mm", -500.0), options.get("start_y_mm", -250.0))
    path = Journey(start, np.radians(options.get("start_degrees", 0.0)), stretches, ease=0.2 * step)
    return _along(skeleton, times, gait, path, swing=0.33, elbow=0.45, lean=0.05)


def stand(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """Standing still with the sway of a standing person: options heading_degrees, sway_mm."""
    count, sway = len(times), options.get("sway_mm", 6.0)
    heading = np.full(count, np.radians(options.get("heading_degrees", 30.0)))
    zero = np.zeros(count)
    root = np.stack([sway * np.sin(1.7 * times), sway * np.sin(1.1 * times + 1.0), zero], axis=-1)
    root[:, 2] = skeleton.standing_hip_height - 9.0
    turns = trunk(heading, zero, 0.02 * np.sin(1.3 * times), zero)
    forward = turns["pelvis"][:, :, 0]
    outward = np.stack([-np.sin(heading), np.cos(heading), zero], axis=-1)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        ankle = sign * 0.065 * skeleton.height * outward + np.array([0.0, 0.0, skeleton.ankle_height])
        add_leg(turns, skeleton, side, root, (ankle, axis_turn(2, heading + sign * 0.15)), forward)
        add_arm(turns, side, 0.04 * np.sin(1.5 * times), np.full(count, 0.2), np.full(count, 0.35))
    return PersonMotion(skeleton, frame_rate(times), root, turns)


MOTIONS: dict[str, MotionMaker] = {
    "walk": walk,
    "run": run,
    "box": box,
    "turning_walk": turning_walk,
    "handstand": handstand,
    "circuit": circuit,
    "stand": stand,
    "crouch": crouch,
    "sit": sit,
}


def make_motion(name: str, skeleton: Skeleton, frames: int, fps: float, options: Options) -> PersonMotion:
    """The motion called `name`, `frames` long. Raises StudioError naming the motions there are."""
    if name not in MOTIONS:
        raise StudioError(f"There is no motion called '{name}'.", f"Choose one of {', '.join(MOTIONS)}.")
    return MOTIONS[name](skeleton, np.arange(frames) / fps, options)


def _along(
    skeleton: Skeleton,
    times: Array,
    gait: Gait,
    path: Path,
    *,
    swing: float,
    elbow: float,
    lean: float,
    obstacle: Obstacle | None = None,
) -> PersonMotion:
    """A gait along a path, arms swinging against the legs (`swing`, `elbow`, `lean` in radians), less where the
    path is one that slows down.
    """
    phase = 2.0 * np.pi * times / gait.cycle
    pace = path.pace(gait.speed * times) if isinstance(path, Journey) else np.ones_like(times)
    stride = (0.3 + 0.7 * pace) * np.cos(phase + 0.1)
    place, heading = path(gait.speed * times)
    sideways = 0.016 * skeleton.height * np.sin(phase - 0.4)
    root = np.concatenate([place, np.zeros((len(times), 1))], axis=1)
    root[:, 0] -= sideways * np.sin(heading)
    root[:, 1] += sideways * np.cos(heading)
    turns = trunk(
        heading - 0.09 * stride, lean + 0.015 * np.cos(2.0 * phase), 0.16 * stride, 0.03 * np.sin(phase)
    )
    feet = [foot_track(gait, path, times, skeleton, left=side == "left", obstacle=obstacle) for side in SIDES]
    allowed = allowed_height(skeleton, root, turns["pelvis"], feet)
    root[:, 2] = _pelvis_height(skeleton, gait, phase, allowed)
    if isinstance(path, Journey):
        root[:, 2] = _risen(root[:, 2], allowed, frame_rate(times))
    for side, track in zip(SIDES, feet, strict=True):
        sign = 1.0 if side == "left" else -1.0
        ahead = turns["pelvis"][:, :, 0] + track.turn[:, :, 0]
        add_leg(turns, skeleton, side, root, (track.ankle, track.turn), ahead)
        forward = 0.05 - sign * swing * stride
        bend = elbow + 0.45 * swing * (1.0 - sign * np.cos(phase - 0.3))
        add_arm(turns, side, forward, np.full(len(times), 0.24), bend)
    return PersonMotion(skeleton, frame_rate(times), root, turns)


def _pelvis_height(skeleton: Skeleton, gait: Gait, phase: Array, allowed: Array) -> Array:
    """Height of the pelvis (F,), mm, as high as `allowed` (F,) lets it be throughout.

    A walker follows the first two harmonics of the step cycle in what the legs allow, softened to BOB of
    their size (bent knees smooth the way); a runner is lowest over the standing leg. The whole is then
    lowered until it is allowed everywhere.
    """
    waves = np.stack([np.cos(phase), np.sin(phase), np.cos(2.0 * phase), np.sin(2.0 * phase)], axis=1)
    if gait.duty > 0.5:
        basis = np.concatenate([np.ones((len(phase), 1)), waves], axis=1)
        bob = BOB * waves @ np.linalg.lstsq(basis, allowed, rcond=None)[0][1:]
    else:
        bob = -RUNNING_BOB * skeleton.height * np.cos(2.0 * phase - 2.0 * np.pi * gait.duty)
    return bob + float(np.min(allowed - bob))


def _risen(height: Array, allowed: Array, fps: float) -> Array:
    """(F,) the height raised where turning and stepping ask for bent knees elsewhere only: as high as is `allowed`,
    the room above it evened out over RISE_S seconds on both sides.
    """
    reach = max(1, round(RISE_S * fps))
    room = minimum_filter1d(allowed - height, 2 * reach + 1, mode="nearest")
    return height + gaussian_filter1d(room, reach / 3.0, radius=reach, mode="nearest")
