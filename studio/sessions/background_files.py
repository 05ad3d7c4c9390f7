"""A session's files for masks: backgrounds by camera, excluded regions, and knobs.

background/…                 plates and clips; the manifest names the one in use
exclusions/<camera>.png      white where nothing counts: a bystander, a monitor
in_front/<camera>.png        white where a thing stands in front of the subject's place: a table, a pole
person_masks/<n>/<camera>/…  masks that the studio made of a person, a PNG a frame, as those that come with footage; the
                             manifest names those in use
animal_masks/<n>/<camera>/…  those of an animal before known backgrounds
stroke_masks/<n>/<camera>/…  those made of brush strokes (`stroke_files`)
chosen_masks/<n>/<camera>/…  those of the source that suits each camera best
subject_masks/<n>/<camera>/… those of one of several subjects in view; subject_masks/<n>/whole/<camera>/… those of all,
                             of which they were cut
evidence.json                knobs of `evidence.settings` that new runs of the session start with, and the
                             given backgrounds and masks, where others are in use
"""

import contextlib
import dataclasses
import os
import shutil
from collections.abc import Generator, Iterable, Mapping
from pathlib import Path

import msgspec
import numpy as np

from studio.evidence.backgrounds import check_plate_size
from studio.footage.capture.footage import Region, background_turn, turned_picture
from studio.footage.capture.footage_source import CameraSource
from studio.footage.capture.pictures import check_picture, is_picture, painted_picture, png_of, with_polygon
from studio.footage.capture.video import measure_video
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import FootageError, NotFoundError
from studio.foundations.foreign_files import read_file
from studio.sessions import atomic_files
from studio.sessions.names import free_name, name_from
from studio.sessions.record_files import RecordFile
from studio.sessions.session import Session, redescribe
from studio.sessions.work_under_way import one_at_a_time, work_of_others

EVIDENCE_NAME, BACKGROUND_NAME = "evidence.json", "background"
ANIMAL_MASKS, PERSON_MASKS, STROKE_MASKS, CHOSEN_MASKS, SUBJECT_MASKS = HOMES = (
    "animal_masks",
    "person_masks",
    "stroke_masks",
    "chosen_masks",
    "subject_masks",
)
WHOLE = "whole"
SCHEMA_VERSION = 3
MASKS_GONE = (
    "The masks that the studio made were of the footage as it was before, and are gone: make them again with 'studio"
    " background SESSION --source person' (or animal, strokes, or best)."
)

Knob = bool | int | float | str


