"""A live camera's pictures on disk as they come: fragmented MP4, of which a kill loses less than a second.

Pictures are kept as JPEG: a stream's own bytes where it sent JPEG, so that nothing is decoded or lost, else pictures
are compressed lightly. A recording has an even frame rate: a lost picture is replaced by the one before it and a
surplus one is left out, so that a picture's number gives its time; both are counted. When each picture really came
stands in `timestamps.csv` (`footage.capture.timestamps`).
"""

import csv
import fractions
import io
import os
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import av
import av.container
import av.error
import av.video
import cv2
import numpy as np

from studio.footage.capture.camera_streams import Bytes, Shot
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import check_file, open_file

QUALITY, PREVIEW_QUALITY = 95, 80
FRAGMENT_MICROSECONDS = 500_000
TOLERANCE = 0.6
"""Frames that a picture may be late or early before one is repeated or left out."""
LONGEST_GAP = 600
"""Pictures put in at most at once; after a longer silence the recording continues without them."""
TIME_COLUMNS = ("cam_id", "frame_index", "frame_time")
FRAGMENTS = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "frag_duration": str(FRAGMENT_MICROSECONDS),
             "flush_packets": "1"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class StreamFigures:
    """What was recorded of a camera. pictures : in the file. repeated : of those, put in for lost ones. left_out :
    pictures that came too soon after others.
    """

    pictures: int
    repeated: int
    left_out: int


class Cadence:
    """Keeps a camera's pictures at an even rate. fps : of the recording."""

    def __init__(self, fps: float) -> None:
        self._fps, self._first, self.count = fps, 0.0, 0

    def copies(self, came: float) -> int:
        """How often the next picture, which came at that second, is written: 0 where there are enough already."""
        if not self.count:
            self._first = came
        late = (came - self._first) * self._fps - self.count
        if late < -TOLERANCE:
            return 0
        missing = min(LONGEST_GAP, round(late)) if late > TOLERANCE else 0
        if missing == LONGEST_GAP:
            self._first = came - (self.count + missing) / self._fps
        self.count += 1 + missing
        return 1 + missing

    def time_of(self, number: int) -> float:
        """When a picture with that number should have come."""
        return self._first + number / self._fps


class StreamWriter:
    """Writes one camera's file; used by one thread. times : where lines of `timestamps.csv` go."""

    def __init__(self, name: str, path: Path, fps: float, times: "TimesFile") -> None:
        self.name, self._path = name, path
        self._rate = fractions.Fraction(fps).limit_denominator(1001)
        self._times, self._cadence = times, Cadence(float(self._rate))
        self._container: av.container.OutputContainer | None = None
        self._size, self._last = (0, 0), b""
        self._repeated = self._left_out = 0

    @property
    def figures(self) -> StreamFigures:
        return StreamFigures(self._cadence.count, self._repeated, self._left_out)

    def write(self, shot: Shot) -> None:
        """Write a picture, and before it the one before again for each that was lost.

        Raises FootageError if the stream changed its size, OSError where the disk refuses.
        """
        size = (shot.pixels.shape[1], shot.pixels.shape[0])
        if self._container is None:
            self._open(size)
        elif size != self._size:
            raise FootageError(
                f"Camera {self.name} changed its pictures from {self._size[0]}x{self._size[1]} to {size[0]}x{size[1]}.",
                "Give it one resolution and record again.",
            )
        before = self._cadence.count
        copies = self._cadence.copies(shot.came)
        if not copies:
            self._left_out += 1
            return
        content = jpeg_of(shot)
        for number in range(before, before + copies - 1):
            self._mux(number, self._last or content)
            self._times.add(self.name, number, self._cadence.time_of(number))
        self._repeated += copies - 1
        self._mux(before + copies - 1, content)
        self._times.add(self.name, before + copies - 1, shot.came)
        self._last = content

    def close(self) -> None:
        if self._container is not None:
            container, self._container = self._container, None
            with _disk_errors():
                container.close()

    def _open(self, size: tuple[int, int]) -> None:
        container = av.open(str(self._path), "w", format="mp4", options=FRAGMENTS)
        stream = container.add_stream("mjpeg", rate=self._rate)
        assert isinstance(stream, av.video.VideoStream)
        stream.width, stream.height, stream.pix_fmt = *size, "yuvj420p"
        stream.time_base = 1 / self._rate
        self._container, self._stream, self._size = container, stream, size

    def _mux(self, number: int, content: bytes) -> None:
        assert self._container is not None
        packet = av.Packet(content)
        packet.stream, packet.time_base = self._stream, 1 / self._rate
        packet.pts = packet.dts = number
        packet.duration = 1
        packet.is_keyframe = True
        with _disk_errors():
            self._container.mux(packet)


