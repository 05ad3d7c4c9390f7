"""The outline of a truncated elliptical cone as a camera sees it.

A cone runs along its frame's z from z = 0 (radius_start) to z = length (radius_end; length may be negative).
Its cross-section is a circle scaled by scale_x and scale_y along the frame's x and y. In the frame without
these scales the cone is round: let v be the vector from the camera's centre to the middle of the axis and u
the unit vector of the x-y plane perpendicular to v's x-y part. Side A runs from -radius_start u to
-radius_end u, side B likewise with +u (Lee-walk data, "Limb outline in an image", as PARSEC bodytrack draws
limbs). There are no end caps, and the tangent points are those of a far camera: against the true tangents of
a cylinder of radius r at distance d a side is off by r³ / 2d³ radians, hundredths of a pixel for a limb in a
room.
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera

# A camera this close (mm) to a cone's axis, seen along it, has no sideways direction: any u will do.
ON_AXIS = 1e-9


def limb_outlines(shapes: Array, frames: Array, camera: Camera) -> Array:
    """World points A0, A1, B1, B0 of each cone's outline, (N, L, 4, 3) mm: side A up, side B back.

    shapes : (L, 5) length, radius_start, radius_end, scale_x, scale_y (`KinematicTables.limb_shape`).
    frames : (N, L, 3, 4) world_from_limb (`forward_kinematics.limb_frames`). camera : its centre is used.
    """
    length, radius_start, radius_end = shapes[:, 0], shapes[:, 1], shapes[:, 2]
    scales = shapes[:, 3:5]
    rotations, origins = frames[..., :3], frames[..., 3]
    centre = np.einsum("nlji,nlj->nli", rotations, camera.centre - origins)
    sideways = -centre[..., :2] / scales
    distance = np.hypot(sideways[..., 0], sideways[..., 1])
    seen = distance > ON_AXIS
    safe = np.where(seen, distance, 1.0)
    across = np.stack(
        [np.where(seen, -sideways[..., 1] / safe, 1.0), np.where(seen, sideways[..., 0] / safe, 0.0)], axis=-1
    )
    across = across * scales
    corners = np.zeros((*frames.shape[:2], 4, 3))
    corners[:, :, 0, :2] = -radius_start[:, None] * across
    corners[:, :, 1, :2] = -radius_end[:, None] * across
    corners[:, :, 2, :2] = radius_end[:, None] * across
    corners[:, :, 3, :2] = radius_start[:, None] * across
    corners[:, :, 1:3, 2] = length[:, None]
    return np.einsum("nlij,nlkj->nlki", rotations, corners) + origins[:, :, None]
