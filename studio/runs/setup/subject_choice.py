"""Stores a session's subject, as chosen by the user or after a fit."""

from pathlib import Path

import msgspec

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.subject import Subject, fit_subject, write_subject
from studio.foundations.errors import BodyError
from studio.runs.setup.subject_fitting import FittedSubject, keep_subject, replace_subject
from studio.sessions.provenance import note
from studio.sessions.session import SUBJECT_NAME, Session, redescribe

LEAST_HEIGHT, MOST_HEIGHT = 300.0, 3000.0


def body_of_choice(session: Session, subject: Subject) -> tuple[BodyModel, tuple[str, ...]]:
    """The body of a subject in a session, and notes on measures that it cannot use. Writes nothing.

    Raises BodyError for an unknown body or an impossible height.
    """
    if subject.height_mm is not None and not LEAST_HEIGHT <= subject.height_mm <= MOST_HEIGHT:
        raise BodyError(
            f"A height of {subject.height_mm:g} mm is not a person's.", "Give millimetres, such as 1800."
        )
    return fit_subject(load_body(subject.body, session.body_folders), subject, session.body_folders)


def choose_subject(session: Session, subject: Subject) -> Session:
    """Make a subject the session's own, so that new runs use its body. Raises as `body_of_choice`."""
    body_of_choice(session, subject)
    write_subject(subject, session.path / SUBJECT_NAME)
    return _with_body(session, subject.body)


def choose_body(session: Session, body: str) -> Session:
    """Make a body, as large as its file says, the session's own; the subject before, whose measures would change it, is
    kept as subject-before.toml. Raises BodyError.
    """
    subject = Subject(body=body)
    body_of_choice(session, subject)
    replace_subject(session, subject)
    return _with_body(session, body)


def keep_fitted(session: Session, fitted: FittedSubject) -> Path:
    """Make a fitted subject the session's own, and record its provenance."""
    place = keep_subject(session, fitted)
    note(_with_body(session, fitted.subject.body), "subject")
    return place


def _with_body(session: Session, body: str) -> Session:
    if session.manifest.body == body:
        return session
    return redescribe(session, msgspec.structs.replace(session.manifest, body=body))
