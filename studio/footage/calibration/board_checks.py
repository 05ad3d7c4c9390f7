"""Faults that board footage shows in a calibration made elsewhere, and in itself."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import cv2
import numpy as np

from studio.footage.calibration.board_poses import BoardView, pair_pose, view_of
from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.extrinsics import Rig
from studio.footage.calibration.fault_hypotheses import explained
from studio.footage.calibration.findings import Finding
from studio.footage.calibration.intrinsics import Lens
from studio.footage.calibration.rig_checks import scale_finding
from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.camera import Camera

GOOD_PX = 3.0
"""Pixels per 1000 of width by which two sound views of a board may miss each other, median."""
CLIPPED_PX = 60.0
MOST_FRAMES = 24
SIZE_TOLERANCE = 0.02
CONTRADICTED, AGREED, FEWEST_SHARED = 0.5, 0.8, 3


def board_findings(
    cameras: Sequence[Camera], board: Board, detections: Sequence[Detection]
) -> tuple[Finding, ...]:
    """Check cameras against their detections of a board: identity, mirroring, resolution, rotation, size of squares."""
    backwards = mirrored_detections(detections)
    if backwards:
        return backwards
    findings = explained(
        cameras, lambda tried: board_disagreement(tried, board, detections), GOOD_PX, "board's pictures"
    )
    if findings:
        return findings
    size = square_size(cameras, board, detections)
    if size is None or abs(size / board.square_mm - 1.0) <= SIZE_TOLERANCE:
        return ()
    return (scale_finding(size / board.square_mm, f"the board's squares ({board.square_mm:g} mm)", board),)


def mirrored_detections(detections: Sequence[Detection]) -> tuple[Finding, ...]:
    """Cameras whose ChArUco boards could be read in the mirrored picture only."""
    findings: list[Finding] = []
    for name in sorted({detection.camera for detection in detections}):
        mine = [detection.mirrored for detection in detections if detection.camera == name]
        if 2 * sum(mine) > len(mine):
            message = f"The pictures of camera {name} are mirrored: its markers are read in the mirrored picture only."
            remedy = "Switch mirroring off in the camera's program, or flip the footage."
            findings.append(Finding("mirrored-video", "blocks", message, remedy, (name,)))
    return tuple(findings)


def mirrored_cameras(
    board: Board, detections: Sequence[Detection], lenses: Mapping[str, Lens], rig_names: Sequence[str]
) -> tuple[Finding, ...]:
    """Cameras that agree with the others only once their pictures are mirrored; a chessboard itself has no handedness.

    With two cameras either of them may be the mirrored one.
    """
    views: dict[str, dict[int, BoardView]] = {name: {} for name in rig_names}
    backwards: dict[str, dict[int, BoardView]] = {name: {} for name in rig_names}
    for detection in detections:
        if detection.camera not in views:
            continue
        view = view_of(board, detection, lenses[detection.camera])
        other = view_of(board, *unmirrored(board, detection, lenses[detection.camera]))
        if view is not None and other is not None:
            views[detection.camera][detection.frame] = view
            backwards[detection.camera][detection.frame] = other
    odd: dict[str, int] = dict.fromkeys(rig_names, 0)
    compared = 0
    for first, second in combinations(rig_names, 2):
        straight = pair_pose(first, second, views)
        crossed = pair_pose(first, second, {first: views[first], second: backwards[second]})
        if straight is None or crossed is None or straight.shared < FEWEST_SHARED:
            continue
        compared += 1
        if straight.agreeing < CONTRADICTED * straight.shared and crossed.agreeing > AGREED * crossed.shared:
            odd[first] += 1
            odd[second] += 1
    most = max(odd.values(), default=0)
    if most == 0:
        return ()
    guilty = tuple(name for name in rig_names if odd[name] == most)
    reason = "the boards agree once left and right are exchanged"
    message = f"The pictures of camera {' or '.join(guilty)} are mirrored: {reason}."
    remedy = "Switch mirroring off in the camera's program, or flip the footage."
    return (Finding("mirrored-video", "blocks", message, remedy, guilty),)


def unmirrored(board: Board, detection: Detection, lens: Lens) -> tuple[Detection, Lens]:
    """A chessboard detection and its lens with left and right of the picture exchanged."""
    across, down = board.corners
    row, column = np.divmod(detection.ids, across)
    # The corner from which the board counts has a black square outside; mirroring along the even side keeps it.
    along = across % 2 == 0 or board.turn_symmetric
    ids = row * across + (across - 1 - column) if along else (down - 1 - row) * across + column
    pixels = np.column_stack([detection.size[0] - 1.0 - detection.pixels[:, 0], detection.pixels[:, 1]])
    matrix, distortion = lens.matrix.copy(), lens.distortion.copy()
    matrix[0, 2] = detection.size[0] - 1.0 - matrix[0, 2]
    distortion[3] = -distortion[3]
    flipped = Detection(detection.camera, detection.frame, detection.picture, detection.size, ids, pixels)
    changed = Lens(
        lens.camera, lens.size, matrix, distortion, lens.rms, lens.focal_deviation, lens.centre_deviation,
        lens.model, lens.residuals, lens.coverage,
    )  # fmt: skip
    return flipped, changed


def pair_findings(rig: Rig) -> tuple[Finding, ...]:
    """Cameras that contradict all others in most frames: footage out of step, or another camera's."""
    shares: dict[str, list[float]] = {camera.name: [] for camera in rig.cameras}
    for pair in rig.pairs:
        if pair.shared >= FEWEST_SHARED:
            shares[pair.first].append(pair.agreeing / pair.shared)
            shares[pair.second].append(pair.agreeing / pair.shared)
    bad = tuple(name for name, values in shares.items() if values and max(values) < CONTRADICTED)
    if not bad:
        return ()
    message = f"Camera {', '.join(bad)} sees the boards elsewhere than the others in most frames."
    remedy = "Check that the footage of all cameras begins at the same moment (frames are paired by number)."
    return (Finding("out-of-step", "blocks", message, remedy, bad),)


