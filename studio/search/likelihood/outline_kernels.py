# pyright: standard
"""Poses to projected limb outlines, sixteen poses at a time (structure of arrays, so that all of it
vectorises).

A limb's outline in a view is four points: side A from its start to its end, and side B (Lee-walk README,
"Limb outline in an image"): with u the unit vector across the limb as the camera sees it, A = (-r0 u, 0) to
(-r1 u, length) and B = (+r0 u, 0) to (+r1 u, length), each projected once, lens distortion included. Samples
between them are interpolated in the image by the likelihoods. Frames are twelve rows of sixteen lanes in one
flat array: distances between rows that the compiler knows are what lets it vectorise without checking for
overlap.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Floats
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_in_threads import EXACT, FAST, FAST_INLINED, njit
from studio.search.likelihood.kinematic_program import FIXED_MOVE, KinematicProgram

LANES = 16
# Rows of an outline: x and y (pixels) of A start, A end, B end, B start; how it is seen (1 wholly inside the
# picture, 0 not wholly, -1 not at all); depth of its middle, mm.
ROWS = 10
SEEN_ROW, DEPTH_ROW = 8, 9
UNSEEN_PIXEL = np.float32(-1.0e6)
NEAREST_DEPTH = np.float32(10.0)
# A corner this close to the border (pixels) counts as outside, so that rounding carries no sample over.
MARGIN = np.float32(0.01)


# sin(x) = x P(x²) and cos(x) = Q(x²) on [-π, π], least-maximum fit: errors 5e-7 and 4e-7 in single precision.
S1, S2, S3 = np.float32(-0.16666664), np.float32(0.0083333105), np.float32(-0.00019840155)
S4, S5, S6 = np.float32(2.7529454e-06), np.float32(-2.467697e-08), np.float32(1.345148e-10)
C2, C3, C4 = np.float32(0.041666664), np.float32(-0.0013888864), np.float32(2.4800556e-05)
C5, C6, C7 = np.float32(-2.7534847e-07), np.float32(2.0603907e-09), np.float32(-9.7234035e-12)
ZERO, HALF, ONE, TINY = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(1e-12)
FULL_TURN, TURNS = 2.0 * np.pi, 0.5 / np.pi


class View(NamedTuple):
    """A camera's numbers, held in registers. rotation : nine, by rows. matrix : fx skew cx fy cy. right, bottom : the
    picture's border. eye : where it stands.
    """

    rotation: tuple[Any, ...]
    matrix: tuple[Any, ...]
    lens: tuple[Any, ...]
    limit: Any
    right: Any
    bottom: Any
    eye: tuple[Any, ...]


@njit(**FAST_INLINED)
def sine_cosine(x):
    """Sine and cosine of an angle within half a turn."""
    q = x * x
    sine = x * (ONE + q * (S1 + q * (S2 + q * (S3 + q * (S4 + q * (S5 + q * S6))))))
    return sine, ONE + q * (-HALF + q * (C2 + q * (C3 + q * (C4 + q * (C5 + q * (C6 + q * C7))))))


@njit(**FAST_INLINED)
def pose_motions(entries, program, motions):
    """Rows 2k and 2k + 1 of `motions`: cosine and sine of operation k's angle, or its distance."""
    kinds, parameters, values = program.kind, program.parameter, program.value
    for k in range(kinds.shape[0]):
        kind = kinds[k]
        if kind >= FIXED_MOVE:
            continue
        parameter, value = parameters[k], np.float64(values[k])
        for lane in range(LANES):
            amount = value * entries[parameter, lane]
            sine, cosine = sine_cosine(np.float32(amount - FULL_TURN * np.floor(amount * TURNS + 0.5)))
            motions[k, lane] = cosine if kind < 3 else np.float32(amount)
            motions[k, LANES + lane] = sine


@njit(**FAST_INLINED)
def rotated(cosine, sine, a, b):
    """One row of two columns of a frame that turns: they mix."""
    return cosine * a + sine * b, cosine * b - sine * a


@njit(**FAST_INLINED)
def combined(a, b, c, x, y, z):
    """One row of a frame's three axes times a column of a constant motion."""
    return a * x + b * y + c * z


