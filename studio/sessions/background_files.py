"""A session's files for masks: backgrounds by camera, excluded regions, and knobs.

background/…                 plates and clips; the manifest names the one in use
exclusions/<camera>.png      white where nothing counts: a bystander, a monitor
evidence.json                knobs of `evidence.settings` that new runs of the session start with, and the
                             given backgrounds, where cleaned ones are in use
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np

from studio.arrays import Array, Bytes
from studio.capture.footage import EXCLUSIONS, background_turn
from studio.capture.footage_source import CameraSource
from studio.capture.pictures import check_picture, is_picture, painted_picture, png_of, with_polygon
from studio.capture.video import measure_video
from studio.errors import FootageError, NotFoundError
from studio.evidence.backgrounds import check_plate_size
from studio.sessions import atomic_files
from studio.sessions.record_files import RecordFile
from studio.sessions.session import Session, described_anew

EVIDENCE_NAME, BACKGROUND_NAME = "evidence.json", "background"
SCHEMA_VERSION = 1

Knob = bool | int | float | str


class SessionEvidence(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """knobs : by flat name. given : camera to the given background, where a cleaned one is in use."""

    schema: int = SCHEMA_VERSION
    knobs: dict[str, Knob] = {}
    given: dict[str, str] = {}


_RECORD = RecordFile(
    SessionEvidence,
    "how a session's masks are made",
    "Remove it, and set the background again.",
    ("Session '{name}' has no background.", "Set it again."),
    SCHEMA_VERSION,
)


def read_evidence(session: Session) -> SessionEvidence:
    """How masks of a session are made; nothing special where that was not set. Raises SessionError."""
    return _RECORD.read(session.path / EVIDENCE_NAME, SessionEvidence())


def given_backgrounds(session: Session) -> Session:
    """The session with the backgrounds in use that were given, where cleaned ones were."""
    evidence = read_evidence(session)
    if not evidence.given:
        return session
    write_evidence(session, msgspec.structs.replace(evidence, given={}))
    return use_backgrounds(session, evidence.given)


def use_cleaned(session: Session, contents: Mapping[str, Bytes]) -> Session:
    """Store cleaned backgrounds (H, W, 3) by camera as `background/<camera>-clean.png` and use them; the earlier ones
    are remembered as given.
    """
    folder = session.path / BACKGROUND_NAME
    folder.mkdir(exist_ok=True)
    given = {source.name: source.background for source in session.manifest.footage.cameras}
    names = {}
    for camera, picture in contents.items():
        place = folder / f"{_source(session, camera).name}-clean.png"
        atomic_files.write_bytes(place, png_of(picture))
        names[camera] = place.relative_to(session.path).as_posix()
    write_evidence(session, msgspec.structs.replace(read_evidence(session), given=given))
    return use_backgrounds(session, names)


def write_evidence(session: Session, evidence: SessionEvidence) -> None:
    """Store a session's knobs for masks."""
    _RECORD.write(session.path / EVIDENCE_NAME, evidence)


def set_backgrounds(session: Session, files: Mapping[str, Path]) -> Session:
    """Take over pictures or clips of the empty room, by camera; they are copied into the session.

    Returns the session with its new manifest. Raises NotFoundError for a camera or file that is not there, FootageError
    for one of another size.
    """
    for camera, path in files.items():
        source = _source(session, camera)
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
    names = {}
    for camera, path in files.items():
        place = folder / f"{camera}{path.suffix.lower()}"
        if place.resolve() != path.resolve():
            atomic_files.copy_file(path, place)
        names[camera] = place.relative_to(session.path).as_posix()
    evidence = read_evidence(session)
    kept = {camera: name for camera, name in evidence.given.items() if camera not in names}
    write_evidence(session, msgspec.structs.replace(evidence, given=kept))
    return use_backgrounds(session, names)


def use_backgrounds(session: Session, names: Mapping[str, str]) -> Session:
    """The session with other backgrounds in its manifest: camera to a path within the session, "" for none."""
    footage = session.manifest.footage
    cameras = tuple(
        dataclasses.replace(source, background=names.get(source.name, source.background))
        for source in footage.cameras
    )
    changed = dataclasses.replace(footage, cameras=cameras)
    return described_anew(session, msgspec.structs.replace(session.manifest, footage=changed))


def set_exclusion(session: Session, camera: str, content: bytes) -> int:
    """Store a painted picture (PNG or other) of excluded regions; an empty one removes them. Returns the pixels.

    Raises FootageError for an unreadable picture, or one of another size than the footage.
    """
    source = _source(session, camera)
    path = session.path / EXCLUSIONS / f"{camera}.png"
    if not content:
        path.unlink(missing_ok=True)
        return 0
    painted = painted_picture(content)
    if painted.shape != (source.height, source.width):
        raise FootageError(
            f"The exclusion is {painted.shape[1]}x{painted.shape[0]} pixels, camera {camera}"
            f" {source.width}x{source.height}.",
            "Give a PNG of the footage's size.",
        )
    count = int(np.count_nonzero(painted))
    if not count:
        path.unlink(missing_ok=True)
        return 0
    path.parent.mkdir(exist_ok=True)
    atomic_files.write_bytes(path, png_of(painted))
    return count


def polygon_exclusion(session: Session, camera: str, corners: Array) -> int:
    """Add a polygon (K, 2) of pixels to the excluded regions. Returns the pixels of all. Raises NotFoundError."""
    source = _source(session, camera)
    path = session.path / EXCLUSIONS / f"{camera}.png"
    painted = np.zeros((source.height, source.width), np.uint8)
    if path.exists():
        painted = painted_picture(path.read_bytes())
    return set_exclusion(session, camera, png_of(with_polygon(painted, corners)))


def exclusion_path(session: Session, camera: str) -> Path | None:
    """The painted picture of a camera, if there is one. Raises NotFoundError for a camera that is not there."""
    path = session.path / EXCLUSIONS / f"{_source(session, camera).name}.png"
    return path if path.exists() else None


def _source(session: Session, camera: str) -> CameraSource:
    """The footage of a camera. Raises NotFoundError."""
    sources = {source.name: source for source in session.manifest.footage.cameras}
    if camera not in sources:
        raise NotFoundError(
            f"Session '{session.name}' has no camera '{camera[:64]}'.", f"It has {', '.join(sources)}."
        )
    return sources[camera]
