"""A live camera's stream opened and read: pictures as they come, decoded by PyAV.

The format is given, never guessed, only the protocols of cameras are spoken, nothing leads from a camera to another
address, and a read that takes too long is an error instead of a wait.
"""

import fractions
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import av
import av.container
import av.error
import av.video
import numpy as np

from studio.footage.capture.camera_addresses import CameraAddress
from studio.footage.capture.mjpeg_over_http import mjpeg_parts
from studio.footage.capture.rtsp_relay import relayed
from studio.footage.capture.video import MAX_PIXELS, open_video, reason
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError

SECONDS_TO_OPEN, SECONDS_TO_READ = 5.0, 2.0
HUFFMAN_TABLES = b"\xff\xc4"
"""Some devices leave these out of their JPEG; then the bytes cannot be kept as a picture."""
FORMATS = {"rtsp": "rtsp", "usb": "video4linux2"}
OPTIONS = {
    "rtsp": {"protocol_whitelist": "rtsp,rtp,tcp", "rtsp_transport": "tcp", "fflags": "nobuffer"},
    "usb": {"input_format": "mjpeg"},
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A picture of a stream. pixels : (H, W, 3) uint8 BGR. jpeg : its bytes where the stream was JPEG, else b"". came :
    seconds of the clock at which it had arrived, before it was decoded.
    """

    pixels: Bytes
    jpeg: bytes
    came: float


# Waits for seconds, or until it is stopped: then it returns True.
Wait = Callable[[float], bool]


def open_stream(
    address: CameraAddress,
    wait: Wait,
    clock: Callable[[], float] = time.monotonic,
    released: Callable[[], bool] = lambda: True,
) -> Iterator[Shot]:
    """The pictures of a camera as they come; released : whether a replayed video may continue after its first one.

    Raises FootageError, also in the middle.
    """
    if address.kind == "replay":
        yield from replayed_video(Path(address.url), wait, clock, released)
        return
    if address.kind == "http":
        yield from _decoded(address, mjpeg_parts(address, wait, (SECONDS_TO_OPEN, SECONDS_TO_READ)), clock)
        return
    try:
        with _open(address) as container:
            stream = container.streams.video[0]
            stream.thread_type = "NONE"
            stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}
            yield from _shots(container, stream, clock)
    except (av.error.FFmpegError, OSError, IndexError) as problem:
        # A library's own words may hold the address with its password.
        raise FootageError(
            f"Camera {address.name} ({address.shown}) gives no pictures ({_why(problem)}).",
            "Check that it is switched on, its address, and its name and password.",
        ) from None


def _decoded(address: CameraAddress, parts: Iterator[bytes], clock: Callable[[], float]) -> Iterator[Shot]:
    """Pictures of JPEG files as they come; damaged ones are left out."""
    decoder = av.CodecContext.create("mjpeg", "r")
    assert isinstance(decoder, av.VideoCodecContext)
    decoder.thread_type = "NONE"
    decoder.options = {"max_pixels": str(MAX_PIXELS)}
    for content in parts:
        came = clock()
        try:
            frames = decoder.decode(av.Packet(content))
        except av.error.FFmpegError:
            continue
        for frame in frames:
            if not frame.is_corrupt:
                yield Shot(_pixels(frame), content if HUFFMAN_TABLES in content else b"", came)


def replayed_video(
    path: Path,
    wait: Wait,
    clock: Callable[[], float] = time.monotonic,
    released: Callable[[], bool] = lambda: True,
) -> Iterator[Shot]:
    """A video replayed as a camera, its first picture repeated until it is released. Raises FootageError."""
    try:
        with open_video(path) as container:
            stream = container.streams.video[0]
            step = float(1 / (stream.average_rate or stream.guessed_rate or fractions.Fraction(30)))
            due = clock()
            for number, frame in enumerate(container.decode(stream)):
                pixels = _pixels(frame)
                while True:
                    if wait(max(0.0, due - clock())):
                        return
                    yield Shot(pixels, b"", clock())
                    # A still picture need not be made up for.
                    due = due + step if number else max(due + step, clock())
                    if number or released():
                        break
    except av.error.FFmpegError as problem:
        raise FootageError(
            f"'{path.name}' cannot be replayed ({reason(problem)}).", "Copy or export the video again."
        ) from None


@contextmanager
def _open(address: CameraAddress) -> Generator[av.container.InputContainer]:
    opened = partial(
        av.open, mode="r", format=FORMATS[address.kind], timeout=(SECONDS_TO_OPEN, SECONDS_TO_READ)
    )
    options = OPTIONS[address.kind]
    if address.kind == "rtsp":
        with relayed(address, SECONDS_TO_OPEN) as url, opened(url, options=options) as container:
            yield container
        return
    try:
        container = opened(address.url, options=options)
    except (av.error.FFmpegError, OSError):
        # Not every device speaks JPEG.
        container = opened(address.url)
    with container:
        yield container


def _shots(
    container: av.container.InputContainer, stream: av.video.VideoStream, clock: Callable[[], float]
) -> Iterator[Shot]:
    """Decoded pictures; one that is damaged is left out, the next one is awaited."""
    is_jpeg = stream.codec_context.name == "mjpeg"
    for packet in container.demux(stream):
        if not packet.size:
            continue
        came = clock()
        try:
            frames = packet.decode()
        except av.error.InvalidDataError:
            continue
        content = bytes(packet) if is_jpeg else b""
        for frame in frames:
            if not frame.is_corrupt:
                kept = content if HUFFMAN_TABLES in content else b""
                yield Shot(_pixels(frame), kept, came)


def _pixels(frame: av.VideoFrame) -> Bytes:
    """(H, W, 3) uint8 BGR."""
    return frame.to_ndarray(format="bgr24").astype(np.uint8, copy=False)


def _why(problem: Exception) -> str:
    """A library's error as text, without the address."""
    if isinstance(problem, IndexError):
        return "no video in it"
    if isinstance(problem, av.error.ExitError):
        return f"no data for {SECONDS_TO_READ:g} s"
    return str(getattr(problem, "strerror", "") or type(problem).__name__)
