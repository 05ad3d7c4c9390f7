"""A session's brush strokes, and the masks that were made of them.

strokes.json                   the strokes of all cameras, as they are painted or given
stroke_masks/<n>/<camera>/…    masks made of them, a PNG a frame (`background_files`)
stroke_masks/<n>/made.json     of which strokes and which footage they were made: of strokes that changed only in later
                               frames, the masks before these are taken over
"""

import dataclasses
import math
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from studio.evidence.strokes import Stroke
from studio.footage.capture.footage import thresholded_mask, turned_picture
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.pictures import read_picture
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError, SessionError
from studio.foundations.foreign_files import check_regular
from studio.sessions.background_files import STROKE_MASKS, made_folders, mask_name
from studio.sessions.record_files import RecordFile
from studio.sessions.session import Session

STROKES_NAME, MADE_NAME = "strokes.json", "made.json"
MOST_STROKES, MOST_POINTS, WIDEST = 10_000, 20_000, 2000.0
MISSING = (
    "Session '{name}' has no strokes.",
    "Paint them in step Background of the guided set-up, or give a file with --strokes.",
)
OUTDATED = (
    "The brush strokes are of the pictures as they were before: look at them in step Background, and paint them again"
    " where they do not fit."
)
FORMAT = (
    'Write {"strokes": [{"camera": "cam1", "frame": 0, "kind": "inside", "width": 8, "points": [[320, 200],'
    " [330, 260]]}, …]}, points in pixels of the camera's picture."
)