class SessionEvidence(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """knobs : by flat name. given : camera to the given background, where a cleaned one is in use. given_masks : camera
    to the masks that came with its footage, "" for none, where the studio's own are in use. found_in_front : cameras
    whose things in front were found in the masks: painted by hand they are kept when masks are set up again.
    """

    schema: int = SCHEMA_VERSION
    knobs: dict[str, Knob] = {}
    given: dict[str, str] = {}
    given_masks: dict[str, str] = {}
    found_in_front: list[str] = []


_RECORD = RecordFile(
    SessionEvidence,
    "how a session's masks are made",
    "Remove it, and set the background again.",
    ("Session '{name}' has no background.", "Set it again."),
    SCHEMA_VERSION,
    # Version 1 knew no masks of the studio's own, version 2 no things in front.
    {1: lambda entries: entries, 2: lambda entries: entries},
)


def read_evidence(session: Session) -> SessionEvidence:
    """How masks of a session are made; the defaults if nothing was set. Raises SessionError."""
    return _RECORD.read(session.path / EVIDENCE_NAME, SessionEvidence())


def use_given_backgrounds(session: Session) -> Session:
    """Put the session's given backgrounds back into use, where cleaned ones were; gives the session as it is then."""
    evidence = read_evidence(session)
    if not evidence.given:
        return session
    change_evidence(session, given={})
    return use_backgrounds(session, evidence.given)


def use_cleaned(session: Session, contents: Mapping[str, Bytes]) -> Session:
    """Store cleaned backgrounds (H, W, 3) by camera as `background/<camera>-clean.png` and use them; the earlier ones
    are remembered as given.
    """
    folder = session.path / BACKGROUND_NAME
    folder.mkdir(exist_ok=True)
    given = {source.name: source.background for source in session.manifest.footage.cameras}
    names: dict[str, str] = {}
    for camera, picture in contents.items():
        place = folder / f"{session.camera_source(camera).name}-clean.png"
        atomic_files.write_bytes(place, png_of(picture))
        names[camera] = place.relative_to(session.path).as_posix()
    change_evidence(session, given=given)
    return use_backgrounds(session, names)


def write_evidence(session: Session, evidence: SessionEvidence) -> None:
    """Store a session's knobs for masks."""
    _RECORD.write(session.path / EVIDENCE_NAME, evidence)


def change_evidence(session: Session, **entries: Mapping[str, Knob] | Mapping[str, str] | list[str]) -> None:
    """Change entries of what is stored of a session's masks, in a turn: what others change meanwhile is kept."""
    with one_at_a_time(session.path):
        write_evidence(session, msgspec.structs.replace(read_evidence(session), **entries))


def set_backgrounds(session: Session, files: Mapping[str, Path]) -> Session:
    """Take over pictures or clips of the empty room, by camera; they are copied into the session.

    Returns the session with its new manifest. Raises NotFoundError for a camera or file that is not there, FootageError
    for one of another size.
    """
    for camera, path in files.items():
        source = session.camera_source(camera)
        if not path.is_file():
            raise NotFoundError(f"There is no file '{path}'.", "Give a picture or a video of the empty room.")
        size = (source.width, source.height)
        if is_picture(path):
            given = check_picture(path)
        else:
            video = measure_video(path)
            given = (video.width, video.height)
        if background_turn(source.turned, size, given) % 180:
            given = (given[1], given[0])
        check_plate_size(given, size, path.name)
    folder = session.path / BACKGROUND_NAME
    folder.mkdir(exist_ok=True)
    names: dict[str, str] = {}
    for camera, path in files.items():
        place = folder / f"{camera}{path.suffix.lower()}"
        if place.resolve() != path.resolve():
            atomic_files.copy_file(path, place)
        names[camera] = place.relative_to(session.path).as_posix()
    with one_at_a_time(session.path):
        given_before = read_evidence(session).given
        change_evidence(session, given={key: given_before[key] for key in given_before if key not in names})
    return use_backgrounds(session, names)


def use_backgrounds(session: Session, names: Mapping[str, str]) -> Session:
    """The session with other backgrounds in its manifest: camera to a path within the session, "" for none."""
    footage = session.manifest.footage
    cameras = tuple(
        dataclasses.replace(source, background=names.get(source.name, source.background))
        for source in footage.cameras
    )
    changed = dataclasses.replace(footage, cameras=cameras)
    return redescribe(session, msgspec.structs.replace(session.manifest, footage=changed))


class MadeMasks:
    """A folder that is filled with masks of a session, which then takes its place."""

    def __init__(self, session: Session, folder: Path) -> None:
        self.folder = folder
        self._sources = {source.name: source for source in session.manifest.footage.cameras}
        self._places: dict[str, str] = {}
        for name, source in self._sources.items():
            self._places[name] = free_name(name_from(name, "camera"), set(self._places.values()))
            with atomic_files.writing("The masks in", folder):
                (folder / self._places[name]).mkdir()
            # Masks are counted as the file's frames are, of which the session's first is not the first.
            frames = range(session.manifest.frame_count)
            used = {source.file_frame(frame) for frame in frames} if source.steps else set(frames)
            last = max(used, default=0) if source.steps else source.offset - 1
            blank = np.zeros((source.height, source.width), np.uint8)
            for number in range(last + 1):
                if not source.steps or number not in used:
                    self._write(name, f"{number:06d}.png", blank)

    def put(self, camera: str, frame: int, mask: Bytes) -> None:
        """Write a mask (H, W), 0 or 255, of a frame of the session, as the camera's file shows it: not turned."""
        self._write(camera, mask_name(self._sources[camera], frame), mask)

    def _write(self, camera: str, name: str, mask: Bytes) -> None:
        with atomic_files.writing("The masks in", self.folder):
            stored = turned_picture(mask, -self._sources[camera].turned % 360)
            (self.folder / self._places[camera] / name).write_bytes(png_of(stored))

    def take_over(self, camera: str, frame: int, stored: Path) -> None:
        """Copy a mask of the session that is already in the right form."""
        with atomic_files.writing("The masks in", self.folder):
            self._path(camera, frame).write_bytes(read_file(stored))

    @property
    def folders(self) -> dict[str, str]:
        """Camera to the name of its masks' folder in this one."""
        return dict(self._places)

    def names(self, place: str) -> dict[str, str]:
        """Camera to its masks' folder. place : of this folder in the session."""
        return {camera: f"{place}/{name}" for camera, name in self._places.items()}

    def _path(self, camera: str, frame: int) -> Path:
        return self.folder / self._places[camera] / mask_name(self._sources[camera], frame)


def mask_name(source: CameraSource, frame: int) -> str:
    """The file of a camera's mask of a frame of the session, counted as its footage's file is."""
    return f"{source.file_frame(frame):06d}.png"


def made_folders(session: Session, home: str) -> list[Path]:
    """The folders of masks of one of HOMES, the newest last."""
    folders = [path for path in (session.path / home).glob("*") if path.name.isdigit()]
    return sorted(folders, key=lambda path: int(path.name))


@contextlib.contextmanager
def made_masks(session: Session, home: str) -> Generator[MadeMasks]:
    """Masks to be filled in; at the end, unless anything failed, they take their place in `home`, one of HOMES, and are
    used.

    Earlier ones stay until `forget_unused_masks`. Raises SessionError.
    """
    with one_at_a_time(session.path):
        folder = atomic_files.new_folder_beside(session.path / home / "1", parents=False)
    try:
        made = MadeMasks(session, folder)
        yield made
        with one_at_a_time(session.path):
            numbers = [int(path.name) for path in made_folders(session, home)]
            place = f"{home}/{max(numbers, default=0) + 1}"
            atomic_files.move_into_place(folder, session.path / place)
            change_evidence(session, given_masks=given_masks_of(session))
            use_masks(session, made.names(place))
    finally:
        atomic_files.discard(folder)


def given_masks_of(session: Session) -> dict[str, str]:
    """Camera to the masks that came with its footage, "" for none, whatever masks are in use."""
    given = read_evidence(session).given_masks
    return {
        source.name: given.get(source.name, "") if has_made_masks(source) else source.masks
        for source in session.manifest.footage.cameras
    }


def has_made_masks(source: CameraSource) -> bool:
    """Whether the masks in use are the studio's own."""
    return home_of_masks(source) != ""


def home_of_masks(source: CameraSource) -> str:
    """Which of HOMES the masks in use lie in, "" for none."""
    home = source.masks.partition("/")[0]
    return home if home in HOMES else ""


def without_made_masks(session: Session, cameras: Iterable[CameraSource]) -> tuple[CameraSource, ...]:
    """Some of the session's cameras, with the masks that came with their footage."""
    given = given_masks_of(session)
    return tuple(
        dataclasses.replace(source, masks=given[source.name]) if has_made_masks(source) else source
        for source in cameras
    )


def use_given_masks(session: Session) -> Session:
    """The session with the masks in use that came with its footage."""
    if not any(map(has_made_masks, session.manifest.footage.cameras)):
        return session
    cameras = without_made_masks(session, session.manifest.footage.cameras)
    change_evidence(session, given_masks={})
    return use_masks(session, {source.name: source.masks for source in cameras})


def forget_unused_masks(session: Session) -> None:
    """Remove the studio's own masks that no camera refers to any more, and unfinished ones; none while others are at
    work in the session, who may be making or trying them. The newest masks from strokes stay, since later strokes
    change only part of them.
    """
    with one_at_a_time(session.path):
        # A job's process works for the server, which says so, too.
        if any(work.process != str(os.getppid()) for work in work_of_others(session.path)):
            return
        cameras = Session(session.path).manifest.footage.cameras
        used = {Path(*Path(source.masks).parts[:2]) for source in cameras if has_made_masks(source)}
        of_strokes = made_folders(session, STROKE_MASKS)
        if of_strokes and not any(place.parts[0] == STROKE_MASKS for place in used):
            used.add(of_strokes[-1].relative_to(session.path))
        for home in HOMES:
            for path in list((session.path / home).glob("*")):
                if path.relative_to(session.path) not in used:
                    shutil.rmtree(path, ignore_errors=True)
            with contextlib.suppress(OSError):
                (session.path / home).rmdir()


def use_masks(session: Session, names: Mapping[str, str]) -> Session:
    """The session with other masks in its manifest: camera to a path within the session, "" for none."""
    footage = session.manifest.footage
    cameras = tuple(
        dataclasses.replace(source, masks=names.get(source.name, source.masks)) for source in footage.cameras
    )
    changed = dataclasses.replace(footage, cameras=cameras)
    return redescribe(session, msgspec.structs.replace(session.manifest, footage=changed))


def set_region(session: Session, kind: Region, camera: str, content: bytes) -> int:
    """Store a region of a camera, a painted picture (PNG or other); an empty one removes it. Returns its pixels.

    Raises FootageError for an unreadable picture, or one of another size than the footage.
    """
    source = session.camera_source(camera)
    painted = painted_picture(content) if content else np.zeros((source.height, source.width), np.uint8)
    if painted.shape != (source.height, source.width):
        raise FootageError(
            f"What was painted is {painted.shape[1]}x{painted.shape[0]} pixels, camera {camera}"
            f" {source.width}x{source.height}.",
            "Give a PNG of the footage's size.",
        )
    _write_region(session, kind, camera, painted)
    if kind == "in_front":
        found = read_evidence(session).found_in_front
        if camera in found:
            change_evidence(session, found_in_front=[name for name in found if name != camera])
    return int(np.count_nonzero(painted))


def _write_region(session: Session, kind: Region, camera: str, painted: Bytes) -> None:
    path = session.path / kind / f"{camera}.png"
    if not painted.any():
        path.unlink(missing_ok=True)
        return
    path.parent.mkdir(exist_ok=True)
    atomic_files.write_bytes(path, png_of(painted))


def painted_in_front(session: Session) -> list[str]:
    """Cameras whose things in front were painted by hand."""
    found = read_evidence(session).found_in_front
    return [path.stem for path in sorted((session.path / "in_front").glob("*.png")) if path.stem not in found]


def use_found_in_front(session: Session, found: Mapping[str, Bytes]) -> None:
    """Replace the things that were found in front before. found : by camera, not those painted by hand."""
    with one_at_a_time(session.path):
        for camera in read_evidence(session).found_in_front:
            if camera not in found:
                (session.path / "in_front" / f"{camera}.png").unlink(missing_ok=True)
        for camera, painted in found.items():
            _write_region(session, "in_front", camera, painted)
        change_evidence(session, found_in_front=sorted(found))


def add_polygon(session: Session, kind: Region, camera: str, corners: Array) -> int:
    """Add a polygon (K, 2) of pixels to a region of a camera. Returns the pixels of all. Raises NotFoundError."""
    source = session.camera_source(camera)
    path = session.path / kind / f"{camera}.png"
    painted = np.zeros((source.height, source.width), np.uint8)
    if path.exists():
        painted = painted_picture(read_file(path))
    return set_region(session, kind, camera, png_of(with_polygon(painted, corners)))
