"""`session.json`: the description of a session, as measured and decided at import.

Nothing here changes while runs are made, and nothing that can be computed (such as the progress of runs) is stored
twice. Unknown entries are refused and the schema's version is checked, so that a newer studio's session is reported as
such.
"""

import datetime
from pathlib import Path, PurePath

import msgspec

from studio.footage.capture.footage_source import FootageSource
from studio.footage.capture.naming import CameraMatch
from studio.foundations.foreign_files import MANIFEST_NAME
from studio.sessions.record_files import RecordFile

SCHEMA_VERSION = 1
FILE_NAME = MANIFEST_NAME
FASTEST, MOST_FRAMES, WIDEST = 10_000.0, 100_000_000, 1 << 16
"""Frames per second, frames, pixels of a side."""


class SessionManifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A session's description.

    name : the folder's name when it was made; title : free text shown to people. created : UTC, ISO 8601.
    body : the body its subject is fitted to. tracker, weighting : defaults for runs of this session,
    "" for the studio's own default. footage : see `FootageSource`; paths relative to the session
    folder. calibration_source : name of the imported file or files. assumptions : made so that
    footage and calibration fit (a crop, a unit, a frame rate). matching : footage to cameras. layout : the recognised
    folder layout of the source. footage_changed : when offsets or turns were last changed (UTC, ISO
    8601, to the microsecond), "" if never; runs made before count the frames as they were then.
    calibration_changed : likewise of the calibration.
    """

    schema: int = SCHEMA_VERSION
    name: str
    title: str
    created: str
    body: str
    footage: FootageSource
    tracker: str = ""
    weighting: str = ""
    calibration_source: str = ""
    imported_from: str = ""
    assumptions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    matching: tuple[CameraMatch, ...] = ()
    layout: str = ""
    footage_changed: str = ""
    calibration_changed: str = ""

    @property
    def fps(self) -> float:
        """Frames per second of the footage."""
        return self.footage.fps

    @property
    def frame_count(self) -> int:
        """Frames that every camera has."""
        return self.footage.frame_count


def is_time(text: str) -> bool:
    """Whether a text is a time in ISO 8601 that names its zone, as `now` gives it."""
    try:
        return datetime.datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        return False


def now() -> str:
    """The time to be written into records: UTC, ISO 8601, to the second."""
    return datetime.datetime.now(datetime.UTC).replace(microsecond=0).isoformat()


def _impossible(manifest: SessionManifest) -> str:
    """What no footage can have, a clause; "" for nothing."""
    footage = manifest.footage
    for changed in (manifest.footage_changed, manifest.calibration_changed):
        if changed and not is_time(changed):
            return f"that something was changed at {changed[:40]!r}"
    if not 0.0 <= footage.fps <= FASTEST or (footage.cameras and not footage.fps):
        return f"that the footage has {footage.fps:g} frames per second"
    if not 0 <= footage.frame_count <= MOST_FRAMES:
        return f"that the footage has {footage.frame_count} frames"
    if len({camera.name for camera in footage.cameras}) < len(footage.cameras):
        return "a camera's name twice"
    for camera in footage.cameras:
        if not (0 < camera.width <= WIDEST and 0 < camera.height <= WIDEST):
            return f"that the pictures of camera {camera.name[:40]!r} are {camera.width}x{camera.height}"
        if max(abs(camera.frame_count), abs(camera.offset)) > MOST_FRAMES:
            return f"that camera {camera.name[:40]!r} has {camera.frame_count} frames from {camera.offset} on"
        for place in camera.places:
            path = PurePath(place)
            if place and not path.is_absolute() and (not path.parts or ".." in path.parts or "\0" in place):
                return f"that files of camera {camera.name[:40]!r} lie at {place[:80]!r}, which is not in the session"
    return ""


_RECORD = RecordFile(
    SessionManifest,
    "a session's manifest",
    "Import the session again, or correct the entry.",
    ("There is no session in '{folder}'.", "Make one with 'studio import SOURCE --into SESSION'."),
    SCHEMA_VERSION,
    impossible=_impossible,
)


def read_manifest(session_folder: Path) -> SessionManifest:
    """The manifest of a session. Raises NotFoundError if there is none, SessionError for an invalid one."""
    return _RECORD.read(session_folder / FILE_NAME)


def write_manifest(session_folder: Path, manifest: SessionManifest) -> None:
    _RECORD.write(session_folder / FILE_NAME, manifest)
