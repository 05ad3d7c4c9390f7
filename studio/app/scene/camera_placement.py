"""The placement of a camera's picture in the scene, and the view through the camera.

The picture hangs on a plane in front of its camera so that every pixel lies on its own ray: the principal
point may be off-centre, the lens distortion is taken out of the picture (cameras in the scene are plain
pinholes), and the picture is turned by the camera's quarter turns *together with* the plane, which changes
what is up for a viewer and no ray.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.app.scene import METRES_PER_MM
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.overlay_drawing import upright

_VIEW_MARGIN = 1.04


@dataclass(frozen=True, slots=True, eq=False)
class PicturePlane:
    """A camera as shown: turned upright, in metres.

    wxyz, position : world_from_camera of the upright camera (x right, y down, z forward as the viewer sees
    it). left, right, top, bottom : the picture's edges on the plane at depth 1, signed.
    """

    wxyz: Array
    position: Array
    left: float
    right: float
    top: float
    bottom: float

    @property
    def size(self) -> tuple[float, float]:
        """Width and height at depth 1."""
        return self.right - self.left, self.bottom - self.top

    @property
    def middle(self) -> Array:
        """(3,) the picture's middle at depth 1 in the upright camera's frame."""
        return np.array([(self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0, 1.0])

    @property
    def corners(self) -> Array:
        """(4, 3) top left, top right, bottom right, bottom left at depth 1 in the upright camera's frame."""
        left, right, top, bottom = self.left, self.right, self.top, self.bottom
        return np.array([[left, top, 1.0], [right, top, 1.0], [right, bottom, 1.0], [left, bottom, 1.0]])

    @property
    def up(self) -> Array:
        """(3,) the up direction of the upright picture in the world."""
        return -Rotation.from_quat(self.wxyz, scalar_first=True).as_matrix()[:, 1]

    @property
    def forward(self) -> Array:
        """(3,) the optical axis as a direction in the world."""
        return Rotation.from_quat(self.wxyz, scalar_first=True).as_matrix()[:, 2]

    def field_of_view(self, aspect: float) -> float:
        """Vertical angle (radians) with which a viewer of this width/height sees the whole picture."""
        across = max(abs(self.left), abs(self.right)) / max(aspect, 1e-6)
        return 2.0 * float(np.arctan(_VIEW_MARGIN * max(across, abs(self.top), abs(self.bottom))))


def picture_plane(camera: Camera) -> PicturePlane:
    """The camera's plane, upright."""
    matrix = camera.matrix
    columns = (np.array([-0.5, camera.width - 0.5]) - matrix[0, 2]) / matrix[0, 0]
    rows = (np.array([-0.5, camera.height - 0.5]) - matrix[1, 2]) / matrix[1, 1]
    turn = clockwise_turn(camera.quarter_turns)
    corners = np.array([[columns[0], rows[0]], [columns[1], rows[1]]]) @ turn[:2, :2].T
    low, high = corners.min(axis=0), corners.max(axis=0)
    world_from_upright = camera.rotation.T @ turn.T
    wxyz = Rotation.from_matrix(world_from_upright).as_quat(scalar_first=True)
    return PicturePlane(
        wxyz,
        camera.centre * METRES_PER_MM,
        left=float(low[0]),
        right=float(high[0]),
        top=float(low[1]),
        bottom=float(high[1]),
    )


def clockwise_turn(quarter_turns: int) -> Array:
    """(3, 3) rotation from the stored picture's axes to those of the picture turned clockwise by so many
    times 90°.

    One turn: the stored picture's right becomes down, its down becomes left (x' = -y, y' = x).
    """
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return np.linalg.matrix_power(quarter, quarter_turns % 4)


@dataclass(frozen=True, slots=True, eq=False)
class StraightPicture:
    """Takes the lens distortion out of a camera's pictures and makes them small; maps are computed once."""

    columns: NDArray[np.float32]
    rows: NDArray[np.float32]
    quarter_turns: int

    def __call__(self, picture: Bytes) -> Bytes:
        """A picture of the source size to a small, straight, upright one."""
        straight = cv2.remap(
            picture, self.columns, self.rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
        )
        return upright(np.asarray(straight, dtype=np.uint8), self.quarter_turns)


def straight_picture(camera: Camera, source_width: int, longest_side: int) -> StraightPicture:
    """The small undistorted picture of a camera whose pictures arrive `source_width` pixels wide (perhaps reduced)."""
    longest = max(camera.width, camera.height)
    shrink = min(1.0, longest_side / longest)
    size = (max(1, round(camera.width * shrink)), max(1, round(camera.height * shrink)))
    source = _scaled(camera.matrix, source_width / camera.width)
    target = _scaled(camera.matrix, size[0] / camera.width)
    columns, rows = cv2.initUndistortRectifyMap(
        source, camera.distortion, np.eye(3), target, size, cv2.CV_32FC1
    )
    return StraightPicture(
        np.asarray(columns, dtype=np.float32), np.asarray(rows, dtype=np.float32), camera.quarter_turns
    )


def _scaled(matrix: Array, scale: float) -> Array:
    """An intrinsic matrix for a picture resized by `scale`, pixel (0, 0) being the centre of the top-left pixel."""
    result = matrix.copy()
    result[:2] *= scale
    result[0, 2] = (matrix[0, 2] + 0.5) * scale - 0.5
    result[1, 2] = (matrix[1, 2] + 0.5) * scale - 0.5
    return result
