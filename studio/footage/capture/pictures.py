"""Folders of pictures, one file a frame, in natural order or by number.

A live camera's pictures are named by their numbers (`000041.jpg`), and their folder may grow while it is read. A number
may be missing because the camera gave no picture, or no set of pictures was complete; the picture before it stands in.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import av
import av.error
import cv2
import numpy as np

from studio.footage.capture.naming import natural_key
from studio.footage.capture.video import MAX_PIXELS
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import check_regular, foreign_file, read_file
from studio.foundations.isolated import isolated, silent

PICTURE_SUFFIXES = frozenset((".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm"))
STRICTLY_DECODED = frozenset((".png", ".jpg", ".jpeg", ".bmp"))
"""Formats whose damage OpenCV may paper over and the video library reports."""


@dataclass(frozen=True, slots=True)
class PicturesMeasure:
    """The result of reading every picture of a folder. missing : numbers that the file names skip."""

    width: int
    height: int
    frame_count: int
    missing: tuple[int, ...]


def list_pictures(folder: Path) -> tuple[Path, ...]:
    """The pictures of a folder in natural order of their names; hidden files are passed over."""
    pictures = [
        path
        for path in folder.iterdir()
        if path.suffix.lower() in PICTURE_SUFFIXES and not path.name.startswith(".") and path.is_file()
    ]
    return tuple(sorted(pictures, key=lambda path: natural_key(path.name)))


def is_picture(path: Path) -> bool:
    return path.suffix.lower() in PICTURE_SUFFIXES


def read_picture(path: Path) -> Bytes:
    """(H, W, 3) uint8 BGR; grey pictures become three equal channels. Raises FootageError naming the file."""
    with foreign_file(path, FootageError, "a picture that can be read", "Put the file back.", footage=True):
        content = np.frombuffer(read_file(path, wrong=FootageError, footage=True), np.uint8)
    picture = None
    if content.size:
        try:
            picture = cv2.imdecode(content, cv2.IMREAD_COLOR)
        except cv2.error:
            picture = None
    if picture is None:
        raise _damaged(path)
    return picture.astype(np.uint8, copy=False)


def check_picture(path: Path) -> tuple[int, int]:
    """Width and height of a picture that decodes whole, which is tried in a process of its own. Raises FootageError for
    damage or an absurd size.
    """
    check_regular(path, FootageError)
    return isolated(FootageError, _size_of, path)


def _size_of(path: Path) -> tuple[int, int]:
    check_regular(path, FootageError)
    if path.suffix.lower() in STRICTLY_DECODED:
        try:
            with av.open(str(path), options={"protocol_whitelist": "file"}) as container:
                stream = container.streams.video[0]
                if stream.width * stream.height > MAX_PIXELS:
                    raise FootageError(
                        f"'{path.name}' is {stream.width}x{stream.height} pixels.", "Scale the pictures down."
                    )
                stream.codec_context.options = {"err_detect": "explode"}
                if any(frame.is_corrupt for frame in container.decode(stream)):
                    raise _damaged(path)
        except (av.error.FFmpegError, OSError, IndexError):
            raise _damaged(path) from None
    height, width = read_picture(path).shape[:2]
    return width, height


def measure_pictures(folder: Path, on_frame: Callable[[int, int], None] | None = None) -> PicturesMeasure:
    """Size and count of a folder's pictures, every one decoded once in a process of its own, and the numbers that are
    missing in between.

    on_frame : called with pictures read and pictures in all; may raise to stop. Raises FootageError if there are none,
    one is damaged or sizes differ.
    """
    return isolated(FootageError, _measure, folder, on_frame or silent)


def _measure(folder: Path, on_frame: Callable[[int, int], None]) -> PicturesMeasure:
    paths = list_pictures(folder)
    if not paths:
        raise FootageError(f"'{folder.name}' holds no pictures.", "Put the frames in it as PNG, JPEG or BMP.")
    width, height = _size_of(paths[0])
    for number, path in enumerate(paths, 1):
        size = _size_of(path)
        if size != (width, height):
            raise FootageError(
                f"'{folder.name}/{path.name}' is {size[0]}x{size[1]} pixels,"
                f" '{paths[0].name}' is {width}x{height}.",
                "Give all pictures of a camera one size.",
            )
        on_frame(number, len(paths))
    return PicturesMeasure(width, height, len(paths), _missing_numbers(paths))


class PictureReader:
    """The pictures of a folder as frames."""

    def __init__(self, folder: Path, frame_count: int) -> None:
        self._folder = folder
        self._paths = list_pictures(folder) if folder.is_dir() else ()
        if len(self._paths) < frame_count:
            raise FootageError(
                f"'{folder.name}' holds {len(self._paths)} pictures and had {frame_count} at import.",
                "Put the pictures back, or import the session again.",
            )

    def read(self, index: int) -> Bytes:
        """(H, W, 3) uint8 BGR picture of frame `index`."""
        if index >= len(self._paths):
            raise FootageError(
                f"'{self._folder.name}' has no picture for frame {index}.", "Put the pictures back."
            )
        return read_picture(self._paths[index])

    def close(self) -> None:
        """Nothing to close."""


def _missing_numbers(paths: tuple[Path, ...]) -> tuple[int, ...]:
    """Numbers skipped in the last number of the file names, where these are otherwise evenly spaced."""
    digit_groups = [re.findall(r"\d+", path.stem) for path in paths]
    if len(paths) < 3 or not all(digit_groups):
        return ()
    numbers = np.array([int(digits[-1]) for digits in digit_groups])
    steps = np.diff(numbers)
    stride = int(np.median(steps))
    if stride <= 0 or np.all(steps == stride):
        return ()
    wanted = set(range(int(numbers[0]), int(numbers[-1]) + 1, stride))
    return tuple(sorted(wanted - set(numbers.tolist())))[:1000]


def _damaged(path: Path) -> FootageError:
    return FootageError(
        f"'{path.parent.name}/{path.name}' is damaged or no picture.", "Copy or export the picture again."
    )


SUFFIX = ".jpg"
DIGITS = 6
FURTHEST = 600
"""Largest number of steps back to an earlier picture."""


def picture_path(folder: Path, number: int) -> Path:
    """Where the picture of a frame lies, or would."""
    return folder / f"{number:0{DIGITS}d}{SUFFIX}"


def has_picture(folder: Path, number: int) -> bool:
    """Whether the camera gave one."""
    return picture_path(folder, number).exists()


class NumberedReader:
    """The pictures of a folder by their numbers; knows of new ones at once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def read(self, index: int) -> Bytes:
        """(H, W, 3) uint8 BGR of frame `index`, else of the nearest before it, else of the nearest after it.

        Raises FootageError where there is none near, or it is damaged.
        """
        for number in (*range(index, max(-1, index - FURTHEST), -1), *range(index + 1, index + FURTHEST)):
            path = picture_path(self._folder, number)
            if path.exists():
                return read_picture(path)
        raise FootageError(
            f"Camera folder '{self._folder.name}' has no picture near frame {index}.",
            "Record again, or choose frames in which the camera ran.",
        )

    def close(self) -> None:
        """Nothing to close."""


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
            "What was painted is no picture that can be read.", "Give a PNG of the footage's size."
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
