# pyright: standard
"""How far limbs lie apart, sixteen poses at a time.

The axes of two limbs are segments; where these come closest (C. Ericson, Real-Time Collision Detection, 5.1.9, here
without branches, so that all of it vectorises), a vector w of length d leads from one to the other. Each limb reaches
from its axis towards the other by the extent of its cross-section along w, for an ellipse of half axes a, b across the
limb: h = sqrt((a x·w)² + (b y·w)²) / d, x and y the cross-section's unit axes. Since w is perpendicular to an axis
that it does not leave at an end, this is the radius there; at an end it is that of the flat disc which ends the limb,
0 straight ahead. Two limbs' ratio is d / (h + h'): 1 where they touch, 0 where their axes cross.

Frames are twelve rows of sixteen lanes as in `outline_kernels`, from which the forward kinematics is taken.
"""

import numpy as np

from studio.foundations.arrays import Array, Floats, Indices, Mask
from studio.foundations.numba_in_threads import EXACT_INLINED, FAST, FAST_INLINED, njit
from studio.search.likelihood.kinematic_program import KinematicProgram
from studio.search.likelihood.outline_kernels import LANES, ONE, ZERO, block_frames

# Squared sine of two axes' angle below which they count as parallel; squared mm that count as nothing.
PARALLEL, NOTHING = np.float32(1.0e-6), np.float32(1.0e-6)


@njit(**FAST_INLINED)
def within(value):
    """Clamped to 0...1."""
    return min(max(value, ZERO), ONE)


@njit(**FAST_INLINED)
def closest(a, b, c, e, f):
    """Where segments P + s p and Q + t q come closest, s and t in 0...1.

    a = p·p, b = p·q, e = q·q, c = p·(P - Q), f = q·(P - Q). Taking s once more from t is exact: where t was not
    clamped it gives the same s again.
    """
    across = a * e - b * b
    parallel = across <= PARALLEL * a * e
    s = within((b * f - c * e) / (ONE if parallel else across))
    t = within((b * (ZERO if parallel else s) + f) / e)
    return within((b * t - c) / a), t


@njit(**FAST_INLINED)
def pair_ratios(one, two, shape_one, shape_two, ratios):
    """Ratios (16,) of one pair of limbs, from their frames (192,) each.

    shape_one, shape_two : (5,) length, radius_start, radius_end, scale_x, scale_y.
    """
    long_one, radius_one, x_one, y_one = shape_one[0], shape_one[1], shape_one[3], shape_one[4]
    long_two, radius_two, x_two, y_two = shape_two[0], shape_two[1], shape_two[3], shape_two[4]
    taper_one, taper_two = shape_one[2] - radius_one, shape_two[2] - radius_two
    a, e = long_one * long_one, long_two * long_two
    for lane in range(LANES):
        z0, z1, z2 = one[2 * LANES + lane], one[6 * LANES + lane], one[10 * LANES + lane]
        k0, k1, k2 = two[2 * LANES + lane], two[6 * LANES + lane], two[10 * LANES + lane]
        r0 = one[3 * LANES + lane] - two[3 * LANES + lane]
        r1 = one[7 * LANES + lane] - two[7 * LANES + lane]
        r2 = one[11 * LANES + lane] - two[11 * LANES + lane]
        b = long_one * long_two * (z0 * k0 + z1 * k1 + z2 * k2)
        c = long_one * (z0 * r0 + z1 * r1 + z2 * r2)
        f = long_two * (k0 * r0 + k1 * r1 + k2 * r2)
        s, t = closest(a, b, c, e, f)
        along_one, along_two = s * long_one, t * long_two
        w0 = r0 + along_one * z0 - along_two * k0
        w1 = r1 + along_one * z1 - along_two * k1
        w2 = r2 + along_one * z2 - along_two * k2
        u = x_one * (one[lane] * w0 + one[4 * LANES + lane] * w1 + one[8 * LANES + lane] * w2)
        v = y_one * (one[LANES + lane] * w0 + one[5 * LANES + lane] * w1 + one[9 * LANES + lane] * w2)
        p = x_two * (two[lane] * w0 + two[4 * LANES + lane] * w1 + two[8 * LANES + lane] * w2)
        q = y_two * (two[LANES + lane] * w0 + two[5 * LANES + lane] * w1 + two[9 * LANES + lane] * w2)
        extent_one = (radius_one + s * taper_one) * np.sqrt(u * u + v * v)
        extent_two = (radius_two + t * taper_two) * np.sqrt(p * p + q * q)
        square = w0 * w0 + w1 * w1 + w2 * w2
        ratios[lane] = square / (extent_one + extent_two + NOTHING)


@njit(**FAST)
def ratio_blocks(
    first: int,
    last: int,
    poses: Array,
    program: KinematicProgram,
    limbs: Indices,
    out: Floats,
) -> None:
    """Ratios (B, P, 16) of the blocks first..last - 1 of sixteen poses each; lanes past the last pose repeat it."""
    frames = np.zeros((program.parent.shape[0], 12 * LANES), np.float32)
    entries = np.zeros((poses.shape[1], LANES), np.float64)
    motions = np.zeros((program.kind.shape[0], 2 * LANES), np.float32)
    ratios = np.zeros(LANES, np.float32)
    for block in range(first, last):
        block_frames(block, poses, program, entries, motions, frames)
        for pair in range(limbs.shape[0]):
            one, two = limbs[pair, 0], limbs[pair, 1]
            pair_ratios(
                frames[program.limb_frame[one]], frames[program.limb_frame[two]],
                program.limb_shape[one], program.limb_shape[two], ratios,
            )  # fmt: skip
            for lane in range(LANES):
                out[block, pair, lane] = ratios[lane]


@njit(**EXACT_INLINED)
def is_within(pose, limits):
    """Whether every parameter of a pose (D,) is finite and within its limits (2, D), both included."""
    held = True
    for d in range(len(pose)):
        held &= limits[0, d] <= pose[d] <= limits[1, d] and np.isfinite(pose[d])
    return held


@njit(**FAST)
def hold_blocks(
    first: int,
    last: int,
    poses: Array,
    limits: Array,
    program: KinematicProgram,
    limbs: Indices,
    least: Floats,
    held: Mask,
) -> None:
    """Of the poses (N, D) in blocks first..last - 1 of sixteen each, fill held (N,): whether every parameter is finite
    and within its limits (2, D), both included, and all pairs keep their least share (P,). Those beyond a limit are not
    compared further.
    """
    begin, end = first * LANES, min(last * LANES, poses.shape[0])
    kept, count = np.zeros((end - begin, poses.shape[1]), np.float64), 0
    for n in range(begin, end):
        held[n] = is_within(poses[n], limits)
        if held[n]:
            kept[count] = poses[n]
            count += 1
    if len(least) == 0 or count == 0:
        return
    ratios = np.zeros((-(-count // LANES), limbs.shape[0], LANES), np.float32)
    ratio_blocks(0, ratios.shape[0], kept[:count], program, limbs, ratios)
    count = 0
    for n in range(begin, end):
        if held[n]:
            for pair in range(len(least)):
                held[n] &= ratios[count // LANES, pair, count % LANES] >= least[pair]
            count += 1
