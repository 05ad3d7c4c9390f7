"""A session's footage: the pictures and masks of any frame, at random or onwards.

Each camera has its own decoder behind a lock, so cameras can be read from several threads and the same
session can be opened twice. The last pictures are kept, so that re-annealing or showing a frame
again decodes nothing.

Footage can be played forwards and backwards without end (ping-pong), so that a short clip can be replayed for long.

A jump from a clip's end to its beginning could not be tracked; at a turning point the body only moves backwards.
Videos can only be decoded onwards, so on the way back stretches of frames are decoded at once and kept; a stretch
costs some ten frames' time, every now and then.
"""

import itertools
import threading
import weakref
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, get_args

import numpy as np

from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.pictures import NumberedReader, PictureReader, has_picture, read_picture
from studio.footage.capture.video import VideoReader
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError, NotFoundError
from studio.foundations.memory import give_back_freed_memory

Region = Literal["exclusions", "in_front"]
"""Regions of a camera's pictures that stay the same in all frames: where nothing counts, and where a thing stands in
front of the subject's place. Each is a folder of a session with a painted picture a camera."""
REGIONS: tuple[Region, ...] = get_args(Region)
HIDDEN = "hidden"
"""Beside cameras' folders of masks, a folder with the same names: pictures, white where the masks say nothing of the
subject, for another one is in front of it."""
KEPT_BYTES = 24_000_000
"""Pictures kept for each camera: eight of 1920x1080/2, twenty-six of 640x480."""
KEPT_BYTES_IN_ALL = 96_000_000
"""Of pictures that a process keeps, of all footage that it has open."""
FEWEST_KEPT = 2
"""Pictures of each camera that stay in any case."""
MANY_PICTURES = 24
"""After so many pictures it is worth a fifth of a second to give back what their decoders held; pages that ask for one
picture at a time do not wait for that."""
MASK_LEVEL = 127
"""Masks that come with the data are foreground above this grey level (lossy videos blur 0 and 255)."""


class Reader(Protocol):
    """Frames of one file or folder."""

    def read(self, index: int) -> Bytes:
        """(H, W, 3) uint8 BGR."""
        ...

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True, eq=False)
class FramePictures:
    """One frame as all cameras saw it. pictures : (H, W, 3) uint8 BGR each, in the order of the cameras."""

    frame: int
    cameras: tuple[str, ...]
    pictures: tuple[Bytes, ...]


class Footage:
    """Pictures and masks of a session, frame by frame."""

    def __init__(self, source: FootageSource, folder: Path) -> None:
        self.source, self.folder = source, folder
        self.cameras = tuple(camera.name for camera in source.cameras)
        self.frame_count, self.fps = source.frame_count, source.fps
        self._by_name = {camera.name: camera for camera in source.cameras}
        self._pictures = {
            camera.name: _Kept(camera_reader(camera, folder), camera, colour_as_it_is)
            for camera in source.cameras
        }
        self._masks = {
            camera.name: _Kept(_mask_reader(folder / camera.masks), camera, thresholded_mask)
            for camera in source.cameras
            if camera.masks
        }
        self._hidden = {
            camera.name: _Kept(_mask_reader(path), camera, thresholded_mask)
            for camera in source.cameras
            if camera.masks and (path := hidden_beside(folder / camera.masks)).is_dir()
        }

    def picture(self, camera: str, frame: int) -> Bytes:
        """(H, W, 3) uint8 BGR of one camera; read-only. Raises NotFoundError, FootageError."""
        return self._pictures[camera].read(self._check_frame(frame))

    def mask(self, camera: str, frame: int) -> Bytes | None:
        """(H, W) uint8, 0 or 255, the mask of the camera's file, given or made in set-up, or None where it has none."""
        kept = self._masks.get(camera)
        return None if kept is None else kept.read(self._check_frame(frame))

    def hidden(self, camera: str, frame: int) -> Bytes | None:
        """(H, W) uint8, 255 where a camera's mask says nothing of the subject, or None where it does everywhere."""
        kept = self._hidden.get(camera)
        return None if kept is None else kept.read(self._check_frame(frame))

    def pictures(self, frame: int) -> FramePictures:
        return FramePictures(frame, self.cameras, tuple(self.picture(name, frame) for name in self.cameras))

    def masks(self, frame: int) -> dict[str, Bytes] | None:
        """The masks of the cameras that have files of them, given or made in set-up; None if none has."""
        masks = {name: kept.read(self._check_frame(frame)) for name, kept in self._masks.items()}
        return masks or None

    def has_masks(self, camera: str) -> bool:
        """Whether a camera has mask files, given with its pictures or made in set-up."""
        return camera in self._masks

    def size(self, camera: str) -> tuple[int, int]:
        """Width and height of a camera's pictures."""
        return self._by_name[camera].width, self._by_name[camera].height

    def background_path(self, camera: str) -> Path | None:
        """The plate picture or empty clip of a camera, if there is one."""
        entry = self._by_name[camera].background
        return self.folder / entry if entry else None

    def absent(self, frame: int) -> frozenset[str]:
        """Cameras without a picture of a frame that others have: live ones that had stopped. What `picture` shows in
        its place means nothing.
        """
        numbered = [camera for camera in self.source.cameras if camera.kind == "numbered"]
        if not numbered:
            return frozenset()
        index = self._check_frame(frame)
        missing = {
            camera.name
            for camera in numbered
            if not has_picture(self.folder / camera.path, camera.file_frame(index))
        }
        return frozenset(missing) if len(missing) < len(self.cameras) else frozenset()

    def region(self, kind: Region, camera: str) -> Bytes | None:
        """(H, W) uint8, 255 in a region of a camera's pictures, None where nothing is painted: `<kind>/<camera>.png`.

        Raises FootageError for a picture of another size.
        """
        path = self.folder / kind / f"{camera}.png"
        if not path.exists():
            return None
        picture = read_picture(path)
        source = self._by_name[camera]
        if picture.shape[:2] != (source.height, source.width):
            raise FootageError(
                f"The picture '{kind}/{path.name}' is {picture.shape[1]}x{picture.shape[0]} pixels, the footage"
                f" {source.width}x{source.height}.",
                "Paint it again, or remove it.",
            )
        return thresholded_mask(picture)

    def turned_background(self, camera: str, picture: Bytes) -> Bytes:
        """A background picture of a camera (H, W, 3), turned as its footage is, unless it was turned already."""
        source = self._by_name[camera]
        height, width = picture.shape[:2]
        turn = background_turn(source.turned, (source.width, source.height), (width, height))
        return turned_picture(picture, turn)

    def release(self, camera: str) -> None:
        """Close a camera's files and forget its last pictures; the next read opens them again."""
        for kept in filter(None, (self._pictures[camera], self._masks.get(camera), self._hidden.get(camera))):
            kept.release()
        give_back_freed_memory(of_late=True)

    def close(self) -> None:
        for kept in (*self._pictures.values(), *self._masks.values(), *self._hidden.values()):
            kept.close()
        if sum(kept.read_count for kept in self._pictures.values()) >= MANY_PICTURES:
            give_back_freed_memory()

    def _check_frame(self, frame: int) -> int:
        if not 0 <= frame < self.frame_count:
            raise NotFoundError(
                f"There is no frame {frame}.", f"The footage has frames 0 to {self.frame_count - 1}."
            )
        return frame


