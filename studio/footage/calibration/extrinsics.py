"""The poses of the cameras, from boards that several of them saw at once.

Pairs of cameras vote on their relative pose; the most trusted pairs make a tree; every frame's board gets the pose on
which its cameras agree best; then bundle adjustment, once more without the views that do not fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from studio.footage.calibration.board_poses import BoardView, PairPose, pair_pose, views_by_camera
from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.bundle import Bundle, Observations, adjusted, errors_of, kept_inliers
from studio.footage.calibration.intrinsics import Lens
from studio.footage.capture.naming import listed, natural_key
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rigid import compose, inverse, rigid
from studio.foundations.geometry.rotations import rotation_from_vector, vector_from_rotation
from studio.foundations.progress import Progress, no_progress

MOST_FRAMES = 90
CLIPPED_PX = 30.0
OUTLYING, LEAST_OUTLYING_PX = 4.0, 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """Solved cameras, in the frame of the first one until the floor is set.

    boards : frame → (3, 4) world_from_board, mm. turned : (camera, frame) of boards counted from their other end.
    rms : camera → pixels over the views used. views : camera → how many. dropped : views left out as not fitting.
    pairs : relative poses of pairs.
    """

    cameras: tuple[Camera, ...]
    boards: Mapping[int, Array]
    rms: Mapping[str, float]
    views: Mapping[str, int]
    turned: frozenset[tuple[str, int]] = frozenset()
    dropped: int = 0
    pairs: tuple[PairPose, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The input of the solver. views : camera → frame → its detection of the board."""

    board: Board
    names: tuple[str, ...]
    lenses: Mapping[str, Lens]
    views: Mapping[str, Mapping[int, BoardView]]


def solve_rig(
    board: Board,
    detections: Sequence[Detection],
    lenses: Mapping[str, Lens],
    *,
    refine_lenses: bool = False,
    progress: Progress = no_progress,
) -> Rig:
    """The cameras named by `lenses`, from their detections at the same frame numbers.

    Raises CalibrationError naming the cameras that share no board view with the others.
    """
    names = tuple(sorted(lenses, key=natural_key))
    seen = _Seen(board, names, lenses, views_by_camera(board, detections, lenses))
    pairs: list[PairPose] = []
    couples = list(combinations(names, 2))
    for number, (first, second) in enumerate(couples):
        progress("Comparing cameras", number, len(couples))
        pair = pair_pose(first, second, seen.views)
        if pair is not None:
            pairs.append(pair)
    poses = _tree(names, pairs)
    frames = _chosen_frames(seen)
    boards, turned = _board_poses(seen, frames, poses)
    progress("Adjusting all together", 0, 2)
    bundle, observed = _bundle(seen, frames, poses, boards, turned)
    bundle = adjusted(bundle, observed)
    errors = errors_of(bundle, observed)
    limit = max(OUTLYING * float(np.median(errors)), LEAST_OUTLYING_PX)
    kept, dropped = kept_inliers(bundle, observed, limit)
    missing = [name for number, name in enumerate(names) if not np.any(kept.camera == number)]
    if missing:
        raise CalibrationError(
            f"No board view of camera {listed(missing)} agrees with the other cameras.",
            "Check that its footage runs in step with the others', is not mirrored and has its own lens's calibration.",
        )
    progress("Adjusting all together", 1, 2)
    bundle = adjusted(bundle, kept, refine_lenses)
    progress("Adjusting all together", 2, 2)
    return replace(_rig(seen, frames, bundle, kept), turned=turned, dropped=dropped, pairs=tuple(pairs))


def _tree(names: Sequence[str], pairs: Sequence[PairPose]) -> dict[str, Array]:
    """Camera → (3, 4) camera_from_world along the most trusted pairs; the first camera is the world."""
    if len(names) < 2:
        raise CalibrationError(f"{len(names)} camera alone cannot be placed.", "Give footage of two or more.")
    poses = {names[0]: rigid(np.eye(3), np.zeros(3))}
    order = sorted(pairs, key=lambda pair: -pair.trust)
    while len(poses) < len(names):
        step = next((pair for pair in order if (pair.first in poses) != (pair.second in poses)), None)
        if step is None:
            away = [name for name in names if name not in poses]
            raise CalibrationError(
                f"Camera {listed(away)} saw the board in no frame together with camera {listed(poses)}.",
                "Carry the board through the places that neighbouring cameras both see; frames are paired by number.",
            )
        if step.first in poses:
            poses[step.second] = compose(step.second_from_first, poses[step.first])
        else:
            poses[step.first] = compose(inverse(step.second_from_first), poses[step.second])
    return poses


def _chosen_frames(seen: _Seen) -> list[int]:
    """Frames that two or more cameras saw; if there are many, those that serve the least served pairs."""
    together: dict[int, list[tuple[str, str]]] = {}
    for frame in sorted(set[int]().union(*(seen.views[name] for name in seen.names))):
        pairs = list(combinations([name for name in seen.names if frame in seen.views[name]], 2))
        if pairs:
            together[frame] = pairs
    served: dict[tuple[str, str], int] = {pair: 0 for pairs in together.values() for pair in pairs}
    chosen: list[int] = []
    while together and len(chosen) < MOST_FRAMES:
        frame = max(together, key=lambda each: (sum(0.5 ** served[pair] for pair in together[each]), -each))
        for pair in together.pop(frame):
            served[pair] += 1
        chosen.append(frame)
    return sorted(chosen)