class SessionStrokes(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    schema: int = 1
    strokes: tuple[Stroke, ...] = ()


class StrokeMasksMade(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What stroke masks were made of. folders : camera to its masks' folder. footage : camera to what its pictures
    were. run : whose projection helped, "" for none.
    """

    schema: int = 1
    strokes: tuple[Stroke, ...]
    folders: dict[str, str]
    footage: dict[str, str]
    run: str = ""


_STROKES = RecordFile(SessionStrokes, "brush strokes", FORMAT, MISSING)
_MADE = RecordFile(
    StrokeMasksMade, "what masks were made of", "Remove its folder, and make them again.", MISSING
)


_replacing = threading.Lock()


def stored_strokes(session: Session) -> tuple[Stroke, ...]:
    """The session's strokes as they are stored, none where nothing was painted. Raises SessionError."""
    return _STROKES.read(session.path / STROKES_NAME, SessionStrokes()).strokes


def read_strokes(session: Session) -> tuple[Stroke, ...]:
    """The session's strokes, without those that its footage has no camera, frame or place for any more since it was
    changed. Raises SessionError.
    """
    sources, count = sources_by_name(session), session.manifest.frame_count
    return tuple(one for one in stored_strokes(session) if not _misfit(one, sources, count))


def write_strokes(session: Session, strokes: Sequence[Stroke]) -> None:
    """Store a session's strokes in place of those it has. Raises FootageError for what does not fit it."""
    check_strokes(session, strokes)
    restore_strokes(session, strokes)


def replace_strokes(session: Session, camera: str, strokes: Sequence[Stroke]) -> None:
    """Store one camera's strokes in place of those it has. Raises FootageError for what does not fit it."""
    with _replacing:
        others = [one for one in read_strokes(session) if one.camera != camera]
        write_strokes(session, [*others, *strokes])


def restore_strokes(session: Session, strokes: Sequence[Stroke]) -> None:
    """Store earlier strokes again, whether or not they still fit."""
    path = session.path / STROKES_NAME
    if not strokes:
        path.unlink(missing_ok=True)
        return
    _STROKES.write(path, SessionStrokes(strokes=tuple(strokes)))


def strokes_of_file(session: Session, path: Path) -> tuple[Stroke, ...]:
    """The strokes of a file of the same format. Raises FootageError, SessionError for one that cannot be read."""
    check_regular(path, SessionError)
    if not path.is_file():
        raise FootageError(f"There is no file '{path}'.", FORMAT)
    strokes = _STROKES.read(path).strokes
    check_strokes(session, strokes, f"'{path.name}': ")
    return strokes


def check_strokes(session: Session, strokes: Sequence[Stroke], where: str = "") -> None:
    """Raises FootageError for strokes that do not fit the session's footage. where : begins the message."""
    if len(strokes) > MOST_STROKES:
        raise FootageError(f"{where}{len(strokes)} strokes are too many.", f"Paint {MOST_STROKES} at most.")
    sources, count = sources_by_name(session), session.manifest.frame_count
    for number, stroke in enumerate(strokes, 1):
        if wrong := _misfit(stroke, sources, count):
            raise FootageError(f"{where}stroke {number} cannot be: {wrong}.", FORMAT)


def sources_by_name(session: Session) -> dict[str, CameraSource]:
    """The session's cameras by name."""
    return {source.name: source for source in session.manifest.footage.cameras}


def missing_view(camera: str, frame: int, sources: Mapping[str, CameraSource], count: int) -> str:
    """What the footage lacks of a camera's view of a frame, "" if it has it. count : of frames."""
    if camera not in sources:
        return f"there is no camera '{camera[:64]}'; the session has {', '.join(sources)}"
    if not 0 <= frame < count:
        return f"there is no frame {frame}; the footage has frames 0 to {count - 1}"
    return ""


def _misfit(stroke: Stroke, sources: Mapping[str, CameraSource], count: int) -> str:
    """Why a stroke does not fit the footage, "" if it does. count : of frames."""
    if missing := missing_view(stroke.camera, stroke.frame, sources, count):
        return missing
    source = sources[stroke.camera]
    if not 1.0 <= stroke.width <= WIDEST:
        return f"a brush is 1 to {WIDEST:.0f} pixels wide, not {stroke.width:g}"
    if not 1 <= len(stroke.points) <= MOST_POINTS:
        return f"it has {len(stroke.points)} points, and 1 to {MOST_POINTS} are possible"
    away = next((point for point in stroke.points if not _in_picture(point, source, stroke.width)), None)
    if away is None:
        return ""
    return f"point {away[0]:g}, {away[1]:g} lies outside the picture of {source.width}x{source.height}"


def _in_picture(point: tuple[float, float], source: CameraSource, width: float) -> bool:
    """Whether any of a dot of this width can lie in the picture."""
    x, y = point
    inside = -width <= x <= source.width + width and -width <= y <= source.height + width
    return math.isfinite(x) and math.isfinite(y) and inside


@dataclasses.dataclass(frozen=True, slots=True)
class StrokeMasks:
    """Masks made of strokes that lie in a session. place : their folder. made : of what."""

    place: Path
    made: StrokeMasksMade
    sources: dict[str, CameraSource]

    def path(self, camera: str, frame: int) -> Path:
        """The PNG of a frame's mask."""
        return self.place / self.made.folders[camera] / mask_name(self.sources[camera], frame)

    def mask(self, camera: str, frame: int) -> Bytes:
        """(H, W) uint8, 0 or 255, as the footage is turned. Raises FootageError."""
        return turned_picture(
            thresholded_mask(read_picture(self.path(camera, frame))), self.sources[camera].turned
        )


def made_of_strokes(session: Session, run: str = "") -> StrokeMasks | None:
    """The newest masks made of strokes on the present footage, with the projection of `run`; None without any."""
    footage = session.manifest.footage
    for place in reversed(made_folders(session, STROKE_MASKS)):
        try:
            made = _MADE.read(place / MADE_NAME)
        except (SessionError, FootageError, LookupError):
            continue
        if made.footage == pictures_of(footage) and made.run == run:
            return StrokeMasks(place, made, {source.name: source for source in footage.cameras})
    return None


def write_made(folder: Path, made: StrokeMasksMade) -> None:
    """Store what the masks of a folder were made of."""
    _MADE.write(folder / MADE_NAME, made)


def pictures_of(footage: FootageSource) -> dict[str, str]:
    """Camera to words that change when its pictures do."""
    return {
        source.name: f"{source.path} {source.width}x{source.height} from {source.offset}, turned {source.turned},"
        f" {footage.frame_count} frames"
        for source in footage.cameras
    }
