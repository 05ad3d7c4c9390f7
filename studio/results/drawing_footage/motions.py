"""The written motions for footage, each a set of smooth curves on the synthetic skeleton.

A motion takes the skeleton, the frame times (F,) in seconds and its options, and returns a `PersonMotion`.
All were written for this project; none is recorded from a person.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points
from studio.body.retargeting import smooth_above
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.circuit import circuit
from studio.results.drawing_footage.gait import (
    Gait,
    Journey,
    Obstacle,
    Path,
    Stretch,
    add_arm,
    add_leg,
    allowed_height,
    circle_path,
    eased,
    foot_track,
    frame_rate,
    line_path,
    trunk,
    winding_path,
)
from studio.results.drawing_footage.room import GRAIN, Block

# A handstand: hands on the floor, kick up one leg after the other, hold with a sway, come down again.

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
    """Kick-up to a handstand: options heading_degrees, hands_apart_mm. The wrists stay in place."""
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
    """A supporting arm on its palm: nearly straight, spread so that the wrists are `half_apart` from the middle."""
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


# Written exercises on both feet that no recording has: going down into a crouch and up again, sitting down on a
# stool.
# The feet stay in place; the pelvis goes down and back along eased curves and the legs reach from it to the
# ankles.


Options = dict[str, float]

STANDING_BENT = 12.0
"""mm by which a standing person's hips are lower than with straight legs."""
SEAT_MM, SEAT_HALF = 430.0, 165.0
PELVIS_ABOVE_SEAT = 0.066
"""Height of a sitting person's pelvis centre above the seat, as a share of the person's height."""
SEAT_BEHIND = 0.235
"""Distance of a sitting person's pelvis behind the ankles, as a share of the height."""


@dataclass(frozen=True, slots=True, eq=False)
class _Carriage:
    """The posture in every frame, (F,) each. down, back : mm of the pelvis from standing. lean :
    of the trunk, radians. arm, out, bend : of both arms as `add_arm` takes them; arms are two (left, right).
    """

    down: Array
    back: Array
    lean: Array
    arm: tuple[Array, Array]
    out: Array
    bend: tuple[Array, Array]


