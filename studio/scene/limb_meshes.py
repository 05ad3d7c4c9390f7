"""Limbs as meshes in metres, made with trimesh, and the poses of their frames as viser wants them.

A limb is a truncated cone with an elliptical cross-section along its frame's z axis; the mesh is made once
in that frame, and a pose only moves it.
"""

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel, Limb

METRES_PER_MM = 0.001
SECTIONS = 28

Array = NDArray[np.float64]


def limb_mesh(limb: Limb, sections: int = SECTIONS) -> trimesh.Trimesh:
    """The limb's surface in its joint's frame, metres: a side and two flat caps with crisp rims, normals
    outwards.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, sections, endpoint=False)
    circle = np.stack([limb.scale_x * np.cos(turn), limb.scale_y * np.sin(turn)], axis=-1)
    start = np.column_stack([limb.radius_start * circle, np.zeros(sections)])
    end = np.column_stack([limb.radius_end * circle, np.full(sections, limb.length)])
    here = np.arange(sections)
    after = np.roll(here, -1)
    side = np.concatenate(
        [
            np.column_stack([here, after, after + sections]),
            np.column_stack([here, after + sections, here + sections]),
        ]
    )
    parts = [
        trimesh.Trimesh(np.concatenate([start, end]), side, process=False),
        _cap(start, np.array([0.0, 0.0, 0.0]), facing_up=False),
        _cap(end, np.array([0.0, 0.0, limb.length]), facing_up=True),
    ]
    mesh: trimesh.Trimesh = trimesh.util.concatenate(parts)  # pyright: ignore[reportAssignmentType]
    if limb.length < 0.0:
        mesh.invert()
    mesh.apply_scale(METRES_PER_MM)
    return mesh


def limb_frames(body: BodyModel, pose: Array) -> tuple[Array, Array]:
    """The drawn limbs' frames at a pose: wxyz quaternions (L, 4) and positions (L, 3) in metres."""
    frames = joint_frames(body, np.asarray(pose, dtype=np.float64)[None])[0]
    chosen = frames[[limb.joint for limb in body.drawn]]
    wxyz = Rotation.from_matrix(chosen[:, :, :3]).as_quat(scalar_first=True)
    return wxyz, chosen[:, :, 3] * METRES_PER_MM


def _cap(rim: Array, centre: Array, facing_up: bool) -> trimesh.Trimesh:
    here = np.arange(len(rim))
    after = np.roll(here, -1)
    hub = np.full(len(rim), len(rim))
    faces = np.column_stack([hub, here, after] if facing_up else [hub, after, here])
    return trimesh.Trimesh(np.concatenate([rim, centre[None]]), faces, process=False)
