"""The body's cones as triangles with normals, for files that carry a surface."""

import numpy as np

from studio.arrays import Array, Indices
from studio.body.model import Limb

SECTIONS = 24


def cone(limb: Limb, sections: int = SECTIONS) -> tuple[Array, Array, Indices]:
    """Vertices (V, 3) mm and outward normals (V, 3) in the limb's frame, and faces (T, 3), counter-clockwise as seen
    from outside: a side with smooth normals and two flat caps with rims of their own.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, sections, endpoint=False)
    rim = np.column_stack([limb.scale_x * np.cos(turn), limb.scale_y * np.sin(turn), np.zeros(sections)])
    top, up = np.array([0.0, 0.0, limb.length]), np.sign(limb.length)
    near, far = limb.radius_start * rim, limb.radius_end * rim + top
    vertices = np.concatenate([near, far, near, np.zeros((1, 3)), far, top[None]])
    down = np.tile([0.0, 0.0, -up], (sections + 1, 1))
    normals = np.concatenate([_sides(limb, turn, 0.0), _sides(limb, turn, 1.0), down, -down])
    here = np.arange(sections)
    after, first, second = np.roll(here, -1), 2 * sections, 3 * sections + 1
    near_hub, far_hub = np.full(sections, first + sections), np.full(sections, second + sections)
    faces = np.concatenate(
        [
            np.column_stack([here, after, after + sections]),
            np.column_stack([here, after + sections, here + sections]),
            np.column_stack([near_hub, first + after, first + here]),
            np.column_stack([far_hub, second + here, second + after]),
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
