"""Calibration boards: their pattern and the places of their corners.

A board's own frame: origin at its first inner corner, x along a row of corners, y along a column (down on the
printed page), z = x × y into the board, away from the viewer; mm. Corners count row by row.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import cv2
import cv2.aruco
import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera

DEFAULT_DICTIONARY = "DICT_4X4_250"
SPELLING = (
    "Write charuco:5x7,40,30 (squares, square mm, marker mm) or chessboard:4x7,60 (inner corners, square mm)."
)
FEWEST_CORNERS = 2
LARGEST_SIDE = 60


@dataclass(frozen=True, slots=True)
class Board:
    """A printed board.

    columns, rows : squares of a ChArUco board, inner corners of a chessboard (as OpenCV and most tools count).
    square_mm, marker_mm : side lengths as *measured on the print*; marker_mm 0 for chessboards.
    dictionary : OpenCV's name of the markers' dictionary.
    legacy : ChArUco pattern as OpenCV before 4.6 drew it (differs for an even number of rows).
    thickness_mm : of the plate that carries it; matters when it lies on the floor.

    Raises CalibrationError for a board that cannot be.
    """

    kind: Literal["charuco", "chessboard"]
    columns: int
    rows: int
    square_mm: float
    marker_mm: float = 0.0
    dictionary: str = DEFAULT_DICTIONARY
    legacy: bool = False
    thickness_mm: float = 0.0

    def __post_init__(self) -> None:
        across, down = self.corners
        if min(across, down) < FEWEST_CORNERS or max(across, down) > LARGEST_SIDE:
            raise CalibrationError(f"A board with {across}x{down} inner corners cannot be used.", SPELLING)
        if not (np.isfinite(self.square_mm) and self.square_mm > 0.0):
            raise CalibrationError(
                f"Squares of {self.square_mm:g} mm are impossible.", "Measure the printed board."
            )
        if self.kind == "chessboard":
            if across == down:
                raise CalibrationError(
                    f"A chessboard with {across}x{down} inner corners looks the same after a quarter turn.",
                    "Use a board with unlike numbers of columns and rows, or a ChArUco board.",
                )
            return
        if not 0.0 < self.marker_mm < self.square_mm:
            raise CalibrationError(
                f"Markers of {self.marker_mm:g} mm do not fit in squares of {self.square_mm:g} mm.",
                "A ChArUco board's markers are smaller than its squares; measure both.",
            )
        if self.marker_count > len(self.opencv_dictionary().bytesList):
            raise CalibrationError(
                f"{self.dictionary} has too few markers for {self.columns}x{self.rows} squares.",
                "Choose a dictionary with more markers.",
            )

    @property
    def corners(self) -> tuple[int, int]:
        """Inner corners, across and down."""
        if self.kind == "chessboard":
            return self.columns, self.rows
        return self.columns - 1, self.rows - 1

    @property
    def squares(self) -> tuple[int, int]:
        """Squares, across and down."""
        return self.corners[0] + 1, self.corners[1] + 1

    @property
    def marker_count(self) -> int:
        return self.columns * self.rows // 2

    @property
    def points(self) -> Array:
        """(K, 3) all inner corners in the board's frame, mm."""
        across, down = self.corners
        grid = np.stack(np.meshgrid(np.arange(across), np.arange(down)), axis=-1).reshape(-1, 2)
        return np.column_stack([grid * self.square_mm, np.zeros(len(grid))]).astype(np.float64)

    @property
    def turn_symmetric(self) -> bool:
        """Whether the board looks the same after half a turn, so that pictures do not show its first corner."""
        across, down = self.corners
        return self.kind == "chessboard" and (across + down) % 2 == 0

    @property
    def text(self) -> str:
        """The board as `board_from_text` reads it."""
        if self.kind == "chessboard":
            return f"chessboard:{self.columns}x{self.rows},{self.square_mm:g}"
        text = f"charuco:{self.columns}x{self.rows},{self.square_mm:g},{self.marker_mm:g},{self.dictionary}"
        return text + (",legacy" if self.legacy else "")

    def opencv_dictionary(self) -> cv2.aruco.Dictionary:
        """OpenCV's dictionary. Raises CalibrationError for an unknown name."""
        number = getattr(cv2.aruco, self.dictionary, None)
        if not self.dictionary.startswith("DICT_") or not isinstance(number, int):
            raise CalibrationError(
                f"There is no marker dictionary '{self.dictionary}'.",
                "DICT_4X4_50 and DICT_5X5_100 are usual.",
            )
        return cv2.aruco.getPredefinedDictionary(number)

    def opencv_board(self) -> cv2.aruco.CharucoBoard:
        """OpenCV's ChArUco board of the same measures (its origin is the outer corner)."""
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows), self.square_mm, self.marker_mm, self.opencv_dictionary()
        )
        board.setLegacyPattern(self.legacy)
        return board


def board_from_text(text: str, thickness_mm: float = 0.0) -> Board:
    """A board from "charuco:5x7,40,30[,DICT_4X4_250][,legacy]" or "chessboard:4x7,60". Raises CalibrationError."""
    kind, _, rest = text.strip().partition(":")
    parts = [part.strip() for part in rest.split(",")]
    size = re.fullmatch(r"(\d{1,3})\s*[x×]\s*(\d{1,3})", parts[0])
    wanted = {"charuco": 3, "chessboard": 2}.get(kind, 0)
    legacy = kind == "charuco" and parts[-1] == "legacy"
    parts = parts[:-1] if legacy else parts
    named = kind == "charuco" and len(parts) == wanted + 1
    if size is None or not wanted or (len(parts) != wanted and not named):
        raise CalibrationError(f"The board '{text}' cannot be understood.", SPELLING)
    try:
        lengths = [float(part) for part in parts[1:wanted]]
    except ValueError:
        raise CalibrationError(f"The board '{text}' has a length that is no number.", SPELLING) from None
    columns, rows = int(size[1]), int(size[2])
    if kind == "chessboard":
        return Board("chessboard", columns, rows, lengths[0], thickness_mm=thickness_mm)
    dictionary = parts[wanted] if named else DEFAULT_DICTIONARY
    return Board("charuco", columns, rows, lengths[0], lengths[1], dictionary, legacy, thickness_mm)


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """One board in one picture.

    camera : whose. frame : equal numbers are the same moment in all cameras. picture : what to call it in messages.
    size : width and height of the picture, pixels. ids : (K,) corners seen, indices into `Board.points`.
    pixels : (K, 2) where. mirrored : the board was found only in the mirrored picture (pixels are those of the
    mirrored one).
    """

    camera: str
    frame: int
    picture: str
    size: tuple[int, int]
    ids: Indices
    pixels: Array
    mirrored: bool = False


def of_camera(detections: Iterable[Detection], camera: str) -> tuple[Detection, ...]:
    """Those of one camera, by frame."""
    own = [detection for detection in detections if detection.camera == camera]
    return tuple(sorted(own, key=lambda detection: detection.frame))


def rays_of(camera: Camera, pixels: Array) -> Array:
    """(K, 3) unit directions in the world from the camera's centre through (K, 2) pixels."""
    flat = cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion)[:, 0]
    ahead = np.column_stack([flat, np.ones(len(flat))]) @ camera.rotation
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
