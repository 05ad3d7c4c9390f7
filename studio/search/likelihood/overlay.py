"""Overlay of a likelihood's outlines and sample points on the pictures, the same ones that the kernels
read.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.likelihood.bodytrack import BodytrackSettings
from studio.search.likelihood.bodytrack_kernels import EDGE_STEP, INSIDE_STEP, LEAST
from studio.search.likelihood.edge_region import EdgeRegionSettings
from studio.search.likelihood.edge_region_kernels import CHUNK, FIRST_STRIP, SECOND_STRIP, THIRD_STRIP
from studio.search.likelihood.edge_silhouette import EdgeSilhouetteSettings
from studio.search.likelihood.mesh_outlines import MeshOutlines
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.visible_edges import body_edges, hidden_samples, limb_sides

IntArray = NDArray[np.int64]

STRIPS = (float(FIRST_STRIP), float(SECOND_STRIP), float(THIRD_STRIP))
CAP_POINTS = 13
"""Points on the half ellipse that closes an end."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewOverlay:
    """One camera's view of one pose, pixels. L drawn limbs.

    camera : its name. limbs : L names. outlines : (L, 4, 2) corners A0, A1, B1, B0, NaN for a limb that is
    not seen. contours : L closed polylines (K, 2), sides and the half ellipses at both ends, or of a body with
    meshes the outlines of the links that limbs stand for; (0, 2) for a limb that is not seen. edge_samples,
    region_samples : (K, 2) points inside the picture that the likelihood reads, before they are rounded to the
    nearest pixel; none for the template, which reads all pixels."""

    camera: str
    limbs: tuple[str, ...]
    outlines: Array
    contours: tuple[Array, ...]
    edge_samples: Array
    region_samples: Array


def limb_contours(body: BodyModel, cameras: tuple[Camera, ...], pose: Array) -> tuple[tuple[Array, ...], ...]:
    """For each camera the `ViewOverlay.contours` of a pose (D,), nothing else. Raises BodyError for one that does not
    fit.
    """
    pose = np.asarray(pose, dtype=np.float64)
    corners = OutlineProjector.of_body(body, cameras).corners(pose[None])[0][0]
    return _contours_by_view(body, cameras, pose, corners)


def overlay_points(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    pose: Array,
    settings: Any,  # noqa: ANN401 - any likelihood's settings
) -> tuple[ViewOverlay, ...]:
    """The overlay on each camera's picture for a pose (D,). Raises BodyError for a pose that does not fit.

    settings : of the likelihood in use; sample points are those of its kernels.
    """
    pose = np.asarray(pose, dtype=np.float64)
    projector = OutlineProjector.of_body(body, cameras)
    corners, seen = projector.corners(pose[None])
    lines, visible = _edges_read(body, projector, pose, settings)
    names = tuple(limb.name for limb in body.drawn)
    found: list[ViewOverlay] = []
    shown = _contours_by_view(body, cameras, pose, corners[0])
    for view, (camera, outlines, state) in enumerate(zip(cameras, corners[0], seen[0], strict=True)):
        edge, region = sample_points(outlines[state >= 0], settings)
        if lines is not None:
            edge = _on_lines(outlines, lines, visible[view] & (state[lines[:, 0], None] >= 0))
        points = _inside(camera, edge), _inside(camera, region)
        found.append(ViewOverlay(camera.name, names, outlines, shown[view], *points))
    return tuple(found)


def _edges_read(
    body: BodyModel,
    projector: OutlineProjector,
    pose: Array,
    settings: Any,  # noqa: ANN401
) -> tuple[IntArray | None, NDArray[np.bool_]]:
    """Edges (K, 3) as in `visible_edges` and (V, K, samples) which of their samples are visible, where the likelihood
    uses them; else None.
    """
    if isinstance(settings, EdgeSilhouetteSettings):
        lines = body_edges(body).whole
    elif isinstance(settings, EdgeRegionSettings) and settings.occlusion_aware:
        lines = limb_sides(projector.limb_count)
    else:
        return None, np.zeros(0, dtype=np.bool_)
    samples = settings.edge_chunks * CHUNK
    hidden = hidden_samples(projector.blocks(pose[None]), lines, samples)
    bits = hidden[0, ..., 0, None] >> np.arange(samples, dtype=np.uint64)
    return lines, (bits & np.uint64(1)) == 0


def _on_lines(outlines: Array, lines: IntArray, chosen: NDArray[np.bool_]) -> Array:
    """(P, 2) the samples of edges (K, 3) of outlines (L, 4, 2) that are `chosen` (K, samples)."""
    begin, end = outlines[lines[:, 0], lines[:, 1]], outlines[lines[:, 0], lines[:, 2]]
    points = begin[:, None] + _middles(chosen.shape[1])[:, None] * (end - begin)[:, None]
    return points[chosen]


