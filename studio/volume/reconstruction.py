"""Hull settings and the reconstruction's door (being built)."""

from dataclasses import dataclass

from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.knobs import knob
from studio.volume.hull import Hull
from studio.volume.tracking_space import Box

NEXT_FRAME = "next frame"


@dataclass(frozen=True, slots=True)
class HullSettings:
    """How the hull is carved (section 6.1)."""

    title = "Visual hull"

    hull_depth: int = knob(
        7,
        5,
        8,
        1,
        label="octree depth",
        takes_effect=NEXT_FRAME,
        help="The tracking space is cut into 2 to this power voxels a side: 6 coarse and fast, 8 fine and slow.",
    )


class Reconstructor:
    """Carves hulls for some cameras, a tracking space and settings: build it once, use it for every frame."""

    def __init__(self, cameras: tuple[Camera, ...], box: Box, settings: HullSettings) -> None:
        self.cameras, self.box, self.settings = cameras, box, settings

    def hull(self, evidence: FrameEvidence) -> Hull:
        """The hull of one frame."""
        raise NotImplementedError


def reconstruct(
    evidence: FrameEvidence, cameras: tuple[Camera, ...], box: Box, settings: HullSettings | None = None
) -> Hull:
    """The hull of one frame; `Reconstructor` does the same for many."""
    return Reconstructor(cameras, box, settings or HullSettings()).hull(evidence)