@njit(**FAST_INLINED)
def turn(frame, second, third, motions, k):
    """Turn frames about the axis before `second` in the cycle x, y, z: two columns mix."""
    for lane in range(LANES):
        c, s = motions[k, lane], motions[k, LANES + lane]
        a0, b0 = rotated(c, s, frame[second * LANES + lane], frame[third * LANES + lane])
        a1, b1 = rotated(c, s, frame[(4 + second) * LANES + lane], frame[(4 + third) * LANES + lane])
        a2, b2 = rotated(c, s, frame[(8 + second) * LANES + lane], frame[(8 + third) * LANES + lane])
        frame[second * LANES + lane], frame[third * LANES + lane] = a0, b0
        frame[(4 + second) * LANES + lane], frame[(4 + third) * LANES + lane] = a1, b1
        frame[(8 + second) * LANES + lane], frame[(8 + third) * LANES + lane] = a2, b2


@njit(**FAST_INLINED)
def move(frame, column, motions, k):
    """Move frames along one of their own axes by a pose entry."""
    for lane in range(LANES):
        distance = motions[k, lane]
        frame[3 * LANES + lane] += frame[column * LANES + lane] * distance
        frame[7 * LANES + lane] += frame[(4 + column) * LANES + lane] * distance
        frame[11 * LANES + lane] += frame[(8 + column) * LANES + lane] * distance


@njit(**FAST_INLINED)
def fixed_row(frame, row, lane, m):
    """One row of frames times a constant motion, given as its twelve numbers."""
    a, b = frame[row * LANES + lane], frame[(row + 1) * LANES + lane]
    c, d = frame[(row + 2) * LANES + lane], frame[(row + 3) * LANES + lane]
    frame[row * LANES + lane] = combined(a, b, c, m[0], m[4], m[8])
    frame[(row + 1) * LANES + lane] = combined(a, b, c, m[1], m[5], m[9])
    frame[(row + 2) * LANES + lane] = combined(a, b, c, m[2], m[6], m[10])
    frame[(row + 3) * LANES + lane] = combined(a, b, c, m[3], m[7], m[11]) + d


@njit(**FAST_INLINED)
def fixed_motion(frame, fixed, k):
    """Frames times one constant motion: fixed[k], (3, 4)."""
    motion = (
        fixed[k, 0, 0], fixed[k, 0, 1], fixed[k, 0, 2], fixed[k, 0, 3],
        fixed[k, 1, 0], fixed[k, 1, 1], fixed[k, 1, 2], fixed[k, 1, 3],
        fixed[k, 2, 0], fixed[k, 2, 1], fixed[k, 2, 2], fixed[k, 2, 3],
    )  # fmt: skip
    for lane in range(LANES):
        fixed_row(frame, 0, lane, motion)
        fixed_row(frame, 4, lane, motion)
        fixed_row(frame, 8, lane, motion)


@njit(**FAST_INLINED)
def fixed_move(frame, fixed, k):
    """Frames moved by one constant vector in their own axes: the last column of fixed[k]."""
    x, y, z = fixed[k, 0, 3], fixed[k, 1, 3], fixed[k, 2, 3]
    for lane in range(LANES):
        px = combined(frame[lane], frame[LANES + lane], frame[2 * LANES + lane], x, y, z)
        py = combined(frame[4 * LANES + lane], frame[5 * LANES + lane], frame[6 * LANES + lane], x, y, z)
        pz = combined(frame[8 * LANES + lane], frame[9 * LANES + lane], frame[10 * LANES + lane], x, y, z)
        frame[3 * LANES + lane] += px
        frame[7 * LANES + lane] += py
        frame[11 * LANES + lane] += pz


@njit(**FAST_INLINED)
def load_parent(frame, frames, parent):
    """Start from the parent's frames, or from the world's."""
    if parent >= 0:
        for i in range(12 * LANES):
            frame[i] = frames[parent, i]
        return
    for i in range(12 * LANES):
        frame[i] = ZERO
    for lane in range(LANES):
        frame[lane] = ONE
        frame[5 * LANES + lane] = ONE
        frame[10 * LANES + lane] = ONE


@njit(**FAST)
def pose_frames(program, motions, frames):
    """World frames (F, 192) of sixteen poses from their motions: rows of (3, 4), sixteen lanes each."""
    parent, first, kinds, fixed = program.parent, program.first_operation, program.kind, program.fixed
    for joint in range(parent.shape[0]):
        frame = frames[joint]
        load_parent(frame, frames, parent[joint])
        for k in range(first[joint], first[joint + 1]):
            kind = kinds[k]
            if kind == 0:
                turn(frame, 1, 2, motions, k)
            elif kind == 1:
                turn(frame, 2, 0, motions, k)
            elif kind == 2:
                turn(frame, 0, 1, motions, k)
            elif kind == 3:
                move(frame, 0, motions, k)
            elif kind == 4:
                move(frame, 1, motions, k)
            elif kind == 5:
                move(frame, 2, motions, k)
            elif kind == FIXED_MOVE:
                fixed_move(frame, fixed, k)
            else:
                fixed_motion(frame, fixed, k)