def sample_points(outlines: Array, settings: Any) -> tuple[Array, Array]:  # noqa: ANN401
    """Edge and region sample points, each (K, 2) pixels, of the outlines (L, 4, 2) of limbs that are seen."""
    edge: list[Array] = [np.zeros((0, 2))]
    region: list[Array] = [np.zeros((0, 2))]
    for outline in outlines:
        if isinstance(settings, EdgeRegionSettings):
            along = _middles(settings.edge_chunks * CHUNK)
            edge += [_grid(outline, along, np.array([side])) for side in (0.0, 1.0)]
            along = _middles(settings.region_chunks * CHUNK)
            region.append(_grid(outline, along, np.array(STRIPS)))
        elif isinstance(settings, BodytrackSettings):
            for side, (start, end) in ((0.0, (0, 1)), (1.0, (3, 2))):
                count = _intervals(outline[end] - outline[start], float(EDGE_STEP))
                edge.append(_grid(outline, np.linspace(0.0, 1.0, count + 1), np.array([side])))
            rows = _intervals(outline[1] - outline[0], float(INSIDE_STEP))
            width = 0.5 * (outline[3] + outline[2] - outline[0] - outline[1])
            columns = _intervals(width, float(INSIDE_STEP))
            region.append(_grid(outline, np.linspace(0.0, 1.0, rows + 1), np.arange(columns) / columns))
    return np.concatenate(edge), np.concatenate(region)


def _grid(outline: Array, along: Array, across: Array) -> Array:
    """(K, 2) points at fractions along and across an outline (4, 2): A0, A1, B1, B0."""
    side_a = outline[0] + along[:, None] * (outline[1] - outline[0])
    side_b = outline[3] + along[:, None] * (outline[2] - outline[3])
    return (side_a + across[:, None, None] * (side_b - side_a)).reshape(-1, 2)


def _middles(count: int) -> Array:
    """The middles of `count` equal parts of a line from 0 to 1."""
    return (np.arange(count) + 0.5) / count


def _intervals(line: Array, step: float) -> int:
    """Number of intervals into which the benchmark divides a line."""
    return max(LEAST, int(np.hypot(line[0], line[1]) / step + 0.5))


def _inside(camera: Camera, points: Array) -> Array:
    """The points whose nearest pixel exists."""
    low = (points >= -0.5).all(axis=1)
    return points[low & (points < np.array([camera.width, camera.height]) - 0.5).all(axis=1)]


def _contours_by_view(
    body: BodyModel, cameras: tuple[Camera, ...], pose: Array, corners: Array
) -> tuple[tuple[Array, ...], ...]:
    """For each camera the contours of the limbs of a pose (D,). corners : (V, L, 4, 2) of their cones."""
    if not body.meshes:
        return tuple(
            _contours(body, camera, pose, outlines) for camera, outlines in zip(cameras, corners, strict=True)
        )
    meshes = MeshOutlines(body, cameras)
    return tuple(meshes.contours(pose, view) for view in range(len(cameras)))


def _contours(body: BodyModel, camera: Camera, pose: Array, outlines: Array) -> tuple[Array, ...]:
    """Closed polylines around each limb: side A, far end, side B, near end."""
    shapes = kinematic_tables(body).limb_shape
    seen = np.flatnonzero(np.isfinite(outlines).all(axis=(1, 2)))
    frames, shapes, corners = limb_frames(body, pose[None])[0][seen], shapes[seen], outlines[seen]
    along = corners[:, 1] - corners[:, 0]
    zeros = np.zeros(len(seen))
    far = _caps(camera, frames, shapes, (shapes[:, 0], shapes[:, 2]), corners[:, 1], along)
    near = _caps(camera, frames, shapes, (zeros, shapes[:, 1]), corners[:, 3], -along)
    lines = np.concatenate([corners[:, :1], far, near, corners[:, :1]], axis=1)
    contours = [np.zeros((0, 2))] * len(outlines)
    for limb, line in zip(seen, lines, strict=True):
        contours[limb] = line
    return tuple(contours)


def _caps(
    camera: Camera,
    frames: Array,
    shapes: Array,
    end: tuple[Array, Array],
    starts: Array,
    away: Array,
) -> Array:
    """(L, CAP_POINTS, 2) the half of an end's ellipse that bulges away from each limb, from one side to the other.

    frames (L, 3, 4) and shapes (L, 5) of the limbs; end : (L,) its places along the bone and its radii, mm;
    starts (L, 2) : where the halves begin, away (L, 2) : the direction in which they bulge, pixels.
    """
    places, radii = end
    turns = np.linspace(0.0, 2.0 * np.pi, 2 * CAP_POINTS - 1)
    scales, origins = shapes[:, 3:5], frames[:, :, 3]
    centres = np.einsum("lji,lj->li", frames[:, :, :2], camera.centre - origins) / scales
    angles = np.arctan2(-centres[:, 0], centres[:, 1])[:, None] + turns
    circles = radii[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=2) * scales[:, None]
    rings = np.concatenate([circles, np.broadcast_to(places[:, None, None], (*angles.shape, 1))], axis=2)
    points = rings @ frames[:, :, :3].transpose(0, 2, 1) + origins[:, None]
    pixels = project(camera, points)[0]
    ones, others = pixels[:, :CAP_POINTS], pixels[:, CAP_POINTS - 1 :][:, ::-1]
    middle = CAP_POINTS // 2
    is_one = np.sum((ones[:, middle] - others[:, middle]) * away, axis=1) >= 0.0
    halves = np.where(is_one[:, None, None], ones, others)
    first, last = (np.sum((halves[:, at] - starts) ** 2, axis=1) for at in (0, -1))
    return np.where((first <= last)[:, None, None], halves, halves[:, ::-1])
