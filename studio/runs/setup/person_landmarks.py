"""Where a network sees a person's joints, in three dimensions: a witness that knows nothing of our bodies and searches.

Each camera's points (`evidence.person_network`) are triangulated over the cameras. Left and right, which the network
exchanges at times, are given to each camera so that the rays meet; of the two ways to do that for all cameras together
the one that goes on from the frame before. Which of both sides is the left one most cameras say, in all frames.
A camera whose point lies far from where the others' rays meet does not count for that point. The network's joints are
no marker on a bone: each may lie constantly beside a body's own, by centimetres (`Evaluation.without_offsets_mm` is
the error without that).
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from studio.body.motion_files.trc import MarkerMotion
from studio.evidence.person_network import Detection
from studio.footage.calibration.floor import triangulated
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError, FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.progress import Progress
from studio.runs.setup.person_masks import Detections, followed_person

PAIRS = {
    "Shoulder": (11, 12),
    "Elbow": (13, 14),
    "Wrist": (15, 16),
    "Hip": (23, 24),
    "Knee": (25, 26),
    "Ankle": (27, 28),
}
"""The network's points of joints that our bodies have: left, right."""
NAMES = tuple(f"{side}{joint}" for joint in PAIRS for side in "LR")
LEFT_AND_RIGHT = [row for pair in PAIRS.values() for row in pair]
RIGHT_AND_LEFT = [row for pair in PAIRS.values() for row in reversed(pair)]
APART = 0.06
"""Distance of a camera's point from where the others' rays meet, as a share of its crop's side, from which it does not
count for that point: 6 cm on a crop around a standing person are 0.03."""
MOST_EXCHANGED = 6
"""Cameras up to which every way to exchange sides is tried."""


def person_landmarks(cameras: Sequence[Camera], footage: Footage, progress: Progress) -> MarkerMotion:
    """Twelve joints of the person whom the network follows, mm in the session's world; NaN where fewer than two cameras
    see one. Raises FootageError for one camera, or where no person is seen.
    """
    if len(cameras) < 2:
        raise FootageError(
            "One camera shows no place in space.", "The network's joints need two calibrated cameras or more."
        )
    known = {camera.name: camera for camera in cameras}
    positions = np.full((footage.frame_count, len(NAMES), 3), np.nan)
    seen = dict(followed_person(cameras, footage, progress))
    before: Array | None = None
    votes = 0
    for frame in sorted(seen):
        joints = _joints(known, seen[frame], before)
        if joints is not None:
            positions[frame], vote = joints
            before = positions[frame]
            votes += vote
    if votes < 0:
        positions = positions.reshape(-1, len(PAIRS), 2, 3)[:, :, ::-1].reshape(positions.shape)
    if before is None:
        raise FootageError(
            "No two cameras see the same person in any frame.",
            "Look at the calibration, and whether the whole person is in the pictures.",
        )
    times = np.arange(footage.frame_count) / footage.fps
    return MarkerMotion(NAMES, times, positions, "mm", footage.fps)


def _joints(
    cameras: Mapping[str, Camera], seen: Detections, before: Array | None
) -> tuple[Array, int] | None:
    """(12, 3) mm, and how many more cameras see the left side as the left one than as the right one; None where fewer
    than two cameras see the person. before : those of the last frame; without it both sides may be exchanged.
    """
    names = [name for name in seen if name in cameras]
    if len(names) < 2:
        return None
    ways = itertools.product((False, True), repeat=len(names) - 1) if len(names) <= MOST_EXCHANGED else [()]
    best: tuple[float, Array, int] | None = None
    for way in ways:
        exchanged = dict(zip(names, (False, *way, *[False] * len(names)), strict=False))
        pixels = {name: _pixels(seen[name], exchanged[name]) for name in names}
        points = meeting_of(cameras, pixels)
        if points is None:
            continue
        missed = float(np.mean([np.median(_misses(cameras[name], points, pixels[name])) for name in names]))
        if best is None or missed < best[0]:
            kept = len(names) - 2 * sum(exchanged.values())
            best = missed, _without_outliers(cameras, pixels, seen, points), kept
    if best is None:
        return None
    placed, vote = best[1:]
    other = _exchanged(placed)
    if before is None or _movement(placed, before) <= _movement(other, before):
        return placed, vote
    return other, -vote


def _pixels(seen: Detection, exchanged: bool) -> Array:
    return seen.points[RIGHT_AND_LEFT if exchanged else LEFT_AND_RIGHT]


def _exchanged(points: Array) -> Array:
    return points.reshape(-1, 2, 3)[:, ::-1].reshape(points.shape)


def _movement(points: Array, before: Array) -> float:
    with np.errstate(invalid="ignore"):
        return float(np.nanmedian(np.linalg.norm(points - before, axis=1)))


def _misses(camera: Camera, points: Array, pixels: Array) -> Array:
    """(12,) pixels."""
    return np.asarray(np.linalg.norm(project(camera, points)[0] - pixels, axis=1))


def meeting_of(cameras: Mapping[str, Camera], pixels: Mapping[str, Array]) -> Array | None:
    """(N, 3) mm where the rays of pixels (N, 2) of each camera meet; None where they do not."""
    try:
        return triangulated([cameras[name] for name in pixels], pixels)
    except CalibrationError:
        return None


def _without_outliers(
    cameras: Mapping[str, Camera], pixels: Mapping[str, Array], seen: Detections, points: Array
) -> Array:
    """The points without the cameras that contradict the others; NaN where two contradict each other."""
    cleaned = points.copy()
    for row in range(len(points)):
        rays = {name: places[row : row + 1] for name, places in pixels.items()}
        cleaned[row], _ = of_those_that_agree(cameras, rays, seen, points[row : row + 1])
    return cleaned


def of_those_that_agree(
    cameras: Mapping[str, Camera],
    rays: Mapping[str, Array],
    seen: Detections,
    point: Array,
    apart: float = APART,
) -> tuple[Array, int]:
    """(1, 3) where the rays (1, 2 pixels each) of the largest set of cameras meet that agree on the point, and how many
    these are; NaN and 0 where no two do. apart : as `APART`.
    """

    def contradiction(among: Mapping[str, Array], at: Array) -> float:
        return max(
            float(_misses(cameras[name], at, among[name])[0]) / seen[name].next_crop.side for name in among
        )

    left: dict[str, Array] = dict(rays)
    while contradiction(left, point) > apart:
        fewer = [{name: left[name] for name in left if name != gone} for gone in left]
        meeting = [
            (rest, at) for rest in fewer if len(rest) > 1 and (at := meeting_of(cameras, rest)) is not None
        ]
        if not meeting:
            return np.full_like(point, np.nan), 0
        left, point = min(meeting, key=lambda one: contradiction(*one))
    return point, len(left)
