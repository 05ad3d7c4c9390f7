"""What a video file says of itself before it is decoded, and what of that is refused.

Small files can ask for very much memory or time, so size, length and codec are checked first and the decoder is told
the same limit. Headers are believed no further: `video.measure_video` counts by decoding.
"""

from dataclasses import dataclass
from pathlib import Path

import av
import av.container
import av.error
import av.video
import numpy as np

from studio.errors import FootageError
from studio.foreign_files import check_regular, foreign_file
from studio.isolated import isolated

MAX_PIXELS = 64_000_000
MAX_FRAMES = 2_000_000
MAX_SECONDS = 86_400.0
SAME_RATE = 0.02
CODECS = frozenset(
    ("h264", "hevc", "av1", "libdav1d", "vp8", "vp9", "libvpx", "libvpx-vp9", "mpeg4", "mpeg1video", "mpeg2video",
     "msmpeg4v2", "msmpeg4v3", "wmv1", "wmv2", "wmv3", "vc1", "h263", "flv1", "mjpeg", "prores", "dnxhd", "dvvideo",
     "ffv1", "huffyuv", "ffvhuff", "utvideo", "magicyuv", "qtrle", "png", "rawvideo", "theora", "cinepak", "v210",
     "jpeg2000", "cfhd")
)  # fmt: skip
"""Codecs that cameras and editors write; what games and screens once used is not decoded."""


@dataclass(frozen=True, slots=True)
class VideoProbe:
    """What a file announces. width, height : pixels as shown, its rotation applied; turned : that rotation, degrees
    clockwise. frame_count, seconds, fps : 0 where it does not say. steady : whether its frames seem evenly spaced.
    """

    codec: str
    width: int
    height: int
    turned: int
    frame_count: int
    seconds: float
    fps: float
    steady: bool


def probe_video(path: Path) -> VideoProbe:
    """What a video announces; only its first frame is decoded, in a process of its own. Raises FootageError for what is
    refused or no video.
    """
    check_regular(path, FootageError)
    return isolated(FootageError, _probed, path)


def _probed(path: Path) -> VideoProbe:
    """`probe_video` itself."""
    with (
        foreign_file(path, FootageError, "a video", "Copy or export it again."),
        open_video(path) as container,
    ):
        stream = container.streams.video[0]
        try:
            first = next(iter(container.decode(stream)), None)
        except (av.error.FFmpegError, OSError) as problem:
            raise FootageError(
                f"'{path.name}' is damaged or cut at frame 0 ({reason(problem)}).",
                "Copy or export the video again.",
            ) from None
        if first is None:
            raise FootageError(f"'{path.name}' holds no frames.", "Record or export the video again.")
        turned = check_turn(path, first)
        size = (first.height, first.width) if turned in (90, 270) else (first.width, first.height)
        rates = [float(rate or 0) for rate in (stream.average_rate, stream.base_rate)]
        return VideoProbe(
            stream.codec_context.name,
            *size,
            turned,
            announced_frames(container, stream),
            _seconds(container, stream),
            float(stream.average_rate or stream.guessed_rate or 0),
            min(rates) > 0.0 and max(rates) / min(rates) < 1.0 + SAME_RATE,
        )


def open_video(path: Path) -> av.container.InputContainer:
    """The container, its first video stream checked and set to stop at damage. Raises FootageError, also for what is no
    regular file.
    """
    check_regular(path, FootageError)
    try:
        container = av.open(str(path), options={"protocol_whitelist": "file"}, metadata_errors="replace")
    except (av.error.FFmpegError, OSError, ValueError) as problem:
        raise FootageError(
            f"'{path.name}' cannot be opened as a video at frame 0 ({reason(problem)}).",
            "The file is damaged, was cut short or is no video: copy or export it again.",
        ) from None
    try:
        _check(path, container)
    except FootageError:
        container.close()
        raise
    stream = container.streams.video[0]
    stream.thread_type = "NONE"
    stream.codec_context.options = {"err_detect": "explode", "max_pixels": str(MAX_PIXELS)}
    return container


def announced_frames(container: av.container.InputContainer, stream: av.video.VideoStream) -> int:
    """The number of frames that the container promises, 0 if it does not."""
    if stream.frames:
        return stream.frames
    if stream.duration and stream.time_base and stream.average_rate:
        return int(stream.duration * stream.time_base * stream.average_rate)
    if container.duration and stream.average_rate and len(container.streams) == 1:
        return int(container.duration / 1_000_000 * stream.average_rate)
    return 0


def check_turn(path: Path, frame: av.VideoFrame) -> int:
    """Degrees clockwise by which the file asks to be shown turned. Raises FootageError for slanted or mirrored ones."""
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if matrix is not None:
        a, b, _, c, d = np.frombuffer(memoryview(matrix), "<i4").astype(np.float64)[:5]
        if a * d - b * c < 0.0:
            raise FootageError(
                f"'{path.name}' asks to be shown mirrored, which no calibration can follow.",
                "Switch mirroring off in the camera, and re-encode the video without it.",
            )
    if round(frame.rotation) % 90:
        raise FootageError(
            f"'{path.name}' asks to be shown turned by {frame.rotation} degrees.",
            "Re-encode it without a rotation.",
        )
    return round(-frame.rotation / 90.0) % 4 * 90


def reason(problem: Exception) -> str:
    """The decoder's words without file names and numbers."""
    return str(getattr(problem, "strerror", None) or problem).split(": '")[0].lower()


def _check(path: Path, container: av.container.InputContainer) -> None:
    """Raises FootageError for what is not to be decoded."""
    if not container.streams.video:
        raise FootageError(f"'{path.name}' has no pictures in it.", "Give a video file.")
    stream = container.streams.video[0]
    codec = stream.codec_context.name
    if codec not in CODECS:
        raise FootageError(
            f"'{path.name}' is encoded with '{codec}', which is not decoded here.", "Re-encode it as H.264."
        )
    if stream.width * stream.height > MAX_PIXELS:
        raise FootageError(
            f"'{path.name}' is {stream.width}x{stream.height} pixels, more than {MAX_PIXELS} in all.",
            "Scale the video down.",
        )
    frames, seconds = announced_frames(container, stream), _seconds(container, stream)
    if frames > MAX_FRAMES or seconds > MAX_SECONDS:
        raise FootageError(
            f"'{path.name}' announces {frames} frames in {seconds:.0f} s, more than {MAX_FRAMES} or a day.",
            "Cut it into pieces.",
        )


def _seconds(container: av.container.InputContainer, stream: av.video.VideoStream) -> float:
    if stream.duration and stream.time_base:
        return float(stream.duration * stream.time_base)
    return container.duration / 1_000_000 if container.duration else 0.0
