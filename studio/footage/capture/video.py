"""Video files, frame by frame and exactly: damage is reported, never skipped.

Headers are not believed: a video is measured by decoding every frame once (`measure_video`). The decoder stops at
damage (`err_detect=explode`), frames that it marks as corrupt count as damage, and fewer frames than the container
announces mean that the file was cut. Damage that leaves a lawful bit stream cannot be seen by any decoder.

Small files can ask for very much memory or time, so size, length and codec are checked before decoding, and the decoder
gets the same limit.

Reading a frame's side data makes it part of a cycle, so it stays, 3 MB of full HD, until Python collects cycles, which
it seldom does (`video` reads that of one frame of each file); and glibc keeps memory freed by a thread for that thread.
So released memory is returned to the system explicitly.
"""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import av
import av.container
import av.error
import av.filter
import av.video
import numpy as np
from av.video.reformatter import VideoReformatter

from studio.footage.capture.interlacing import FieldMotion, Fields, whole_picture
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import check_regular, foreign_file
from studio.foundations.isolated import isolated, silent

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
    """The header of a video. width, height : pixels as shown, its rotation applied; turned : that rotation, degrees
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
    """The header of a video; its first frame is decoded in another process. Raises FootageError for refused files."""
    check_regular(path, FootageError)
    return isolated(FootageError, _probed, path)


def _probed(path: Path) -> VideoProbe:
    with (
        foreign_file(path, FootageError, "a video", "Copy or export it again.", footage=True),
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
    """The container, its first video stream set to stop at damage. Raises FootageError."""
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
    """The rotation of the file in degrees clockwise. Raises FootageError for slanted or mirrored ones."""
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if matrix is not None:
        a, b, _, c, d = np.frombuffer(memoryview(matrix), "<i4").astype(np.float64)[:5]
        if a * d - b * c < 0.0:
            raise FootageError(
                f"'{path.name}' is to be shown mirrored, which no calibration can represent.",
                "Switch mirroring off in the camera, and re-encode the video without it.",
            )
    if round(frame.rotation) % 90:
        raise FootageError(
            f"'{path.name}' is to be shown rotated by {frame.rotation} degrees.",
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


VIDEO_SUFFIXES = frozenset((".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".ts", ".mts"))
STEADY = 0.6
"""Frames may lie this share of a frame's duration off an even spacing before a frame rate is called
variable."""
TREMBLE = 0.1
"""Times off an even spacing by more than this share of a frame's duration tremble."""
MOST_GAPS, ROUNDED = 0.1, 5e-4
"""At most this share of the frames' steps are gaps; measured rates are this near the usual one that they are."""
FIELD_PAIRS, FEWEST_APART, USUALLY_APART = 48, 4, 16
"""About so many pairs of neighbouring pictures are looked at for fields, at least so many frames apart, and so many
where a file does not say how long it is."""
LOWER_FIRST = frozenset(("dvvideo",))
"""Codecs whose interlaced pictures begin with the lower field where nothing says otherwise."""
FORWARD = 24
"""A jump forward of up to this many frames is decoded through instead of a seek."""


@dataclass(frozen=True, slots=True)
class VideoMeasure:
    """A video measured by decoding all of it. width, height : pixels as shown (the file's rotation applied).

    uneven_frame : the first frame that is not where a constant frame rate puts it, or -1. turned : degrees clockwise by
    which the file itself says to turn its pictures. interlaced : whether its pictures hold two moments. first_field :
    the earlier one where what moves says it, else "". times : (F,) seconds as the file has them, empty where it has
    none.
    """

    width: int
    height: int
    frame_count: int
    fps: float
    uneven_frame: int
    turned: int = 0
    interlaced: bool = False
    first_field: Fields = ""
    times: Array = field(default_factory=lambda: np.zeros(0), compare=False)


