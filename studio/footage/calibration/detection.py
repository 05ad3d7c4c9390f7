"""Boards found in pictures: ChArUco and chessboard corners, sub-pixel, with the first corner identified.

Only calls that OpenCV 4.10 and 5 both have. Chessboard corners come in any of several orders; here they are put into
the board's own: never mirrored, and beginning at the corner whose outer square is black, if the board has only one.
Boards that look the same after half a turn (`Board.turn_symmetric`) keep the order that begins furthest to the top
left; the comparison of views resolves the rest.
"""

from collections.abc import Callable
from functools import partial

import cv2
import cv2.aruco
import numpy as np
from numpy.typing import NDArray

from studio.footage.calibration.boards import Board, Detection
from studio.foundations.arrays import Array, Bytes, Floats, Indices

FEWEST_CORNERS = 6
SUBPIXEL_REACH = (2, 5)
FIRST_LOOK = 960
"""Chessboards are searched for in pictures reduced to this long side first; full-size searches take seconds."""
OFF_PLANE = 0.15
"""Corners may lie this share of their spacing off a plane's picture (root mean square); a wrong row gives 0.4."""


class BoardFinder:
    """Finds one board in pictures.

    thorough : try slower searches for chessboards that the first does not find (single pictures, not videos).
    mirrored_too : also look into the mirrored picture where none is found (ChArUco; a chessboard has no handedness).
    """

    def __init__(self, board: Board, *, thorough: bool = True, mirrored_too: bool = True) -> None:
        self.board, self._thorough = board, thorough
        self._mirrored_too = mirrored_too and board.kind == "charuco"
        self._charuco = _charuco_detector(board) if board.kind == "charuco" else None

    def find(self, picture: Bytes, camera: str, frame: int, name: str = "") -> Detection | None:
        """The board in a (H, W, 3) BGR or (H, W) grey picture, None if fewer than six of its corners are seen."""
        grey = picture
        if picture.ndim == 3:
            grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        corners, mirrored = self._corners(grey), False
        if corners is None and self._mirrored_too:
            corners, mirrored = self._corners(np.ascontiguousarray(grey[:, ::-1])), True
        if corners is None:
            return None
        size = (int(grey.shape[1]), int(grey.shape[0]))
        return Detection(camera, frame, name or f"frame {frame}", size, *corners, mirrored=mirrored)

    def _corners(self, grey: Bytes) -> tuple[Indices, Array] | None:
        if self._charuco is not None:
            return _charuco_corners(self.board, self._charuco, grey)
        pixels = _chessboard_corners(self.board, grey, self._thorough)
        return None if pixels is None else (np.arange(len(pixels), dtype=np.int64), pixels)


def sharpness(picture: Bytes, detection: Detection) -> float:
    """How sharp the board is: the mean gradient over its standard deviation of grey levels, inside its bounds."""
    low = np.maximum(np.floor(detection.pixels.min(axis=0)).astype(int) - 2, 0)
    high = np.ceil(detection.pixels.max(axis=0)).astype(int) + 3
    part = picture[low[1] : high[1], low[0] : high[0]]
    grey = (part.mean(axis=2) if part.ndim == 3 else part).astype(np.float32)
    steps = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    return float(np.percentile(steps, 95) / max(float(grey.std()), 1.0))


def _charuco_detector(board: Board) -> cv2.aruco.CharucoDetector:
    detection = cv2.aruco.DetectorParameters()
    detection.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.CharucoDetector(
        board.opencv_board(), cv2.aruco.CharucoParameters(), detection, cv2.aruco.RefineParameters()
    )


def _charuco_corners(
    board: Board, detector: cv2.aruco.CharucoDetector, grey: Bytes
) -> tuple[Indices, Array] | None:
    """(K,) ids and (K, 2) pixels.

    OpenCV 4.10 gives corners half a pixel off; all are refined again here, in a window that leaves the markers out.
    """
    corners, ids, _, _ = detector.detectBoard(grey)
    if ids is None or len(ids) < FEWEST_CORNERS:  # pyright: ignore[reportUnnecessaryComparison] - it may be
        return None
    order = np.argsort(np.ravel(ids))
    numbers = np.ravel(ids)[order].astype(np.int64)
    coarse = np.asarray(corners, dtype=np.float32).reshape(-1, 2)[order]
    gap = 0.5 * _spacing(board, numbers, coarse) * (1.0 - board.marker_mm / board.square_mm)
    reach = int(np.clip(np.floor(gap), *SUBPIXEL_REACH))
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 0.002)
    fine = cv2.cornerSubPix(grey, coarse[:, None].copy(), (reach, reach), (-1, -1), until)[:, 0]
    kept = np.linalg.norm(fine - coarse, axis=1) < reach
    if kept.sum() < FEWEST_CORNERS:
        return None
    return numbers[kept], np.asarray(fine[kept], dtype=np.float64)


