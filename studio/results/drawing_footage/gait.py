"""Steps along a path: footprints, swings, and legs that reach them.

A gait is written as smooth parametric curves: the pelvis follows a path at its speed and bobs; each foot stands still
for a share of the step cycle (`duty`) and travels to its next footprint along an eased arc for the rest, the ankle
turning about the ball of the foot at the end of the stance. Hips and knees then follow from the ankles.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from studio.body.person import Skeleton
from studio.foundations.arrays import Array
from studio.foundations.geometry.rotations import axis_turn, frames_along
from studio.results.drawing_footage.person import yaw_pitch_roll

Path = Callable[[Array], tuple[Array, Array]]
Obstacle = Callable[[Array, Array, Array], Array]

BALL, HEEL = 0.66, -0.20
"""Points about which a foot rolls, as shares of its length in front of the ankle."""


@dataclass(frozen=True, slots=True)
class Gait:
    """The parameters of a gait, walking or running.

    speed : mm/s. cadence : steps per second (of both feet together). duty : share of a foot's cycle on the floor (> 0.5
    walking, < 0.5 running). foot_spacing : lateral distance between footprints, mm. lift : height of the ankle's arc in
    swing, mm. heel_rise : turn of the foot about its ball at push-off, radians.
    """

    speed: float
    cadence: float
    duty: float
    foot_spacing: float
    lift: float
    heel_rise: float

    @property
    def cycle(self) -> float:
        """Seconds from one stance of a foot to its next."""
        return 2.0 / self.cadence


def eased(share: Array) -> Array:
    """Minimum-jerk progress: 0 to 1 with neither speed nor acceleration at both ends."""
    s = np.clip(share, 0.0, 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def swung(share: Array) -> Array:
    """Progress of a foot in the air: 0 to 1, at rest at both ends, slower than a minimum-jerk curve."""
    s = np.clip(share, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def circle_path(radius: float, start_angle: float = 0.0) -> Path:
    """A circle to the left about the origin: distance (mm) to position (F, 2) and heading (F,)."""

    def at(distance: Array) -> tuple[Array, Array]:
        angle = start_angle + distance / radius
        position = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return position, angle + np.pi / 2

    return at


def line_path(start: tuple[float, float], heading: float) -> Path:
    """A straight line: distance (mm) to position (F, 2) and heading (F,)."""

    def at(distance: Array) -> tuple[Array, Array]:
        along = np.array([np.cos(heading), np.sin(heading)])
        return np.array(start) + np.asarray(distance)[..., None] * along, np.full(np.shape(distance), heading)

    return at


def winding_path(radius: float, sway: float, waves: float, start_angle: float = 0.0) -> Path:
    """A circle whose radius swings by `sway` mm, `waves` times a round: turns of changing sharpness."""

    def place(distance: Array) -> Array:
        angle = start_angle + distance / radius
        reach = radius + sway * np.sin(waves * (angle - start_angle))
        return reach[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def at(distance: Array) -> tuple[Array, Array]:
        distance = np.asarray(distance, dtype=float)
        ahead = place(distance + 1.0) - place(distance - 1.0)
        return place(distance), np.unwrap(np.arctan2(ahead[..., 1], ahead[..., 0]))

    return at


@dataclass(frozen=True, slots=True, eq=False)
class FootTrack:
    """One foot over time.

    ankle : (F, 3) mm. turn : (F, 3, 3) world_from_foot. swing : (F,) 0 on the floor, 0...1 in the air.
    """

    ankle: Array
    turn: Array
    swing: Array


def foot_track(
    gait: Gait, path: Path, times: Array, skeleton: Skeleton, *, left: bool, obstacle: Obstacle | None = None
) -> FootTrack:
    """The foot's journey over footprints laid beside the path.

    times : (F,) seconds. obstacle : extra height (F,) mm that the ankle must keep above points (F, 2) between
    one footprint (F, 2) to the next (F, 2).
    """
    phase = times / gait.cycle + (0.0 if left else 0.5)
    count, share = np.floor(phase), phase - np.floor(phase)
    swing = np.clip((share - gait.duty) / (1.0 - gait.duty), 0.0, 1.0)
    flat, heading = _footprint(gait, path, count + swung(swing), left)
    # Push-off turns the foot about its ball in the last third of the stance; the swing turns it back and
    # ends with the toes raised a little, so that the heel lands first.
    push = eased((share / gait.duty - 0.62) / 0.38) * np.where(swing > 0.0, 1.0 - eased(swing / 0.7), 1.0)
    land = eased((swing - 0.6) / 0.4) * (swing > 0.0) + (1.0 - eased(share / (0.18 * gait.duty))) * (
        swing == 0.0
    )
    pitch = gait.heel_rise * push - 0.28 * land
    ankle, tilted = rolled(flat, heading, pitch, skeleton)
    ankle[:, 2] += gait.lift * eased(swing / 0.5) * eased((1.0 - swing) / 0.5)
    if obstacle is not None:
        ends = [_footprint(gait, path, count + step, left)[0] for step in (0.0, 1.0)]
        ankle[:, 2] += eased(swing / 0.3) * eased((1.0 - swing) / 0.45) * obstacle(flat, *ends)
    return FootTrack(ankle, tilted, swing)


def rolled(ground: Array, heading: Array, pitch: Array, skeleton: Skeleton) -> tuple[Array, Array]:
    """Ankle (F, 3) and world_from_foot (F, 3, 3) of a foot over `ground` (F, 2) that is turned by `pitch` about its
    ball (up) or heel (down), which stay in place.
    """
    ball = np.array([BALL * skeleton.foot, 0.0, -skeleton.ankle_height])
    heel = np.array([HEEL * skeleton.foot, 0.0, -skeleton.ankle_height])
    level = axis_turn(2, heading)
    tilted = level @ axis_turn(1, pitch)
    pivot = np.where((pitch > 0.0)[:, None], ball, heel)
    flat = np.concatenate([ground, np.full((len(ground), 1), skeleton.ankle_height)], axis=1)
    return flat + (level @ pivot[..., None])[..., 0] - (tilted @ pivot[..., None])[..., 0], tilted


def _footprint(gait: Gait, path: Path, count: Array, left: bool) -> tuple[Array, Array]:
    """Position of the foot in its `count`-th stance: under the hip in the middle of that stance. Fractions
    lie between two footprints along the path.
    """
    middle = (count + 0.5 * gait.duty - (0.0 if left else 0.5)) * gait.cycle
    centre, heading = path(gait.speed * middle)
    side = 0.5 * gait.foot_spacing * (1.0 if left else -1.0)
    return centre + side * np.stack([-np.sin(heading), np.cos(heading)], axis=-1), heading


def leg_to_ankle(hip: Array, ankle: Array, forward: Array, thigh: float, shin: float) -> tuple[Array, Array]:
    """Rotations of thigh and shin, (F, 3, 3) each, that reach the ankle, the knee pointing forward.

    hip, ankle : (F, 3) mm. forward : (F, 3) the direction in which the knee bends. An ankle out of reach (0.2 % of the
    leg is always kept bent) is approached as far as the leg goes.
    """
    reach = ankle - hip
    distance = np.minimum(np.linalg.norm(reach, axis=1), 0.998 * (thigh + shin))
    along = reach / np.linalg.norm(reach, axis=1, keepdims=True)
    ahead = forward - np.sum(forward * along, axis=1, keepdims=True) * along
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    cosine = (thigh**2 + distance**2 - shin**2) / (2.0 * thigh * distance)
    offset = np.arccos(np.clip(cosine, -1.0, 1.0))[:, None]
    knee = hip + thigh * (np.cos(offset) * along + np.sin(offset) * ahead)
    end = hip + distance[:, None] * along
    lateral = np.cross(-along, ahead)
    return frames_along(hip - knee, lateral), frames_along(knee - end, lateral)


# Paths that change direction: straight stretches, bends and turns on the spot, one after the other.


GRID_MM = 5.0
LONG_ENOUGH_MM = 3000.0


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of a path. length : mm at full speed in its time. turn : radians to the left during it. onward : share of
    the full speed, 0 while turning on the spot.
    """

    length: float
    turn: float = 0.0
    onward: float = 1.0


