"""The likelihoods by name: a new one is one file and one line here, or a package's entry point (`registry`)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import EDGE_KINDS, FrameEvidence
from studio.foundations.errors import SettingsError
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import knobs_of
from studio.foundations.registry import Registry
from studio.search.likelihood.blob_settings import BlobSettings
from studio.search.likelihood.blobs import BlobLikelihood
from studio.search.likelihood.bodytrack import BodytrackLikelihood, BodytrackSettings
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.edge_silhouette import EdgeSilhouetteLikelihood, EdgeSilhouetteSettings
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.likelihood.template import TemplateLikelihood, TemplateSettings


class Likelihood(Protocol):
    """A likelihood prepared for one body, some cameras and some settings."""

    def problem(self, evidence: FrameEvidence) -> FrameLikelihood:
        """One frame as a function of poses."""
        ...


@dataclass(frozen=True, slots=True)
class LossLimit:
    """How far below a run's usual weight a frame is lost (`search.trackers.loss_detection`).

    spread : usual standard deviation of the log weight over well tracked frames.
    spreads : how many of them below the median is lost. The defaults are for a likelihood that was not measured.
    """

    spread: float = 0.1
    spreads: float = 6.0


@dataclass(frozen=True, slots=True)
class Weighting:
    """One way of weighing poses.

    edge_kind : the edge map it reads, or "hull" where it carves one (`evidence.pipeline`).
    reads_pictures : whether it uses the pictures themselves, not only masks and edges.
    settings_type : its knobs.
    prepare : (body, cameras, settings of that type) to a `Likelihood`.
    loss : when a frame is lost.
    """

    name: str
    label: str
    settings_type: type
    edge_kind: str
    prepare: Callable[[BodyModel, tuple[Camera, ...], Any], Likelihood]
    loss: LossLimit = LossLimit()
    reads_pictures: bool = False


def _check(weighting: Weighting) -> None:
    """Raise SettingsError for an unknown kind of evidence."""
    if weighting.edge_kind not in EDGE_KINDS:
        raise SettingsError(f"there are no edges '{weighting.edge_kind}', only {', '.join(EDGE_KINDS)}")
    knobs_of(weighting.settings_type)


_OWN = (
    Weighting(
        "edge-region",
        "Edges and region",
        EdgeRegionSettings,
        "proximity",
        EdgeRegionLikelihood,
        LossLimit(0.09, 5.0),
    ),
    Weighting(
        "edge-silhouette",
        "Edges and silhouette",
        EdgeSilhouetteSettings,
        "proximity",
        EdgeSilhouetteLikelihood,
        LossLimit(0.6, 4.5),
    ),
    Weighting(
        "edge-region-silhouette",
        "Edges, region and silhouette",
        EdgeRegionSilhouetteSettings,
        "proximity",
        EdgeRegionSilhouetteLikelihood,
        LossLimit(0.1, 5.5),
    ),
    Weighting(
        "bodytrack",
        "Benchmark's score",
        BodytrackSettings,
        "bodytrack",
        BodytrackLikelihood,
        LossLimit(0.02, 5.5),
    ),
    Weighting(
        "template",
        "Template and silhouette",
        TemplateSettings,
        "none",
        TemplateLikelihood,
        LossLimit(0.001, 5.0),
    ),
    Weighting(
        "blobs",
        "Blobs of the visual hull",
        BlobSettings,
        "hull",
        BlobLikelihood,
        LossLimit(0.12, 4.5),
        reads_pictures=True,
    ),
)
WEIGHTINGS: Registry[Weighting] = Registry("weighting", "studio.weightings", Weighting, _OWN, _check)
