"""That a frame's evidence belongs to the cameras it is weighed with."""

from studio.errors import FootageError
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera


def check_views(cameras: tuple[Camera, ...], evidence: FrameEvidence, edges: bool = True) -> None:
    """Raises FootageError where views are missing, or their maps' sizes are not the cameras'.

    edges : whether the edge maps are looked at.
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