def open_footage(source: FootageSource, session_folder: Path) -> Footage:
    """The footage that a manifest describes. Raises FootageError if a file is gone, NotFoundError if the session is."""
    for camera in source.cameras:
        for entry in filter(None, camera.places):
            if not (session_folder / entry).exists():
                if not session_folder.is_dir():
                    raise NotFoundError(
                        f"'{session_folder}' is no longer there.",
                        "If it was renamed meanwhile, do this again under its new name.",
                    )
                raise FootageError(
                    f"Footage '{entry}' of camera {camera.name} is not there.",
                    "Put the file back, or import the session again.",
                )
        if min(camera.width, camera.height) < 1:
            raise FootageError(
                f"The pictures of camera {camera.name} are said to be {camera.width}x{camera.height} pixels.",
                "Import the session again.",
            )
        if camera.offset < 0 or camera.file_frame(source.frame_count - 1) >= max(1, camera.frame_count):
            raise FootageError(
                f"Camera {camera.name} has {camera.frame_count} frames, which {source.frame_count} from frame"
                f" {camera.offset} on are not among.",
                "Correct its offset with 'studio synchronise', or import the session again.",
            )
    return Footage(source, session_folder)


def camera_reader(source: CameraSource, session_folder: Path) -> Reader:
    """The frames of one camera's file or folder as they lie there: not turned, counted from the file's first one."""
    path = session_folder / source.path
    if source.kind == "video":
        return VideoReader(path, source.frame_count, source.fields)
    if source.kind == "numbered":
        return NumberedReader(path)
    return PictureReader(path, source.frame_count)


