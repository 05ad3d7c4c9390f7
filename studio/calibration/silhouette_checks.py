"""What silhouettes of one person say of a calibration, without a board.

Planes through the line between two cameras that touch the person touch both silhouettes (epipolar tangency): the range
of their angles about the baseline must be the same from both cameras. Views in which the person is cut by the
picture's edge, or that look along the baseline, say nothing.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.calibration.boards import Board
from studio.calibration.fault_hypotheses import explained
from studio.calibration.findings import Finding
from studio.calibration.scale_checks import scale_finding
from studio.geometry.camera import Camera
from studio.geometry.projection import project

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Masks = Mapping[int, Mapping[str, Bytes]]

GOOD = 0.1
"""Share of the person's extent by which tangent planes may miss, mean over pairs of the median over frames."""
LEAST = 0.02
"""The same, from which on a fault is looked for that would explain it."""
CLIPPED = 1.5
LEAST_PIXELS = 40
WIDEST = np.radians(150.0)
STEPS = 600
HEIGHT_TOLERANCE = 0.15
USUAL_HEIGHT, HUMAN = 1600.0, (0.5, 1.5)


def silhouette_findings(
    cameras: Sequence[Camera], masks: Masks, height_mm: float | None = None, board: Board | None = None
) -> tuple[Finding, ...]:
    """Whether cameras fit the silhouettes (frame → camera → mask) of one person, and the person's height."""
    outlines = outlines_of(cameras, masks)
    found = explained(
        cameras, lambda tried: silhouette_disagreement(tried, outlines), GOOD, "silhouettes", LEAST
    )
    if found:
        return found
    seen = height_seen(cameras, masks)
    if seen is None:
        return ()
    if height_mm is not None and abs(seen / height_mm - 1.0) > HEIGHT_TOLERANCE:
        return (scale_finding(seen / height_mm, f"the person's height ({height_mm:.0f} mm)", board),)
    if height_mm is None and not HUMAN[0] < seen / USUAL_HEIGHT < HUMAN[1]:
        return (scale_finding(seen / USUAL_HEIGHT, "a person's height (about 1.6 m)", board),)
    return ()


def outlines_of(cameras: Sequence[Camera], masks: Masks) -> dict[int, dict[str, Array]]:
    """Frame → camera → (K, 2) convex outline, pixels; without those that the picture's edge cuts."""
    found: dict[int, dict[str, Array]] = {}
    for frame, views in masks.items():
        for camera in cameras:
            mask = views.get(camera.name)
            if mask is None:
                continue
            inner = np.count_nonzero(mask)
            edges = (mask[0], mask[-1], mask[:, 0], mask[:, -1])
            if inner < LEAST_PIXELS or any(np.any(edge) for edge in edges):
                continue
            rows, columns = np.nonzero(mask)
            hull = cv2.convexHull(np.column_stack([columns, rows]).astype(np.int32))
            found.setdefault(frame, {})[camera.name] = hull[:, 0].astype(np.float64)
    return found


def silhouette_disagreement(cameras: Sequence[Camera], outlines: Mapping[int, Mapping[str, Array]]) -> float:
    """How far tangent planes miss, as a share of the person's extent; NaN if no pair of views can tell."""
    values = []
    for one, two in combinations(cameras, 2):
        misses = [
            _miss(one, two, views[one.name], views[two.name])
            for views in outlines.values()
            if one.name in views and two.name in views
        ]
        told = [miss for miss in misses if not np.isnan(miss)]
        if told:
            values.append(float(np.median(told)))
    return float(np.mean(values)) if values else float("nan")


def height_seen(cameras: Sequence[Camera], masks: Masks) -> float | None:
    """The person's height by the calibration, mm: the upright line through the middle of the silhouettes, as far as it
    stays inside them; the median over views, the largest of the frames. None where no frame tells.
    """
    heights = [height for views in masks.values() if (height := _height_in(cameras, views)) is not None]
    return float(np.percentile(heights, 80)) if heights else None


def _height_in(cameras: Sequence[Camera], views: Mapping[str, Bytes]) -> float | None:
    seen = [camera for camera in cameras if camera.name in views and np.any(views[camera.name])]
    if len(seen) < 2:
        return None
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for camera in seen:
        middle = np.mean(np.nonzero(views[camera.name]), axis=1)[::-1]
        ahead = rays_of(camera, middle[None])[0]
        across = np.eye(3) - np.outer(ahead, ahead)
        normal += across
        right += across @ camera.centre
    foot = np.linalg.solve(normal, right).astype(np.float64)
    reach = float(np.median([np.linalg.norm(camera.centre - foot) for camera in seen]))
    line = np.tile(foot, (STEPS, 1)).astype(np.float64)
    line[:, 2] += np.linspace(-0.8 * reach, 0.8 * reach, STEPS)
    tops, bottoms = [], []
    for camera in seen:
        mask = views[camera.name]
        pixels, depth = project(camera, line)
        columns, rows = (np.nan_to_num(np.round(pixels), nan=-1.0)).astype(int).T
        inside = (
            (depth > 0) & (columns >= 0) & (rows >= 0) & (columns < mask.shape[1]) & (rows < mask.shape[0])
        )
        covered = np.zeros(STEPS, bool)
        covered[inside] = mask[rows[inside], columns[inside]] > 0
        if covered.any():
            heights = line[covered, 2]
            tops.append(float(heights.max()))
            bottoms.append(float(heights.min()))
    return float(np.median(tops) - np.median(bottoms)) if tops else None


def rays_of(camera: Camera, pixels: Array) -> Array:
    """(K, 3) unit directions in the world."""
    flat = cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion)[:, 0]
    ahead = np.column_stack([flat, np.ones(len(flat))]) @ camera.rotation
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def _miss(one: Camera, two: Camera, first: Array, second: Array) -> float:
    """By how much of the person's extent the tangent planes of two outlines miss; NaN where they cannot tell."""
    baseline = two.centre - one.centre
    length = float(np.linalg.norm(baseline))
    if length < 1e-9:
        return CLIPPED
    axis = baseline / length
    rays = rays_of(one, first), rays_of(two, second)
    middle = rays[0].mean(axis=0)
    middle = middle - (middle @ axis) * axis
    if np.linalg.norm(middle) < 1e-6:
        return float("nan")
    ahead = middle / np.linalg.norm(middle)
    aside = np.cross(axis, ahead)
    angles = [np.arctan2(ray @ aside, ray @ ahead) for ray in rays]
    # The second camera's angles may lie across the cut at half a turn; a full range means that it looks along the line.
    turn = np.angle(np.mean(np.exp(1j * angles[1])))
    angles[1] = np.angle(np.exp(1j * (angles[1] - turn))) + turn
    low, high = [float(each.min()) for each in angles], [float(each.max()) for each in angles]
    extents = [top - bottom for top, bottom in zip(high, low, strict=True)]
    if max(extents) > WIDEST:
        return float("nan")
    shift = np.abs(np.angle(np.exp(1j * np.array([low[0] - low[1], high[0] - high[1]]))))
    return float(min(shift.sum() / max(float(np.mean(extents)), 1e-6), CLIPPED))
