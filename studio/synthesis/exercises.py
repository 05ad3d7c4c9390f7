"""Written exercises on both feet that no recording has: going down into a crouch and up again, sitting down on a stool.

The feet stay where they stand; the pelvis goes down and back along eased curves and the legs reach from it to the
ankles.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.person import SIDES, PersonMotion, Skeleton
from studio.geometry.rotations import axis_turn
from studio.synthesis.gait import eased
from studio.synthesis.posture import add_arm, add_leg, frame_rate, trunk
from studio.synthesis.room import GRAIN, Block

Array = NDArray[np.float64]
Options = dict[str, float]

STANDING_BENT = 12.0
"""mm that the hips of somebody who stands are lower than straight legs would have them."""
SEAT_MM, SEAT_HALF = 430.0, 165.0
PELVIS_ABOVE_SEAT = 0.066
"""Height of the pelvis centre above what one sits on, of the person's height: the seat's flesh."""
SEAT_BEHIND = 0.235
"""How far behind the ankles the pelvis of somebody who sits is, of the height."""


@dataclass(frozen=True, slots=True, eq=False)
class _Carriage:
    """How the person is held in every frame, (F,) each. down, back : mm of the pelvis from where it stands. lean :
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
    """Sitting down on a stool that stands there (`stool`), hands to the thighs: options seat_mm (its height), down_s,
    start_s, heading_degrees, stance, at_x_mm, at_y_mm.
    """
    share = eased((times - options.get("start_s", 0.15)) / options.get("down_s", 0.9))
    seated = options.get("seat_mm", SEAT_MM) + PELVIS_ABOVE_SEAT * skeleton.height
    bow = 4.0 * share * (1.0 - share)
    held = _Carriage(
        down=(skeleton.standing_hip_height - STANDING_BENT - seated) * share,
        # The pelvis goes back before it goes down: one reaches for the seat, bowed.
        back=SEAT_BEHIND * skeleton.height * eased(np.sqrt(share)),
        lean=0.75 * bow + 0.10 * share,
        arm=(0.05 + 0.45 * share + 0.5 * bow, 0.05 + 0.40 * share + 0.4 * bow),
        out=0.22 - 0.06 * share,
        bend=(0.35 + 0.75 * share, 0.35 + 0.85 * share),
    )
    return _on_both_feet(skeleton, times, options, held)


def stool(skeleton: Skeleton, options: Options) -> Block:
    """What `sit` sits down on."""
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
