"""A session that begins empty: a name and a body, before there is footage or a calibration."""

from pathlib import Path

from studio.body.catalogue import load_body
from studio.body.subject import DEFAULT_BODY
from studio.capture.footage_source import FootageSource
from studio.errors import SessionError
from studio.sessions.atomic_files import made_whole
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

NO_FOOTAGE = FootageSource(0.0, 0, ())
LONGEST_TITLE = 200


def begin_session(place: Path, title: str = "", body: str = "") -> Session:
    """Make an empty session at `place` (as `Workspace.place_for` gives it). title : its name unless given.

    Raises BodyError for a body that is not there, SessionError for a title that cannot be shown or a place that is
    taken.
    """
    words = " ".join(title.split()) or place.name
    if len(words) > LONGEST_TITLE:
        raise SessionError(
            f"A title of {len(words)} characters cannot be shown.", f"Use 1 to {LONGEST_TITLE} characters."
        )
    name = load_body(body).name if body else DEFAULT_BODY
    manifest = SessionManifest(name=place.name, title=words, created=now(), body=name, footage=NO_FOOTAGE)
    with made_whole(place) as folder:
        write_manifest(folder, manifest)
    return Session(place)


def next_step(cameras: int, calibrated: bool) -> str:
    """What a session lacks before it can be tracked: "footage", "calibration", or "" if nothing."""
    if not cameras:
        return "footage"
    return "" if calibrated else "calibration"
