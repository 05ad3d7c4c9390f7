"""Edges and bidirectional silhouette: the fitness of Fleischmann, Austvoll & Kwolek 2012, section 2.2.

    f   = f_s + f_e                                                    0...2, each averaged over the views
    f_s = 1/2 Y / (B + Y) + 1/2 Y / (R + Y)                            0...1, by exact areas
    f_e = mean of the edge map over samples along the visible edges    0...1

Y is the area of both the projected and the observed silhouette, B of the projected one only, R of the observed one
only (`silhouette_areas`); which edges count, in which stage, is in `visible_edges`. A swarm maximises f; for other
trackers log w = scale · f.

**Where nothing is seen.** 0 / 0 is 0: a view whose silhouette is empty, or in which nothing of the body is seen, adds
nothing to f_s. What of the body lies outside the picture counts in B, and a limb that reaches behind a camera as a
whole picture, so that no pose gains by leaving a picture: for a body that lies within it this is the paper's f_s.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import next_frame_knob
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.edge_region_kernels import CHUNK
from studio.search.likelihood.edge_silhouette_kernels import fitness_blocks
from studio.search.likelihood.evidence_check import check_views
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.problem import WHOLE_BODY, BaseFrameLikelihood, Preparation, Shares
from studio.search.likelihood.silhouette_areas import Silhouettes, resolution_knob, silhouettes_of
from studio.search.likelihood.visible_edges import EdgeMaps, body_edges

BLOCKS_A_THREAD = 8
"""About half a millisecond of ten limbs in four pictures."""


@dataclass(frozen=True, slots=True)
class EdgeSilhouetteSettings:
    """Knobs of the edge and silhouette fitness. A frame's problem is made once, so all take effect with the next
    frame.
    """

    title: ClassVar[str] = "Edge and silhouette"

    fitness_scale: float = next_frame_knob(
        25.0,
        0.5,
        200.0,
        0.5,
        help="log w = scale · f; at 25 a tenth of Condensation's particles survives. The studio's own trackers choose"
        " their own exponent, so it changes numbers on screen only.",
    )
    silhouette_resolution: str = resolution_knob()
    samples_per_edge: int = next_frame_knob(
        16,
        16,
        64,
        16,
        help="Samples on each edge in each view (to the nearest 16).",
    )

    @property
    def edge_chunks(self) -> int:
        """Samples on each edge, in units of sixteen."""
        return max(1, round(self.samples_per_edge / CHUNK))


class EdgeSilhouetteLikelihood(Preparation):
    """Makes the likelihood of any frame."""

    def __init__(
        self, body: BodyModel, cameras: tuple[Camera, ...], settings: EdgeSilhouetteSettings
    ) -> None:
        super().__init__(body, cameras, settings)
        self.edges = body_edges(body)

    def problem(self, evidence: FrameEvidence) -> "EdgeSilhouetteFrameLikelihood":
        """One frame as a function of poses. Raises FootageError where views do not fit the cameras."""
        check_views(self.cameras, evidence)
        silhouettes = silhouettes_of(evidence, self.settings.silhouette_resolution)
        return EdgeSilhouetteFrameLikelihood(self, silhouettes, EdgeMaps(evidence))


class EdgeSilhouetteFrameLikelihood(BaseFrameLikelihood):
    """One frame as a function of poses."""

    def __init__(
        self, likelihood: EdgeSilhouetteLikelihood, silhouettes: Silhouettes, edges: EdgeMaps
    ) -> None:
        self.likelihood, self.silhouettes, self.edges = likelihood, silhouettes, edges
        self.priors = likelihood.priors

    def terms(self, poses: Array, stage: int = WHOLE_BODY) -> tuple[Array, Array]:
        """f_s and f_e, each (N, V), of poses (N, D). Raises BodyError for poses that are no finite (N, D)."""
        likelihood = self.likelihood
        outlines = likelihood.projector.blocks(poses)
        edges, chunks = likelihood.edges.of_stage(stage), likelihood.settings.edge_chunks
        areas = self.silhouettes.areas(outlines, len(poses))
        return areas.fitness(), self.edges.fitness(outlines, edges, chunks, len(poses))

    def shares(self, poses: Array) -> Shares:
        """scale / V · f_e and scale / V · f_s of each of the V cameras."""
        silhouette, edge = self.terms(poses)
        names = tuple(camera.name for camera in self.likelihood.cameras)
        factor = self.likelihood.settings.fitness_scale / len(names)
        return Shares(names, ("edge", "silhouette"), factor * np.stack([edge, silhouette], axis=2))

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) f = f_s + f_e of poses (N, D), 0...2. Raises BodyError for poses that are no finite (N, D)."""
        projector, silhouettes = self.likelihood.projector, self.silhouettes
        poses = projector.checked(poses)
        fitness = np.empty(len(poses))
        edges = self.likelihood.edges.of_stage(stage), self.likelihood.settings.edge_chunks, self.edges.maps
        areas = silhouettes.scale, silhouettes.maps, silhouettes.pixels
        given = poses, projector.program, projector.camera_table, *edges, *areas, fitness
        parallel_blocks(fitness_blocks, -(-len(poses) // LANES), BLOCKS_A_THREAD, *given)
        return fitness

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) log-weights scale · f of poses (N, D). Raises BodyError for poses that are no finite (N, D)."""
        return self.likelihood.settings.fitness_scale * self.fitness(poses, stage)
