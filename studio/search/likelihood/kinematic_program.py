"""A body's kinematic tables as a short program for the outline kernel.

Steps by constants are folded into one fixed motion each and joints that carry no drawn limb are left out, so
that a pose costs one pair of column turns for each of its angles and little else. Any tree that
`KinematicTables` can hold can be compiled.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.body.model import MOVE, TURN, KinematicTables
from studio.foundations.arrays import Array, Floats

IntArray = NDArray[np.int64]

# Kinds of operation: 0, 1, 2 turn about x, y, z by a pose entry; 3, 4, 5 move along x, y, z by a pose entry.
FIXED_MOVE = 6
FIXED_MOTION = 7
NO_PARAMETER = -1


class KinematicProgram(NamedTuple):
    """F frames (parents first), K operations, L drawn limbs, as kernels read them.

    parent (F,): -1 for the world. first_operation (F + 1,). kind, parameter (K,); value (K,): coefficient of the pose
    entry. fixed (K, 3, 4): the constant motion of FIXED kinds. limb_frame (L,). limb_shape (L, 5): length,
    radius_start, radius_end, scale_x, scale_y, mm. dimension : entries of a pose that are read, at least.
    """

    parent: IntArray
    first_operation: IntArray
    kind: IntArray
    parameter: IntArray
    value: Floats
    fixed: Floats
    limb_frame: IntArray
    limb_shape: Floats
    dimension: int


@lru_cache(maxsize=64)
def compile_program(tables: KinematicTables) -> KinematicProgram:
    """The program of a body's tables, made once a table: read only."""
    needed = _needed_joints(tables)
    number = {int(joint): index for index, joint in enumerate(needed)}
    operations: list[tuple[int, int, float, Array]] = []
    first = [0]
    for joint in needed:
        operations += _joint_operations(tables, int(joint))
        first.append(len(operations))
    parents = [number.get(int(tables.parent[joint]), -1) for joint in needed]
    parameters = [operation[1] for operation in operations]
    return KinematicProgram(
        parent=np.array(parents, dtype=np.int64),
        first_operation=np.array(first, dtype=np.int64),
        kind=np.array([operation[0] for operation in operations], dtype=np.int64),
        parameter=np.array(parameters, dtype=np.int64),
        value=np.array([operation[2] for operation in operations], dtype=np.float32),
        fixed=np.array([operation[3] for operation in operations], dtype=np.float32).reshape(-1, 3, 4),
        limb_frame=np.array([number[int(joint)] for joint in tables.limb_joint], dtype=np.int64),
        limb_shape=np.ascontiguousarray(tables.limb_shape, dtype=np.float32),
        dimension=max(parameters, default=NO_PARAMETER) + 1,
    )


def _needed_joints(tables: KinematicTables) -> IntArray:
    """The joints between the world and a drawn limb, parents first."""
    needed = np.zeros(len(tables.parent), dtype=np.bool_)
    for joint in tables.limb_joint:
        index = int(joint)
        while index >= 0 and not needed[index]:
            needed[index] = True
            index = int(tables.parent[index])
    return np.flatnonzero(needed)


def _joint_operations(tables: KinematicTables, joint: int) -> list[tuple[int, int, float, Array]]:
    """One joint's steps as (kind, parameter, coefficient, fixed motion), constants folded together."""
    operations: list[tuple[int, int, float, Array]] = []
    pending = np.eye(4)
    for step in range(int(tables.first_step[joint]), int(tables.first_step[joint + 1])):
        kind, axis = int(tables.step_kind[step]), int(tables.step_axis[step])
        parameter, value = int(tables.step_parameter[step]), float(tables.step_value[step])
        if parameter < 0:
            pending = pending @ _fixed_step(kind, axis, value)
            continue
        operations += _fixed_operation(pending)
        pending = np.eye(4)
        offset = 0 if kind == TURN else 3
        operations.append((axis + offset, parameter, value, np.zeros((3, 4))))
    return operations + _fixed_operation(pending)


def _fixed_step(kind: int, axis: int, value: float) -> Array:
    """(4, 4) a constant move along, or right-handed turn about, one axis."""
    motion = np.eye(4)
    if kind == MOVE:
        motion[axis, 3] = value
        return motion
    second, third = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = np.cos(value), np.sin(value)
    motion[second, second] = motion[third, third] = cosine
    motion[third, second], motion[second, third] = sine, -sine
    return motion


def _fixed_operation(motion: Array) -> list[tuple[int, int, float, Array]]:
    """The operation of a folded constant motion; none for the identity."""
    if np.array_equal(motion, np.eye(4)):
        return []
    kind = FIXED_MOVE if np.array_equal(motion[:3, :3], np.eye(3)) else FIXED_MOTION
    return [(kind, NO_PARAMETER, 0.0, motion[:3])]
