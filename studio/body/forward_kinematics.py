"""Positions of joints, limbs and markers for N poses at once.

A joint's frame is its parent's frame times its steps, left to right (`body/model.py`). Frames are (3, 4)
motions world_from_joint: three axis columns and the origin (mm).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studio.body.model import MOVE, BodyModel, kinematic_tables
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.foundations.numba_in_threads import KERNEL, njit


def joint_frames(body: BodyModel, poses: ArrayLike) -> Array:
    """world_from_joint of every joint, (N, F, 3, 4) mm.

    poses : (N, D) radians and mm; one pose (D,) counts as N = 1.

    Raises BodyError when D is not the body's.
    """
    poses = checked_poses(body, poses)
    tables = kinematic_tables(body)
    frames = np.zeros((len(poses), len(body.joints), 3, 4))
    place_joints(
        poses,
        tables.parent,
        tables.first_step,
        tables.step_kind,
        tables.step_axis,
        tables.step_parameter,
        tables.step_value,
        frames,
    )
    return frames


def limb_frames(body: BodyModel, poses: ArrayLike) -> Array:
    """world_from_limb of every drawn limb, (N, L, 3, 4) mm: its cone runs along z from 0 to its length."""
    return joint_frames(body, poses)[:, kinematic_tables(body).limb_joint]


def limb_ends(body: BodyModel, poses: ArrayLike) -> Array:
    """World points of the drawn limbs' axes at z = 0 and z = length, (N, L, 2, 3) mm.

    poses : (N, D) radians and mm.
    """
    frames = limb_frames(body, poses)
    along = frames[..., 2] * kinematic_tables(body).limb_shape[:, :1]
    return np.stack([frames[..., 3], frames[..., 3] + along], axis=2)


def marker_points(body: BodyModel, poses: ArrayLike) -> Array:
    """World points of the markers in the body's order, (N, M, 3) mm.

    poses : (N, D) radians and mm.
    """
    joints = np.array([marker.joint for marker in body.markers], dtype=np.int64)
    offsets = np.array([marker.offset for marker in body.markers]).reshape(-1, 3)
    frames = joint_frames(body, poses)[:, joints]
    return (frames[..., :3] @ offsets[..., None])[..., 0] + frames[..., 3]


def checked_poses(body: BodyModel, poses: ArrayLike) -> Array:
    """(N, D) contiguous poses; a single (D,) becomes (1, D). Raises BodyError when D is not the body's."""
    array = np.ascontiguousarray(np.atleast_2d(np.asarray(poses, dtype=np.float64)))
    size = len(body.parameters)
    if array.ndim != 2 or array.shape[1] != size:
        cause = (
            f"Poses of shape {np.shape(poses)} do not fit body '{body.name}', which has {size} parameters."
        )
        raise BodyError(cause, "Give one row of parameters a pose, in the body's order.")
    return array


@njit(**KERNEL)
def place_joints(
    poses: Array,
    parent: NDArray[np.integer],
    first_step: NDArray[np.integer],
    kind: NDArray[np.integer],
    axis: NDArray[np.integer],
    parameter: NDArray[np.integer],
    value: Array,
    frames: Array,
) -> None:
    """Fill frames (N, F, 3, 4) with world_from_joint of poses (N, D); the rest as in `KinematicTables`."""
    for n in range(poses.shape[0]):
        for f in range(parent.shape[0]):
            frame = frames[n, f]
            if parent[f] < 0:
                frame[:] = 0.0
                frame[0, 0] = 1.0
                frame[1, 1] = 1.0
                frame[2, 2] = 1.0
            else:
                # Number by number: assigned as a whole it is checked, by texts that take a third of compiling all this.
                for row in range(3):
                    for column in range(4):
                        frame[row, column] = frames[n, parent[f], row, column]
            for s in range(first_step[f], first_step[f + 1]):
                amount = value[s] if parameter[s] < 0 else value[s] * poses[n, parameter[s]]
                take_step(frame, kind[s], axis[s], amount)


@njit(**KERNEL)
def take_step(frame: Array, kind: int, axis: int, amount: float) -> None:
    """Multiply frame (3, 4) from the right by one elementary motion, in place. amount : mm or radians."""
    if kind == MOVE:
        for row in range(3):
            frame[row, 3] += frame[row, axis] * amount
        return
    cosine, sine = math.cos(amount), math.sin(amount)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    for row in range(3):
        first, second = frame[row, one], frame[row, two]
        frame[row, one] = cosine * first + sine * second
        frame[row, two] = cosine * second - sine * first
