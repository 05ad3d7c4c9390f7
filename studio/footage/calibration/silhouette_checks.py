"""Checks of a calibration by silhouettes of one person, without a board.

Planes through the line between two cameras that touch the person touch both silhouettes (epipolar tangency): the range
of their angles about the baseline must be the same from both cameras. Views in which the person is cut by the
picture's edge, or that look along the baseline, do not count.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import cv2
import numpy as np

from studio.footage.calibration.boards import Board, rays_of
from studio.footage.calibration.fault_hypotheses import explained
from studio.footage.calibration.findings import Finding
from studio.footage.calibration.rig_checks import height_finding, unit_finding
from studio.footage.calibration.standing import Posture, postures, standing_height
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera

Masks = Mapping[int, Mapping[str, Bytes]]

GOOD = 0.1
"""Share of the person's extent by which tangent planes may miss, mean over pairs of the median over frames."""
LEAST = 0.02
"""The same, from which a fault that would explain it is searched for."""
CLIPPED = 1.5
LEAST_PIXELS = 40
WIDEST = np.radians(150.0)
HEIGHT_TOLERANCE = 0.15
USUAL_HEIGHT, HUMAN = 1600.0, (0.5, 1.5)
ANY_POSTURE = (0.2, 5.0)
POSTURE_TOLERANCE = 0.55
"""No posture makes a person's longest extent less than this share of their height, or more than the other; most keep it
within the tolerance."""


def silhouette_findings(
    cameras: Sequence[Camera],
    masks: Masks,
    height_mm: float | None = None,
    board: Board | None = None,
    scale: float = 1.0,
) -> tuple[Finding, ...]:
    """Whether cameras fit the silhouettes (frame → camera → mask) of one person, and the person's height. scale : of
    the body beside a person, where it is another one (`scale_of`).
    """
    outlines = outlines_of(cameras, masks)
    findings = explained(
        cameras, lambda tried: silhouette_disagreement(tried, outlines), GOOD, "silhouettes", LEAST
    )
    if findings:
        return findings
    return stature_findings(postures(cameras, masks), height_mm, board, scale)


def stature_findings(
    standing: Sequence[Posture],
    height_mm: float | None = None,
    board: Board | None = None,
    scale: float = 1.0,
) -> tuple[Finding, ...]:
    """Findings from a person's size: a wrong unit in any posture, other faults only when the person stands."""
    usual = USUAL_HEIGHT * scale
    known, words = (
        (usual, f"a usual height (about {0.001 * usual:.2g} m)")
        if height_mm is None
        else (height_mm, f"the height given ({height_mm:.0f} mm)")
    )
    extents = [posture.reach_mm / known for posture in standing]
    if extents and (max(extents) < ANY_POSTURE[0] or min(extents) > ANY_POSTURE[1]):
        unit = unit_finding(float(np.median(extents)), "the person's size", POSTURE_TOLERANCE)
        return (unit,) if unit is not None else ()
    seen = standing_height(standing)
    least, most = HUMAN if height_mm is None else (1.0 - HEIGHT_TOLERANCE, 1.0 + HEIGHT_TOLERANCE)
    if seen is None or least <= seen / known <= most:
        return ()
    # The seen height is never above the true one: a person tall enough in any frame is not too small.
    if seen < known and max(posture.height_mm for posture in standing) >= least * known:
        return ()
    return (height_finding(seen, known, words, board),)


def outlines_of(cameras: Sequence[Camera], masks: Masks) -> dict[int, dict[str, Array]]:
    """Frame → camera → (K, 2) convex outline, pixels; without those that the picture's edge cuts."""
    outlines: dict[int, dict[str, Array]] = {}
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
            outlines.setdefault(frame, {})[camera.name] = hull[:, 0].astype(np.float64)
    return outlines


def silhouette_disagreement(cameras: Sequence[Camera], outlines: Mapping[int, Mapping[str, Array]]) -> float:
    """How far tangent planes miss, as a share of the person's extent; NaN if no pair of views determines it."""
    values: list[float] = []
    for one, two in combinations(cameras, 2):
        misses = [
            _miss(one, two, views[one.name], views[two.name])
            for views in outlines.values()
            if one.name in views and two.name in views
        ]
        finite = [miss for miss in misses if not np.isnan(miss)]
        if finite:
            values.append(float(np.median(finite)))
    return float(np.mean(values)) if values else float("nan")


def angles_about(axis: Array, rays: Sequence[Array]) -> list[Array] | None:
    """The angles of rays (K, 3) of each view about an axis (3,), from the first view's middle; None along the axis."""
    middle = rays[0].mean(axis=0)
    ahead = middle - (middle @ axis) * axis
    if np.linalg.norm(ahead) < 1e-6:
        return None
    ahead = ahead / np.linalg.norm(ahead)
    aside = np.cross(axis, ahead)
    return [np.arctan2(ray @ aside, ray @ ahead) for ray in rays]


def _miss(one: Camera, two: Camera, first: Array, second: Array) -> float:
    """By how much of the person's extent the tangent planes of two outlines miss; NaN if undetermined."""
    baseline = two.centre - one.centre
    length = float(np.linalg.norm(baseline))
    if length < 1e-9:
        return CLIPPED
    axis = baseline / length
    rays = rays_of(one, first), rays_of(two, second)
    angles = angles_about(axis, rays)
    if angles is None:
        return float("nan")
    # The second camera's angles may lie across the cut at half a turn; a full range means that it looks along the line.
    turn = np.angle(np.mean(np.exp(1j * angles[1])))
    angles[1] = np.asarray(np.angle(np.exp(1j * (angles[1] - turn))) + turn, dtype=np.float64)
    low, high = [float(each.min()) for each in angles], [float(each.max()) for each in angles]
    extents = [top - bottom for top, bottom in zip(high, low, strict=True)]
    if max(extents) > WIDEST:
        return float("nan")
    shift = np.abs(np.angle(np.exp(1j * np.array([low[0] - low[1], high[0] - high[1]]))))
    return float(min(shift.sum() / max(float(np.mean(extents)), 1e-6), CLIPPED))
