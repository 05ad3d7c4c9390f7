"""The knobs of the visual hull. Its evidence is chosen by the knobs of `evidence.settings`."""

from dataclasses import dataclass

from studio.evidence.yuv_background import SHADOW
from studio.foundations.knobs import next_frame_knob


@dataclass(frozen=True, slots=True)
class HullSettings:
    """How the hull is carved (section 6.1)."""

    title = "Visual hull"

    hull_depth: int = next_frame_knob(
        7,
        5,
        8,
        1,
        label="octree depth",
        help="The tracking space is cut into 2 to this power voxels a side: 6 coarse and fast, 8 fine and slow.",
    )
    hull_confidence: float = next_frame_knob(
        0.99,
        0.5,
        0.99999,
        0.00001,
        label="confidence",
        help="Eq. 5's α: the share of background areas that are classified as background.",
    )
    hull_shadow: float = next_frame_knob(
        SHADOW,
        0.0,
        0.9,
        0.01,
        label="shadow",
        help="Share of the luminance that a shadow takes away; 0.1 in the paper.",
    )
    hull_deepest_shadow: float = next_frame_knob(
        0.4,
        0.0,
        0.9,
        0.01,
        label="deepest shadow",
        help="Beyond the paper: every darker shade of the background's own colour down to this share taken away is"
        " shadow too; 0 = off, the paper's two Gaussians only.",
    )
    hull_sampling: float = next_frame_knob(
        1.0,
        0.25,
        8.0,
        0.25,
        label="samples",
        unit="√px",
        help="Samples of a voxel's projection: this many times the square root of its area; 1 as in the paper.",
    )
    hull_edge_share: float = next_frame_knob(
        0.25,
        0.05,
        1.0,
        0.05,
        label="edge share",
        help="A voxel of the last depth is kept when this share of its samples is foreground in every view.",
    )
    hull_least_views: int = next_frame_knob(
        3,
        1,
        32,
        1,
        label="least views",
        help="Voxels seen by fewer cameras are carved (of fewer cameras: by all).",
    )
