"""Projected outlines of a body's limbs for many poses, by the outline kernel."""

import copy

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel, KinematicTables, kinematic_tables
from studio.foundations.arrays import Array, Floats
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.kinematic_program import KinematicProgram, compile_program
from studio.search.likelihood.outline_kernels import (
    LANES,
    ROWS,
    outline_blocks,
    read_corners,
    read_slopes,
)

# About half a millisecond of ten limbs in four cameras.
BLOCKS_A_THREAD = 200


class OutlineProjector:
    """Projects one body into some cameras; immutable."""

    def __init__(self, tables: KinematicTables, cameras: tuple[Camera, ...]) -> None:
        self.program = compile_program(tables)
        self.cameras = cameras
        self.camera_table = camera_table(cameras, outward_limit, np.float32)

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
        """Number of drawn limbs."""
        return len(self.program.limb_frame)

    def shaped(self, poses: Array) -> Array:
        """Poses (N, D) in a row. Raises BodyError where they are not (N, D) with enough parameters."""
        poses = np.ascontiguousarray(poses, dtype=np.float64)
        if poses.ndim != 2 or poses.shape[1] < self.program.dimension:
            need = f"(N, {self.program.dimension})"
            raise BodyError(
                f"Poses of shape {poses.shape} do not fit the body.", f"Give an array of shape {need}."
            )
        return poses

    def checked(self, poses: Array) -> Array:
        """As `shaped`; raises BodyError also where a number is not finite."""
        poses = self.shaped(poses)
        if not np.isfinite(poses.sum()) and not np.isfinite(poses).all():
            row, column = np.argwhere(~np.isfinite(poses))[0]
            raise BodyError(
                f"Parameter {column} of pose {row} is {poses[row, column]}, which is not finite.",
                "Give finite poses.",
            )
        return poses

    def blocks(self, poses: Array) -> Floats:
        """(B, V, L, 160) outlines of poses (N, D) in blocks of sixteen: ten rows of sixteen lanes.

        Raises BodyError where poses are not (N, D) with enough parameters, or not finite.
        """
        poses = self.checked(poses)
        count = -(-len(poses) // LANES)
        out = np.empty((count, len(self.cameras), self.limb_count, ROWS * LANES), dtype=np.float32)
        parallel_blocks(outline_blocks, count, BLOCKS_A_THREAD, poses, self.program, self.camera_table, out)
        return out

    def corners(self, poses: Array) -> tuple[Array, NDArray[np.int8]]:
        """Corners A0, A1, B1, B0 (N, V, L, 4, 2) pixels, and how each limb is seen (N, V, L): 1 wholly inside
        the picture, 0 not wholly, -1 not at all (behind the camera or out of its lens: corners are NaN).
        """
        blocks = self.blocks(poses)
        corners = np.empty((len(poses), *blocks.shape[1:3], 4, 2))
        seen = np.empty(corners.shape[:3], dtype=np.int8)
        read_corners(blocks, corners, seen)
        return corners, seen

    def slopes(self, pose: Array, steps: Array, difference: float) -> tuple[Array, Array]:
        """Corners (V, L, 4, 2) of a pose (D,), and their slopes (V, L, 4, 2, D): half the difference between poses one
        step ahead and one behind in each parameter, by `difference`. steps : (D,). As `corners`, NaN where unseen.
        """
        size = len(pose)
        ahead = np.diag(steps)
        blocks = self.blocks(np.concatenate([pose[None], pose + ahead, pose - ahead]))
        corners = np.empty((*blocks.shape[1:3], 4, 2))
        found = np.empty((*corners.shape, size))
        read_slopes(blocks, 2.0 * difference, corners, found)
        return corners, found
