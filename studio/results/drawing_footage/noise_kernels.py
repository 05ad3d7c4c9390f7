# pyright: standard
"""Noise as a pure function of place and time: the same on any number of threads, in any order."""

import math

import numpy as np

from studio.foundations.arrays import Bytes, Floats
from studio.foundations.numba_in_threads import njit, prange

# Odd multipliers of the 32-bit finaliser of MurmurHash3 (Appleby, public domain) and of a lattice.
_MIX_ONE, _MIX_TWO = np.uint32(0x85EBCA6B), np.uint32(0xC2B2AE35)
_ACROSS, _DOWN, _DEEP = np.uint32(0x9E3779B1), np.uint32(0x27D4EB2F), np.uint32(0x165667B1)
_TO_UNIT = 1.0 / 4294967296.0


@njit(error_model="numpy", fastmath=True, inline="always")
def hashed(x, y, z):
    """A uniform number in [0, 1) for three integers."""
    h = np.uint32(x) * _ACROSS ^ np.uint32(y) * _DOWN ^ np.uint32(z) * _DEEP
    h = np.uint32(h ^ (h >> np.uint32(16))) * _MIX_ONE
    h = np.uint32(h ^ (h >> np.uint32(13))) * _MIX_TWO
    h = np.uint32(h ^ (h >> np.uint32(16)))
    return np.float64(h) * _TO_UNIT


@njit(error_model="numpy", fastmath=True)
def value_noise(x, y, z):
    """Smooth noise in [0, 1] with features of size 1."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    ix, iy, iz = int(fx), int(fy), int(fz)
    u, v, w = x - fx, y - fy, z - fz
    u, v, w = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v), w * w * (3.0 - 2.0 * w)
    total = 0.0
    for i in range(2):
        for j in range(2):
            for k in range(2):
                share = (u if i else 1.0 - u) * (v if j else 1.0 - v) * (w if k else 1.0 - w)
                total += share * hashed(ix + i, iy + j, iz + k)
    return total


@njit(error_model="numpy", fastmath=True, parallel=True)
def add_sensor_noise(picture: Floats, deviation: float, stream: int, out: Bytes) -> None:
    """Gaussian noise by Box and Muller on hashed counters, then 8 bits.

    picture : (H, W, 3) float32, 0...255. deviation : grey levels at mid grey (shot noise: grows with
    brightness). stream : a number for camera, frame and seed. out : (H, W, 3) uint8.
    """
    height, width = picture.shape[0], picture.shape[1]
    for row in prange(height):
        for column in range(width):
            for channel in range(3):
                counter = 3 * column + channel
                one = hashed(counter, row, 2 * stream)
                two = hashed(counter, row, 2 * stream + 1)
                normal = math.sqrt(-2.0 * math.log(one + 1e-12)) * math.cos(2.0 * math.pi * two)
                value = picture[row, column, channel]
                value += normal * deviation * math.sqrt(0.35 + max(value, 0.0) / 196.0)
                out[row, column, channel] = np.uint8(min(max(value + 0.5, 0.0), 255.0))
