"""Walking in a circle, standing still for a while, walking on: the Lee walk's motion, written.

The pelvis follows the circle at a speed that falls to zero at the halt and rises after it; the feet follow a
plan of steps whose last two before the halt are side by side. Sway, bob and arm swing fade out into the halt, in
which only breathing remains.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from studio.body.person import SIDES, PersonMotion, Skeleton
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.results.drawing_footage.gait import (
    FootTrack,
    Gait,
    Path,
    add_arm,
    add_leg,
    allowed_height,
    eased,
    frame_rate,
    rolled,
    swung,
    trunk,
)

Options = dict[str, float]

NEVER = 200_000.0
# Shares of an ordinary stance: rolling down from the heel at its beginning, up over the ball at its end.
ROLL_DOWN, ROLL_UP = 0.18, 0.38
LANDING_PITCH = 0.28
# Seconds: of slowing down and of speeding up, from the last landing to the halt, from the halt to the first
# lift-off, of fading gestures, of the pelvis' rise into the halt.
SLOWING, SETTLING, GOING, FADING, RISING = 0.75, 0.12, 0.16, 0.6, 0.3
# A foot stands under the hip after this share of its stance: a walker leans away from the foot that pushes.
UNDER_HIP = 0.42
TOES_OUT, STAGGER = 0.09, 22.0
BOB, SWAY_SHARE, SWING, ELBOW, LEAN = 8.0, 0.012, 0.36, 0.38, 0.045
# Pelvis heights are smoothed over this many samples to either side of a grid of its own, so that footage of any
# frame rate shows the same motion.
GRID_RATE, WINDOW, SMOOTHING = 120.0, 48, 16.0


@dataclass(frozen=True, slots=True)
class Halt:
    """Seconds between which the person stands still."""

    begin: float
    end: float


@dataclass(frozen=True, slots=True, eq=False)
class Footfalls:
    """One foot's stances, in order.

    down, up : (S,) seconds of landing and lift-off. rise : (S,) seconds before lift-off in which the heel rises. at :
    (S,) mm along the path.
    """

    down: Array
    up: Array
    rise: Array
    at: Array


def circuit(skeleton: Skeleton, times: Array, options: Options) -> PersonMotion:
    """A walk in a circle with a halt.

    Options: start_x_mm, start_y_mm, start_heading_degrees, radius_mm, turn (1 left, -1 right), speed_mm_s, cadence,
    still_from_s, still_until_s (never, unless both are given). Raises StudioError for a halt that is too early or
    too short to step into.
    """
    gait = Gait(
        speed=options.get("speed_mm_s", 850.0),
        cadence=options.get("cadence", 1.9),
        duty=0.60,
        foot_spacing=0.10 * skeleton.height,
        lift=30.0,
        heel_rise=0.45,
    )
    path, halt = _circle(options), _halt(options, gait)
    last = max(float(times[-1]), halt.end if halt.begin < times[-1] + 1.0 else 0.0) + 1.0
    grid = np.arange(-int(GRID_RATE), int(np.ceil(last * GRID_RATE)) + 1) / GRID_RATE
    coarse = _Bearing(skeleton, gait, path, halt, grid)
    height = CubicSpline(grid, coarse.smooth_height())(times)
    return _Bearing(skeleton, gait, path, halt, times).motion(height)


class _Bearing:
    """Trunk and feet at given times, before the pelvis has its height."""

    def __init__(self, skeleton: Skeleton, gait: Gait, path: Path, halt: Halt, times: Array) -> None:
        self.skeleton, self.times, self.halt = skeleton, times, halt
        last_left = halt.begin - SETTLING - 0.5 * gait.cycle
        first_left = halt.end + GOING + (1.0 - gait.duty) * gait.cycle
        before = times < 0.5 * (halt.begin + halt.end)
        self.phase = 2.0 * np.pi * (times - np.where(before, last_left, first_left)) / gait.cycle
        self.vigour = _vigour(times, halt)
        place, heading = path(path_length(times, gait.speed, halt))
        sideways = SWAY_SHARE * skeleton.height * np.sin(self.phase - 0.4) * self.vigour
        breath = np.sin(2.0 * np.pi * 0.26 * times)
        across = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        self.root = np.zeros((len(times), 3))
        self.root[:, :2] = place + (sideways + 1.5 * np.sin(1.1 * times))[:, None] * across
        stride = np.cos(self.phase + 0.1) * self.vigour
        self.stride = stride
        self.turns = trunk(
            heading - 0.08 * stride,
            LEAN * (0.75 + 0.25 * self.vigour)
            + 0.004 * np.cos(2.0 * self.phase) * self.vigour
            + 0.003 * breath,
            0.14 * stride,
            _levelling(skeleton) + 0.02 * np.sin(self.phase) * self.vigour,
        )
        self.feet: list[FootTrack] = [
            planned_track(
                footfalls(gait, halt, left=side == "left", until=float(times[-1])),
                gait,
                path,
                times,
                skeleton,
                left=side == "left",
                toes_out=TOES_OUT,
            )
            for side in SIDES
        ]
        self.bob = -BOB * np.cos(2.0 * self.phase - 0.2 * np.pi) * self.vigour

    def smooth_height(self) -> Array:
        """(F,) heights of the pelvis that both legs reach at all times: the lowest that is allowed nearby, smoothed,
        and the bob; in the halt one height that is allowed throughout. Times must be those of the grid.
        """
        room = allowed_height(self.skeleton, self.root, self.turns["pelvis"], self.feet) - self.bob
        lowest = minimum_filter1d(room, 2 * WINDOW + 1, mode="nearest")
        height = gaussian_filter1d(lowest, SMOOTHING, mode="nearest", radius=WINDOW) + self.bob
        begin, end = self.halt.begin - RISING, self.halt.end + RISING
        near = (self.times >= begin) & (self.times <= end)
        if not near.any():
            return height
        held = eased((self.times - begin) / RISING) - eased((self.times - self.halt.end) / RISING)
        return height + held * (float(height[near].min()) - height)

    def motion(self, height: Array) -> PersonMotion:
        """The whole person with the pelvis at `height` (F,) mm."""
        bones, turns = self.skeleton, dict(self.turns)
        root = self.root.copy()
        root[:, 2] += height
        for side, track in zip(SIDES, self.feet, strict=True):
            sign = 1.0 if side == "left" else -1.0
            ahead = turns["pelvis"][:, :, 0] + track.turn[:, :, 0]
            add_leg(turns, bones, side, root, (track.ankle, track.turn), ahead)
            forward = 0.04 - sign * SWING * self.stride
            bend = ELBOW + 0.4 * SWING * self.vigour * (1.0 - sign * np.cos(self.phase - 0.3))
            add_arm(turns, side, forward, np.full(len(root), 0.26), bend)
        return PersonMotion(bones, frame_rate(self.times), root, turns)


def path_length(times: Array, speed: float, halt: Halt) -> Array:
    """(F,) mm along the path: steady walking with a halt, each change taking SLOWING seconds."""

    def ramp(share: Array) -> Array:
        """Integral of a smooth step from 0 to 1."""
        s = np.clip(share, 0.0, 1.0)
        return s**3 - 0.5 * s**4 + np.maximum(share - 1.0, 0.0)

    slowing = SLOWING * ramp((times - halt.begin + SLOWING) / SLOWING)
    going = SLOWING * ramp((times - halt.end) / SLOWING)
    return speed * (times - slowing + going)


def footfalls(gait: Gait, halt: Halt, *, left: bool, until: float) -> Footfalls:
    """One foot's stances from before time 0 to after `until`; the right foot lands last before the halt."""
    stand, swing = gait.duty * gait.cycle, (1.0 - gait.duty) * gait.cycle
    arrive = halt.begin - SETTLING - (0.5 * gait.cycle if left else 0.0)
    leave = halt.end + GOING + (0.0 if left else 0.5 * gait.cycle)
    before = arrive - gait.cycle * np.arange(int(np.ceil((arrive + 2.0) / gait.cycle)) + 1, 0.0, -1.0)
    after = leave + swing + gait.cycle * np.arange(max(int(np.ceil((until - leave) / gait.cycle)), 0) + 3)
    along = [path_length(np.add(down, UNDER_HIP * stand), gait.speed, halt) for down in (before, after)]
    rise = ROLL_UP * stand
    rest = path_length(np.array([halt.begin]), gait.speed, halt) + (STAGGER if left else -STAGGER)
    return Footfalls(
        np.concatenate([before, [arrive], after]),
        np.concatenate([before + stand, [leave], after + stand]),
        np.concatenate(
            [np.full(len(before), rise), [min(rise, leave - halt.end)], np.full(len(after), rise)]
        ),
        np.concatenate([along[0], rest, along[1]]),
    )


