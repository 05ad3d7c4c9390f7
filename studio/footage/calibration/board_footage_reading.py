"""Board footage of several cameras: one video, or one folder of pictures, or one picture a camera."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from studio.footage.calibration.boards import Detection
from studio.footage.calibration.detection import BoardFinder, sharpness
from studio.footage.capture.footage import background_turn, turned_picture
from studio.footage.capture.naming import match_names, natural_key
from studio.footage.capture.pictures import is_picture, list_pictures, read_picture
from studio.footage.capture.video import VIDEO_SUFFIXES, VideoReader, measure_video
from studio.foundations.arrays import Bytes, Indices
from studio.foundations.errors import CalibrationError
from studio.foundations.progress import Progress, no_progress

LENS_FRAMES, RIG_FRAMES = 60, 120
LENS_PICTURES = 30
AFFIXES = re.compile(
    r"^(int|ext|intrinsics?|extrinsics?|calib|calibration|board)[_-]|[_-](int|ext|img|imgs|images|calib|calibration|board)$"
)
BLURRED = 0.5
"""Pictures less sharp than this share of the median are passed over where there are many."""


@dataclass(frozen=True, slots=True)
class BoardFootage:
    """One camera's. name : of the file or folder. video : a video file, or None. pictures : picture files, or ()."""

    name: str
    video: Path | None
    pictures: tuple[Path, ...]


@dataclass(frozen=True, slots=True)
class HowTaken:
    """How a session's footage is read, for board footage taken with it. offsets : camera → the recording's frame (or
    picture) that is moment 0. turned : camera → degrees clockwise. sizes : camera → width, height of the turned
    footage; board pictures that lie as that already stay as they are.
    """

    offsets: Mapping[str, int] = field(default_factory=dict[str, int])
    turned: Mapping[str, int] = field(default_factory=dict[str, int])
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])

    def upright(self, camera: str, picture: Bytes) -> Bytes:
        """A recording's picture, turned as the footage of its camera is."""
        turn, given = self.turned.get(camera, 0), (picture.shape[1], picture.shape[0])
        return turned_picture(picture, background_turn(turn, self.sizes.get(camera, given), given))


AS_IT_IS = HowTaken()


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A detection and how sharp its picture is."""

    detection: Detection
    sharpness: float


def list_footage(folder: Path) -> tuple[BoardFootage, ...]:
    """The footage in a folder: its videos, its folders of pictures, or its pictures (one a camera).

    Raises CalibrationError if there is none.
    """
    if not folder.is_dir():
        raise CalibrationError(
            f"There is no folder '{folder}'.", "Name the folder with the board's videos or pictures."
        )
    entries = sorted((path for path in folder.iterdir() if not _is_litter(path.name)), key=_natural)
    videos = [path for path in entries if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file()]
    if videos:
        return tuple(BoardFootage(path.stem, path, ()) for path in videos)
    folders = [(path, list_pictures(path)) for path in entries if path.is_dir()]
    footage = [BoardFootage(path.name, None, pictures) for path, pictures in folders if pictures]
    if footage:
        return tuple(footage)
    single = [path for path in entries if path.is_file() and is_picture(path)]
    if not single:
        raise CalibrationError(
            f"'{folder.name}' holds no videos and no folders of pictures.",
            "Put one video or one folder of pictures of the board a camera in it, named after the cameras.",
        )
    return tuple(BoardFootage(path.stem, None, (path,)) for path in single)


def by_camera(footage: Sequence[BoardFootage], names: Sequence[str]) -> dict[str, BoardFootage]:
    """Camera name → its footage. Raises CalibrationError if names cannot be matched one to one."""
    matches = match_names([entry.name for entry in footage], names, "board recordings", CalibrationError)
    matched = {match.camera: entry for match, entry in zip(matches, footage, strict=True)}
    return {name: matched[name] for name in names if name in matched}


def plain_names(names: Sequence[str]) -> tuple[str, ...]:
    """Cameras' names from their board footage, without words for its purpose, if they stay distinct."""
    plain = tuple(AFFIXES.sub("", name) or name for name in names)
    return plain if len(set(plain)) == len(plain) else tuple(names)


def look_for_lens(
    finder: BoardFinder,
    camera: str,
    footage: BoardFootage,
    progress: Progress = no_progress,
    taken: HowTaken = AS_IT_IS,
) -> list[Seen]:
    """The board in one camera's pictures, or in up to 60 frames spread over its video."""
    count = frame_count(footage)
    frames = np.arange(count) if footage.video is None else frames_in_step([count], LENS_FRAMES)
    return _examine(finder, camera, footage, count, frames, progress, taken)


def look_together(
    finder: BoardFinder,
    footage: dict[str, BoardFootage],
    progress: Progress = no_progress,
    also: Sequence[int] = (),
    taken: HowTaken = AS_IT_IS,
) -> list[Seen]:
    """The board in up to 120 moments of all cameras; frames (or pictures in their order) of equal number, counted from
    the offsets on, belong together, as far as the shortest recording goes. also : moments to include in any case.

    Raises CalibrationError if the offsets leave none.
    """
    counts = {camera: frame_count(entry) for camera, entry in footage.items()}
    begins = {camera: taken.offsets.get(camera, 0) for camera in footage}
    first = max(0, -min(begins.values()))
    least = min(counts[camera] - begins[camera] for camera in footage)
    if least <= first:
        raise CalibrationError(
            "With these offsets no moment of the board footage is left that all cameras have.",
            "Correct them, or leave them out where the board was recorded separately.",
        )
    frames = first + frames_in_step([least - first], RIG_FRAMES)
    frames = np.union1d(frames, [frame for frame in also if first <= frame < least]).astype(np.int64)
    seen: list[Seen] = []
    for camera, entry in footage.items():
        seen += _examine(finder, camera, entry, counts[camera], frames, progress, taken, begins[camera])
    return seen


