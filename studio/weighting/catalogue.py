"""The weightings by name. A new one is one file and one line here."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.weighting.blob_settings import BlobSettings
from studio.weighting.blobs import BlobWeigher
from studio.weighting.bodytrack import BodytrackSettings, BodytrackWeigher
from studio.weighting.edge_region import EdgeRegionSettings, EdgeRegionWeigher
from studio.weighting.edge_region_silhouette import EdgeRegionSilhouetteSettings, EdgeRegionSilhouetteWeigher
from studio.weighting.edge_silhouette import EdgeSilhouetteSettings, EdgeSilhouetteWeigher
from studio.weighting.problem import FrameFunction
from studio.weighting.template import TemplateSettings, TemplateWeigher


class Weigher(Protocol):
    """A weighting made ready for one body, some cameras and some settings."""

    def problem(self, evidence: FrameEvidence) -> FrameFunction:
        """One frame as a function of poses."""
        ...


@dataclass(frozen=True, slots=True)
class Weighting:
    """One way of weighing poses. edge_kind : the edge map it reads, or "hull" where it carves one
    (`evidence.pipeline`). reads_pictures : whether it looks at the pictures themselves, not only at masks and edges.

    settings_type : its knobs. prepare : (body, cameras, settings of that type) to a `Weigher`.
    """

    name: str
    label: str
    settings_type: type
    edge_kind: str
    prepare: Callable[[BodyModel, tuple[Camera, ...], Any], Weigher]
    reads_pictures: bool = False


WEIGHTINGS: dict[str, Weighting] = {
    entry.name: entry
    for entry in (
        Weighting("edge-region", "Edges and region", EdgeRegionSettings, "proximity", EdgeRegionWeigher),
        Weighting(
            "edge-silhouette",
            "Edges and silhouette",
            EdgeSilhouetteSettings,
            "proximity",
            EdgeSilhouetteWeigher,
        ),
        Weighting(
            "edge-region-silhouette",
            "Edges, region and silhouette",
            EdgeRegionSilhouetteSettings,
            "proximity",
            EdgeRegionSilhouetteWeigher,
        ),
        Weighting("bodytrack", "Benchmark's score", BodytrackSettings, "bodytrack", BodytrackWeigher),
        Weighting("template", "Template and silhouette", TemplateSettings, "none", TemplateWeigher),
        Weighting(
            "blobs", "Blobs of the visual hull", BlobSettings, "hull", BlobWeigher, reads_pictures=True
        ),
    )
}
