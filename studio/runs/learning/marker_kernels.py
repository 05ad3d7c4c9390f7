# pyright: standard
"""Points and directions on a body along poses, with their slopes by every parameter, in one pass over the tree.

A turn by θ about the world axis a through o moves a point p by a × (p - o) dθ, a direction v by a × v dθ; a move
along a moves points by a. Summed over a joint's own steps and those of all joints above it.
"""

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import take_step
from studio.body.model import MOVE
from studio.foundations.arrays import Array, Indices
from studio.foundations.numba_in_threads import KERNEL, njit

MOVES = MOVE


@njit(**KERNEL)
def place_points(
    poses: Array,
    parent: Indices,
    first_step: Indices,
    kind: Indices,
    axis: Indices,
    parameter: Indices,
    value: Array,
    joints: Indices,
    offsets: Array,
    is_point: NDArray[np.bool_],
    places: Array,
    slopes: Array,
) -> None:
    """Fill places (N, P, 3) and slopes (N, D, P, 3) of poses (N, D).

    joints (P,), offsets (P, 3) : joint and position in its frame of each point or direction. is_point (P,).
    The rest as in `KinematicTables`. slopes with no parameters (D = 0) are left out.
    """
    count = parent.shape[0]
    frames = np.zeros((count, 3, 4))
    axes, origins = np.zeros((len(kind), 3)), np.zeros((len(kind), 3))
    for n in range(poses.shape[0]):
        for f in range(count):
            frame = frames[f]
            if parent[f] < 0:
                frame[:] = 0.0
                for row in range(3):
                    frame[row, row] = 1.0
            else:
                frame[:] = frames[parent[f]]
            for s in range(first_step[f], first_step[f + 1]):
                amount = value[s] if parameter[s] < 0 else value[s] * poses[n, parameter[s]]
                axes[s] = frame[:, axis[s]]
                origins[s] = frame[:, 3]
                take_step(frame, kind[s], axis[s], amount)
        for p in range(joints.shape[0]):
            _place(places[n, p], frames[joints[p]], offsets[p], is_point[p])
            if slopes.shape[1] == 0:
                continue
            f = joints[p]
            while f >= 0:
                for s in range(first_step[f], first_step[f + 1]):
                    if parameter[s] >= 0:
                        slope = slopes[n, parameter[s], p]
                        _add_slope(slope, axes[s], origins[s], value[s], kind[s], places[n, p], is_point[p])
                f = parent[f]


@njit(**KERNEL)
def _place(place, frame, offset, is_point):
    for row in range(3):
        place[row] = frame[row, 3] if is_point else 0.0
        for column in range(3):
            place[row] += frame[row, column] * offset[column]


@njit(**KERNEL)
def _add_slope(slope, axis, origin, value, kind, place, is_point):
    if kind == MOVES:
        if is_point:
            for row in range(3):
                slope[row] += value * axis[row]
        return
    for row in range(3):
        one, two = (row + 1) % 3, (row + 2) % 3
        first = place[one] - (origin[one] if is_point else 0.0)
        second = place[two] - (origin[two] if is_point else 0.0)
        slope[row] += value * (axis[one] * second - axis[two] * first)
