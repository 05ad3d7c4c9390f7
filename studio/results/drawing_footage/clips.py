"""Pictures into small H.264 files, as recorders write them."""

from fractions import Fraction
from pathlib import Path
from types import TracebackType

import av
import cv2
import numpy as np

from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError

KEYFRAME_EVERY = 50


class ClipWriter:
    """An mp4 file (H.264, yuv420p) that takes pictures one after the other; use it as a context manager.

    path : the file. size : width and height in pixels, both even. quality : x264's constant rate factor, 0 (exact) to
    51. The encoder runs on one thread, so the same pictures give the same bytes. Raises FootageError for odd sizes.
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: float, quality: float) -> None:
        if size[0] % 2 or size[1] % 2:
            raise FootageError(
                f"A picture of {size[0]} x {size[1]} pixels cannot be written as H.264.",
                "Make both sides even.",
            )
        self._container = av.open(str(path), "w", format="mp4")
        options = {"crf": f"{quality:g}", "preset": "slow", "threads": "1"}
        self._stream = self._container.add_stream(
            "libx264", rate=Fraction(fps).limit_denominator(1001), options=options
        )
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        self._stream.gop_size = KEYFRAME_EVERY

    def add(self, picture: Bytes) -> None:
        """Append one picture: (H, W, 3) uint8 BGR, or (H, W) uint8 grey."""
        colour = picture if picture.ndim == 3 else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(colour, np.uint8), format="bgr24")
        self._container.mux(self._stream.encode(frame))

    def __enter__(self) -> "ClipWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._container.mux(self._stream.encode(None))
        self._container.close()
