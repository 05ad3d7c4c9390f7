"""Outlines of limbs that no body has, in the form that kernels read: ten rows of sixteen lanes."""

import numpy as np

from studio.foundations.arrays import Array, Floats
from studio.search.likelihood.outline_kernels import DEPTH_ROW, LANES, ROWS, SEEN_ROW


def convex_corners(rng: np.random.Generator, shape: tuple[int, ...], middle: Array, size: float) -> Array:
    """(*shape, 4, 2) corners A0, A1, B1, B0 of tapering limbs about `middle` pixels, up to `size` pixels long and half
    as wide, some of them with their sides exchanged.
    """
    angle = rng.uniform(0.0, 2.0 * np.pi, shape)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1) * rng.choice([-1.0, 1.0], shape)[..., None]
    begin = middle + rng.uniform(-1.0, 1.0, (*shape, 2)) * middle
    end = begin + rng.uniform(0.3, 1.0, shape)[..., None] * size * along
    near, far = (rng.uniform(0.1, 0.25, shape)[..., None] * size * across for _ in range(2))
    return np.stack([begin - near, end - far, end + far, begin + near], axis=-2)


def outlines_of(corners: Array, seen: Array, depth: Array) -> Floats:
    """(B, V, L, 160) of corners (16 B, V, L, 4, 2) pixels, and seen and depth, each (16 B, V, L)."""
    numbers = np.empty((*seen.shape, ROWS))
    numbers[..., :8] = corners.reshape(*seen.shape, 8)
    numbers[..., SEEN_ROW], numbers[..., DEPTH_ROW] = seen, depth
    lanes = numbers.reshape(-1, LANES, *seen.shape[1:], ROWS).transpose(0, 2, 3, 4, 1)
    return np.ascontiguousarray(lanes, dtype=np.float32).reshape(*lanes.shape[:3], ROWS * LANES)
