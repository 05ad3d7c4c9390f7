"""The initial settings of a session: the studio's defaults with the session's mask knobs; masks made with them."""

from collections.abc import Generator, Mapping
from contextlib import closing, contextmanager

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.evidence.settings import EvidenceSettings
from studio.search.settings import (
    DEFAULT_TRACKER,
    DEFAULT_WEIGHTING,
    RunSettings,
    changed_settings,
    default_settings,
    values,
)
from studio.sessions.background_files import SessionEvidence, read_evidence
from studio.sessions.session import Session


def session_settings(
    session: Session, tracker: str = "", weighting: str = "", changes: Mapping[str, object] | None = None
) -> RunSettings:
    """Settings for a session. tracker, weighting : "" for the defaults. changes : knobs by flat name, which override.

    Raises SettingsError for an unknown knob or a value out of range; stored knobs of another version are ignored.
    """
    tracker = tracker or DEFAULT_TRACKER
    settings = default_settings(tracker, weighting or DEFAULT_WEIGHTING)
    evidence: SessionEvidence = read_evidence(session)
    known = values(settings)
    own = {name: value for name, value in evidence.knobs.items() if name in known}
    return changed_settings(settings, {**own, **(changes or {})})


@contextmanager
def masks_of(session: Session, settings: EvidenceSettings | None = None) -> Generator[EvidenceMaker]:
    """What makes a session's masks, without edges; its footage is closed at the end. settings : default: the session's.

    Raises FootageError.
    """
    knobs = settings or session_settings(session).evidence
    with closing(session.footage()) as footage:
        cameras = session.cameras()
        yield EvidenceMaker(cameras, footage, Backgrounds(footage), knobs, "none")
