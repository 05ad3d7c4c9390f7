"""One camera's lens from pictures of a board: as many unknowns as the pictures can carry, outliers dropped."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.coverage import Coverage, coverage_of
from studio.footage.capture.calibration_files import read_intrinsics
from studio.footage.capture.naming import match_names
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError

FEWEST_PICTURES = 3
OUTLYING, LEAST_OUTLYING_PX = 3.0, 0.7
"""A picture is dropped if its residual exceeds so many times the median and so many pixels per 1000 of width."""
DROP_ROUNDS, KEPT_SHARE = 6, 0.6
SOME, MANY, PLENTY = 4, 10, 20
"""From so many pictures on: the centre is free; the tangential distortion; the aspect and a third radial term."""
GOOD_COVERAGE = 0.5
CENTRE_DEVIATION = 0.01
"""The principal point is fixed at the centre if it is uncertain by more than this share of the picture's width."""
PROFILED = 0.04
"""The focal length is held off by this share to see how much worse the pictures fit."""
FOCAL_GUESSES = (0.8, 1.3, 2.2)


@dataclass(frozen=True, slots=True)
class PictureResidual:
    """How well one picture fits. rms : pixels. tilt : board against picture, degrees (NaN: dropped). dropped : why."""

    picture: str
    frame: int
    rms: float
    tilt: float
    dropped: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A calibrated lens.

    size : width, height. matrix (3, 3), distortion (5,) k1 k2 p1 p2 k3. rms : over the pictures used, pixels.
    focal_deviation, centre_deviation : one standard deviation, pixels (0 for a centre that was held fixed).
    model : the free parameters, as text. residuals : one a picture, dropped ones with their reason.
    """

    camera: str
    size: tuple[int, int]
    matrix: Array
    distortion: Array
    rms: float
    focal_deviation: float
    centre_deviation: float
    model: str
    residuals: tuple[PictureResidual, ...]
    coverage: Coverage

    @property
    def used(self) -> tuple[PictureResidual, ...]:
        """The pictures that count."""
        return tuple(residual for residual in self.residuals if not residual.dropped)


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """The result of one call of the solver. rms_of : (N,) pixels a picture; turns : (N, 3) rotation vectors."""

    matrix: Array
    distortion: Array
    rms: float
    deviations: Array
    rms_of: Array
    turns: Array


def solve_lens(board: Board, detections: Sequence[Detection]) -> Lens:
    """The lens of the one camera that all detections are of.

    Raises CalibrationError for fewer than three pictures, or pictures of several sizes.
    """
    camera, size = _check(detections)
    used, dropped = list(detections), dict[int, str]()
    solution, model = _fit(board, used, size)
    least = max(FEWEST_PICTURES, int(np.ceil(KEPT_SHARE * len(detections))))
    for _ in range(DROP_ROUNDS):
        limit = max(OUTLYING * float(np.median(solution.rms_of)), LEAST_OUTLYING_PX * size[0] / 1000.0)
        worst = int(np.argmax(solution.rms_of))
        if solution.rms_of[worst] <= limit or len(used) <= least:
            break
        dropped[id(used[worst])] = (
            f"its residual is {solution.rms_of[worst]:.2f} px, the others' {np.median(solution.rms_of):.2f} px"
        )
        del used[worst]
        solution, model = _fit(board, used, size)
    profiled = _profiled_deviation(board, used, size, solution)
    turns: list[Array] = list(solution.turns)
    upright = [abs(float(np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)[2, 2])) for turn in turns]
    tilts = np.degrees(np.arccos(np.clip(upright, 0, 1)))
    place = {id(detection): number for number, detection in enumerate(used)}
    residuals = tuple(
        PictureResidual(detection.picture, detection.frame, np.nan, np.nan, dropped[id(detection)])
        if id(detection) in dropped
        else PictureResidual(
            detection.picture,
            detection.frame,
            float(solution.rms_of[place[id(detection)]]),
            float(tilts[place[id(detection)]]),
        )
        for detection in detections
    )
    return Lens(
        camera,
        size,
        solution.matrix,
        solution.distortion,
        solution.rms,
        max(float(np.max(solution.deviations[:2])), profiled),
        float(np.max(solution.deviations[2:4])),
        model,
        residuals,
        coverage_of(used, size),
    )


def _check(detections: Sequence[Detection]) -> tuple[str, tuple[int, int]]:
    names = sorted({detection.camera for detection in detections})
    sizes = sorted({detection.size for detection in detections})
    name = names[0] if names else "?"
    if len(detections) < FEWEST_PICTURES:
        raise CalibrationError(
            f"The board is found in {len(detections)} pictures of camera {name}; {FEWEST_PICTURES} are the least.",
            "Check the board's kind and numbers, and take pictures in which the whole board is sharp.",
        )
    if len(sizes) > 1:
        raise CalibrationError(
            f"Camera {name} has board pictures of {sizes[0][0]}x{sizes[0][1]} and {sizes[1][0]}x{sizes[1][1]} pixels.",
            "Take all of them with one mode of the camera, the one that records the motion.",
        )
    return name, sizes[0]


def _fit(board: Board, detections: Sequence[Detection], size: tuple[int, int]) -> tuple[_Solution, str]:
    """The richest model that the pictures carry, and its name in words."""
    share, count = coverage_of(detections, size).share, len(detections)
    flags = cv2.CALIB_FIX_K3
    words = ["focal length", "two radial terms"]
    if count < MANY:
        flags |= cv2.CALIB_ZERO_TANGENT_DIST
    else:
        words.append("tangential distortion")
    if count < PLENTY or share < GOOD_COVERAGE:
        flags |= cv2.CALIB_FIX_ASPECT_RATIO
    else:
        words.append("aspect")
    if count >= SOME:
        free = _best_start(board, detections, size, flags)
        if np.max(free.deviations[2:4]) <= CENTRE_DEVIATION * size[0] and _inside(free, size):
            return free, ", ".join([*words, "centre"]) + " free"
    flags |= cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_ASPECT_RATIO
    flags |= cv2.CALIB_FIX_K2
    fixed = _best_start(board, detections, size, flags)
    return fixed, "focal length and one radial term free, centre held in the middle"


def _profiled_deviation(
    board: Board, detections: Sequence[Detection], size: tuple[int, int], solution: _Solution
) -> float:
    """One standard deviation of the focal length, pixels, from how much worse the pictures fit beside it.

    The solver's own deviations hold near its solution only; boards that face the camera fit any focal length, and the
    solver may be sure of a wrong one. Here the focal length is held a few percent off and all else solved again.
    """
    flags = cv2.CALIB_FIX_FOCAL_LENGTH | cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_K3
    flags |= cv2.CALIB_ZERO_TANGENT_DIST if len(detections) < MANY else 0
    count = sum(len(detection.ids) for detection in detections)
    focal = float(np.mean(np.diag(solution.matrix)[:2]))
    rises: list[float] = []
    for share in (1.0 - PROFILED, 1.0 + PROFILED):
        held = _solved(board, detections, size, flags, share * focal, solution.matrix[:2, 2])
        rises.append(2.0 * count * max((held.rms / max(solution.rms, 1e-9)) ** 2 - 1.0, 1e-12))
    return PROFILED * focal / float(np.sqrt(min(rises)))


def _inside(solution: _Solution, size: tuple[int, int]) -> bool:
    share = solution.matrix[:2, 2] / np.array(size)
    return bool(np.all((share > 0.25) & (share < 0.75)))


def _best_start(
    board: Board, detections: Sequence[Detection], size: tuple[int, int], flags: int
) -> _Solution:
    """The least residual over a few guesses of the focal length; the first that is good is enough."""
    best: _Solution | None = None
    for guess in FOCAL_GUESSES:
        solution = _solved(board, detections, size, flags, guess * max(size))
        if best is None or solution.rms < best.rms:
            best = solution
        if best.rms < size[0] / 1000.0:
            break
    if best is None:
        raise AssertionError("there is at least one guess")
    return best


def _solved(
    board: Board,
    detections: Sequence[Detection],
    size: tuple[int, int],
    flags: int,
    focal: float,
    centre: Array | None = None,
) -> _Solution:
    points = board.points
    middle = (np.array(size) - 1.0) / 2.0 if centre is None else centre
    start = np.array([[focal, 0.0, middle[0]], [0.0, focal, middle[1]], [0.0, 0.0, 1.0]])
    # OpenCV's threads add up in whatever order they end: a lens other in its eleventh digit starts another search.
    cv2.setNumThreads(1)
    rms, matrix, distortion, turns, _, deviations, _, of_picture = cv2.calibrateCameraExtended(
        [points[detection.ids].astype(np.float32) for detection in detections],
        [detection.pixels.astype(np.float32) for detection in detections],
        size,
        start,
        np.zeros(5),
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-9),
    )
    return _Solution(
        np.asarray(matrix, dtype=np.float64),
        np.ravel(distortion).astype(np.float64)[:5],
        float(rms),
        np.ravel(deviations).astype(np.float64),
        np.ravel(of_picture).astype(np.float64),
        np.array([np.ravel(turn) for turn in turns], dtype=np.float64),
    )


def lenses_of_file(path: Path, names: Sequence[str]) -> dict[str, Lens]:
    """Camera → lens, matched by name; pictures, residuals and coverage are unknown. Raises CalibrationError."""
    read = {entry.name: entry for entry in read_intrinsics(path)}
    matches = match_names(list(names), list(read), "recordings", CalibrationError)
    lenses: dict[str, Lens] = {}
    for match in matches:
        entry = read[match.camera]
        size = (entry.width, entry.height)
        lenses[match.footage] = Lens(
            match.footage,
            size,
            entry.matrix,
            entry.distortion,
            float("nan"),
            0.0,
            0.0,
            f"read from {path.name}",
            (),
            coverage_of((), size),
        )
    return lenses