@njit(**FAST_INLINED)
def view_of(camera):
    """A row of a `CameraTable` as a View."""
    r, m, k, eye, size = camera.rotation, camera.matrix, camera.lens, camera.centre, camera["size"]
    return View(
        (r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2], r[2, 0], r[2, 1], r[2, 2]),
        (m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2]),
        (k[0], k[1], k[2], k[3], k[4]),
        camera.limit,
        size[0] - HALF,
        size[1] - HALF,
        (eye[0], eye[1], eye[2]),
    )


@njit(**FAST_INLINED)
def turned(r, x, y, z):
    """A direction in the world in a camera's axes. r : its rotation."""
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@njit(**FAST_INLINED)
def projected(view, start, axis, across, along, radius):
    """Pixel of start + along axis + radius across (camera's axes, mm), and how it is seen."""
    x = start[0] + along * axis[0] + radius * across[0]
    y = start[1] + along * axis[1] + radius * across[1]
    z = start[2] + along * axis[2] + radius * across[2]
    inverse = ONE / max(z, NEAREST_DEPTH)
    x *= inverse
    y *= inverse
    # As `foundations.geometry.projection.distorted`, without numbers that would make it double precision.
    k1, k2, p1, p2, k3 = view.lens
    square = x * x + y * y
    radial = ONE + square * (k1 + square * (k2 + square * k3))
    xd = x * radial + p1 * (x * y + x * y) + p2 * (square + x * x + x * x)
    yd = y * radial + p1 * (square + y * y + y * y) + p2 * (x * y + x * y)
    fx, skew, cx, fy, cy = view.matrix
    u = fx * xd + skew * yd + cx
    v = fy * yd + cy
    seen = (z > NEAREST_DEPTH) & (square < view.limit)
    inside = (
        (u >= MARGIN - HALF) & (u < view.right - MARGIN) & (v >= MARGIN - HALF) & (v < view.bottom - MARGIN)
    )
    state = (ONE if inside else ZERO) if seen else -ONE
    return u if seen else UNSEEN_PIXEL, v if seen else UNSEEN_PIXEL, state


@njit(**FAST_INLINED)
def sideways(x, y, scale_x, scale_y):
    """u of a limb whose camera lies at x, y in the limb's axes, scaled with the cross-section."""
    x /= scale_x
    y /= scale_y
    square = x * x + y * y
    inverse = ONE / math.sqrt(max(square, TINY))
    on_axis = square < TINY
    return (ONE if on_axis else y * inverse) * scale_x, (ZERO if on_axis else -x * inverse) * scale_y


@njit(**FAST_INLINED)
def limb_axes(frame, shape, view):
    """Where a limb starts, its whole axis and the unit vector across it as the camera sees it, in the camera's axes."""
    x0, x1, x2, x3, y0, y1, y2, y3, z0, z1, z2, z3 = frame
    length, _, _, scale_x, scale_y = shape
    dx, dy, dz = view.eye[0] - x3, view.eye[1] - y3, view.eye[2] - z3
    ux, uy = sideways(x0 * dx + y0 * dy + z0 * dz, x1 * dx + y1 * dy + z1 * dz, scale_x, scale_y)
    across = turned(view.rotation, x0 * ux + x1 * uy, y0 * ux + y1 * uy, z0 * ux + z1 * uy)
    axis = turned(view.rotation, x2 * length, y2 * length, z2 * length)
    return turned(view.rotation, -dx, -dy, -dz), axis, across


@njit(**FAST_INLINED)
def outline_of(frame, shape, view):
    """The ten numbers of a limb's outline in one view, from its frame (rows of (3, 4)) and its five measures."""
    start, axis, across = limb_axes(frame, shape, view)
    r0, r1 = shape[1], shape[2]
    ax, ay, a_state = projected(view, start, axis, across, ZERO, -r0)
    bx, by, b_state = projected(view, start, axis, across, ONE, -r1)
    cx, cy, c_state = projected(view, start, axis, across, ONE, r1)
    ex, ey, e_state = projected(view, start, axis, across, ZERO, r0)
    state = min(min(a_state, b_state), min(c_state, e_state))
    return ax, ay, bx, by, cx, cy, ex, ey, state, start[2] + HALF * axis[2]


