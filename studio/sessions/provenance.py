"""Provenance of a session's parts: digests of their inputs, which show what a change makes stale.

`made_from.json` holds, for a part made here (the start pose, the fitted subject, the measured masks, the silhouettes'
misses), its own digest and those of its inputs. A given part (imported, typed in) has no entry and is never stale;
neither is one whose file was replaced by hand since.
"""

import hashlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import msgspec

from studio.footage.capture.footage import REGIONS
from studio.foundations.errors import SessionError
from studio.foundations.foreign_files import read_file
from studio.sessions.background_files import EVIDENCE_NAME
from studio.sessions.record_files import RecordFile
from studio.sessions.session import CAMERAS_PATH, START_POSE_NAME, SUBJECT_NAME, Session
from studio.sessions.work_under_way import one_at_a_time

FILE_NAME = "made_from.json"
SCHEMA_VERSION = 1
SMALL_FILE = 64 << 20
"""A background clip that is larger counts by its size and time alone."""

INPUTS = {
    "background": ("footage", "calibration", "masks"),
    "subject": ("footage", "calibration"),
    "start-pose": ("footage", "calibration", "subject"),
    "alignment": ("footage", "calibration", "masks"),
}
"""The inputs of each part."""
ALL_INPUTS = ("footage", "calibration", "subject", "masks")

FILES = {"subject": SUBJECT_NAME, "start-pose": START_POSE_NAME}


class Origin(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The provenance of one part. content : digest of its file, "" without one. inputs : digests of its inputs. words :
    the result as text; good : whether it is good enough for the next steps. stops : findings that make all results
    wrong, sentences.
    """

    content: str
    inputs: dict[str, str]
    words: str = ""
    good: bool = True
    stops: tuple[str, ...] = ()


class MadeFrom(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file's content. parts : by the name of the step that makes them."""

    schema: int = SCHEMA_VERSION
    parts: dict[str, Origin] = {}


def digests(session: Session, names: Iterable[str] = ALL_INPUTS) -> dict[str, str]:
    """Current digests of the named inputs; "" for missing ones."""
    of: dict[str, Callable[[Session], str]] = {
        "footage": _footage_digest,
        "calibration": lambda session: _file_digest(session.path / CAMERAS_PATH),
        "subject": _subject_digest,
        "masks": _masks_digest,
    }
    return {name: of[name](session) for name in names}


def note(
    session: Session, part: str, words: str = "", good: bool = True, stops: tuple[str, ...] = ()
) -> None:
    """Record that a part was made now from the current inputs. part : a key of INPUTS; the rest as in `Origin`."""
    origin = Origin(_own(session, part), digests(session, INPUTS[part]), words, good, stops)
    with one_at_a_time(session.path):
        _write(session, {**_read_origins(session).parts, part: origin})


def remember(session: Session, part: str, words: str, good: bool, stops: tuple[str, ...] = ()) -> None:
    """Note a measurement if the disk can be written; it is reported also if it cannot be kept."""
    _read_origins(session)  # raises where it is damaged
    with suppress(SessionError):
        note(session, part, words, good, stops)


def origin_of(session: Session, part: str) -> Origin | None:
    """The provenance of a part; None if it was given, or its file has changed since."""
    origin = _read_origins(session).parts.get(part)
    return origin if origin is not None and origin.content == _own(session, part) else None


def changed_inputs(session: Session, part: str, among: Iterable[str] = ALL_INPUTS) -> tuple[str, ...]:
    """The inputs of a part that have changed since: some of INPUTS[part], in order. among : the inputs to compare."""
    origin = origin_of(session, part)
    if origin is None:
        return ()
    now = digests(session, [name for name in INPUTS[part] if name in among])
    return tuple(name for name in now if origin.inputs.get(name, "") != now[name])


def adopt(session: Session) -> None:
    """Call before a change: given parts then count as made from the current inputs."""
    known = _read_origins(session).parts
    given = {
        part: Origin(_own(session, part), digests(session, INPUTS[part]))
        for part in FILES
        if (session.path / FILES[part]).exists() and origin_of(session, part) is None and part != "subject"
    }
    if given:
        _write(session, {**known, **given})


def _footage_digest(session: Session) -> str:
    if not session.has_footage:
        return ""
    source = session.manifest.footage
    facts = [
        [camera.name, camera.path, camera.width, camera.height, camera.offset, camera.turned]
        + ([camera.steps] if camera.steps else [])
        + ([camera.fields] if camera.fields else [])
        for camera in source.cameras
    ]
    return _digest(msgspec.json.encode([source.fps, facts]))


def _subject_digest(session: Session) -> str:
    return _digest(session.manifest.body.encode(), _content(session.path / SUBJECT_NAME))


def _masks_digest(session: Session) -> str:
    sources = session.manifest.footage.cameras
    parts = [msgspec.json.encode([[source.name, source.masks, source.background] for source in sources])]
    files = [session.path / source.background for source in sources if source.background]
    files += [path for kind in REGIONS for path in sorted((session.path / kind).glob("*.png"))]
    parts += [_file_digest(path).encode() for path in files]
    return _digest(*parts, _content(session.path / EVIDENCE_NAME))


def _own(session: Session, part: str) -> str:
    return _file_digest(session.path / FILES[part]) if part in FILES else ""


def _digest(*parts: bytes) -> str:
    made = hashlib.sha256()
    for part in parts:
        made.update(len(part).to_bytes(8, "big"))
        made.update(part)
    return made.hexdigest()[:24]


def _content(path: Path) -> bytes:
    return read_file(path) if path.is_file() else b""


def _file_digest(path: Path) -> str:
    """Of a file's content; of its size and time where it is large; "" without one."""
    if not path.is_file():
        return ""
    status = path.stat()
    if status.st_size > SMALL_FILE:
        return _digest(f"{status.st_size} {status.st_mtime_ns}".encode())
    return _digest(read_file(path))


_RECORD = RecordFile(
    MadeFrom,
    "the provenance of a session's parts",
    "Remove it; the parts then count as given.",
    (f"There is no '{FILE_NAME}'.", "Make the parts again."),
    SCHEMA_VERSION,
)


def _read_origins(session: Session) -> MadeFrom:
    return _RECORD.read(session.path / FILE_NAME, MadeFrom())


def _write(session: Session, parts: dict[str, Origin]) -> None:
    _RECORD.write(session.path / FILE_NAME, MadeFrom(parts=parts))
