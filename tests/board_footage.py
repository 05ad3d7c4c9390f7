"""Made-up footage of a calibration board with known truth: a board waved through the view of distorting cameras."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.footage.calibration.board_pdf import drawn
from studio.footage.calibration.boards import Board
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import rigid, transform
from studio.foundations.geometry.rotations import axis_turn, rotation_from_vector
from studio.results.drawing_footage.cameras import pixel_rays

LARGEST_TEXTURE = 3000.0
LEVELS = 5
PAPER, INK, BACK, WALL = 215.0, 28.0, 120.0, 95.0
STREAMS_PER_FRAME = 64


@dataclass(frozen=True, slots=True)
class Footage:
    """How the pictures are spoilt. samples : per pixel and side. blur : sigma, pixels. noise : sigma, grey levels."""

    samples: int = 2
    blur: float = 0.6
    noise: float = 2.0
    seed: int = 0


class BoardRenderer:
    """Pictures of a board in any pose, seen by any of the cameras; pictures are independent of each other."""

    def __init__(self, board: Board, cameras: Sequence[Camera], footage: Footage | None = None) -> None:
        self._board, self._cameras, self._footage = board, tuple(cameras), footage or Footage()
        self._margin = 0.5 * board.square_mm
        across, down = (count * board.square_mm + 2 * self._margin for count in board.squares)
        self._density = LARGEST_TEXTURE / max(across, down)
        ink = drawn(board, self._density, self._margin)
        self._levels = [INK + (PAPER - INK) * (ink.astype(np.float32) / 255.0)]
        for _ in range(LEVELS - 1):
            last = self._levels[-1]
            half = (max(1, last.shape[1] // 2), max(1, last.shape[0] // 2))
            self._levels.append(np.asarray(cv2.resize(last, half, interpolation=cv2.INTER_AREA), np.float32))
        self._rays = [pixel_rays(camera, 1) for camera in self._cameras]

    def picture(self, camera: int, frame: int, world_from_board: Array) -> Bytes:
        """(H, W, 3) BGR of camera number `camera`; `frame` keys the noise. world_from_board : (3, 4), mm."""
        view, spoilt = self._cameras[camera], self._footage
        grey = np.full((view.height, view.width), WALL, np.float32)
        window = self._window(view, world_from_board)
        if window is not None:
            rows, columns = window
            grey[rows, columns] = self._plate(camera, rows, columns, world_from_board)
        soft = cv2.GaussianBlur(grey, (0, 0), spoilt.blur) if spoilt.blur > 0.0 else grey
        stream = (spoilt.seed * 1_000_003 + frame) * STREAMS_PER_FRAME + camera
        rng = np.random.Generator(np.random.Philox(stream))
        noisy = soft + rng.normal(0.0, spoilt.noise, soft.shape) if spoilt.noise > 0.0 else soft
        return np.repeat(np.clip(np.round(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)

    def _plate(
        self, camera: int, rows: slice, columns: slice, world_from_board: Array
    ) -> NDArray[np.float32]:
        """Grey levels of a window: the board's face, its back, or the wall."""
        view, s = self._cameras[camera], self._footage.samples
        coarse = self._rays[camera][rows, columns]
        rays = cv2.resize(coarse, None, fx=s, fy=s, interpolation=cv2.INTER_LINEAR)
        turn, origin = world_from_board[:, :3], world_from_board[:, 3]
        start, ahead = (view.centre - origin) @ turn, rays @ turn.astype(np.float32)
        with np.errstate(divide="ignore", invalid="ignore"):
            far = -start[2] / ahead[..., 2]
            x, y = start[0] + far * ahead[..., 0], start[1] + far * ahead[..., 1]
        left = self._margin + self._board.square_mm
        across, down = (self._density * (value + left) for value in (x, y))
        height, width = self._levels[0].shape
        inside = (far > 0.0) & (across > 0.0) & (across < width) & (down > 0.0) & (down < height)
        if start[2] > 0.0:
            face = np.full(far.shape, BACK, np.float32)
        else:
            step = np.median(np.abs(np.diff(across, axis=1))[inside[:, 1:]]) if inside.any() else 1.0
            level = int(np.clip(np.floor(np.log2(max(float(step), 1.0))), 0, LEVELS - 1))
            places = [
                np.where(inside, value / 2**level - 0.5, 0.0).astype(np.float32) for value in (across, down)
            ]
            face = cv2.remap(
                self._levels[level], places[0], places[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
        fine = np.where(inside, face, WALL)
        shape = (rows.stop - rows.start, s, columns.stop - columns.start, s)
        return fine.reshape(shape).mean(axis=(1, 3)).astype(np.float32)

    def _window(self, camera: Camera, world_from_board: Array) -> tuple[slice, slice] | None:
        """Rows and columns that hold the board, None when it is out of the picture."""
        across, down = self._board.squares
        side = self._board.square_mm
        u, v = np.meshgrid(np.linspace(-1.5, across - 0.5, 12), np.linspace(-1.5, down - 0.5, 12))
        edge = np.column_stack([u.ravel() * side, v.ravel() * side, np.zeros(u.size)])
        pixels, depth = project(camera, transform(world_from_board, edge))
        if depth.min() < 50.0:
            return None
        low, high = np.floor(pixels.min(axis=0)) - 4, np.ceil(pixels.max(axis=0)) + 5
        left, top = (int(value) for value in np.maximum(low, 0))
        right, bottom = int(min(high[0], camera.width)), int(min(high[1], camera.height))
        return (slice(top, bottom), slice(left, right)) if right > left and bottom > top else None


def close_boards(rng: np.random.Generator, board: Board, camera: Camera, count: int) -> Array:
    """(count, 3, 4) world_from_board of a board held before one camera: all over the picture, tilted up to 45°."""
    across, down = board.corners
    middle = 0.5 * board.square_mm * np.array([across - 1, down - 1, 0.0])
    reach = np.linalg.norm(middle)
    poses = []
    for number in range(count):
        focal = camera.matrix[0, 0]
        far = float(rng.uniform(2.0, 4.5)) * reach * focal / (0.5 * min(camera.width, camera.height))
        cell = np.array([(number % 3) - 1.0, (number // 3 % 3) - 1.0])
        shown = 0.5 * np.array([camera.width, camera.height]) - 0.75 * reach * focal / far
        place = np.maximum(shown, 0.0) * (0.9 * cell + rng.uniform(-0.1, 0.1, 2)) / focal
        turn = rotation_from_vector(rng.uniform(-0.65, 0.65, 3)) @ axis_turn(2, rng.uniform(-0.6, 0.6))
        seen = far * np.array([place[0], place[1], 1.0])
        poses.append(
            rigid(camera.rotation.T @ turn, camera.rotation.T @ (seen - turn @ middle - camera.translation))
        )
    return np.array(poses)


def waved_boards(
    rng: np.random.Generator, board: Board, cameras: Sequence[Camera], count: int, reach: float = 700.0
) -> Array:
    """(count, 3, 4) world_from_board of a board carried about the middle of the room at 0.5 to 1.8 m, facing between
    two neighbouring cameras in turn.
    """
    middle = 0.5 * board.square_mm * np.array([board.corners[0] - 1, board.corners[1] - 1, 0.0])
    poses = []
    for number in range(count):
        one = cameras[number % len(cameras)]
        two = cameras[(number + 1) % len(cameras)]
        place = np.array([*rng.uniform(-reach, reach, 2), rng.uniform(500.0, 1800.0)])
        towards = [(camera.centre - place) / np.linalg.norm(camera.centre - place) for camera in (one, two)]
        share = float(rng.uniform(0.35, 0.65))
        into = -(share * towards[0] + (1.0 - share) * towards[1])
        into = into / np.linalg.norm(into)
        right = np.cross((0.0, 0.0, -1.0), into)
        right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0.0, 0.0])
        facing = np.stack([right, np.cross(into, right), into], axis=1)
        turn = facing @ rotation_from_vector(rng.uniform(-0.3, 0.3, 3)) @ axis_turn(2, rng.uniform(-0.4, 0.4))
        poses.append(rigid(turn, place - turn @ middle))
    return np.array(poses)


def floor_board(place: tuple[float, float] = (0.0, 0.0), turn: float = 0.0, thickness: float = 0.0) -> Array:
    """(3, 4) world_from_board of a board lying on the floor, face up, its first corner at `place` (mm), its x axis
    `turn` radians from the world's.
    """
    rotation = axis_turn(2, turn) @ np.diag([1.0, -1.0, -1.0])
    return rigid(rotation, np.array([place[0], place[1], thickness]))
