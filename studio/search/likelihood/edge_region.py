"""The edge and region likelihood of Deutscher & Reid 2005, section 4.2.

    Σe = 1/N Σ (1 - p)²    over samples along the sides of the projected cones, p from the edge map  (Eq. 14)
    Σr = 1/N Σ (1 - p)²    over samples within them, p from the foreground map                       (Eq. 15)
    log w = - Σ over cameras of (a Σe + b Σr)                                                    (Eq. 16, 17)

Eq. 17 is printed without the minus sign of Eq. 16; it belongs there, else the worst pose weighs most. The
paper's weights are a = b = 1 ("an equal weighting to each component was determined empirically").

Every limb has the same number of samples in every view, spread evenly: `edge_samples` on its two sides
together, `region_samples` on three lines within (Fig. 6).

**Where nothing is seen.** N is the same for every pose: a sample outside the picture, or of a limb that
reaches behind a camera or out of its lens, reads p = 0, the worst there is. So no pose gains by leaving a
picture, a view that sees nothing of the body costs a + b, and log w lies between -(a + b) × cameras and 0 for
any finite pose. Leaving such samples out instead, as the benchmark does, rewards hiding; the cost of not
doing so is small: with all four Lee-walk pictures cut off below the hips the best root position moves by 20
mm.

**On a device.** `device` has the poses weighed on a graphics card (`devices`; `device_weighing_kernels` says how equal
the sums are).

**Occlusion-aware edges.** A side that passes behind a nearer limb makes no edge in the picture. With the
option on, such samples are left out of Eq. 14 and its N (of that view and pose) counts the others; if none is
left, Σe = 1.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence, half_mask
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import next_frame_knob
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.devices import DeviceFrameLikelihood, DevicePreparation, device_knob
from studio.search.likelihood.edge_region_kernels import (
    CHUNK,
    EDGE_LINES,
    REGION_LINES,
    WORST,
    record_indices,
    weight_blocks,
)
from studio.search.likelihood.evidence_check import check_views
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps, joined_maps
from studio.search.likelihood.problem import Shares
from studio.search.likelihood.silhouette_areas import Areas, Silhouettes
from studio.search.likelihood.visible_edges import hidden_samples, limb_sides

if TYPE_CHECKING:
    from studio.search.likelihood.device_weighing import ProblemOnDevice

IntArray = NDArray[np.int64]
Words = NDArray[np.uint32]

# About half a millisecond of a four-camera frame.
BLOCKS_A_THREAD = 24


@dataclass(frozen=True, slots=True)
class EdgeRegionSettings:
    """Knobs of the edge and region likelihood. A frame's problem is made once, so all take effect with the
    next.
    """

    title: ClassVar[str] = "Edge and region"

    edge_weight: float = next_frame_knob(
        1.0,
        0.0,
        5.0,
        0.05,
        help="Weight of the edge term, Eq. 14; the paper's is 1.",
    )
    region_weight: float = next_frame_knob(
        1.0,
        0.0,
        5.0,
        0.05,
        help="Weight of the silhouette term, Eq. 15; the paper's is 1.",
    )
    edge_samples: int = next_frame_knob(
        32, 32, 128, 32, help="Edge samples a limb and view (to the nearest 32)."
    )
    region_samples: int = next_frame_knob(
        48, 48, 192, 48, help="Region samples a limb and view (to the nearest 48)."
    )
    occlusion_aware: bool = next_frame_knob(
        False,
        help="Leave out edge samples that nearer limbs hide; takes two to three times as long.",
    )

    device: str = device_knob()

    @property
    def edge_chunks(self) -> int:
        """Samples on each side, in units of sixteen."""
        return max(1, round(self.edge_samples / (EDGE_LINES * CHUNK)))

    @property
    def region_chunks(self) -> int:
        """Samples on each inner line, in units of sixteen."""
        return max(1, round(self.region_samples / (REGION_LINES * CHUNK)))


class EdgeRegionLikelihood(DevicePreparation):
    """Makes that of any frame."""

    def __init__(
        self, body: BodyModel, cameras: tuple[Camera, ...], settings: EdgeRegionSettings, areas: bool = False
    ) -> None:
        """areas : whether a device finds the areas of silhouettes, too."""
        super().__init__(body, cameras, settings)
        projector, chunks = self.projector, (settings.edge_chunks, settings.region_chunks)
        self.choose_device(
            lambda module: module.WeighingDevice(
                projector.program, projector.camera_table, chunks, areas, settings.occlusion_aware
            )
        )

    @property
    def samples_per_evaluation(self) -> int:
        """Map reads of one pose."""
        settings = self.settings
        chunks = EDGE_LINES * settings.edge_chunks + REGION_LINES * settings.region_chunks
        return chunks * CHUNK * self.projector.limb_count * len(self.cameras)

    def problem(
        self, evidence: FrameEvidence, silhouettes: Silhouettes | None = None
    ) -> "EdgeRegionFrameLikelihood":
        """One frame as a function of poses. silhouettes : of the frame, where a device finds areas, too.

        Raises FootageError where views do not fit the cameras.
        """
        check_views(self.cameras, evidence)
        return EdgeRegionFrameLikelihood(self, weighting_maps(evidence), silhouettes)


class EdgeRegionFrameLikelihood(DeviceFrameLikelihood):
    """One frame as a function of poses."""

    def __init__(self, likelihood: EdgeRegionLikelihood, maps: Maps, silhouettes: Silhouettes | None) -> None:
        self.likelihood, self.maps = likelihood, maps
        super().__init__(likelihood, lambda device: device.frame(maps, silhouettes))

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights, Eq. 17. Raises BodyError for poses that are no finite (N, D)."""
        settings = self.likelihood.settings
        weights = self.device_weights(poses, (settings.edge_weight, settings.region_weight, 0.0))
        if weights is not None:
            return weights[1]
        outlines = self.likelihood.projector.blocks(poses)
        return self._evaluated(outlines, self.hidden(outlines), len(poses))[1]

    def terms(self, poses: Array) -> tuple[Array, Array]:
        """Σe and Σr, each (N, V), of poses (N, D)."""
        terms = self.device_terms(poses)
        if terms is not None:
            return terms[:2]
        outlines = self.likelihood.projector.blocks(poses)
        return self.terms_of(outlines, self.hidden(outlines), len(poses))

    def shares(self, poses: Array) -> Shares:
        """-a Σe and -b Σr of every camera."""
        edge, region = self.terms(poses)
        settings, names = self.likelihood.settings, tuple(camera.name for camera in self.likelihood.cameras)
        values = np.stack([-settings.edge_weight * edge, -settings.region_weight * region], axis=2)
        return Shares(names, ("edge", "region"), values)

    def terms_of(
        self, outlines: NDArray[np.float32], hidden: NDArray[np.uint64], count: int
    ) -> tuple[Array, Array]:
        """Σe and Σr, each (N, V), over the limbs in outlines (B, V, L, 160) of N = `count` poses; hidden : of the same
        limbs.
        """
        terms = self._evaluated(outlines, hidden, count)[0]
        return terms[..., 0], terms[..., 1]

    def device_terms(
        self, poses: Array, limbs: NDArray[np.int64] | None = None
    ) -> tuple[Array, Array, Areas] | None:
        """Σe over the edges of some limbs by number (None: all) and Σr, each (N, V), and the areas of poses (N, D),
        found on the device; None where the processor is to find them.

        Raises BodyError for poses that are no finite (N, D), StudioError where a card that was asked for fails.
        """
        return self.from_device("terms", poses, limbs)

    def on_device(self) -> "ProblemOnDevice | None":
        """This frame's likelihood there, for a search that keeps its particles there; None where there is no device."""
        settings = self.likelihood.settings
        return self.problem_there((settings.edge_weight, settings.region_weight, 0.0), None, 1)

    def _evaluated(
        self, outlines: NDArray[np.float32], hidden: NDArray[np.uint64], count: int
    ) -> tuple[Array, Array]:
        """Terms (N, V, 2) and log-weights (N,)."""
        settings = self.likelihood.settings
        blocks, views = outlines.shape[:2]
        terms = np.empty((blocks, LANES, views, 2))
        log_weights = np.empty((blocks, LANES))
        chunks = settings.edge_chunks, settings.region_chunks
        weights = np.array([settings.edge_weight, settings.region_weight])
        given = count, outlines, hidden, *chunks, self.maps, weights
        parallel_blocks(weight_blocks, blocks, BLOCKS_A_THREAD, *given, terms, log_weights)
        return terms.reshape(-1, views, 2)[:count], log_weights.ravel()[:count]

    def recorded_indices(self, outlines: NDArray[np.float32]) -> tuple[Words, Words]:
        """The pixels that the kernel reads, for the benchmark and for tests: (B, V, 16, L, chunks, lines, 16) of
        edges and of regions, numbered from 0 in each picture; see `edge_region_kernels` for numbers beyond it.
        """
        settings = self.likelihood.settings
        blocks, views, limbs = outlines.shape[:3]
        shape = (blocks, views, LANES, limbs)
        edges = np.zeros((*shape, settings.edge_chunks, EDGE_LINES, CHUNK), dtype=np.uint32)
        region = np.zeros((*shape, settings.region_chunks, REGION_LINES, CHUNK), dtype=np.uint32)
        record_indices(outlines, self.hidden(outlines), self.maps.views, edges, region)
        return edges, region

    def hidden(self, outlines: NDArray[np.float32]) -> NDArray[np.uint64]:
        """(B, V, L, 2, 16) a bit for each hidden edge sample; of no blocks where the option is off."""
        blocks, views, limbs = outlines.shape[:3]
        if not self.likelihood.settings.occlusion_aware:
            return np.zeros((0, views, limbs, EDGE_LINES, LANES), dtype=np.uint64)
        samples = self.likelihood.settings.edge_chunks * CHUNK
        hidden = hidden_samples(outlines, limb_sides(limbs), samples)
        return hidden.reshape(blocks, views, limbs, EDGE_LINES, LANES)


def weighting_maps(evidence: FrameEvidence) -> Maps:
    """Edge and foreground maps of all views as 255 (1 - p)², p = value / 255."""
    table = np.round(WORST * (1.0 - np.arange(256) / 255.0) ** 2).astype(np.uint8)
    return joined_maps(
        [[(v.edges, table), (half_mask(v), table)] for v in evidence.views], (WORST, 0), np.uint8
    )