def _levelling(skeleton: Skeleton) -> float:
    """Lean of the pelvis to the right with which legs of different lengths both reach the floor, radians."""
    left, right = (thigh + shin for thigh, shin in zip(skeleton.thigh, skeleton.shin, strict=True))
    return (left - right) / sum(skeleton.hip_half_width)


def _vigour(times: Array, halt: Halt) -> Array:
    """(F,) 1 while walking, 0 while standing."""
    return 1.0 - eased((times - halt.begin + FADING) / FADING) + eased((times - halt.end) / FADING)


def _circle(options: Options) -> Path:
    """The circle through the start in its heading: distance (mm) to position (F, 2) and heading (F,)."""
    turn = 1.0 if options.get("turn", 1.0) > 0.0 else -1.0
    radius = options.get("radius_mm", 700.0)
    heading = np.radians(options.get("start_heading_degrees", 90.0 * turn))
    start = np.array([options.get("start_x_mm", radius), options.get("start_y_mm", 0.0)])
    centre = start + turn * radius * np.array([-np.sin(heading), np.cos(heading)])

    def at(distance: Array) -> tuple[Array, Array]:
        ahead = heading + turn * np.asarray(distance, dtype=float) / radius
        return centre + turn * radius * np.stack([np.sin(ahead), -np.cos(ahead)], axis=-1), ahead

    return at


