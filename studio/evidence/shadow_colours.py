"""The colours of a room's shadows, learnt where no body can be.

A shadow is the background's colour, only darker; on a floor of skin's colour so are forearms and faces. What tells
them apart is geometry: a shadow lies on the room, so it is rarely seen by all cameras as if it were something above
the floor. Of the pixels that may be shadow (`background.differing_pixels`) those whose ray meets no point above the
floor that all other cameras see changed are *unsupported*: shadow for certain. They show how dark and of what tint
shadows are here. The supported ones are a mixture of shadow and body. With U and S the densities of both over
darkness and tint, S = π B + (1 - π) U, so that

    P(body | colour, supported) = 1 - (1 - π) U(colour) / S(colour),

the classifier of positive and unlabelled samples of Elkan & Noto 2008 with the shadows as the labelled class; 1 - π is
S / U where shadows are most frequent, since there is hardly any body. The table only takes back what the two
tolerances (`mask_shadow_darkest`, `mask_shadow_colour`) call shadow: without a floor below the cameras, or with too few
samples, these decide alone. The method is this project's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array, Bytes
from studio.geometry.camera import Camera
from studio.geometry.projection import project

ShadowTable = NDArray[np.uint8]
"""(DARKNESS_BINS, TINT_BINS, TINT_BINS), 1 where a colour that may be shadow is shadow."""
DARKNESS_BINS, TINT_BINS, TINT_REACH = 26, 16, 0.06
"""Cells of the table: share of the background's brightness in steps of 0.04, and the tints in blue and red within
± TINT_REACH of the background's brightness; what lies beyond counts to the outermost."""
NEAR_FLOOR, HIGHEST = 0.04, 0.6
"""Heights between which a body is looked for, as shares of the cameras' distance: a standing person's room of 4 m gives
160 to 2400 mm. Below, feet and their shadows cannot be told apart."""
HEIGHTS = 40
LEAST_CAMERAS, LEAST_SEEING = 3, 2
"""Cameras of a session, and other cameras that must see a point for it to count."""
SAMPLED = 400
"""Pixels of a view and frame whose rays are followed."""
MOST_PARALLEL = 1e4
"""Condition of the point nearest to all optical axes; above, they are parallel."""
LEAST_SAMPLES = 1000
"""Unsupported pixels, fewer say too little."""
FREQUENT = 0.05
"""Cells with at least this share of the fullest one's shadows tell how many of the supported pixels are shadow."""
CERTAIN = 0.8
"""Least probability of body at which a pixel is taken back from the shadows."""
SLACK = 3
"""Pixels by which changed areas are widened: calibrations are off by so much."""


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """A view of a frame for learning. changed : (H, W) bool, differs from the background. alike : (H, W) bool, of
    those the pixels that the tolerances call shadow. picture, background : (H, W, 3) BGR, the background with the
    picture's gain.
    """

    changed: NDArray[np.bool_]
    alike: NDArray[np.bool_]
    picture: Bytes
    background: NDArray[np.floating[Any]]