def measure_video(path: Path, on_frame: Callable[[int, int], None] | None = None) -> VideoMeasure:
    """Size, frame count and rate of a video, by decoding it once, in a process of its own.

    on_frame : called with frames decoded and frames announced (0 if unknown); may raise to stop.
    Raises FootageError naming the file and the frame where it is damaged or cut.
    """
    check_regular(path, FootageError)
    return isolated(FootageError, _measure, path, on_frame or silent)


def _measure(path: Path, on_frame: Callable[[int, int], None]) -> VideoMeasure:
    times: list[float] = []
    width = height = turned = marked = 0
    motion = FieldMotion()
    before: Bytes | None = None
    with open_video(path) as container:
        stream = container.streams.video[0]
        announced = announced_frames(container, stream)
        apart = max(FEWEST_APART, announced // FIELD_PAIRS) if announced else USUALLY_APART
        for frame in _decoded(path, container, stream):
            turned = round(-frame.rotation / 90.0) % 4 * 90
            marked += frame.interlaced_frame
            if len(times) % apart < 2:
                grey = frame.reformat(format="gray").to_ndarray().astype(np.uint8, copy=False)
                if before is not None and len(times) % apart == 1:
                    motion.compare(before, grey)
                before = grey
            size = (frame.height, frame.width) if turned in (90, 270) else (frame.width, frame.height)
            if times and size != (width, height):
                raise FootageError(
                    f"'{path.name}' changes its size at frame {len(times)}.", "Re-encode it with one size."
                )
            width, height = size
            times.append(frame.time if frame.pts is not None else float("nan"))
            if len(times) > MAX_FRAMES:
                raise FootageError(f"'{path.name}' has more than {MAX_FRAMES} frames.", "Cut it into pieces.")
            on_frame(len(times), announced)
        nominal, codec = float(stream.average_rate or stream.guessed_rate or 0), stream.codec_context.name
    if not times:
        raise FootageError(f"'{path.name}' holds no frames.", "Record or export the video again.")
    if len(times) < announced - max(1, announced // 100) - _hidden_frames(path, announced - len(times)):
        raise FootageError(
            f"'{path.name}' ends at frame {len(times)} of the {announced} that it announces.",
            "The file was cut short: copy or export it again.",
        )
    fps, uneven = _rate(np.array(times), nominal)
    known = np.array(times)
    shown_at = known if np.isfinite(known).all() and np.all(np.diff(known) > 0.0) else np.zeros(0)
    interlaced, first = motion.decide(2 * marked > len(times))
    if interlaced and not first and codec in LOWER_FIRST:
        first = "bottom"
    return VideoMeasure(width, height, len(times), fps, uneven, turned, interlaced, first, shown_at)


class VideoReader:
    """Random access to the frames of one measured video; reading onwards keeps the decoder open. Thread-safe."""

    def __init__(self, path: Path, frame_count: int, fields: Fields = "") -> None:
        """frame_count : as measured, 0 where it is not known. fields : which field of each picture is its first frame
        where the two are to be frames of their own, of which there are twice as many.
        """
        self._path, self._count = path, frame_count // 2 if fields else frame_count
        self._fields = fields
        self._halves: dict[bool, av.filter.Graph] = {}
        self._last: tuple[int, av.VideoFrame] | None = None
        self._lock = threading.Lock()
        self._container: av.container.InputContainer | None = None
        self._frames: Iterator[av.VideoFrame] = iter(())
        # Kept with its tables: making them again costs as much as the conversion itself.
        self._reformatter = VideoReformatter()
        self._next = 0
        self._times: list[int] | None = None
        self._keys: list[int] = []

    def read(self, index: int) -> Bytes:
        """(H, W, 3) uint8 BGR picture of frame `index`. Raises FootageError for damage."""
        with self._lock:
            if not self._fields:
                return upright_array(self._decoded(index), self._reformatter)
            number, later = divmod(index, 2)
            if self._last is None or self._last[0] != number:
                self._last = number, self._decoded(number)
            return self._field(self._last[1], below=(self._fields == "bottom") != bool(later))

    def _decoded(self, index: int) -> av.VideoFrame:
        """The file's picture `index`."""
        if self._container is None or not self._next <= index <= self._next + FORWARD:
            self._go_to(index)
        while True:
            frame = next(self._frames, None)
            if frame is None:
                raise _cut(self._path, self._next, self._count)
            self._next += 1
            if self._next > index:
                return frame

    def _field(self, frame: av.VideoFrame, below: bool) -> Bytes:
        """One field of a picture at full height. It is parted before its colours are read: these are stored a line for
        two of the same field.
        """
        graph = self._halves.get(below)
        if graph is None:
            graph = self._halves[below] = _field_graph(frame, below)
        graph.push(frame)
        half = graph.pull()
        assert isinstance(half, av.VideoFrame)
        lines = self._reformatter.reformat(half, format="bgr24").to_ndarray().astype(np.uint8, copy=False)
        return _turned_up(whole_picture(lines, below, frame.height), frame.rotation)

    def close(self) -> None:
        with self._lock:
            if self._container is not None:
                self._container.close()
            self._container = None
            # What yields frames holds the decoder with all its buffers.
            self._frames = iter(())
            self._last = None
            self._halves = {}

    def _go_to(self, index: int) -> None:
        """Place the decoder so that frame `index` is at most a keyframe's distance ahead."""
        if self._times is None and index > FORWARD:
            self._times, self._keys = _packet_times(self._path)
        usable = self._times is not None and self._count in (0, len(self._times))
        key = max((key for key in self._keys if key <= index), default=0) if usable else 0
        if self._container is not None and self._next <= index and key <= self._next:
            return
        if self._container is None or key == 0:
            self._restart()
        if key == 0 or self._times is None or self._container is None:
            return
        stream = self._container.streams.video[0]
        self._container.seek(self._times[key], stream=stream, backward=True)
        self._frames = _decoded(self._path, self._container, stream, key)
        first = next(self._frames, None)
        position = {time: number for number, time in enumerate(self._times)}
        landed = position.get(first.pts, -1) if first is not None and first.pts is not None else -1
        if first is None or not 0 <= landed <= index:
            self._restart()
            return
        self._frames = _again(first, self._frames)
        self._next = landed

    def _restart(self) -> None:
        """Open the file afresh at its first frame."""
        if self._container is not None:
            self._container.close()
        self._container = open_video(self._path)
        self._frames = _decoded(self._path, self._container, self._container.streams.video[0])
        self._next = 0


def upright_array(frame: av.VideoFrame, reformatter: VideoReformatter) -> Bytes:
    """(H, W, 3) uint8 BGR, turned as the file's rotation says."""
    picture = reformatter.reformat(frame, format="bgr24").to_ndarray().astype(np.uint8, copy=False)
    return _turned_up(picture, frame.rotation)


def _turned_up(picture: Bytes, rotation: float) -> Bytes:
    turns = round(rotation / 90.0) % 4
    return np.ascontiguousarray(np.rot90(picture, turns) if turns else picture)


def _field_graph(frame: av.VideoFrame, below: bool) -> av.filter.Graph:
    """What takes every second line of pictures like this one, in all its planes."""
    graph = av.filter.Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format, time_base=Fraction(1, 1)
    )
    part = graph.add("field", "type=bottom" if below else "type=top")
    sink = graph.add("buffersink")
    source.link_to(part)
    part.link_to(sink)
    graph.configure()
    return graph


def _decoded(
    path: Path, container: av.container.InputContainer, stream: av.video.VideoStream, number: int = 0
) -> Iterator[av.VideoFrame]:
    """Frames in the order of showing, counted from `number`; damage becomes a FootageError.

    How a frame is turned is looked up only where its rotation is another than the last one's: reading a
    frame's side data makes it part of a cycle, which stays until Python collects cycles, 3 MB of full HD each.
    """
    last, rotation = "", None
    try:
        for frame in container.decode(stream):
            if frame.is_corrupt:
                raise FootageError(
                    f"'{path.name}' is damaged at frame {number}{last}.", "Copy or export the video again."
                )
            if frame.rotation != rotation:
                check_turn(path, frame)
                rotation = frame.rotation
            yield frame
            number += 1
            last = f" after {frame.time:.3f} s" if frame.pts is not None else ""
    except (av.error.FFmpegError, OSError) as problem:
        raise FootageError(
            f"'{path.name}' is damaged or cut at frame {number}{last} ({reason(problem)}).",
            "Copy or export the video again.",
        ) from None


def _rate(times: Array, nominal: float) -> tuple[float, int]:
    """Frames per second, and the first frame off an even spacing (-1: none), in which lost ones leave gaps."""
    if len(times) < 2 or not np.all(np.isfinite(times)):
        return nominal, -1
    steps = np.diff(times)
    usual = float(np.median(steps))
    gaps = np.maximum(np.round(steps / usual) - 1.0, 0.0) if usual > 0.0 else np.zeros(len(steps))
    if 0 < np.count_nonzero(gaps) <= MOST_GAPS * len(steps):
        fps = 1.0 / float(steps[gaps == 0.0].mean())
        slots = np.arange(len(times)) + np.concatenate([[0.0], np.cumsum(gaps)])
        off = np.abs((times - times[0]) * fps - slots)
        if not np.any(off > STEADY):
            return _rounded(fps), -1
    fps = (len(times) - 1) / float(times[-1] - times[0]) if times[-1] > times[0] else nominal
    if nominal > 0.0 and abs(fps / nominal - 1.0) < 0.005:
        fps = nominal
    off = np.abs((times - times[0]) * fps - np.arange(len(times)))
    # Stamps that tremble put a short video's ends, by which its rate is measured, off as well.
    for rate in (round(fps), round(fps * 1.001) / 1.001) if off.max() > TREMBLE else ():
        slots = (times - times[0]) * rate - np.arange(len(times))
        if rate > 0.0 and np.abs(slots - np.median(slots)).max() <= STEADY:
            return float(rate), -1
    return fps, int(np.argmax(off > STEADY)) if np.any(off > STEADY) else -1


def _rounded(fps: float) -> float:
    """A rate that was measured, as the usual one that it is."""
    usual = min((round(fps), round(fps * 1.001) / 1.001), key=lambda rate: abs(rate - fps))
    return usual if usual > 0.0 and abs(usual / fps - 1.0) < ROUNDED else fps


def _packet_times(path: Path) -> tuple[list[int] | None, list[int]]:
    """Presentation times of all frames in order, and which frames are keyframes, without decoding."""
    shown: list[tuple[int, bool]] = []
    with open_video(path) as container:
        try:
            for packet in container.demux(container.streams.video[0]):
                if packet.size == 0 or packet.is_discard:
                    continue
                if packet.pts is None:
                    return [], []
                shown.append((packet.pts, packet.is_keyframe))
        except av.error.FFmpegError:
            return [], []
    shown.sort()
    return [time for time, _ in shown], [number for number, (_, key) in enumerate(shown) if key]


def _hidden_frames(path: Path, lacking: int) -> int:
    """Frames that an edit list hides, of those that are lacking: they are only there to decode the others."""
    hidden = 0
    with open_video(path) as container:
        try:
            for packet in container.demux(container.streams.video[0]):
                hidden += packet.is_discard and packet.size > 0
        except av.error.FFmpegError:
            return 0
    return min(hidden, lacking)


def _again(first: av.VideoFrame, rest: Iterator[av.VideoFrame]) -> Iterator[av.VideoFrame]:
    """The frame already read, then the others."""
    yield first
    yield from rest


def _cut(path: Path, frame: int, count: int) -> FootageError:
    had = f", it had {count} frames when it was imported" if count else ""
    return FootageError(
        f"'{path.name}' ends at frame {frame}{had}.",
        "Put the original file back, or import the session again.",
    )
