"""The score of PARSEC's bodytrack benchmark, published with the Lee-walk data, as a likelihood.

E = E_edge + E_inside, lower is better; two plain averages over all samples pooled over limbs and cameras:

* E_edge: n = max(4, round(length / 5 px)) intervals along each straight side of a limb's outline, n + 1
  samples with both ends; error ((255 - e) / 255)² of the benchmark's edge map e (`evidence.edges`).
* E_inside: rows of max(4, round(side / 10 px)) intervals with both ends, columns at j / n of the width,
  j = 0 ... n - 1, n = max(4, round(middle width / 10 px)); error 1 where the mask is 0.

Samples outside a picture are skipped and not counted, as in the benchmark; so is a limb that reaches behind a
camera. A pose of which no camera sees anything has the worst score, 1 + 1.

log w = -(a E_edge + b E_inside), a = b = 1 being the benchmark's: there is no other factor, since the
annealed filter finds its own exponent β and Condensation its own likelihood scale. `device` has a graphics card find
it (`device_score_kernels`).
"""

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import next_frame_knob
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.bodytrack_kernels import EDGE_STEP, MOST_ROWS, score_blocks
from studio.search.likelihood.devices import DeviceFrameLikelihood, DevicePreparation, device_knob
from studio.search.likelihood.edge_region_kernels import CHUNK
from studio.search.likelihood.evidence_check import check_views
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps, joined_maps
from studio.search.likelihood.problem import POOLED, Shares

if TYPE_CHECKING:
    from studio.search.likelihood.device_weighing import ProblemOnDevice

IntArray = NDArray[np.int64]

SCORE_MODULE = "studio.search.likelihood.device_score"
FULL = 255 * 255
# The buffer holds at least one side, or one column of the grid, of any length; more samples than this of a kind in
# one view come from a limb that fills many pictures, and are left out.
LEAST_CAPACITY = 1 << 14
# About half a millisecond of a four-camera frame.
BLOCKS_A_THREAD = 8


@dataclass(frozen=True, slots=True)
class BodytrackSettings:
    """Knobs of the benchmark's score. A frame's problem is made once, so all take effect with the next."""

    title: ClassVar[str] = "Benchmark's score"

    score_edge_weight: float = next_frame_knob(
        1.0, 0.0, 5.0, 0.05, help="Weight of E_edge; the benchmark's is 1."
    )
    score_inside_weight: float = next_frame_knob(
        1.0, 0.0, 5.0, 0.05, help="Weight of E_inside; the benchmark's is 1."
    )
    device: str = device_knob()


@dataclass(frozen=True, slots=True)
class Score:
    """The benchmark's score of one pose: total = edge + inside. edge_samples, inside_samples : how many
    counted.
    """

    total: float
    edge: float
    inside: float
    edge_samples: int
    inside_samples: int


class BodytrackLikelihood(DevicePreparation):
    """Makes the likelihood of any frame."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...], settings: BodytrackSettings) -> None:
        super().__init__(body, cameras, settings)
        projector = self.projector
        self.choose_device(
            lambda _: importlib.import_module(SCORE_MODULE).ScoreDevice(
                projector.program, projector.camera_table
            )
        )

    def problem(self, evidence: FrameEvidence) -> "BodytrackFrameLikelihood":
        """One frame as a function of poses; its edge maps are the benchmark's.

        Raises FootageError where views do not fit the cameras.
        """
        check_views(self.cameras, evidence)
        return BodytrackFrameLikelihood(self, score_maps(evidence))


class BodytrackFrameLikelihood(DeviceFrameLikelihood):
    """One frame as a function of poses."""

    def __init__(self, likelihood: BodytrackLikelihood, maps: Maps) -> None:
        self.likelihood, self.maps = likelihood, maps
        settings = likelihood.settings
        self._factors = settings.score_edge_weight, settings.score_inside_weight, 0.0
        super().__init__(likelihood, lambda device: device.frame(maps))

    def on_device(self) -> "ProblemOnDevice | None":
        """This frame's likelihood there, for a search that keeps its particles there; None where there is no device."""
        return self.problem_there(self._factors, None, 1)

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights. Raises BodyError for poses that are no finite (N, D)."""
        weights = self.device_weights(poses, self._factors)
        if weights is not None:
            return weights[1]
        edge, inside, _ = self.terms(np.asarray(poses, dtype=np.float64))
        settings = self.likelihood.settings
        return -(settings.score_edge_weight * edge + settings.score_inside_weight * inside)

    def shares(self, poses: Array) -> Shares:
        """-a E_edge and -b E_inside; their samples are pooled over the cameras."""
        edge, inside, _ = self.terms(np.asarray(poses, dtype=np.float64))
        settings = self.likelihood.settings
        values = np.stack(
            [-settings.score_edge_weight * edge, -settings.score_inside_weight * inside], axis=1
        )
        return Shares((POOLED,), ("edge", "inside"), values[:, None])

    def terms(self, poses: Array) -> tuple[Array, Array, IntArray]:
        """E_edge (N,), E_inside (N,) and the samples counted of each (N, 2), of poses (N, D), by the processor."""
        outlines = self.likelihood.projector.blocks(poses)
        sums = np.zeros((len(outlines), LANES, 4), dtype=np.int64)
        blocks, capacity = len(outlines), self._capacity
        given = outlines, self.maps, capacity, MOST_ROWS
        parallel_blocks(score_blocks, blocks, BLOCKS_A_THREAD, *given, sums)
        sums = sums.reshape(-1, 4)[: len(poses)]
        counts = np.maximum(sums[:, 1::2], 1)
        edge = np.where(sums[:, 1] > 0, sums[:, 0] / (FULL * counts[:, 0]), 1.0)
        inside = np.where(sums[:, 3] > 0, sums[:, 2] / counts[:, 1], 1.0)
        return edge, inside, sums[:, 1::2]

    def score(self, pose: Array) -> Score:
        """The benchmark's own score of one pose (D,), without the settings' weights."""
        edge, inside, counts = self.terms(np.asarray(pose, dtype=np.float64)[None])
        both = float(edge[0]), float(inside[0])
        return Score(both[0] + both[1], *both, int(counts[0, 0]), int(counts[0, 1]))

    @property
    def _capacity(self) -> int:
        """Room for every limb running across its picture, and a grid over it."""
        longest = int(np.hypot(*self.maps.views[:, 2:].T).max() / EDGE_STEP)
        limbs = self.likelihood.projector.limb_count
        return (max(LEAST_CAPACITY, 2 * limbs * longest) + CHUNK) // CHUNK * CHUNK


def score(body: BodyModel, cameras: tuple[Camera, ...], evidence: FrameEvidence, pose: Array) -> Score:
    """The benchmark's score of one pose (D,) in one frame, whose edge maps are the benchmark's."""
    return BodytrackLikelihood(body, cameras, BodytrackSettings()).problem(evidence).score(pose)


def score_maps(evidence: FrameEvidence) -> Maps:
    """Maps of (255 - e)² and of "no foreground" of all views, each followed by a 0."""
    errors = ((255 - np.arange(256)) ** 2).astype(np.uint16)
    return joined_maps([[(v.edges, errors), (v.mask == 0, None)] for v in evidence.views], (0,), np.uint16)
