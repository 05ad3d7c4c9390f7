"""A hand's flesh around its bones: rounded pieces that swell and melt into each other, none of them a cone.

Fingers are swollen at their pads and knuckles and thinner at their creases, the palm is a flat cushion with the balls
of thumb and little finger upon it, webs of skin stand between the fingers, and the forearm goes on behind the wrist. No
radius comes from a body's file: pieces lie along the bones of the joints' frames (z along a bone, y out of the back),
whatever length these have. Knuckles and finger tips are redder than the rest.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.results.drawing_footage.flesh import (
    AXES,
    BOUND,
    BOUND_RADIUS,
    BULGE,
    COLUMNS,
    FOLD,
    FOLD_PERIOD,
    FOLD_PHASE,
    LENGTH,
    RADIUS_END,
    RADIUS_START,
    SCALE_X,
    SCALE_Y,
    SKIN,
    START,
    TROUSERS,
)

REDDER = TROUSERS
"""The row of the wardrobe that knuckles and finger tips have."""
FINGERS = ("index", "middle", "ring", "little")
GIRTHS = {"index": 8.6, "middle": 8.9, "ring": 8.3, "little": 7.2}
"""Radii of the fingers' first bones, mm; the others follow."""
PALM = 0
"""Group of the palm, the wrist and the thumb's ball, which melt together; each finger is a group of its own."""
WRINKLE, WRINKLE_PERIOD = 0.35, 9.0

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class HandPiece:
    """A swept sphere from start to end, mm in a joint's frame.

    radius : at both ends, mm. scale : of the cross-section across and through the hand.
    """

    joint: str
    group: int
    start: Point
    end: Point
    radius: tuple[float, float]
    bulge: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    material: int = SKIN


def hand_pieces(body: BodyModel) -> tuple[HandPiece, ...]:
    """The pieces of a hand with the joints of body `hand25`, in the order of their groups. Raises StudioError for
    another body.
    """
    lengths = {body.joints[limb.joint].name: limb.length for limb in body.limbs}
    wanted = {"palm", "thumb_base", "thumb_distal", *(f"{finger}_distal" for finger in FINGERS)}
    if not wanted <= {joint.name for joint in body.joints}:
        raise StudioError(
            f"Body '{body.name}' has no hand's joints.", "Draw this flesh around body 'hand25'."
        )
    pieces = _palm(body, lengths)
    for number, finger in enumerate(FINGERS, 1):
        girth = GIRTHS[finger]
        for bone, share in (("proximal", 1.0), ("middle", 0.92), ("distal", 0.82)):
            pieces += _phalanx(f"{finger}_{bone}", number, lengths[f"{finger}_{bone}"], share * girth, bone)
    for bone, girth in (("thumb_proximal", 10.4), ("thumb_distal", 9.2)):
        pieces += _phalanx(bone, len(FINGERS) + 1, lengths[bone], girth, bone.removeprefix("thumb_"))
    return tuple(sorted(pieces, key=lambda piece: piece.group))


def _palm(body: BodyModel, lengths: dict[str, float]) -> list[HandPiece]:
    at_rest = {
        joint.name: frame[:, 3]
        for joint, frame in zip(body.joints, joint_frames(body, body.neutral * 0.0)[0], strict=True)
    }
    heads = [at_rest[f"{finger}_proximal"] for finger in FINGERS]
    pieces = [
        # A flat cushion between wrist and knuckles, a bone under each knuckle, the forearm.
        HandPiece("palm", PALM, (0.0, -1.0, 16.0), (-2.0, -1.0, 62.0), (11.5, 12.0), 0.0, (2.3, 0.92)),
        HandPiece("palm", PALM, (0.0, 0.0, -44.0), (0.0, 0.0, 10.0), (17.5, 16.0), -1.2, (1.42, 0.98)),
        HandPiece("palm", PALM, (-24.0, -7.0, 16.0), (-26.0, -5.0, 48.0), (10.0, 8.5), 2.2),
    ]
    for head in heads:
        foot = (0.42 * float(head[0]), 1.0, 14.0)
        end = (float(head[0]), float(head[1]) - 0.5, float(head[2]) - 4.0)
        pieces.append(HandPiece("palm", PALM, foot, end, (9.0, 9.4), 0.8, (1.0, 0.95)))
        knuckle = (end[0], end[1] + 3.0, end[2] + 2.0)
        pieces.append(HandPiece("palm", PALM, knuckle, knuckle, (7.6, 7.6), material=REDDER))
    for one, other in itertools.pairwise(heads):
        web = 0.5 * (one + other)
        place = (float(web[0]), float(web[1]) - 3.0, float(web[2]) - 2.0)
        pieces.append(HandPiece("palm", PALM, place, place, (7.0, 7.0), 0.0, (1.1, 0.7)))
    length = lengths["thumb_base"]
    pieces.append(
        HandPiece("thumb_base", PALM, (0.0, 0.0, 2.0), (0.0, 0.0, length), (13.0, 10.8), 2.6, (1.0, 1.12))
    )
    return pieces


