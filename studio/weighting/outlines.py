"""Projected outlines of a body's limbs for many poses: the typed door of the outline kernel."""

import copy

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel, KinematicTables, kinematic_tables
from studio.errors import BodyError
from studio.geometry.camera import Camera
from studio.weighting.block_threads import run_blocks
from studio.weighting.kinematic_program import KinematicProgram, compile_program
from studio.weighting.outline_kernels import LANES, ROWS, SEEN_ROW, all_outlines, chunk_outlines

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

CAMERA_COLUMNS = 30
# Beyond tan²θ = 1e6 (90 degrees off the axis less 3.4 arc minutes) nothing is a picture.
WIDEST_VIEW = 1.0e6
# About half a millisecond of ten limbs in four cameras.
BLOCKS_A_THREAD = 200


class OutlineProjector:
    """Projects one body into some cameras; holds nothing that changes."""

    def __init__(self, tables: KinematicTables, cameras: tuple[Camera, ...]) -> None:
        self.program = compile_program(tables)
        self.cameras = cameras
        self._camera_table = camera_table(cameras)

    @classmethod
    def of_body(cls, body: BodyModel, cameras: tuple[Camera, ...]) -> "OutlineProjector":
        """The projector of a body's drawn limbs."""
        return cls(kinematic_tables(body), cameras)

    def with_program(self, program: KinematicProgram) -> "OutlineProjector":
        """The projector of another body of the same tree into the same cameras."""
        other = copy.copy(self)
        other.program = program
        return other

    @property
    def limb_count(self) -> int:
        """How many limbs are drawn."""
        return len(self.program.limb_frame)

    def blocks(self, poses: Array) -> Floats:
        """(B, V, L, 160) outlines of poses (N, D) in blocks of sixteen: ten rows of sixteen lanes.

        Raises BodyError where poses are not (N, D) with enough parameters, or not finite.
        """
        poses = np.ascontiguousarray(poses, dtype=np.float64)
        if poses.ndim != 2 or poses.shape[1] < self.program.dimension:
            need = f"(N, {self.program.dimension})"
            raise BodyError(
                f"Poses of shape {poses.shape} do not fit the body.", f"Give an array of shape {need}."
            )
        if not np.isfinite(poses.sum()) and not np.isfinite(poses).all():
            row, column = np.argwhere(~np.isfinite(poses))[0]
            raise BodyError(
                f"Parameter {column} of pose {row} is {poses[row, column]}, which is no number.",
                "Give finite poses.",
            )
        count = -(-len(poses) // LANES)
        out = np.empty((count, len(self.cameras), self.limb_count, ROWS * LANES), dtype=np.float32)
        run_blocks(
            chunk_outlines,
            all_outlines,
            count,
            BLOCKS_A_THREAD,
            *(poses, *self.program.arguments, self._camera_table, out),
        )
        return out

    def corners(self, poses: Array) -> tuple[Array, NDArray[np.int8]]:
        """Corners A0, A1, B1, B0 (N, V, L, 4, 2) pixels, and how each limb is seen (N, V, L): 1 wholly inside
        the picture, 0 not wholly, -1 not at all (behind the camera or out of its lens: corners are NaN).
        """
        blocks = self.blocks(poses)
        count, views, limbs = blocks.shape[:3]
        rows = blocks.reshape(count, views, limbs, ROWS, LANES).transpose(0, 4, 1, 2, 3)
        rows = rows.reshape(count * LANES, views, limbs, ROWS)[: len(poses)]
        seen = np.round(rows[..., SEEN_ROW]).astype(np.int8)
        corners = rows[..., :8].astype(np.float64).reshape(*seen.shape, 4, 2)
        corners[seen < 0] = np.nan
        return corners, seen


def camera_table(cameras: tuple[Camera, ...]) -> Floats:
    """(V, 30) rows for the kernels: rotation (9), translation (3), then as named in the code."""
    table = np.zeros((len(cameras), CAMERA_COLUMNS))
    for row, camera in zip(table, cameras, strict=True):
        matrix = camera.matrix
        k1, k2, p1, p2, k3 = camera.distortion
        row[0:9], row[9:12] = camera.rotation.ravel(), camera.translation
        row[12:15] = matrix[0, 0], matrix[0, 1], matrix[0, 2]
        row[15], row[21] = matrix[1, 1], matrix[1, 2]
        row[16:21] = k1, k2, p1, p2, k3
        row[22] = monotone_limit(float(k1), float(k2), float(k3))
        row[24:26] = camera.width - 0.5, camera.height - 0.5
        row[27:30] = camera.centre
    return table.astype(np.float32)


def monotone_limit(k1: float, k2: float, k3: float) -> float:
    """The squared tangent up to which radial distortion moves points outwards, at most WIDEST_VIEW.

    Beyond it the polynomial folds back and would draw what lies outside the picture into it. The first
    positive root of d/dr [r (1 + k1 r² + k2 r⁴ + k3 r⁶)] = 1 + 3 k1 s + 5 k2 s² + 7 k3 s³, s = r²."""
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
    return float(min(real.min(initial=WIDEST_VIEW), WIDEST_VIEW))
