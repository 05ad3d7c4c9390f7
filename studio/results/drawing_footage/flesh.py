"""The clothed person: rounded pieces laid around the skeleton, their cloth, skin and hair.

Each piece is a sphere swept along a line in one segment's frame, its radius running from one end to the other with a
muscle's bulge between, its cross-section elliptical, its surface folded where it is cloth. The pieces of a group (trunk
and head, each arm, each leg) are blended; groups hardly are, so that an arm beside the trunk stays apart.
No piece is a truncated cone, and no number comes from a tracker's body file.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points
from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]
Point = tuple[float, float, float]

SKIN, SHIRT, TROUSERS, SHOE, HAIR = range(5)
TRUNK, LEFT_ARM, RIGHT_ARM, LEFT_LEG, RIGHT_LEG = range(5)
CLOTHS, GROUPS = 6, 5
"""Rows of a person's wardrobe (the last one is the shirt's stripe), and groups of a person's pieces."""

# Columns of the piece table that the kernels read.
START, AXES, LENGTH, RADIUS_START, RADIUS_END, BULGE, SCALE_X, SCALE_Y = 0, 3, 12, 13, 14, 15, 16, 17
FOLD, FOLD_PERIOD, FOLD_PHASE, BOUND, BOUND_RADIUS, EDGE, COLUMNS = 18, 19, 20, 21, 24, 25, 26

REFERENCE_HEIGHT = 1760.0
CHEST_FOLLOWS = 0.4


@dataclass(frozen=True, slots=True)
class Piece:
    """One swept sphere.

    start, end : mm in the segment's frame, from the segment's joint. radius : mm at both ends. scale : of
    the cross-section forward and sideways. fold : depth of cloth folds, mm, with period `fold_period`.
    """

    segment: str
    group: int
    material: int
    start: Point
    end: Point
    radius: tuple[float, float]
    bulge: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    fold: float = 0.0
    fold_period: float = 110.0


def clothed_pieces(bones: Skeleton, girth: float = 1.0) -> tuple[Piece, ...]:
    """All pieces of a person in a short-sleeved shirt, long trousers and shoes.

    Girths grow with the height; girth : factor on the usual ones.
    """
    pieces = [*_trunk(bones), *_head(bones)]
    for index, side in enumerate(SIDES):
        pieces += _arm(bones, side, index) + _leg(bones, side, index)
    scale = girth * bones.height / REFERENCE_HEIGHT
    return tuple(sorted((_grown(piece, scale) for piece in pieces), key=lambda piece: piece.group))


def piece_tables(motion: PersonMotion, pieces: tuple[Piece, ...]) -> tuple[Array, IntArray]:
    """The pieces in the world: (F, P, COLUMNS) floats in the columns above, and (P, 2) material and group."""
    joints = joint_points(motion)
    tables = np.zeros((motion.frame_count, len(pieces), COLUMNS))
    for index, piece in enumerate(pieces):
        start, end = np.array(piece.start), np.array(piece.end)
        length = float(np.linalg.norm(end - start))
        axis = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        turn, joint = motion.turns[piece.segment], joints[piece.segment]
        table = tables[:, index]
        table[:, START : START + 3] = joint + turn @ start
        world_from_piece = turn @ _upright_frame(axis)
        table[:, AXES : AXES + 9] = np.swapaxes(world_from_piece, 1, 2).reshape(-1, 9)
        table[:, LENGTH] = length
        table[:, RADIUS_START], table[:, RADIUS_END] = piece.radius
        table[:, BULGE] = piece.bulge
        table[:, SCALE_X], table[:, SCALE_Y] = piece.scale
        table[:, FOLD], table[:, FOLD_PERIOD], table[:, FOLD_PHASE] = (
            piece.fold,
            piece.fold_period,
            1.7 * index,
        )
        table[:, BOUND : BOUND + 3] = joint + turn @ (0.5 * (start + end))
        widest = max(piece.radius) + piece.bulge + piece.fold
        table[:, BOUND_RADIUS] = 0.5 * length + widest * max(1.0, *piece.scale)
    return tables, np.array([(piece.material, piece.group) for piece in pieces])


def tables_of_all(parts: Sequence[tuple[Array, IntArray]]) -> tuple[Array, IntArray]:
    """`piece_tables` of several people as one: each has groups and clothes of its own, one person's after another's."""
    tables, labels = zip(*parts, strict=True)
    own = [label + np.array([CLOTHS * k, GROUPS * k]) for k, label in enumerate(labels)]
    return np.concatenate(tables, axis=1), np.concatenate(own)


def _upright_frame(axis: Array) -> Array:
    """(3, 3) frame in the segment's: z along the piece, x as forward as that allows."""
    ahead = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.8 else np.array([0.0, 0.0, 1.0])
    x = ahead - (ahead @ axis) * axis
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=-1)


def _grown(piece: Piece, scale: float) -> Piece:
    first, last = piece.radius
    return replace(piece, radius=(first * scale, last * scale), bulge=piece.bulge * scale)