def learn_shadow_colours(
    cameras: Sequence[Camera], frames: Sequence[Mapping[str, Changed]]
) -> ShadowTable | None:
    """The table of a room's shadows; None where too little is known. frames : views by camera."""
    heights = _heights(cameras)
    if len(cameras) < LEAST_CAMERAS or heights is None:
        return None
    shadows, mixed = np.zeros((2, DARKNESS_BINS, TINT_BINS, TINT_BINS))
    for views in frames:
        widened = {name: _widened(view.changed) for name, view in views.items()}
        for camera in cameras:
            view = views.get(camera.name)
            if view is None:
                continue
            rows, columns = np.nonzero(view.alike)
            if not len(rows):
                continue
            taken = slice(None, None, max(1, len(rows) // SAMPLED))
            rows, columns = rows[taken], columns[taken]
            others = [one for one in cameras if one is not camera and one.name in widened]
            supported = _supported(camera, columns, rows, heights, others, widened)
            cells = cells_of(view.picture[rows, columns], view.background[rows, columns])
            np.add.at(shadows, tuple(cells[~supported].T), 1.0)
            np.add.at(mixed, tuple(cells[supported].T), 1.0)
    if shadows.sum() < LEAST_SAMPLES:
        return None
    return table_of(shadows, mixed)


def table_of(shadows: Array, mixed: Array) -> ShadowTable:
    """The table of `learn_shadow_colours` from counts of certain shadows and of supported pixels, each a cell."""
    certain, either = _smoothed(shadows), _smoothed(mixed)
    frequent = certain >= FREQUENT * certain.max()
    share = float(either[frequent].sum() / certain[frequent].sum())
    body = 1.0 - share * certain / np.maximum(either, 1e-9)
    # Where nothing was seen of either the tolerances decide.
    return np.where((either > 0.0) & (body > CERTAIN), 0, 1).astype(np.uint8)


def cells_of(pictures: Bytes, backgrounds: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
    """(N, 3) cells of the table. pictures, backgrounds : (N, 3) BGR."""
    seen, expected = pictures.astype(np.float64), np.asarray(backgrounds, dtype=np.float64)
    norm = np.maximum((expected**2).sum(axis=1), 1.0)
    share = (seen * expected).sum(axis=1) / norm
    tint = (seen - share[:, None] * expected)[:, (0, 2)] / np.sqrt(norm)[:, None]
    darkness = np.clip((share * (DARKNESS_BINS - 1)).astype(np.int64), 0, DARKNESS_BINS - 1)
    tints = np.clip(np.floor((tint + TINT_REACH) * (0.5 * TINT_BINS / TINT_REACH)), 0, TINT_BINS - 1)
    return np.c_[darkness, tints.astype(np.int64)]


def _heights(cameras: Sequence[Camera]) -> Array | None:
    """(HEIGHTS,) mm above the floor at which a ray is looked at; None where a camera is not above it, or all look the
    same way.
    """
    centres = np.array([camera.centre for camera in cameras])
    axes = np.array([camera.rotation[2] for camera in cameras])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    total, offset = across.sum(axis=0), (across * centres[:, None, :]).sum(axis=(0, 2))
    if np.linalg.cond(total) > MOST_PARALLEL:
        return None
    # The point nearest to all optical axes.
    middle = np.asarray(np.linalg.solve(total, offset), dtype=np.float64)
    distance = float(np.median(np.linalg.norm(centres - middle, axis=1)))
    if centres[:, 2].min() <= NEAR_FLOOR * distance:
        return None
    return np.linspace(NEAR_FLOOR * distance, HIGHEST * distance, HEIGHTS)


def _widened(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    kernel = np.ones((2 * SLACK + 1, 2 * SLACK + 1), np.uint8)
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel)) > 0


def _supported(
    camera: Camera,
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    heights: Array,
    others: Sequence[Camera],
    changed: Mapping[str, NDArray[np.bool_]],
) -> NDArray[np.bool_]:
    """(N,) whether a pixel's ray meets a point that all other cameras in whose pictures it lies see changed."""
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    flat = np.asarray(cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion), np.float64)
    directions: Array = np.c_[flat.reshape(-1, 2), np.ones(len(flat))] @ camera.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        depth: Array = (heights[None, :] - camera.centre[2]) / directions[:, 2:]
    points = camera.centre + directions[:, None, :] * np.where(np.isfinite(depth), depth, -1.0)[..., None]
    possible, seeing = depth > 0.0, np.zeros(depth.shape, np.int64)
    for other in others:
        places, depths = project(other, points.reshape(-1, 3))
        column, row = (np.rint(np.clip(np.nan_to_num(axis, nan=-1.0), -1.0, 1e6)) for axis in places.T)
        inside = (depths > 0.0) & (column >= 0) & (row >= 0) & (column < other.width) & (row < other.height)
        differs = np.ones(len(inside), np.bool_)
        differs[inside] = changed[other.name][row[inside].astype(np.int64), column[inside].astype(np.int64)]
        possible &= differs.reshape(depth.shape)
        seeing += inside.reshape(depth.shape)
    return np.any(possible & (seeing >= LEAST_SEEING), axis=1)


def _smoothed(counts: Array) -> Array:
    """Counts spread over neighbouring cells with weights 1/4, 1/2, 1/4 along each axis."""
    for axis in range(counts.ndim):
        padded = np.pad(counts, [(int(k == axis),) * 2 for k in range(counts.ndim)], mode="edge")
        middle = np.moveaxis(padded, axis, 0)
        counts = np.moveaxis(0.25 * middle[:-2] + 0.5 * middle[1:-1] + 0.25 * middle[2:], 0, axis)
    return counts
