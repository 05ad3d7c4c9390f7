"""What a frame is compared with: the body's points, and the pose that the truth's markers have.

Points are the body's markers, or its limbs' ends where it has none; each belongs to a limb as in
`results.evaluation.errors`.
"""

import threading
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from cachetools import LRUCache

from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.results.evaluation.errors import TRUNK, has_sides, limb_of_markers, rows_of_frames
from studio.results.inspection.reading import InspectedRun
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.frame_refinement import REDRAWN, REDRAWN_STEPS, FrameRefinementSettings
from studio.search.trackers.limb_resampling import DOUBTFUL_SHARE, SeenFrame, redrawn
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.side_exchange import kinds_of

KEPT_POSES = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The truth of a frame. pose : (D,) whose markers come closest to the true ones. residual_mm : how close (RMS).
    points : (M, 3) true markers in the body's order, NaN where the truth has none.
    """

    pose: Array
    residual_mm: float
    points: Array


def body_points(body: BodyModel, poses: Array) -> Array:
    """(N, M, 3) mm the markers of poses (N, D); the limbs' far ends where the body has none."""
    return marker_points(body, poses) if body.markers else limb_ends(body, poses)[:, :, 1]


def limbs_of_points(body: BodyModel) -> tuple[str, ...]:
    """(M,) the limb of each of the body's points."""
    if not body.markers:
        return tuple(limb.name for limb in body.drawn)
    owner = limb_of_markers(body)
    return tuple(owner[marker.name] for marker in body.markers)


def limb_group(body: BodyModel, limb: str) -> str:
    """The limb that a parameter counts with: itself if sided or the body has no sides, else head and trunk."""
    return limb if "left" in limb or "right" in limb or not has_sides(body) else TRUNK


def by_limb(body: BodyModel, distances: Array) -> dict[str, Array]:
    """Mean over each limb's points of distances (..., M) (NaN: unknown)."""
    owner = np.array(limbs_of_points(body))
    limbs: dict[str, Array] = {}
    for limb in dict.fromkeys(owner.tolist()):
        own = distances[..., owner == limb]
        known = np.isfinite(own)
        with np.errstate(invalid="ignore"):
            limbs[limb] = np.where(known, own, 0.0).sum(axis=-1) / known.sum(axis=-1)
    return limbs


def true_points(run: InspectedRun, frame: int) -> Array | None:
    """(M, 3) the truth's markers in the body's order, NaN where missing; None where the session or frame has none."""
    path = run.session.truth_path
    if path is None or not run.body.markers:
        return None
    truth = _truth(path, path.stat().st_mtime_ns)
    row = _rows(path, path.stat().st_mtime_ns, run.run.record.fps).get(frame)
    if truth is None or row is None:
        return None
    points = np.full((len(run.body.markers), 3), np.nan)
    for at, marker in enumerate(run.body.markers):
        if marker.name in truth.names:
            points[at] = truth.positions[row][truth.names.index(marker.name)]
    return points if np.isfinite(points).any() else None


def true_pose(run: InspectedRun, frame: int) -> Reference | None:
    """The pose of the truth's markers, fitted from the tracked pose on; None where there is no truth."""
    points = true_points(run, frame)
    if points is None:
        return None
    key = (run.run.folder, frame, points.tobytes())
    with _lock:
        if key in _poses:
            return _poses[key]
    names = tuple(marker.name for marker in run.body.markers)
    pose, residual = pose_from_markers(run.body, names, points, _start(run, frame))
    reference = Reference(pose, residual, points)
    with _lock:
        _poses[key] = reference
    return reference


def _start(run: InspectedRun, frame: int) -> Array:
    """(D,) where a fit to the truth begins: the frame's tracked pose, else the start pose, else the rest pose."""
    with run.run.results() as results:
        known = results.stored_poses()
    if frame in known:
        return known[frame]
    given = run.run.record.start_pose
    return run.body.neutral if given is None else np.array(given)


_lock = threading.Lock()
_poses = LRUCache[tuple[Path, int, bytes], Reference](KEPT_POSES)


@lru_cache(maxsize=8)
def _truth(path: Path, stamp: int) -> MarkerMotion | None:
    try:
        return read_trc(path)
    except StudioError:
        return None


@lru_cache(maxsize=8)
def _rows(path: Path, stamp: int, fps: float) -> dict[int, int]:
    truth = _truth(path, stamp)
    return {} if truth is None else rows_of_frames(truth, fps)


def refined_pose(
    run: InspectedRun, evidence: FrameEvidence, frame: int, pose: Array, near: Array | None = None
) -> Array:
    """The pose (D,) refined as a run refines its frames, and with the sides that fit best; itself where no silhouette
    shows anything. near : (D,) the body in the next frame, from where lost limbs are searched for.
    """
    points = FrameRefinementSettings().refine_frame_points
    seen = {name: view for name, view in silhouettes_by_camera(evidence, points).items() if len(view.border)}
    cameras = tuple(camera for camera in run.run.cameras() if camera.name in seen)
    if not cameras:
        return pose
    refiner = Refiner(run.body, cameras, RefinementSettings(refinement_steps=REDRAWN_STEPS))
    views = SeenFrame(refiner, Agreement(run.body, cameras), tuple(seen[camera.name] for camera in cameras))
    best = views.hypothesis(refiner.refine(pose, views.silhouettes).pose)
    if near is not None:
        return views.better(best, near).pose
    for kind in kinds_of(run.body):
        best = views.better(best, kind.offered(best.pose))
    if max(best.off.shares().values()) >= DOUBTFUL_SHARE:
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence((0, frame, 0, 0, REDRAWN))))
        best, _ = redrawn(rng, best, views)
    return best.pose
