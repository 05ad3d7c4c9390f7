"""Pictures in which somebody painted what does not count: read, drawn and written."""

import cv2
import numpy as np

from studio.arrays import Array, Bytes
from studio.errors import FootageError

MOST_BYTES = 40_000_000


def painted_picture(content: bytes) -> Bytes:
    """(H, W) uint8, 255 where a picture file (PNG or other) is painted: opaque where it has holes, else bright.

    Raises FootageError for what is no picture.
    """
    picture = None
    if 0 < len(content) <= MOST_BYTES:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise FootageError(
            "The exclusion is no picture that can be read.", "Give a PNG of the footage's size."
        )
    if picture.ndim == 3 and picture.shape[2] == 4:
        alpha = picture[..., 3]
        level = alpha if (alpha < 255).any() else picture[..., :3].max(axis=2)
    else:
        level = picture.max(axis=2) if picture.ndim == 3 else picture
    return np.where(level > (127 if picture.dtype == np.uint8 else 32767), np.uint8(255), np.uint8(0))


def with_polygon(painted: Bytes, corners: Array) -> Bytes:
    """The picture (H, W) with a polygon (K, 2) of pixels painted too."""
    out = painted.copy()
    cv2.fillPoly(out, [np.rint(corners).astype(np.int32)], 255)
    return out


def png_of(picture: Bytes) -> bytes:
    """A picture (H, W) or (H, W, 3) BGR as the content of a PNG file."""
    return cv2.imencode(".png", picture)[1].tobytes()
