"""The visual hull of the subject in a few frames' masks, and which frames and sizes of pictures it is carved in."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels, piece_numbers
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.hull_silhouette import silhouette
from studio.evidence.volume.reconstruction import Reconstructor
from studio.evidence.volume.tracking_space import Box, box_of
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.camera import Camera

COARSE = HullSettings(hull_depth=6)
FINE = HullSettings(hull_depth=8, hull_edge_share=0.5, hull_least_views=2)
ROUGH = dataclasses.replace(FINE, hull_depth=7)
"""Hull settings where many hulls are needed: to find which camera removes something, which knobs are better."""
MARGIN = 120.0
"""Margin (mm, of a person: `scale_of`) around the coarse hull in which the fine one is carved."""
LEAST_PIECE = 0.05
"""Of the largest piece's volume."""
JUDGED_SIDE = 480
"""Least shorter side (pixels) of the compared masks: a voxel of the fine hull is wider than one of their pixels."""


def spread_frames(count: int, wanted: int) -> tuple[int, ...]:
    """Up to `wanted` frames in the middle of as many equal parts of the footage."""
    parts = min(count, wanted)
    return tuple(int((part + 0.5) * count / parts) for part in range(parts))


def person_box(masks: Sequence[Bytes], cameras: tuple[Camera, ...], scale: float = 1.0) -> Box | None:
    """A box around the large pieces of a coarse hull; None for an empty hull. scale : of the body (`scale_of`)."""
    coarse = Reconstructor(cameras, box_of(cameras, scale=scale), COARSE).shape(masks)
    if coarse.empty:
        return None
    coarse = _large_pieces(coarse)
    reach = 0.5 * coarse.edges[:, None] + MARGIN * scale
    return Box((coarse.centres - reach).min(axis=0), (coarse.centres + reach).max(axis=0))


def large_hull(carver: Reconstructor, masks: Sequence[Bytes]) -> Hull | None:
    """The large pieces of the hull, None if it is empty."""
    hull = carver.shape(masks)
    return None if hull.empty else _large_pieces(hull)


def _large_pieces(hull: Hull) -> Hull:
    """The hull without small pieces and ghosts. (A wrong mask may cut a person in two; both parts stay.)"""
    numbers, volumes = piece_numbers(hull)
    return chosen_voxels(hull, volumes[numbers] >= LEAST_PIECE * volumes[0])


def covered(hull: Hull | None, camera: Camera) -> Bytes:
    """(H, W) 255 where a camera sees a hull; nothing of None."""
    if hull is None:
        return np.zeros((camera.height, camera.width), np.uint8)
    return silhouette(hull, camera)