def _spacing(board: Board, ids: Indices, pixels: NDArray[np.floating]) -> float:
    """Pixels from corner to corner: the median over all pairs, by their distance on the board."""
    plan = np.linalg.norm(board.points[ids][:, None] - board.points[ids][None], axis=-1) / board.square_mm
    seen = np.linalg.norm(pixels[:, None] - pixels[None], axis=-1)
    far = plan > 0.0
    return float(np.median(seen[far] / plan[far]))


def _chessboard_corners(board: Board, grey: Bytes, thorough: bool) -> Array | None:
    """(K, 2) all corners row by row in the board's order, None if not all are seen.

    The first look is at the picture made small, its corners refined at full size; without `thorough` it is the only
    one where the picture is large. Searches that may take a neighbour for a corner are believed only if the corners
    lie on one plane.
    """
    across, down = board.corners
    for search in (_SEARCHES if max(grey.shape) > FIRST_LOOK else _SEARCHES[2:])[: None if thorough else 1]:
        corners = search(grey, (across, down))
        if corners is None:
            continue
        ordered = _in_order(board, np.asarray(corners, dtype=np.float64).reshape(down, across, 2), grey)
        if on_a_plane(board, ordered.reshape(-1, 2)):
            return ordered.reshape(-1, 2)
    return None


def on_a_plane(board: Board, pixels: Array) -> bool:
    """Whether all (K, 2) corners are a picture of the board's plane, give or take what a lens may bend."""
    flat = board.points[:, :2]
    homography, _ = cv2.findHomography(flat, pixels, 0)
    if homography is None:  # pyright: ignore[reportUnnecessaryComparison] - it may be
        return False
    across, down = board.corners
    off = cv2.perspectiveTransform(flat[None], homography)[0] - pixels
    spacing = np.median(np.linalg.norm(np.diff(pixels.reshape(down, across, 2), axis=0), axis=-1))
    return bool(np.sqrt((off**2).sum(axis=1).mean()) < OFF_PLANE * spacing)


def _small_search(grey: Bytes, size: tuple[int, int], flags: int) -> Floats | None:
    scale = FIRST_LOOK / max(grey.shape)
    resized = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    small = np.asarray(resized, dtype=np.uint8)
    corners = _search(small, size, flags)
    if corners is None:
        return None
    # Pixels are counted from the middle of the first one, so shrinking happens about the corner at -0.5.
    return _refined(grey, (np.asarray(corners, dtype=np.float32).reshape(-1, 1, 2) + 0.5) / scale - 0.5, size)


def _search(grey: Bytes, size: tuple[int, int], flags: int) -> Floats | None:
    seen, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE | flags)
    return np.asarray(corners, dtype=np.float32) if seen else None


def _classic_search(grey: Bytes, size: tuple[int, int]) -> Floats | None:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    seen, corners = cv2.findChessboardCorners(grey, size, flags=flags)
    return _refined(grey, np.asarray(corners, dtype=np.float32).reshape(-1, 1, 2), size) if seen else None


_SEARCHES: tuple[Callable[[Bytes, tuple[int, int]], Floats | None], ...] = (
    partial(_small_search, flags=0),
    partial(_small_search, flags=cv2.CALIB_CB_EXHAUSTIVE),
    partial(_search, flags=cv2.CALIB_CB_ACCURACY),
    partial(_search, flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY),
    _classic_search,
)
"""Quickest first; the first two are for large pictures."""


def _refined(grey: Bytes, corners: Floats, size: tuple[int, int]) -> Floats:
    """(K, 1, 2) corners moved to where the gradients around them meet."""
    rows = corners.reshape(size[1], size[0], 2)
    spacing = float(np.median(np.linalg.norm(np.diff(rows, axis=0), axis=-1)))
    reach = int(np.clip(0.25 * spacing, 2, 11))
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 0.002)
    fine = cv2.cornerSubPix(grey, corners.astype(np.float32), (reach, reach), (-1, -1), until)
    return np.asarray(fine, dtype=np.float32)


def _in_order(board: Board, grid: Array, grey: Bytes) -> Array:
    """(rows, columns, 2) corners, not mirrored, beginning where the board begins."""
    along, downwards = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * downwards[1] - along[1] * downwards[0] < 0.0:
        grid = grid[:, ::-1]
    turned = grid[::-1, ::-1]
    if board.turn_symmetric:
        return grid if grid[0, 0].sum() <= turned[0, 0].sum() else turned
    return grid if _outer_level(grid, grey) <= _outer_level(turned, grey) else turned


def _outer_level(grid: Array, grey: Bytes) -> float:
    """Grey level of the squares diagonally before the first corner and inside of it; both have one colour."""
    inner = grid[:2, :2].mean(axis=(0, 1))
    outer = 2.0 * grid[0, 0] - inner
    places = np.array([inner, outer], np.float32).reshape(1, 2, 2)
    levels = cv2.remap(
        grey, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return float(np.mean(levels))