@njit(**FAST_INLINED)
def limb_outline(frame, shape, view, outline):
    """Outlines (160,) of one limb in one view, from its frames (192,)."""
    measures = shape[0], shape[1], shape[2], shape[3], shape[4]
    for lane in range(LANES):
        numbers = (
            frame[lane], frame[LANES + lane], frame[2 * LANES + lane], frame[3 * LANES + lane],
            frame[4 * LANES + lane], frame[5 * LANES + lane], frame[6 * LANES + lane], frame[7 * LANES + lane],
            frame[8 * LANES + lane], frame[9 * LANES + lane], frame[10 * LANES + lane], frame[11 * LANES + lane],
        )  # fmt: skip
        ax, ay, bx, by, cx, cy, ex, ey, state, depth = outline_of(numbers, measures, view)
        outline[lane], outline[LANES + lane] = ax, ay
        outline[2 * LANES + lane], outline[3 * LANES + lane] = bx, by
        outline[4 * LANES + lane], outline[5 * LANES + lane] = cx, cy
        outline[6 * LANES + lane], outline[7 * LANES + lane] = ex, ey
        outline[SEEN_ROW * LANES + lane] = state
        outline[DEPTH_ROW * LANES + lane] = depth


@njit(**FAST_INLINED)
def block_frames(block, poses, program, entries, motions, frames):
    """World frames (F, 192) of a block of sixteen poses; lanes past the last pose repeat it. entries (D, 16), motions
    (K, 32) : scratch.
    """
    for lane in range(LANES):
        pose = min(block * LANES + lane, poses.shape[0] - 1)
        for entry in range(poses.shape[1]):
            entries[entry, lane] = poses[pose, entry]
    pose_motions(entries, program, motions)
    pose_frames(program, motions, frames)


@njit(**FAST)
def outline_blocks(
    first: int,
    last: int,
    poses: Array,
    program: KinematicProgram,
    cameras: CameraTable,
    out: Floats,
) -> None:
    """Outlines (B, V, L, 160) of the blocks first..last - 1."""
    limb_frame, limb_shape = program.limb_frame, program.limb_shape
    frames = np.zeros((program.parent.shape[0], 12 * LANES), np.float32)
    outline = np.zeros(ROWS * LANES, np.float32)
    entries = np.zeros((poses.shape[1], LANES), np.float64)
    motions = np.zeros((program.kind.shape[0], 2 * LANES), np.float32)
    for block in range(first, last):
        block_frames(block, poses, program, entries, motions, frames)
        for number in range(cameras.shape[0]):
            view = view_of(cameras[number])
            for limb in range(limb_frame.shape[0]):
                limb_outline(frames[limb_frame[limb]], limb_shape[limb], view, outline)
                for i in range(ROWS * LANES):
                    out[block, number, limb, i] = outline[i]


@njit(**EXACT)
def corner_of(blocks, pose, view, limb, number):
    """One of the eight numbers of a pose's corners; NaN where the limb is not seen."""
    block, lane = pose // LANES, pose % LANES
    if blocks[block, view, limb, SEEN_ROW * LANES + lane] < ZERO:
        return np.nan
    return np.float64(blocks[block, view, limb, number * LANES + lane])


@njit(**EXACT)
def read_corners(blocks: Floats, corners: Array, seen: NDArray[np.int8]) -> None:
    """Fill corners (N, V, L, 4, 2) and seen (N, V, L) from outlines (B, V, L, 160)."""
    for pose in range(corners.shape[0]):
        block, lane = pose // LANES, pose % LANES
        for view in range(corners.shape[1]):
            for limb in range(corners.shape[2]):
                seen[pose, view, limb] = np.int8(blocks[block, view, limb, SEEN_ROW * LANES + lane])
                for number in range(8):
                    corners[pose, view, limb, number >> 1, number & 1] = corner_of(
                        blocks, pose, view, limb, number
                    )


@njit(**EXACT)
def read_slopes(blocks: Floats, difference: float, corners: Array, slopes: Array) -> None:
    """Fill corners (V, L, 4, 2) of the first pose, and slopes (V, L, 4, 2, D) of the D after it less the D after those,
    by `difference`. blocks : outlines (B, V, L, 160).
    """
    size = slopes.shape[4]
    for view in range(corners.shape[0]):
        for limb in range(corners.shape[1]):
            for number in range(8):
                corners[view, limb, number >> 1, number & 1] = corner_of(blocks, 0, view, limb, number)
                for entry in range(size):
                    ahead = corner_of(blocks, 1 + entry, view, limb, number)
                    behind = corner_of(blocks, 1 + size + entry, view, limb, number)
                    slopes[view, limb, number >> 1, number & 1, entry] = (ahead - behind) / difference