def board_disagreement(cameras: Sequence[Camera], board: Board, detections: Sequence[Detection]) -> float:
    """Pixels per 1000 of width by which two-view intersections miss the corners: mean over pairs of the clipped median;
    NaN if no two cameras share a frame.
    """
    pairs = _shared_frames(cameras, detections)
    values: list[float] = []
    for one, two, frames in pairs:
        errors = [_two_views(cameras[one], cameras[two], *couple, board)[1] for couple in frames]
        values.append(min(float(np.median(np.concatenate(errors))), CLIPPED_PX))
    return float(np.mean(values)) if values else float("nan")


def square_size(cameras: Sequence[Camera], board: Board, detections: Sequence[Detection]) -> float | None:
    """Side of a square as these cameras measure it, mm (median); None if no two share a frame."""
    sizes: list[Array] = []
    for one, two, frames in _shared_frames(cameras, detections):
        for first, second in frames:
            points, _, ids = _two_views(cameras[one], cameras[two], first, second, board)
            apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
            plan = np.linalg.norm(board.points[ids][:, None] - board.points[ids][None], axis=-1)
            far = plan > 1.5 * board.square_mm
            if far.any():
                sizes.append(apart[far] / plan[far] * board.square_mm)
    return float(np.median(np.concatenate(sizes))) if sizes else None


def _shared_frames(
    cameras: Sequence[Camera], detections: Sequence[Detection]
) -> list[tuple[int, int, list[tuple[Detection, Detection]]]]:
    """Pairs of cameras with the frames that both saw, with four common corners or more."""
    seen = {(detection.camera, detection.frame): detection for detection in detections}
    shared: list[tuple[int, int, list[tuple[Detection, Detection]]]] = []
    for one, two in combinations(range(len(cameras)), 2):
        names = cameras[one].name, cameras[two].name
        frames = sorted({frame for name, frame in seen if name == names[0] and (names[1], frame) in seen})
        couples = [(seen[names[0], frame], seen[names[1], frame]) for frame in frames]
        couples = [couple for couple in couples if len(np.intersect1d(couple[0].ids, couple[1].ids)) >= 4]
        if couples:
            step = max(1, len(couples) // MOST_FRAMES)
            shared.append((one, two, couples[::step]))
    return shared


def _two_views(
    one: Camera, two: Camera, first: Detection, second: Detection, board: Board
) -> tuple[Array, Array, Indices]:
    """(K, 3) common corners in the world, (K,) pixels per 1000 by which they miss the views, (K,) ids."""
    best: tuple[Array, Array, Indices] | None = None
    for end in (False, True) if board.turn_symmetric else (False,):
        ids = len(board.points) - 1 - second.ids if end else second.ids
        both, left, right = np.intersect1d(first.ids, ids, return_indices=True)
        if len(both) < 4:
            continue
        points, errors = _intersected((one, two), (first.pixels[left], second.pixels[right]))
        if best is None or np.median(errors) < np.median(best[1]):
            best = points, errors, both
    return best if best is not None else (np.zeros((0, 3)), np.array([CLIPPED_PX]), np.zeros(0, np.int64))


def _intersected(cameras: tuple[Camera, Camera], pixels: tuple[Array, Array]) -> tuple[Array, Array]:
    flat = [
        cv2.undistortPoints(seen[:, None], camera.matrix, camera.distortion)[:, 0]
        for camera, seen in zip(cameras, pixels, strict=True)
    ]
    poses = [np.column_stack([camera.rotation, camera.translation]) for camera in cameras]
    solved = cv2.triangulatePoints(poses[0], poses[1], flat[0].T, flat[1].T)
    points = (solved[:3] / np.where(np.abs(solved[3]) < 1e-12, 1e-12, solved[3])).T
    errors = np.zeros(len(points))
    for camera, pose, seen in zip(cameras, poses, flat, strict=True):
        local = points @ pose[:, :3].T + pose[:, 3]
        safe = np.where(local[:, 2:] > 0.0, local[:, 2:], np.nan)
        off = (
            np.linalg.norm(local[:, :2] / safe - seen, axis=1)
            * abs(camera.matrix[0, 0])
            * 1000.0
            / camera.width
        )
        errors = np.maximum(errors, np.where(np.isnan(off), CLIPPED_PX, np.minimum(off, CLIPPED_PX)))
    return points.astype(np.float64), errors
