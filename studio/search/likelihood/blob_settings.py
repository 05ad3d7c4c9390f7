"""The knobs of the blobs' likelihood: carving of the hull, learning and fitting of blobs."""

from dataclasses import dataclass
from typing import ClassVar

from studio.evidence.volume.reconstruction import HullSettings
from studio.foundations.knobs import next_frame_knob


@dataclass(frozen=True, slots=True)
class BlobSettings(HullSettings):
    """Knobs of hull and blobs. A frame's problem is made once, so all take effect with the next."""

    title: ClassVar[str] = "Blobs"

    blob_sharpness: float = next_frame_knob(
        1.0,
        0.1,
        20.0,
        0.1,
        label="sharpness",
        help="A pose weighs 1 / D to this power; the paper's is 1.",
    )
    blob_starts: int = next_frame_knob(
        6,
        1,
        32,
        1,
        label="fits a frame",
        help="Most expected poses that blobs are fitted from; the likeliest fit is kept.",
    )
    blob_iterations: int = next_frame_knob(
        8,
        1,
        50,
        1,
        label="K-means steps",
        help="Most iterations of assigning voxels to blobs and updating the blobs; a converged fit ends earlier.",
    )
    blob_learning: int = next_frame_knob(
        20,
        0,
        200,
        1,
        label="learning frames",
        unit="frames",
        help="Number of first frames from which blobs are learnt; 0 = keep the cones, without colours.",
    )
    blob_split: float = next_frame_knob(
        12.0,
        2.0,
        120.0,
        1.0,
        label="split a blob at",
        unit="grey levels",
        help="While blobs are learnt, one whose colour changes along the bone by more than this over a standard"
        " deviation becomes two; below half of it two become one.",
    )
    blob_parts: int = next_frame_knob(
        3,
        1,
        8,
        1,
        label="most blobs a limb",
        help="A limb is never split into more blobs than this.",
    )
    blob_lost: float = next_frame_knob(
        1.5,
        0.1,
        50.0,
        0.1,
        label="lost below",
        unit="nats/voxel",
        help="The tracker counts as lost where the voxels' likelihood lies this far below the learnt blobs' own.",
    )