def crouch(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """Down into a crouch and up again, arms reaching forward: options depth (of the standing hips' height), down_s,
    hold_s, up_s, start_s (before the going down), heading_degrees, stance (between the ankles, of the height), swing
    (of one arm against the other, radians), at_x_mm, at_y_mm.
    """
    start, down = options.get("start_s", 0.1), options.get("down_s", 0.6)
    again = start + down + options.get("hold_s", 0.2)
    share = eased((times - start) / down) - eased((times - again) / options.get("up_s", 0.6))
    hips, tall, swing = skeleton.standing_hip_height, skeleton.height, options.get("swing", 0.25)
    sway = swing * np.sin(2.0 * np.pi * 0.8 * times)
    held = _Carriage(
        down=options.get("depth", 0.5) * hips * share,
        back=0.10 * tall * share,
        lean=0.85 * share,
        arm=(0.05 + 1.5 * share + sway * share, 0.05 + 1.5 * share - sway * share),
        out=0.22 + 0.15 * share,
        bend=(0.35 + 0.3 * share, 0.35 + 0.3 * share + 0.5 * np.abs(sway)),
    )
    return _on_both_feet(skeleton, times, options, held)


def sit(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """Sitting down on a stool (`stool`), hands to the thighs: options seat_mm (its height), down_s,
    start_s, heading_degrees, stance, at_x_mm, at_y_mm.
    """
    share = eased((times - options.get("start_s", 0.15)) / options.get("down_s", 0.9))
    seated = options.get("seat_mm", SEAT_MM) + PELVIS_ABOVE_SEAT * skeleton.height
    bow = 4.0 * share * (1.0 - share)
    held = _Carriage(
        down=(skeleton.standing_hip_height - STANDING_BENT - seated) * share,
        # The pelvis moves back before it moves down, with the trunk bowed.
        back=SEAT_BEHIND * skeleton.height * eased(np.sqrt(share)),
        lean=0.75 * bow + 0.10 * share,
        arm=(0.05 + 0.45 * share + 0.5 * bow, 0.05 + 0.40 * share + 0.4 * bow),
        out=0.22 - 0.06 * share,
        bend=(0.35 + 0.75 * share, 0.35 + 0.85 * share),
    )
    return _on_both_feet(skeleton, times, options, held)


def stool(skeleton: Skeleton, options: Options) -> Block:
    """The stool of `sit`."""
    heading, half = np.radians(options.get("heading_degrees", 0.0)), 0.5 * options.get("seat_mm", SEAT_MM)
    back = SEAT_BEHIND * skeleton.height
    x, y = _place(options) - back * np.array([np.cos(heading), np.sin(heading)])
    colours = (0.46, 0.40, 0.36), (0.36, 0.30, 0.27)
    centre, size = (float(x), float(y), half), (SEAT_HALF, SEAT_HALF, half)
    return Block(centre, size, colours[0], GRAIN, colours[1], float(heading))


def _place(options: Options) -> Array:
    """(2,) mm, the middle between the ankles."""
    return np.array([options.get("at_x_mm", 0.0), options.get("at_y_mm", 0.0)])


def _on_both_feet(skeleton: Skeleton, times: Array, options: Options, held: _Carriage) -> PersonMotion:
    """The motion of a carriage over two feet that stand still."""
    count, zero = len(times), np.zeros(len(times))
    heading = np.full(count, np.radians(options.get("heading_degrees", 0.0)))
    ahead = np.stack([np.cos(heading), np.sin(heading), zero], axis=-1)
    outward = np.stack([-np.sin(heading), np.cos(heading), zero], axis=-1)
    root = -held.back[:, None] * ahead
    root[:, :2] += _place(options) + np.stack([4.0 * np.sin(1.7 * times), 4.0 * np.sin(1.1 * times)], axis=-1)
    root[:, 2] = skeleton.standing_hip_height - STANDING_BENT - held.down
    turns = trunk(heading, held.lean, 0.03 * np.sin(1.9 * times), zero)
    stance = 0.5 * options.get("stance", 0.16) * skeleton.height
    for index, side in enumerate(SIDES):
        sign = 1.0 if side == "left" else -1.0
        toes_out = axis_turn(2, heading + sign * 0.22)
        ankle = sign * stance * outward + np.array([*_place(options), skeleton.ankle_height])
        add_leg(turns, skeleton, side, root, (ankle, toes_out), toes_out[:, :, 0])
        add_arm(turns, side, held.arm[index], held.out, held.bend[index])
    return PersonMotion(skeleton, frame_rate(times), root, turns)


BOB, RUNNING_BOB, RISE_S = 0.6, 0.018, 0.5

MotionMaker = Callable[[Skeleton, Array, Options], PersonMotion]


def walk(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A walk in a circle with turns: options radius_mm, sway_mm (deviation of the path from the circle),
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
    again (Deutscher & Reid 2005, Fig. 10); turn_steps is the number of whole steps added for the turn, before_mm
    the distance before the box at which the footage begins.
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
        # Whole steps between the two crossings, so that the feet stand about the box in the same way.
        turning = (np.ceil(2.0 * after / step) + options.get("turn_steps", 3.0)) * step - 2.0 * after
        on_the_spot = Stretch(turning, turn=np.pi, onward=0.0)
        path = Journey((start, 0.0), 0.0, (Stretch(after - start), on_the_spot), ease=0.18 * step)
    sooner = max(-start - options["before_mm"], 0.0) / speed if "before_mm" in options else 0.0
    return _along(skeleton, times + sooner, gait, path, swing=0.28, elbow=0.5, lean=0.07, obstacle=obstacle)


def turning_walk(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A walk back and forth with bends and two quick turns on the spot (as in Deutscher & Reid 2005, Fig. 21): options
    speed_mm_s, cadence, start_degrees of the first heading, start_x_mm, start_y_mm, start_s (length of the beginning
    that is left out).
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


def pass_by(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A walk straight on: options start_x_mm, start_y_mm, heading_degrees, speed_mm_s, cadence, start_s (length of the
    beginning that is left out).
    """
    speed = options.get("speed_mm_s", 1100.0)
    gait = Gait(speed, options.get("cadence", 1.85), 0.60, 0.09 * skeleton.height, 35.0, 0.45)
    start = (options.get("start_x_mm", -1100.0), options.get("start_y_mm", 0.0))
    path = line_path(start, np.radians(options.get("heading_degrees", 0.0)))
    times = times + options.get("start_s", 0.0)
    return _along(skeleton, times, gait, path, swing=0.33, elbow=0.40, lean=0.05)


def handshake(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """Standing, the right hand given and shaken, then taken back: options at_x_mm, at_y_mm, heading_degrees, stance,
    start_s, reach_s (how long the arm rises), hold_s, swing (of the shaken forearm, radians), phase (of the other arm's
    sway).
    """
    start, reach = options.get("start_s", 0.2), options.get("reach_s", 0.5)
    again = start + reach + options.get("hold_s", 0.7)
    share = eased((times - start) / reach) - eased((times - again) / reach)
    shake = options.get("swing", 0.12) * np.sin(2.0 * np.pi * 2.6 * (times - start)) * share**2
    sway = 0.12 * np.sin(2.0 * np.pi * 0.5 * times + options.get("phase", 0.0))
    held = _Carriage(
        down=10.0 * share,
        back=np.zeros_like(times),
        lean=0.12 * share,
        arm=(0.05 + sway, 0.05 + 0.75 * share),
        out=0.20 - 0.06 * share,
        bend=(0.30 + np.abs(sway), 0.30 + 0.45 * share + shake),
    )
    return _on_both_feet(skeleton, times, options, held)


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
    "pass_by": pass_by,
    "handshake": handshake,
    "crouch": crouch,
    "sit": sit,
}


def make_motion(name: str, skeleton: Skeleton, frames: int, fps: float, options: Options) -> PersonMotion:
    """The motion called `name`, `frames` long. Raises StudioError listing the known motions."""
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
    """A gait along a path, arms swinging against the legs (`swing`, `elbow`, `lean` in radians), less when slow."""
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
    """Height of the pelvis (F,), mm, at most `allowed` (F,) throughout.

    A walker follows the first two harmonics of the step cycle in the allowed height, reduced to BOB of
    their size (bent knees damp the motion); a runner is lowest over the standing leg. The whole is then
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
    """(F,) the height raised where bent knees are needed elsewhere only: up to `allowed`, the margin smoothed over
    RISE_S seconds on both sides.
    """
    return height - smooth_above(height - allowed, max(1, round(RISE_S * fps)))
