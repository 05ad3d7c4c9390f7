"""Who is in front of a session's cameras, said by a person or kept after a fit: one place writes it down."""

from pathlib import Path

import msgspec

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.subject import Subject, fit_subject, write_subject
from studio.errors import BodyError
from studio.runs.subject_fitting import FittedSubject, keep_subject
from studio.sessions.made_from import note
from studio.sessions.session import SUBJECT_NAME, Session, described_anew

LEAST_HEIGHT, MOST_HEIGHT = 300.0, 3000.0


def body_of_choice(session: Session, subject: Subject) -> tuple[BodyModel, tuple[str, ...]]:
    """The body that a subject would have in a session, and notes on measures that it cannot follow. Writes nothing.

    Raises BodyError for a body that is not there, or a height that is no person's.
    """
    if subject.height_mm is not None and not LEAST_HEIGHT <= subject.height_mm <= MOST_HEIGHT:
        raise BodyError(
            f"A height of {subject.height_mm:g} mm is no person's.", "Give millimetres, such as 1800."
        )
    return fit_subject(load_body(subject.body, session.body_folders), subject, session.body_folders)


def choose_subject(session: Session, subject: Subject) -> Session:
    """Write a subject down as the session's, whose new runs then have its body. Raises as `body_of_choice`."""
    body_of_choice(session, subject)
    write_subject(subject, session.path / SUBJECT_NAME)
    return _with_body(session, subject.body)


def keep_fitted(session: Session, found: FittedSubject) -> Path:
    """Keep a fitted subject as the session's own, and what it was made from."""
    place = keep_subject(session, found)
    note(_with_body(session, found.subject.body), "subject")
    return place


def _with_body(session: Session, body: str) -> Session:
    if session.manifest.body == body:
        return session
    return described_anew(session, msgspec.structs.replace(session.manifest, body=body))
