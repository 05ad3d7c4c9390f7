# pyright: standard
"""Weights of poses on a CUDA device by the benchmark's score: as `device_weighing`, by other sums."""

import functools
from typing import Any

from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_on_devices import cuda
from studio.search.likelihood.device_score_kernels import score_kernel, weigh_scores
from studio.search.likelihood.device_weighing import POSES_A_BLOCK, Memory, ProblemOnDevice, WeighingDevice
from studio.search.likelihood.kinematic_program import KinematicProgram

__all__ = ["ScoreDevice"]


@functools.cache
def score_weights() -> Any:  # noqa: ANN401 - Numba's
    """`weigh_scores` for the device, compiled by its first launch in a process."""
    return cuda.jit(weigh_scores)


class ScoreDevice(WeighingDevice):
    """Weights of one body in some cameras by the benchmark's score. Its frames have the maps of `score_maps`."""

    def __init__(self, program: KinematicProgram, cameras: CameraTable) -> None:
        """Raises StudioError for a body with too many limbs."""
        super().__init__(program, cameras, (1, 1))
        self._kernel = score_kernel(len(program.limb_frame))

    def weigh(
        self,
        poses: Any,  # noqa: ANN401
        problem: ProblemOnDevice,
        edges: Any,  # noqa: ANN401
        every: int,
        found: Any,  # noqa: ANN401
        stream: Any,  # noqa: ANN401
        memory: Memory,
    ) -> None:
        """Fill found (2, N) there with log-weights, twice, of poses (D, N) there; as `sum_maps`."""
        sums = self.sum_maps(poses, problem.frame, edges, every, stream, memory)
        grid = -(-poses.shape[1] // POSES_A_BLOCK), POSES_A_BLOCK, stream
        score_weights()[grid](sums, self.constant(*problem.factors), found)
