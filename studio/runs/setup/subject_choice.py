"""Stores a session's subject, as chosen by the user or after a fit."""

from pathlib import Path

import msgspec

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.subject import Subject, fit_subject
from studio.foundations.words import counted
from studio.runs.setup.subject_fitting import FittedSubject, keep_subject, replace_subject
from studio.sessions.provenance import note
from studio.sessions.session import Session, redescribe

NAMED = 3
"""Lengths that a note names."""


def body_of_choice(session: Session, subject: Subject) -> tuple[BodyModel, tuple[str, ...]]:
    """The body of a subject in a session, and notes on measures that it cannot use. Writes nothing.

    Raises BodyError for an unknown body or an impossible height.
    """
    return fit_subject(load_body(subject.body, session.body_folders), subject, session.body_folders)


def choose_subject(session: Session, subject: Subject) -> Session:
    """Make a subject the session's own, so that new runs use its body; the one before is kept beside it.

    Raises as `body_of_choice`.
    """
    body_of_choice(session, subject)
    if subject != session.subject():
        replace_subject(session, subject)
    return _with_body(session, subject.body)


def lengths_left_out(session: Session, chosen: Subject) -> tuple[str, ...]:
    """Which measured lengths a session's subject has and a chosen one has not, as a note; empty where none is lost."""
    known = session.subject()
    lost = sorted(set(known.lengths_mm) - set(chosen.lengths_mm)) if known else []
    if not lost:
        return ()
    names = f"{', '.join(lost[:NAMED])}{' …' * (len(lost) > NAMED)}"
    return (
        f"Left out: {counted(len(lost), 'measured length')} ({names}). The subject before is kept beside the new one.",
    )


def keep_fitted(session: Session, fitted: FittedSubject) -> Path:
    """Make a fitted subject the session's own, and record its provenance."""
    place = keep_subject(session, fitted)
    note(_with_body(session, fitted.subject.body), "subject")
    return place


def _with_body(session: Session, body: str) -> Session:
    if session.manifest.body == body:
        return session
    return redescribe(session, msgspec.structs.replace(session.manifest, body=body))
