"""`session.json`: the description of a session, as measured and decided at import.

Nothing here changes while runs are made, and nothing that can be computed (such as the progress of runs) is stored
twice. Unknown entries are refused and the schema's version is checked, so that a newer studio's session is reported as
such.
"""

import datetime
from pathlib import Path

import msgspec

from studio.capture.footage_source import FootageSource
from studio.capture.naming import CameraMatch
from studio.sessions.record_files import RecordFile

SCHEMA_VERSION = 1
FILE_NAME = "session.json"


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


def now() -> str:
    """The time to be written into records: UTC, ISO 8601, to the second."""
    return datetime.datetime.now(datetime.UTC).replace(microsecond=0).isoformat()


_RECORD = RecordFile(
    SessionManifest,
    "a session's manifest",
    "Import the session again, or correct the entry.",
    ("There is no session in '{folder}'.", "Make one with 'studio import SOURCE --into SESSION'."),
    SCHEMA_VERSION,
)


def read_manifest(session_folder: Path) -> SessionManifest:
    """The manifest of a session. Raises NotFoundError if there is none, SessionError for an invalid one."""
    return _RECORD.read(session_folder / FILE_NAME)


def write_manifest(session_folder: Path, manifest: SessionManifest) -> None:
    """Write `session.json` in one step."""
    _RECORD.write(session_folder / FILE_NAME, manifest)
