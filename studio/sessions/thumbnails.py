"""A small picture to know a session by: the first camera's middle frame, turned upright."""

from typing import TYPE_CHECKING

import av
import numpy as np

from studio.errors import StudioError

if TYPE_CHECKING:
    from studio.sessions.session import Session

WIDTH = 320
QUALITY = 5


def thumbnail_of(session: "Session") -> bytes | None:
    """JPEG bytes, at most 320 pixels on the longer side; None if the footage or a calibration cannot be
    read."""
    try:
        turns = session.cameras()[0].quarter_turns if session.is_calibrated else 0
        footage = session.footage()
        try:
            picture = footage.picture(footage.cameras[0], footage.frame_count // 2)
        finally:
            footage.close()
    except (StudioError, IndexError):
        return None
    return jpeg(np.rot90(picture, -turns))


def jpeg(picture: np.ndarray, longest: int = WIDTH) -> bytes:
    """A BGR picture (H, W, 3) uint8 as JPEG bytes, its longer side shrunk to `longest` pixels."""
    height, width = picture.shape[:2]
    scale = min(1.0, longest / max(height, width))
    # JPEG's halved colour planes want even sides.
    size = (max(2, round(width * scale / 2) * 2), max(2, round(height * scale / 2) * 2))
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
    small = frame.reformat(width=size[0], height=size[1], format="yuvj420p", interpolation="AREA")
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width, encoder.height = size
    encoder.pix_fmt = "yuvj420p"
    encoder.time_base = 1  # pyright: ignore[reportAttributeAccessIssue]
    encoder.options = {"qmin": str(QUALITY), "qmax": str(QUALITY)}
    packets = [*encoder.encode(small), *encoder.encode(None)]
    return b"".join(bytes(packet) for packet in packets)