def _halt(options: Options, gait: Gait) -> Halt:
    """The halt of the options, else one that is never reached."""
    begin, end = options.get("still_from_s"), options.get("still_until_s")
    if begin is None or end is None:
        return Halt(NEVER, 2.0 * NEVER)
    if begin < gait.cycle or end < begin + 0.5:
        raise StudioError(
            f"A halt from {begin:g} to {end:g} s cannot be walked into and out of.",
            f"Begin it after {gait.cycle:.1f} s (still_from_s) and let it last half a second (still_until_s).",
        )
    return Halt(begin, end)


# A plan holds the stances of one foot in order. Between two stances the foot travels as in `gait.py`; how far it lifts
# and how much the ankle turns shrinks with the step, so that the short steps into and out of a halt are low.


def planned_track(
    plan: Footfalls, gait: Gait, path: Path, times: Array, skeleton: Skeleton, *, left: bool, toes_out: float
) -> FootTrack:
    """The foot's journey over the stances of a plan.

    times : (F,) seconds, between the first landing and the last lift-off. toes_out : radians that the foot is turned
    outward against the path.
    """
    stance = np.clip(np.searchsorted(plan.down, times, side="right") - 1, 0, len(plan.down) - 2)
    swing = np.clip((times - plan.up[stance]) / (plan.down[stance + 1] - plan.up[stance]), 0.0, 1.0)
    along = plan.at[stance] + swung(swing) * (plan.at[stance + 1] - plan.at[stance])
    step = np.clip(np.diff(plan.at) / (gait.speed * gait.cycle), 0.0, 1.0)
    coming = step[stance]
    last = np.concatenate([[1.0], step])[stance]
    ordinary = gait.duty * gait.cycle
    push = eased(1.0 + (times - plan.up[stance]) / plan.rise[stance])
    push *= np.where(swing > 0.0, 1.0 - eased(swing / 0.7), 1.0) * coming
    land = eased((swing - 0.6) / 0.4) * (swing > 0.0) * coming
    land += (1.0 - eased((times - plan.down[stance]) / (ROLL_DOWN * ordinary))) * (swing == 0.0) * last
    pitch = gait.heel_rise * push - LANDING_PITCH * land
    sign = 1.0 if left else -1.0
    centre, heading = path(along)
    beside = 0.5 * gait.foot_spacing * sign * np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    ankle, turn = rolled(centre + beside, heading + sign * toes_out, pitch, skeleton)
    ankle[:, 2] += gait.lift * (0.4 + 0.6 * coming) * eased(swing / 0.5) * eased((1.0 - swing) / 0.5)
    return FootTrack(ankle, turn, swing)