class Journey:
    """A path made of stretches, straight before the first and after the last: a `gait.Path` with a pace.

    start : mm; heading : radians, both where the first stretch begins. ease : mm over which stretches are
    blended (standard deviation of the smoothing).
    """

    def __init__(
        self, start: tuple[float, float], heading: float, stretches: tuple[Stretch, ...], ease: float
    ) -> None:
        total = sum(stretch.length for stretch in stretches)
        self._grid = np.arange(-LONG_ENOUGH_MM, total + LONG_ENOUGH_MM, GRID_MM)
        middles = self._grid + 0.5 * GRID_MM
        onward, rate, begin = np.ones_like(middles), np.zeros_like(middles), 0.0
        for stretch in stretches:
            inside = (middles >= begin) & (middles < begin + stretch.length)
            onward[inside] = stretch.onward
            # Spread over the cells, so that the whole turn is made on any grid.
            rate[inside] = stretch.turn / (GRID_MM * max(np.count_nonzero(inside), 1))
            begin += stretch.length
        self._onward: Array = gaussian_filter1d(onward, ease / GRID_MM, mode="nearest")
        rate = gaussian_filter1d(rate, ease / GRID_MM, mode="nearest")
        zero = int(np.searchsorted(self._grid, 0.0))
        turned = np.concatenate([[0.0], np.cumsum(rate[:-1] * GRID_MM)])
        self._heading: Array = heading + turned
        middle_heading = self._heading + 0.5 * rate * GRID_MM
        steps = (
            GRID_MM
            * self._onward[:, None]
            * np.stack([np.cos(middle_heading), np.sin(middle_heading)], axis=-1)
        )
        place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps[:-1], axis=0)])
        self._place: Array = place - place[zero] + np.array(start)

    def __call__(self, distance: Array) -> tuple[Array, Array]:
        """Position (F, 2) and heading (F,) after a distance (F,) at full speed, mm."""
        return (
            np.stack([np.interp(distance, self._grid, self._place[:, axis]) for axis in (0, 1)], axis=-1),
            np.interp(distance, self._grid, self._heading),
        )

    def pace(self, distance: Array) -> Array:
        """(F,) the share of full speed there."""
        return np.interp(distance, self._grid, self._onward)


# Posture of the rendered person: trunk, arms, and the pelvis' height over the feet.


NEARLY_STRAIGHT = 0.994


def allowed_height(skeleton: Skeleton, root: Array, pelvis: Array, feet: list[FootTrack]) -> Array:
    """(F,) greatest height above `root` of a pelvis from which both ankles are reached with slightly bent knees."""
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
    """Pelvis, thorax (twisted against the pelvis about its own axis) and head, which faces along the path."""
    level = np.zeros_like(heading)
    pelvis = yaw_pitch_roll(heading, level + 0.6 * pitch, level + roll)
    thorax = pelvis @ axis_turn(1, level + 0.4 * pitch) @ axis_turn(2, level + twist)
    head = thorax @ yaw_pitch_roll(-0.55 * (level + twist), level + 0.10, -0.6 * (level + roll))
    return {"pelvis": pelvis, "thorax": thorax, "head": head}


def add_arm(turns: dict[str, Array], side: str, forward: Array, outward: Array, bend: Array) -> None:
    """An arm swung `forward`, held `outward` and bent by `bend` at the elbow, radians; the clavicle follows
    a little. Adds clavicle, upper arm, forearm and hand.
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