def turned_picture(picture: Bytes, degrees: int) -> Bytes:
    """(H, W, 3) turned clockwise by 0, 90, 180 or 270 degrees."""
    return np.ascontiguousarray(np.rot90(picture, -degrees // 90)) if degrees else picture


def background_turn(turned: int, footage: tuple[int, int], background: tuple[int, int]) -> int:
    """Degrees clockwise by which a background is to be turned to lie as the footage does.

    turned : of the footage; sizes as (width, height), the footage's once turned. A background that lies as the turned
    footage already, where that can be seen from its shape, stays as it is.
    """
    (width, height), (wide, tall) = footage, background
    return 0 if turned in (90, 270) and (wide - tall) * (width - height) > 0 else turned


def colour_as_it_is(picture: Bytes) -> Bytes:
    return picture


def hidden_beside(masks: Path) -> Path:
    """Where what is hidden lies, of a camera's folder of masks."""
    return masks.parent / HIDDEN / masks.name


def thresholded_mask(picture: Bytes) -> Bytes:
    """(H, W) 255 where any channel of a mask picture is above the level, else 0."""
    return np.where(picture.max(axis=2) > MASK_LEVEL, np.uint8(255), np.uint8(0))


class _Kept:
    """A reader that checks sizes and keeps its last pictures."""

    def __init__(self, reader: Reader, camera: CameraSource, prepare: Callable[[Bytes], Bytes]) -> None:
        self._reader, self._camera, self._prepare = reader, camera, prepare
        self._lock = threading.Lock()
        self._room = max(FEWEST_KEPT, KEPT_BYTES // (3 * camera.width * camera.height))
        self.read_count = 0
        self._number = next(_NUMBERS)
        weakref.finalize(self, _PICTURES.gone.append, self._number).atexit = False

    def read(self, index: int) -> Bytes:
        with self._lock:
            kept = _PICTURES.get(self._number, index)
            if kept is not None:
                return kept
            self.read_count += 1
            picture = turned_picture(self._reader.read(self._camera.file_frame(index)), self._camera.turned)
            height, width = picture.shape[:2]
            if (width, height) != (self._camera.width, self._camera.height):
                raise FootageError(
                    f"Frame {index} of camera {self._camera.name} is {width}x{height} pixels,"
                    f" not {self._camera.width}x{self._camera.height}.",
                    "Put the original file back, or import the session again.",
                )
            prepared = self._prepare(picture)
            prepared.setflags(write=False)
            _PICTURES.put(self._number, index, prepared, self._room)
            return prepared

    def release(self) -> None:
        with self._lock:
            self._reader.close()
            _PICTURES.forget(self._number)

    def close(self) -> None:
        self._reader.close()
        _PICTURES.forget(self._number)


class _KeptPictures:
    """The pictures that all readers of the process keep, within a size in bytes: the one used longest ago goes.

    Readers are known by numbers of their own. most : bytes; FEWEST_KEPT of each reader stay in any case.
    """

    def __init__(self, most: int) -> None:
        self.most, self.bytes = most, 0
        self.gone: deque[int] = deque()
        """Readers that are no more, as the garbage collector says in any thread at any time."""
        self._lock = threading.Lock()
        self._kept: OrderedDict[tuple[int, int], Bytes] = OrderedDict()
        self._counts: Counter[int] = Counter()

    def get(self, reader: int, index: int) -> Bytes | None:
        with self._lock:
            picture = self._kept.get((reader, index))
            if picture is not None:
                self._kept.move_to_end((reader, index))
            return picture

    def put(self, reader: int, index: int, picture: Bytes, room: int) -> None:
        """room : how many pictures of this reader are kept at most."""
        with self._lock:
            while self.gone:
                self._drop_all(self.gone.popleft())
            self._kept[reader, index] = picture
            self._counts[reader] += 1
            self.bytes += picture.nbytes
            for key in list(self._kept):
                full, too_many = self.bytes > self.most, self._counts[reader] > room
                if not (full or too_many):
                    return
                if self._counts[key[0]] > FEWEST_KEPT and (full or key[0] == reader):
                    self._drop(key)

    def forget(self, reader: int) -> None:
        with self._lock:
            self._drop_all(reader)

    def _drop_all(self, reader: int) -> None:
        for key in [key for key in self._kept if key[0] == reader]:
            self._drop(key)
        self._counts.pop(reader, None)

    def _drop(self, key: tuple[int, int]) -> None:
        self.bytes -= self._kept.pop(key).nbytes
        self._counts[key[0]] -= 1


_NUMBERS = itertools.count()
_PICTURES = _KeptPictures(KEPT_BYTES_IN_ALL)


def _mask_reader(path: Path) -> Reader:
    """Masks may have been trimmed with the footage, so only the frames in use need to be there."""
    return PictureReader(path, 0) if path.is_dir() else VideoReader(path, 0)


STRETCH = 24


def folded(frame: int, count: int) -> int:
    """The frame of `count` that is shown at place `frame` of a way forth and back: 0 1 2 1 0 1 … for three."""
    if count == 1:
        return 0
    place = frame % (2 * count - 2)
    return min(place, 2 * count - 2 - place)


class PingPong(Footage):
    """A session's footage with every frame under many numbers; `frame_count` still says how many it has."""

    _reached: dict[str, int] | None = None

    def picture(self, camera: str, frame: int) -> Bytes:
        """As `Footage.picture`; on the way back with the frames that come next."""
        reached = self._reached = {} if self._reached is None else self._reached
        index = self._check_frame(frame)
        before = reached.get(camera, -1)
        if index < before:
            source = self._by_name[camera]
            room = KEPT_BYTES // (3 * source.width * source.height)
            before = max(0, index - max(1, min(STRETCH, room // 2)) + 1)
            for earlier in range(before, index):
                super().picture(camera, earlier)
        turning = self._check_frame(frame + 1) > index
        reached[camera] = index if turning else before
        return super().picture(camera, index)

    def _check_frame(self, frame: int) -> int:
        if frame < 0:
            raise NotFoundError(f"There is no frame {frame}.", "Frames are counted from 0.")
        return folded(frame, self.frame_count)