class TimesFile:
    """`timestamps.csv` as it grows; many threads may add to it."""

    def __init__(self, path: Path) -> None:
        self._file: TextIO = path.open("w", newline="", encoding="utf-8", buffering=1)
        self._file.write(",".join(TIME_COLUMNS) + "\n")
        self._lock = threading.Lock()

    def add(self, camera: str, number: int, came: float) -> None:
        """A line, whole or not at all."""
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow((camera, number, f"{came:.6f}"))
        with self._lock:
            self._file.write(line.getvalue())

    def close(self) -> None:
        self._file.close()


@contextmanager
def _disk_errors() -> Generator[None]:
    """A library's disk error as an OSError."""
    try:
        yield
    except av.error.FFmpegError as problem:
        raise OSError(problem.errno, problem.strerror) from None


def jpeg_of(shot: Shot) -> bytes:
    """A picture as JPEG: its own bytes where it came so. Raises FootageError where it cannot be one."""
    if shot.jpeg:
        return shot.jpeg
    return jpeg_of_pixels(shot.pixels)


def jpeg_of_pixels(pixels: Bytes, quality: int = QUALITY) -> bytes:
    """(H, W, 3) uint8 BGR as JPEG."""
    done, content = cv2.imencode(".jpg", np.ascontiguousarray(pixels), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise FootageError(
            f"A picture of {pixels.shape[1]}x{pixels.shape[0]} pixels cannot be kept.", "Check the camera."
        )
    return content.tobytes()


def preview_jpeg(shot: Shot, height: int | None = None) -> bytes:
    """A picture to look at as JPEG, at most so many pixels high."""
    tall, wide = shot.pixels.shape[:2]
    if height is None or height >= tall:
        return jpeg_of(shot)
    size = (max(1, round(wide * height / tall)), height)
    return jpeg_of_pixels(
        cv2.resize(shot.pixels, size, interpolation=cv2.INTER_AREA).astype(np.uint8), PREVIEW_QUALITY
    )


HEADER, LONG_HEADER = 8, 16


def whole_boxes(path: Path) -> int:
    """Bytes of a file's boxes (ISO/IEC 14496-12, 4.2) up to the last complete fragment (`moof` with its `mdat`)."""
    size, place, whole = path.stat().st_size, 0, 0
    with open_file(path, FootageError) as file:
        while place + HEADER <= size:
            file.seek(place)
            head = file.read(LONG_HEADER)
            length, kind = int.from_bytes(head[:4], "big"), head[4:8]
            if length == 1:
                length = int.from_bytes(head[8:16], "big")
            if length < HEADER or place + length > size:
                break
            place += length
            if kind != b"moof":
                whole = place
    return whole


def mend_recording(path: Path) -> int:
    """Cut a recording back to what is whole of it; returns the bytes that went. Raises FootageError if nothing is."""
    check_file(path, FootageError)
    size, whole = path.stat().st_size, whole_boxes(path)
    if not whole:
        raise FootageError(f"'{path.name}' holds no complete piece of a recording.", "Leave that camera out.")
    if whole < size:
        os.truncate(path, whole)
    return size - whole