def _phalanx(joint: str, group: int, length: float, girth: float, bone: str) -> list[HandPiece]:
    """A bone's flesh: swollen pads towards the palm, a crease at the joint, the last one with a round tip."""
    thin = 0.9 * girth
    shaft = HandPiece(
        joint, group, (0.0, 0.4, 0.0), (0.0, 0.4, length), (thin, 0.88 * thin), 0.35, (1.05, 1.0)
    )
    if bone == "distal":
        tip = length - thin
        return [
            HandPiece(
                joint, group, (0.0, 0.2, 0.0), (0.0, 0.2, tip), (thin, 0.84 * thin), 0.5, (1.08, 0.94), REDDER
            ),
            HandPiece(
                joint, group, (0.0, -1.6, 0.5 * tip), (0.0, -1.6, 0.9 * tip), (0.78 * thin, 0.72 * thin)
            ),
        ]
    pad = HandPiece(
        joint, group, (0.0, -1.8, 0.25 * length), (0.0, -1.8, 0.75 * length), (0.8 * girth, 0.76 * girth), 0.8
    )
    knuckle = HandPiece(
        joint, group, (0.0, 1.1, length), (0.0, 1.1, length), (0.95 * thin, 0.95 * thin), material=REDDER
    )
    return [shaft, pad, knuckle]


def hand_tables(body: BodyModel, poses: Array, magnify: float) -> tuple[Array, NDArray[np.int64]]:
    """The hand in the room: (T, P, COLUMNS) as `flesh.py` has them, and (P, 2) material and group."""
    pieces, frames = hand_pieces(body), joint_frames(body, poses)
    joints = {joint.name: place for place, joint in enumerate(body.joints)}
    tables = np.zeros((len(poses), len(pieces), COLUMNS))
    for place, piece in enumerate(pieces):
        start, end = np.array(piece.start), np.array(piece.end)
        frame, length = frames[:, joints[piece.joint]], float(np.linalg.norm(end - start))
        axis = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        across = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
        across /= np.linalg.norm(across)
        turn = frame[:, :, :3] @ np.stack([across, np.cross(axis, across), axis], axis=-1)
        begin = magnify * (frame[:, :, :3] @ start + frame[:, :, 3])
        table = tables[:, place]
        table[:, START : START + 3] = begin
        table[:, AXES : AXES + 9] = np.swapaxes(turn, 1, 2).reshape(-1, 9)
        table[:, LENGTH] = magnify * length
        table[:, RADIUS_START], table[:, RADIUS_END] = magnify * np.array(piece.radius)
        table[:, BULGE] = magnify * piece.bulge
        table[:, SCALE_X], table[:, SCALE_Y] = piece.scale
        table[:, FOLD], table[:, FOLD_PERIOD] = magnify * WRINKLE, magnify * WRINKLE_PERIOD
        table[:, FOLD_PHASE] = 1.7 * place
        table[:, BOUND : BOUND + 3] = begin + 0.5 * magnify * length * turn[..., 2]
        widest = magnify * (max(piece.radius) + max(piece.bulge, 0.0) + WRINKLE)
        table[:, BOUND_RADIUS] = 0.5 * magnify * length + widest * max(1.0, *piece.scale)
    return tables, np.array([(piece.material, piece.group) for piece in pieces])
