"""The surfaces of links: triangles, as a body file keeps them, and made coarser.

A body file holds a mesh as text, so that a run and an archive hold their whole body: base64 of zlib of little-endian
numbers, float32 for points and uint32 for triangles.
"""

import base64
import binascii
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.definition import MeshEntry
from studio.foundations.arrays import Array, Indices

MOST_NUMBERS = 1_000_000
"""Numbers of a mesh's points, and of its triangles."""
AROUND = 32
"""Corners of the circles of a cone's mesh."""


def mesh_entry(joint: str, points: Array, triangles: Indices) -> MeshEntry:
    """The entry of a mesh in a joint's frame: points (V, 3) mm, triangles (F, 3) numbers of points."""
    return MeshEntry(joint, _packed(points, "<f4"), _packed(triangles, "<u4"))


def mesh_of(entry: MeshEntry) -> tuple[Array, Indices]:
    """Points (V, 3), mm, and triangles (F, 3) of an entry. Raises ValueError where it holds none."""
    points = np.asarray(_unpacked(entry.points, "<f4"), dtype=np.float64)
    triangles = np.asarray(_unpacked(entry.triangles, "<u4"), dtype=np.int64)
    if not len(triangles) or not np.isfinite(points).all() or triangles.max() >= len(points):
        raise ValueError("it is no mesh")
    return points, triangles


def _packed(values: NDArray[Any], kind: str) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values, dtype=kind).tobytes(), 9)).decode()


def _unpacked(text: str, kind: str) -> NDArray[Any]:
    """(N, 3) numbers. Raises ValueError."""
    try:
        unpacking = zlib.decompressobj()
        content = unpacking.decompress(base64.b64decode(text, validate=True), 4 * MOST_NUMBERS)
    except (binascii.Error, zlib.error) as problem:
        raise ValueError(str(problem)) from None
    if not unpacking.eof or len(content) % 12:
        raise ValueError("it is too large, cut off or of no three columns")
    return np.frombuffer(content, dtype=kind).reshape(-1, 3)


def coarser(points: Array, triangles: Indices, cell: float) -> tuple[Array, Indices]:
    """The mesh with points of each cube of `cell` mm made one, their mean: on a curve of radius r within
    about cell² / 8 r of the surface.
    """
    cubes = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    _, own, counts = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    own = own.reshape(-1)
    means = np.zeros((len(counts), 3))
    np.add.at(means, own, points)
    means /= counts[:, None]
    turned = own[triangles]
    apart = (turned[:, 0] != turned[:, 1]) & (turned[:, 1] != turned[:, 2]) & (turned[:, 2] != turned[:, 0])
    kept = turned[apart]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    return means, kept[np.sort(first)]


def cone_mesh(
    length: float, radii: tuple[float, float], scales: tuple[float, float]
) -> tuple[Array, Indices]:
    """The mesh of a truncated elliptical cone along z."""
    angles = np.arange(AROUND) * (2.0 * np.pi / AROUND)
    circle = np.stack([scales[0] * np.cos(angles), scales[1] * np.sin(angles)], axis=1)
    rings = [
        np.column_stack([r * circle, np.full(AROUND, z)]) for r, z in zip(radii, (0.0, length), strict=True)
    ]
    points = np.concatenate([*rings, [[0.0, 0.0, 0.0], [0.0, 0.0, length]]])
    here = np.arange(AROUND)
    following = (here + 1) % AROUND
    faces = [
        np.stack([here, following, here + AROUND], axis=1),
        np.stack([following, following + AROUND, here + AROUND], axis=1),
        np.stack([following, here, np.full(AROUND, 2 * AROUND)], axis=1),
        np.stack([here + AROUND, following + AROUND, np.full(AROUND, 2 * AROUND + 1)], axis=1),
    ]
    return points, np.concatenate(faces).astype(np.int64)