def _board_poses(
    seen: _Seen, frames: Sequence[int], poses: Mapping[str, Array]
) -> tuple[dict[int, Array], frozenset[tuple[str, int]]]:
    """Frame → world_from_board on which its cameras agree best, and the views that count from the other end."""
    boards: dict[int, Array] = {}
    turned: set[tuple[str, int]] = set()
    for frame in frames:
        views = {name: seen.views[name][frame] for name in seen.names if frame in seen.views[name]}
        best, ends = np.inf, list[tuple[str, bool]]()
        for name, view in views.items():
            for pose in view.poses[~view.turned]:
                candidate = compose(inverse(poses[name]), pose)
                costs = [
                    _cost(seen.board, candidate, poses[other], seen.lenses[other], theirs)
                    for other, theirs in views.items()
                ]
                total = sum(min(pair) for pair in costs)
                if total < best:
                    best, boards[frame] = total, candidate
                    ends = [(other, pair[1] < pair[0]) for other, pair in zip(views, costs, strict=True)]
        turned |= {(other, frame) for other, end in ends if end}
    return boards, frozenset(turned)


def _cost(board: Board, pose: Array, camera: Array, lens: Lens, view: BoardView) -> tuple[float, float]:
    """Clipped mean pixels between a board's pose and a view, and the same counted from the board's other end."""
    detection = view.detection
    costs: list[float] = []
    for ids in (detection.ids, len(board.points) - 1 - detection.ids):
        local = board.points[ids] @ pose[:, :3].T + pose[:, 3]
        seen = local @ camera[:, :3].T + camera[:, 3]
        ahead = np.maximum(seen[:, 2:], 1.0)
        flat = seen[:, :2] / ahead
        # The lens's bending is left out on both sides alike: a coarse measure to choose by.
        centre, focal = lens.matrix[:2, 2], np.diag(lens.matrix)[:2]
        off = np.linalg.norm(flat * focal + centre - detection.pixels, axis=1)
        costs.append(float(np.minimum(off, CLIPPED_PX).mean()))
        if not board.turn_symmetric:
            return costs[0], np.inf
    return costs[0], costs[1]


def _bundle(
    seen: _Seen,
    frames: Sequence[int],
    poses: Mapping[str, Array],
    boards: Mapping[int, Array],
    turned: frozenset[tuple[str, int]],
) -> tuple[Bundle, Observations]:
    parts: list[tuple[Array, ...]] = []
    points = seen.board.points
    for number, name in enumerate(seen.names):
        for moment, frame in enumerate(frames):
            if frame in seen.views[name]:
                detection = seen.views[name][frame].detection
                ids = len(points) - 1 - detection.ids if (name, frame) in turned else detection.ids
                one = np.full(len(ids), 1)
                parts.append((one * number, one * moment, points[ids], detection.pixels))
    camera, moment, corners, pixels = (np.concatenate(column) for column in zip(*parts, strict=True))
    bundle = Bundle(
        np.array([_vector(poses[name]) for name in seen.names]),
        np.array([_vector(boards[frame]) for frame in frames]),
        np.array([_lens_row(seen.lenses[name]) for name in seen.names]),
    )
    return bundle, Observations(camera.astype(np.int64), moment.astype(np.int64), corners, pixels)


def _vector(pose: Array) -> Array:
    return np.concatenate([vector_from_rotation(pose[:, :3]), pose[:, 3]])


def _lens_row(lens: Lens) -> Array:
    matrix = lens.matrix
    return np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *lens.distortion])


def _rig(seen: _Seen, frames: Sequence[int], bundle: Bundle, used: Observations) -> Rig:
    """The cameras and boards of a bundle, with what is left of errors on the observations that were used."""
    errors = errors_of(bundle, used)
    cameras, rms, views = list[Camera](), dict[str, float](), dict[str, int]()
    for number, name in enumerate(seen.names):
        fx, fy, cx, cy = bundle.lenses[number, :4]
        vector = bundle.cameras[number]
        cameras.append(
            Camera(
                name,
                *seen.lenses[name].size,
                np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
                bundle.lenses[number, 4:].copy(),
                rotation_from_vector(vector[:3]),
                vector[3:].copy(),
            )
        )
        mine = used.camera == number
        rms[name] = float(np.sqrt(np.mean(errors[mine] ** 2)))
        views[name] = len(np.unique(used.moment[mine]))
    moments = set(used.moment.tolist())
    boards = {
        frame: rigid(rotation_from_vector(row[:3]), row[3:].copy())
        for number, (frame, row) in enumerate(zip(frames, bundle.boards, strict=True))
        if number in moments
    }
    return Rig(tuple(cameras), boards, rms, views)


def moved(rig: Rig, new_from_old: Array) -> Rig:
    """The rig in another world: (3, 4) new_from_old."""
    boards = {frame: compose(new_from_old, pose) for frame, pose in rig.boards.items()}
    return replace(rig, cameras=moved_cameras(rig.cameras, new_from_old), boards=boards)


def moved_cameras(cameras: Sequence[Camera], new_from_old: Array) -> tuple[Camera, ...]:
    """Cameras in another world: (3, 4) new_from_old."""
    back = inverse(new_from_old)
    moved: list[Camera] = []
    for camera in cameras:
        pose = compose(rigid(camera.rotation, camera.translation), back)
        moved.append(replace(camera, rotation=pose[:, :3].copy(), translation=pose[:, 3].copy()))
    return tuple(moved)
