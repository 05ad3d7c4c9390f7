"""The settings that a session begins with: the studio's defaults, and what the session says of its masks."""

from collections.abc import Mapping

from studio.sessions.background_files import SessionEvidence, read_evidence
from studio.sessions.session import Session
from studio.settings import (
    DEFAULT_TRACKER,
    DEFAULT_WEIGHTING,
    RunSettings,
    changed_settings,
    default_settings,
    values,
)


def session_settings(
    session: Session, tracker: str = "", weighting: str = "", changes: Mapping[str, object] | None = None
) -> RunSettings:
    """Settings for a session. tracker, weighting : "" for the usual ones. changes : knobs by flat name, above all.

    Raises SettingsError for a knob that there is none of, or a value out of its range; what the session says about
    knobs of another version is passed over.
    """
    tracker = tracker or DEFAULT_TRACKER
    settings = default_settings(tracker, weighting or DEFAULT_WEIGHTING)
    evidence: SessionEvidence = read_evidence(session)
    known = values(settings)
    own = {name: value for name, value in evidence.knobs.items() if name in known}
    return changed_settings(settings, {**own, **(changes or {})})
