"""Checks that pictures are not too large for the kernels, and that a frame's evidence fits its cameras."""

from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera

# Kernels work out pixel numbers in single precision, exact up to 2^24, and keep a few for entries that are no
# pixel.
LARGEST_PICTURE = 2**24 - 16


def check_sizes(cameras: tuple[Camera, ...]) -> None:
    """Raises FootageError for a camera whose pictures have more pixels than the kernels can number."""
    for camera in cameras:
        if camera.width * camera.height > LARGEST_PICTURE:
            size = f"{camera.width} × {camera.height}"
            raise FootageError(
                f"Pictures of camera '{camera.name}' are {size}, more than 16.7 million pixels.",
                "Import the footage at a smaller size.",
            )


def check_views(cameras: tuple[Camera, ...], evidence: FrameEvidence, edges: bool = True) -> None:
    """Raises FootageError where views are missing, or their maps' sizes are not the cameras'.

    edges : whether the edge maps are checked.
    """
    names = [view.camera for view in evidence.views]
    if names != [camera.name for camera in cameras]:
        raise FootageError(
            f"Frame {evidence.frame} has views {', '.join(names) or 'of no camera'}.",
            f"It needs one of each camera, in this order: {', '.join(camera.name for camera in cameras)}.",
        )
    for camera, view in zip(cameras, evidence.views, strict=True):
        for kind, picture in (("mask", view.mask), ("edge map", view.edges if edges else view.mask)):
            if picture.shape != (camera.height, camera.width):
                size = " × ".join(str(length) for length in reversed(picture.shape))
                raise FootageError(
                    f"The {kind} of camera '{camera.name}' in frame {evidence.frame} is {size} pixels.",
                    f"Its calibration is for {camera.width} × {camera.height}.",
                )
