"""Three terms, each 0...1 in every view: edges and region of Deutscher & Reid, bidirectional silhouette of
Fleischmann et al.

    f     = mean over views of  a (1 - Σe) + b (1 - Σr) + c f_s
    log w = - Σ over cameras of (a Σe + b Σr + c (1 - f_s))  =  cameras · (f - a - b - c)

Σe and Σr are those of `edge_region` (Eq. 14 and 15 of Deutscher & Reid 2005), f_s that of `edge_silhouette`
(Fleischmann et al. 2012, section 2.2); the log-weight is Eq. 16 and 17 with a third term. The region compares inside
the model only, f_s in both directions; together, 1 : 1 : 1, they lost the fewest limbs in the prototypes. In the first
stage of a search only the trunk's edges count, the other two terms use the whole body.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import next_frame_knob
from studio.search.likelihood.area_kernels import three_terms
from studio.search.likelihood.edge_region import (
    EdgeRegionFrameLikelihood,
    EdgeRegionLikelihood,
    EdgeRegionSettings,
)
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY, BaseFrameLikelihood, Shares
from studio.search.likelihood.silhouette_areas import Areas, Silhouettes, resolution_knob, silhouettes_of
from studio.search.likelihood.visible_edges import body_edges

if TYPE_CHECKING:
    from studio.search.likelihood.device_weighing import ProblemOnDevice


@dataclass(frozen=True, slots=True)
class EdgeRegionSilhouetteSettings(EdgeRegionSettings):
    """The knobs of edges and region, and the silhouette's. All take effect with the next frame."""

    title: ClassVar[str] = "Edge, region and silhouette"

    silhouette_weight: float = next_frame_knob(
        1.0, 0.0, 5.0, 0.05, help="Weight of the bidirectional silhouette term."
    )
    silhouette_resolution: str = resolution_knob()


class EdgeRegionSilhouetteLikelihood:
    """Makes the likelihood of any frame."""

    def __init__(
        self, body: BodyModel, cameras: tuple[Camera, ...], settings: EdgeRegionSilhouetteSettings
    ) -> None:
        self.settings, self.cameras = settings, cameras
        self.edge_region = EdgeRegionLikelihood(body, cameras, settings, areas=True)
        self.trunk = np.unique(body_edges(body).trunk[:, 0])
        self.weights = settings.edge_weight, settings.region_weight, settings.silhouette_weight

    def problem(self, evidence: FrameEvidence) -> "EdgeRegionSilhouetteFrameLikelihood":
        """One frame as a function of poses. Raises FootageError where views do not fit the cameras."""
        silhouettes = silhouettes_of(evidence, self.settings.silhouette_resolution)
        edge_region = self.edge_region.problem(evidence, silhouettes)
        return EdgeRegionSilhouetteFrameLikelihood(self, edge_region, silhouettes)


class EdgeRegionSilhouetteFrameLikelihood(BaseFrameLikelihood):
    """One frame as a function of poses."""

    def __init__(
        self,
        likelihood: EdgeRegionSilhouetteLikelihood,
        edge_region: EdgeRegionFrameLikelihood,
        silhouettes: Silhouettes,
    ) -> None:
        self.likelihood, self.edge_region, self.silhouettes = likelihood, edge_region, silhouettes
        self.priors = edge_region.priors

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of edges and region."""
        return self.edge_region.notes

    def on_device(self) -> "ProblemOnDevice | None":
        """As that of edges and region."""
        return self.edge_region.problem_there(self.likelihood.weights, self._edges_alone(TRUNK_FIRST), 0)

    def give_up_device(self, error: Exception) -> None:
        """As that of edges and region."""
        self.edge_region.give_up_device(error)

    def terms(self, poses: Array, stage: int = WHOLE_BODY) -> tuple[Array, Array, Array]:
        """1 - Σe, 1 - Σr and f_s, each (N, V), of poses (N, D).

        Raises BodyError for poses that are no finite (N, D).
        """
        edge, region, areas = self._found(poses, stage)
        return 1.0 - edge, 1.0 - region, areas.fitness()

    def _found(self, poses: Array, stage: int) -> tuple[Array, Array, Areas]:
        """Σe and Σr, each (N, V), and the areas of poses (N, D)."""
        trunk = self._edges_alone(stage)
        terms = self.edge_region.device_terms(poses, trunk)
        if terms is not None:
            return terms
        outlines = self.likelihood.edge_region.projector.blocks(poses)
        hidden = self.edge_region.hidden(outlines)
        edge, region = self.edge_region.terms_of(outlines, hidden, len(poses))
        if trunk is not None:
            parts = np.ascontiguousarray(outlines[:, :, trunk]), np.ascontiguousarray(hidden[:, :, trunk])
            edge = self.edge_region.terms_of(*parts, len(poses))[0]
        return edge, region, self.silhouettes.areas(outlines, len(poses))

    def _edges_alone(self, stage: int) -> NDArray[np.int64] | None:
        """The limbs whose edges count alone in a stage, by number; None where all do."""
        trunk = self.likelihood.trunk
        all_count = stage != TRUNK_FIRST or len(trunk) == self.likelihood.edge_region.projector.limb_count
        return None if all_count else trunk

    def shares(self, poses: Array) -> Shares:
        """-a Σe, -b Σr and -c (1 - f_s) of every camera."""
        names, factors = tuple(camera.name for camera in self.likelihood.cameras), self.likelihood.weights
        values = [factor * (term - 1.0) for factor, term in zip(factors, self.terms(poses), strict=True)]
        return Shares(names, ("edge", "region", "silhouette"), np.stack(values, axis=2))

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) f of poses (N, D), between 0 and the sum of the weights."""
        weights = self.likelihood.weights
        weighed = self.edge_region.device_weights(poses, weights, self._edges_alone(stage))
        if weighed is not None:
            return weighed[0]
        edge, region, areas = self._found(poses, stage)
        outside = np.ascontiguousarray(areas.outside)  # one form of the kernel, not two
        found = areas.both, areas.projected, areas.observed, outside
        return three_terms(edge, region, *found, np.array(weights))

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) log-weights of poses (N, D). Raises BodyError for poses that are no finite (N, D)."""
        return len(self.likelihood.cameras) * (self.fitness(poses, stage) - sum(self.likelihood.weights))
