"""The cones of a body in its rest pose, each point on one joint: the mesh of animated bodies."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from studio.body.model import Limb
from studio.foundations.arrays import Array, Indices
from studio.results.export.skeleton import Skeleton

SECTIONS = 24


def cone(limb: Limb) -> tuple[Array, Array, Indices]:
    """Vertices (V, 3) mm and outward normals (V, 3) in the limb's frame, and faces (T, 3), counter-clockwise as seen
    from outside: a side with smooth normals and two flat caps with rims of their own.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, SECTIONS, endpoint=False)
    rim = np.column_stack([limb.scale_x * np.cos(turn), limb.scale_y * np.sin(turn), np.zeros(SECTIONS)])
    top, up = np.array([0.0, 0.0, limb.length]), np.sign(limb.length)
    near, far = limb.radius_start * rim, limb.radius_end * rim + top
    vertices = np.concatenate([near, far, near, np.zeros((1, 3)), far, top[None]])
    down = np.tile([0.0, 0.0, -up], (SECTIONS + 1, 1))
    normals = np.concatenate([_sides(limb, turn, 0.0), _sides(limb, turn, 1.0), down, -down])
    ring = np.arange(SECTIONS)
    after, first, second = np.roll(ring, -1), 2 * SECTIONS, 3 * SECTIONS + 1
    near_hub, far_hub = np.full(SECTIONS, first + SECTIONS), np.full(SECTIONS, second + SECTIONS)
    faces = np.concatenate(
        [
            np.column_stack([ring, after, after + SECTIONS]),
            np.column_stack([ring, after + SECTIONS, ring + SECTIONS]),
            np.column_stack([near_hub, first + after, first + ring]),
            np.column_stack([far_hub, second + ring, second + after]),
        ]
    )
    # A limb of negative length is the same cone mirrored along z: its faces turn the other way round.
    return vertices, normals, faces if limb.length > 0.0 else faces[:, ::-1]


def _sides(limb: Limb, turn: Array, share: float) -> Array:
    """(sections, 3) unit normals of the side at a share of the length: across both tangents of the surface there."""
    radius = limb.radius_start + share * (limb.radius_end - limb.radius_start)
    around = np.column_stack([-limb.scale_x * np.sin(turn), limb.scale_y * np.cos(turn), np.zeros(len(turn))])
    slope = (limb.radius_end - limb.radius_start) / limb.length
    along = np.column_stack(
        [slope * limb.scale_x * np.cos(turn), slope * limb.scale_y * np.sin(turn), np.ones(len(turn))]
    )
    across = np.cross(around * max(radius, 1.0), along)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


SIDES = ("left", "right", "middle")


@dataclass(frozen=True, slots=True, eq=False)
class SkinnedPart:
    """The cones of one side. points (V, 3) mm and normals (V, 3) at rest in the world, joints (V,) that carry them,
    faces (T, 3) counter-clockwise as seen from outside.
    """

    side: str
    points: Array
    normals: Array
    joints: Indices
    faces: Indices


def standing_at_rest(skeleton: Skeleton) -> Array:
    """(J, 3) mm where the joints are at rest, the body's lowest point on the floor if it stands in a T-pose."""
    places = skeleton.rest_pivots
    tips = [place + end for place, end in zip(places, skeleton.ends, strict=True) if end is not None]
    lowest = min(point[2] for point in (*places, *tips))
    return places - np.array([0.0, 0.0, lowest if skeleton.kind == "T-pose" else 0.0])


def cones_at_rest(skeleton: Skeleton, standing: Array) -> Iterator[SkinnedPart]:
    """The sides that have limbs. standing : (J, 3) mm, of `standing_at_rest`."""
    pivots, frames = (part[0] for part in skeleton.tree.placed(skeleton.body.neutral[None]))
    origins = skeleton.tree.origins(skeleton.body.neutral[None])[0]
    for side in SIDES:
        points, normals, joints, faces = list[Array](), list[Array](), list[Indices](), list[Indices]()
        count = 0
        for limb in (limb for limb in skeleton.body.drawn if limb.side == side):
            joint = skeleton.tree.whole[limb.joint]
            own, outwards, triangles = cone(limb)
            shift = frames[joint].T @ (origins[joint] - pivots[joint])
            points.append((own + shift) @ skeleton.turns[joint].T + standing[joint])
            normals.append(outwards @ skeleton.turns[joint].T)
            joints.append(np.full(len(own), joint))
            faces.append(triangles + count)
            count += len(own)
        if count:
            yield SkinnedPart(
                side,
                np.concatenate(points),
                np.concatenate(normals),
                np.concatenate(joints),
                np.concatenate(faces),
            )
