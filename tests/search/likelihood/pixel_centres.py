"""A rasteriser by pixel centres, in plain NumPy: the oracle of exact areas."""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Mask

NEAR = 1e-3
"""Pixels whose centre lies this close to an edge (pixels) may fall on either side."""


def depths_inside(outline: Array, left: int, top: int, right: int, bottom: int) -> Array:
    """(bottom - top, right - left) how deep pixel centres lie inside a convex outline (4, 2): the distance to the
    nearest of its edges' lines, negative outside."""
    x, y = np.arange(left, right, dtype=float), np.arange(top, bottom, dtype=float)[:, None]
    following = np.roll(outline, -1, axis=0)
    turn = np.sum(outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0])
    deep = np.full((bottom - top, right - left), np.inf)
    for (px, py), (qx, qy) in zip(outline, following, strict=True):
        length = max(np.hypot(qx - px, qy - py), 1e-12) * (1.0 if turn > 0 else -1.0)
        deep = np.minimum(deep, (qx - px) / length * (y - py) - (qy - py) / length * (x - px))
    return deep


def union(corners: Array, width: int, height: int, scale: float = 1.0) -> tuple[Mask, Mask, Mask]:
    """(H, W) three times: pixels in the union of the outlines (L, 4, 2), NaN ones left out; those surely in it, those
    perhaps. scale : of the picture; pixel (0, 0) is the centre of the top-left pixel at every scale."""
    drawn, surely, perhaps = (np.zeros((height, width), dtype=bool) for _ in range(3))
    for outline in (corners + 0.5) * scale - 0.5:
        if not np.isfinite(outline).all():
            continue
        low = np.clip(np.floor(outline.min(axis=0)).astype(int) - 1, 0, None)
        high = np.clip(np.ceil(outline.max(axis=0)).astype(int) + 2, 0, [width, height])
        if (low >= high).any():
            continue
        deep = depths_inside(outline, low[0], low[1], high[0], high[1])
        box = slice(low[1], high[1]), slice(low[0], high[0])
        drawn[box] |= deep >= 0
        surely[box] |= deep >= NEAR
        perhaps[box] |= deep > -NEAR
    return drawn, surely, perhaps


def triangles_drawn(
    seen: Array, triangles: NDArray[np.int64], width: int, height: int
) -> tuple[Array, Array]:
    """(H, W) number of the nearest triangle at each pixel's centre, -1 where there is none, and its depth there,
    infinite where there is none. seen : (V, 3) pixel and depth of the triangles' (F, 3) points, NaN where not seen.
    """
    owner, depth = np.full((height, width), -1), np.full((height, width), np.inf)
    y, x = np.mgrid[:height, :width].astype(float)
    centres = np.stack([x, y, np.ones_like(x)])
    for number, corners in enumerate(seen[triangles]):
        if not np.isfinite(corners).all():
            continue
        shares = np.einsum("ij,jhw->ihw", np.linalg.inv([*corners[:, :2].T, np.ones(3)]), centres)
        # Shares are even in the picture by depth: one over the depth is, too.
        here = 1.0 / np.einsum("i,ihw->hw", 1.0 / corners[:, 2], shares)
        nearer = (shares >= 0.0).all(axis=0) & (here < depth)
        owner[nearer], depth[nearer] = number, here[nearer]
    return owner, depth
