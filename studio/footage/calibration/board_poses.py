"""Poses of boards relative to single cameras, and relative poses of cameras that saw the same boards."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.intrinsics import Lens
from studio.foundations.arrays import Array
from studio.foundations.geometry.rigid import compose, inverse, rigid
from studio.foundations.geometry.rotations import nearest_rotation

NEAR_ANGLE, NEAR_SHARE = np.radians(6.0), 0.06
"""Two votes for the pose of a camera agree within this turn and this share of the board's distance."""
MOST_VOTES = 240


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """One detection with the poses that explain it. poses : (P, 3, 4) camera_from_board, mm, of which one is right;
    turned : (P,) whether the corners are counted from the other end (boards that look alike after half a turn).
    """

    detection: Detection
    poses: Array
    turned: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class PairPose:
    """The relative pose of two cameras. second_from_first : (3, 4), mm. agreeing, shared : number of frames."""

    first: str
    second: str
    second_from_first: Array
    agreeing: int
    shared: int

    @property
    def trust(self) -> float:
        """Agreeing frames, less where others contradict."""
        return self.agreeing * self.agreeing / max(self.shared, 1)


def view_of(board: Board, detection: Detection, lens: Lens) -> BoardView | None:
    """The poses of a board that explain a detection, most likely first; None if its corners lie on a line."""
    poses: list[Array] = []
    turned: list[bool] = []
    count = len(board.points)
    for other_end in (False, True) if board.turn_symmetric else (False,):
        ids = count - 1 - detection.ids if other_end else detection.ids
        points = board.points[ids]
        spread = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)
        if spread[1] < 0.5 * board.square_mm:
            return None
        try:
            _, turns, shifts, _ = cv2.solvePnPGeneric(
                points, detection.pixels, lens.matrix, lens.distortion, flags=cv2.SOLVEPNP_IPPE
            )
        except cv2.error:
            return None
        for turn, shift in zip(turns, shifts, strict=True):
            pose = rigid(
                np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64), np.ravel(shift).astype(np.float64)
            )
            if np.isfinite(pose).all() and pose[2, 3] > 0.0:
                poses.append(pose)
                turned.append(other_end)
    return BoardView(detection, np.array(poses), np.array(turned)) if poses else None


def views_by_camera(
    board: Board, detections: Sequence[Detection], lenses: Mapping[str, Lens]
) -> dict[str, dict[int, BoardView]]:
    """Camera → frame → view."""
    views: dict[str, dict[int, BoardView]] = {name: {} for name in lenses}
    for detection in detections:
        if detection.camera in lenses:
            view = view_of(board, detection, lenses[detection.camera])
            if view is not None:
                views[detection.camera][detection.frame] = view
    return views


def pair_pose(first: str, second: str, views: Mapping[str, Mapping[int, BoardView]]) -> PairPose | None:
    """The pose of one camera against another on which most of their shared frames agree; None without any."""
    frames = sorted(set(views[first]) & set(views[second]))
    if not frames:
        return None
    chosen = np.unique(np.linspace(0, len(frames) - 1, MOST_VOTES // 4).astype(int))
    frames = [frames[int(k)] for k in chosen]
    votes, voters, distances = list[Array](), list[int](), list[float]()
    for frame in frames:
        one, two = views[first][frame], views[second][frame]
        # Turning the board for both cameras changes nothing, so only the second one's may be turned.
        for pose in one.poses[~one.turned]:
            for other in two.poses:
                votes.append(compose(other, inverse(pose)))
                voters.append(frame)
                distances.append(0.5 * (pose[2, 3] + other[2, 3]))
    stack, owner, far = np.array(votes), np.array(voters), np.array(distances)
    near = _agreement(stack, far)
    support = np.array([len(set(owner[row])) for row in near])
    best = int(np.argmax(support + 0.5 * near.sum(axis=1) / len(owner)))
    chosen = stack[near[best]]
    mean = rigid(nearest_rotation(chosen[:, :, :3].sum(axis=0)), np.median(chosen[:, :, 3], axis=0))
    return PairPose(first, second, mean, int(support[best]), len(frames))


def _agreement(poses: Array, distances: Array) -> NDArray[np.bool_]:
    """(N, N) which votes agree with which."""
    trace = np.einsum("aij,bij->ab", poses[:, :, :3], poses[:, :, :3])
    angle = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
    apart = np.linalg.norm(poses[:, None, :, 3] - poses[None, :, :, 3], axis=-1)
    return (angle < NEAR_ANGLE) & (apart < NEAR_SHARE * np.minimum(distances[:, None], distances[None]) + 5.0)