def frame_count(footage: BoardFootage) -> int:
    """The number of frames or pictures; a video is decoded completely, so that damage is found. Raises FootageError."""
    return len(footage.pictures) if footage.video is None else measure_video(footage.video).frame_count


def frames_in_step(counts: Sequence[int], most: int) -> Indices:
    """Frame numbers to look at, the same for all cameras of these frame counts."""
    least = min(counts)
    step = max(1, -(-least // most))
    return np.arange(0, least, step)


def chosen_for_lens(seen: Sequence[Seen], most: int = LENS_PICTURES) -> tuple[list[Detection], int]:
    """Sharp ones that together cover the picture, most informative first; and how many were blurred."""
    if len(seen) <= most // 2:
        return [entry.detection for entry in seen], 0
    usual = float(np.median([entry.sharpness for entry in seen]))
    sharp = [entry for entry in seen if entry.sharpness >= BLURRED * usual]
    cells = [_cells(entry.detection) for entry in sharp]
    covered: dict[int, int] = {}
    left, chosen = list(range(len(sharp))), list[Detection]()
    while left and len(chosen) < most:
        gains = [
            sum(0.5 ** covered.get(cell, 0) for cell in cells[k]) * min(sharp[k].sharpness / usual, 1.2)
            for k in left
        ]
        best = left.pop(int(np.argmax(gains)))
        for cell in cells[best]:
            covered[cell] = covered.get(cell, 0) + 1
        chosen.append(sharp[best].detection)
    return sorted(chosen, key=lambda detection: detection.frame), len(seen) - len(sharp)


def _cells(detection: Detection) -> set[int]:
    """Cells of an 8 by 8 grid that a detection's corners lie in, distinguished by the tilt of the board."""
    places = np.clip(8 * detection.pixels / np.array(detection.size), 0, 7).astype(int)
    first, last = detection.pixels[0], detection.pixels[-1]
    lean = int(np.degrees(np.arctan2(last[1] - first[1], last[0] - first[0])) // 20) % 18
    return {int(place) + 64 * lean for place in 8 * places[:, 1] + places[:, 0]}


def _examine(
    finder: BoardFinder,
    camera: str,
    footage: BoardFootage,
    count: int,
    frames: Indices,
    progress: Progress,
    taken: HowTaken,
    begin: int = 0,
) -> list[Seen]:
    seen: list[Seen] = []
    for done, (frame, name, raw) in enumerate(_pictures(footage, count, frames + begin)):
        progress(f"Looking for the board, camera {camera}", done, len(frames))
        picture = taken.upright(camera, raw)
        detection = finder.find(picture, camera, frame - begin, name)
        if detection is not None:
            seen.append(Seen(detection, sharpness(picture, detection)))
    return seen


def footage_picture(footage: BoardFootage, frame: int) -> Bytes:
    """(H, W, 3) one frame of a recording (or picture, in their order), as it is stored. Raises FootageError."""
    count = frame_count(footage)
    return next(iter(_pictures(footage, count, np.array([min(max(frame, 0), count - 1)]))))[2]


def _pictures(footage: BoardFootage, count: int, frames: Indices) -> Iterator[tuple[int, str, Bytes]]:
    if footage.video is None:
        for frame in map(int, frames):
            yield frame, footage.pictures[frame].name, read_picture(footage.pictures[frame])
        return
    reader = VideoReader(footage.video, count)
    try:
        for frame in map(int, frames):
            yield frame, f"frame {frame}", reader.read(frame)
    finally:
        reader.close()


def _is_litter(name: str) -> bool:
    """Hidden files, and the coverage pictures of an earlier calibration."""
    return name.startswith(".") or ".coverage-" in name


def _natural(path: Path) -> tuple[tuple[int, int, str], ...]:
    return natural_key(path.name)


LENS_NAMES = ("intrinsics", "intrinsic")
RIG_NAMES = ("extrinsics", "extrinsic")


def find_board_footage(folder: Path) -> tuple[Path | None, Path | None]:
    """The folders with footage for the lenses and with common footage.

    `intrinsics/` and `extrinsics/` in the folder or in its `calibration/` (Pose2Sim, Caliscope), or the folder itself
    with one recording a camera (anipose, FreeMoCap).

    Raises CalibrationError if neither is there.
    """
    if not folder.is_dir():
        raise CalibrationError(f"There is no folder '{folder}'.", "Name the folder of the board's footage.")
    for place in (folder, folder / "calibration"):
        lens = _first(place, LENS_NAMES)
        rig = _first(place, RIG_NAMES)
        if lens is not None or rig is not None:
            return lens, rig
    for place in (folder / "calibration", folder):
        if place.is_dir() and _holds_footage(place):
            return None, place
    raise CalibrationError(
        f"'{folder.name}' holds no board footage.",
        "Make folders intrinsics/ and extrinsics/ with one video or folder of pictures a camera, or name them.",
    )


def _first(place: Path, names: tuple[str, ...]) -> Path | None:
    return next((place / name for name in names if (place / name).is_dir()), None)


def _holds_footage(place: Path) -> bool:
    try:
        return bool(list_footage(place))
    except CalibrationError:
        return False