def _trunk(bones: Skeleton) -> list[Piece]:
    """Pelvis and seat in trousers, belly, chest and shoulders in the shirt.

    Where one shoulder lies further out than the other, the chest follows their middle part of the way.
    """
    up, (hip_left, hip_right) = bones.trunk, bones.hip_half_width
    (_, left, left_up), (_, right, right_up) = bones.shoulder
    middle, low = CHEST_FOLLOWS * 0.5 * (left - right), up + 0.5 * (left_up + right_up)
    seat, shirt = partial(Piece, "pelvis", TRUNK, TROUSERS), partial(Piece, "thorax", TRUNK, SHIRT)
    waist, chest = (0, 0.6 * middle, 0.48 * up), (-6, middle, 0.76 * up)
    return [
        seat((-8, -0.7 * hip_right, 5), (-8, 0.7 * hip_left, 5), (110, 110), fold=2.0),
        seat((-4, 0, 20), (0, 0, 0.16 * up), (136, 128), scale=(0.80, 1.06)),
        shirt((-2, 0, 0.13 * up), waist, (140, 138), 5, (0.86, 1.04), 6.0, 130.0),
        shirt((2, *waist[1:]), chest, (141, 136), 6, (0.89, 1.07), 4.0, 150.0),
        shirt((-12, -0.62 * right, low - 18), (-12, 0.62 * left, low - 18), (80, 80)),
        shirt((-14, -0.25 * right, up - 36), (-14, 0.25 * left, up - 36), (56, 56)),
    ]


def _head(bones: Skeleton) -> list[Piece]:
    """Neck, skull, face, nose, hair. The crown of the hair lies at the head-top marker."""
    top = bones.head
    skin, hair = partial(Piece, "head", TRUNK, SKIN), partial(Piece, "head", TRUNK, HAIR)
    return [
        Piece("thorax", TRUNK, SKIN, (-8, 0, bones.trunk - 40), (6, 0, bones.trunk + 0.32 * top), (58, 54)),
        skin((8, 0, 0.44 * top), (2, 0, 0.66 * top), (66, 80), scale=(1.12, 0.95)),
        skin((86, 0, 0.46 * top), (82, 0, 0.56 * top), (13, 9)),
        hair((-12, 0, 0.66 * top), (-14, 0, 0.685 * top), (84, 83), scale=(1.1, 0.98)),
        hair((-36, 0, 0.42 * top), (-28, 0, 0.62 * top), (56, 70)),
    ]


def _arm(bones: Skeleton, side: str, index: int) -> list[Piece]:
    """Shoulder and sleeve, bare upper arm and forearm, hand and fingers."""
    group = LEFT_ARM if side == "left" else RIGHT_ARM
    inward = -1.0 if side == "left" else 1.0
    upper, fore, hand = bones.upper_arm[index], bones.forearm[index], bones.hand
    ahead, out, up = bones.shoulder[index]
    begin = (0.55 * ahead - 4, -0.55 * inward * out, up - 10)
    end = (0.98 * ahead, -0.98 * inward * out, up - 2)
    sleeve, skin = f"{side}_upper_arm", partial(Piece, f"{side}_hand", group, SKIN)
    return [
        Piece(f"{side}_clavicle", group, SHIRT, begin, end, (63, 60)),
        Piece(
            sleeve, group, SHIRT, (0, 0, 4), (0, 0, -0.62 * upper), (60, 57), 3, fold=4.0, fold_period=90.0
        ),
        Piece(sleeve, group, SKIN, (0, 0, -0.35 * upper), (0, 0, -upper), (48, 42), 5),
        Piece(f"{side}_forearm", group, SKIN, (0, 0, 0), (0, 0, -fore), (42, 29), 7),
        skin((0, 0, 4), (0, 0, -0.50 * hand), (30, 42), scale=(1.0, 0.62)),
        skin((4, 0, -0.50 * hand), (14, 0, -0.90 * hand), (40, 18), scale=(1.0, 0.5)),
        skin((22, 4 * inward, -0.15 * hand), (52, 8 * inward, -0.48 * hand), (16, 11)),
    ]


def _leg(bones: Skeleton, side: str, index: int) -> list[Piece]:
    """Seat, thigh and shin in trousers with a cuff, shoe."""
    group = LEFT_LEG if side == "left" else RIGHT_LEG
    outward = 1.0 if side == "left" else -1.0
    thigh, shin, foot, sole = bones.thigh[index], bones.shin[index], bones.foot, bones.ankle_height
    above, below = (partial(Piece, f"{side}_{part}", group, TROUSERS) for part in ("thigh", "shin"))
    shoe = partial(Piece, f"{side}_foot", group, SHOE)
    return [
        above((-34, 0, 5), (-22, 0, -0.16 * thigh), (88, 82)),
        above((0, 4 * outward, 0), (2, 0, -thigh), (94, 77), 5, fold=4.0, fold_period=120.0),
        below((2, 0, 0), (-4, 0, -0.90 * shin), (77, 65), 4, fold=5.0, fold_period=100.0),
        below((-6, 0, -0.84 * shin), (-2, 0, -0.95 * shin), (68, 69), fold=4.0, fold_period=60.0),
        shoe((-30, 0, 42 - sole), (0.38 * foot, 0, 36 - sole), (42, 36), 4),
        shoe((0.34 * foot, 0, 35 - sole), (0.62 * foot, 0, 27 - sole), (42, 27), scale=(0.85, 1.15)),
    ]
