"""Cameras turned by their silhouettes (`runs.setup.aligning`): stores the measurement for the guided set-up, and
restores the earlier calibration on request, byte for byte.

calibration/cameras.alignment.json     which calibration the one in use was turned from
"""

import hashlib

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.footage.calibration.report import board_error
from studio.foundations.errors import CalibrationError, NotFoundError, SessionError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.typed_decoding import decode_json
from studio.runs.setup.aligning import SessionAlignment, keep_alignment
from studio.sessions.atomic_files import write_bytes
from studio.sessions.calibration_changes import CalibrationChange, earlier_calibration, restore_calibration
from studio.sessions.provenance import changed_inputs, note, origin_of, remember
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.work_under_way import one_at_a_time

RECORD_PATH = CAMERAS_PATH.with_name("cameras.alignment.json")
PART = "alignment"


class Turned(msgspec.Struct, frozen=True):
    """Stored with turned cameras. before : name of the earlier calibration; source : its origin, as text; content :
    digest of the turned cameras' file, which shows whether it is still in use.
    """

    before: str
    source: str
    content: str


def remember_alignment(session: Session, aligned: SessionAlignment) -> None:
    """Store how far the silhouettes miss with the calibration in use, for the guided set-up."""
    remember(session, PART, _misses_in_words(aligned, aligned.aligned.before), not aligned.needed)


SMALL_ERROR = 1.0
"""Pixels: a board's calibration that leaves less is right."""
LARGE_TURN = 1.0
"""Degrees: cameras are not turned by more unless they were touched."""


def alignment_words(session: Session, aligned: SessionAlignment) -> str:
    """How far the silhouettes miss and the remedy, as a sentence. Where a board's calibration is right and the turns
    would be large, masks are named as the likelier cause.
    """
    angles, missed = aligned.aligned, _misses_in_words(aligned, aligned.aligned.before)
    if not aligned.needed:
        return f"{missed}: the cameras agree."
    if not aligned.better:
        return f"{missed}, and turning cameras does not explain it: check the masks and the calibration."
    turn, after = float(np.nanmax(angles.turns)), float(np.nanmax(angles.after))
    turned = f"with cameras turned by up to {turn:.2f}° they would miss by {after:.1f} px"
    board = None if turned_from(session) else board_error(session.manifest.calibration_source)
    if turn > LARGE_TURN and board is not None and board < SMALL_ERROR:
        worst = aligned.names[int(np.nanargmax(angles.before))]
        return (
            f"{missed}, though the board's calibration is right to {board:.2f} px: look at the masks of {worst} first. "
            f"Only where a camera was touched since: {turned}."
        )
    return f"{missed}; {turned}."


def misses_in_words(session: Session) -> str:
    """Why the calibration in use does not fit the silhouettes, from the last measurement; "" if it fits, or if footage,
    masks or calibration have changed since.
    """
    known = origin_of(session, PART)
    if known is None or known.good or changed_inputs(session, PART):
        return ""
    return f"{known.words}: see step Background, “Do the cameras agree?”"


def _misses_in_words(aligned: SessionAlignment, pixels: NDArray[np.float64]) -> str:
    worst, most = int(np.nanargmax(pixels)), float(np.nanmax(pixels))
    return f"The silhouettes miss by up to {most:.1f} px ({aligned.names[worst]})"


def turn_cameras(session: Session, aligned: SessionAlignment) -> CalibrationChange:
    """Make the turned cameras the session's. Raises SessionError while a run is being tracked, CalibrationError if the
    calibration has changed since the alignment.
    """
    with one_at_a_time(session.path):
        if not aligned.is_of(session):
            raise CalibrationError(
                f"The calibration of session '{session.name}' has changed since it was measured.",
                "Measure the cameras again.",
            )
        source = session.manifest.calibration_source
        change = keep_alignment(session, aligned)
        if change.kept is not None:
            turned = Turned(change.kept.name, source, _content(change.session))
            write_bytes(change.session.path / RECORD_PATH, msgspec.json.encode(turned))
    angles = aligned.aligned
    worst, most = int(np.nanargmax(angles.after)), float(np.nanmax(angles.after))
    words = f"The silhouettes miss by up to {most:.1f} px ({aligned.names[worst]})"
    note(change.session, PART, words)
    return change


def turned_from(session: Session) -> str:
    """Name of the earlier calibration that the cameras in use were turned from; "" if they were not."""
    turned = _turned(session)
    return "" if turned is None else turned.before


def turn_back(session: Session) -> CalibrationChange:
    """Restore the calibration from before the cameras were turned. Raises NotFoundError if they were not, SessionError
    while a run is being tracked.
    """
    with one_at_a_time(session.path):
        turned = _turned(session)
        if turned is None:
            raise NotFoundError(
                f"The cameras of session '{session.name}' were not turned by their silhouettes.",
                "Choose one of the earlier calibrations in step Calibration.",
            )
        return restore_calibration(session, turned.before, turned.source)


def _turned(session: Session) -> Turned | None:
    try:
        turned = decode_json(read_file(session.path / RECORD_PATH, LARGEST_RECORD), Turned)
        earlier_calibration(session, turned.before)
    except (OSError, msgspec.DecodeError, SessionError):
        return None
    return turned if turned.content == _content(session) else None


def _content(session: Session) -> str:
    return hashlib.sha256(read_file(session.path / CAMERAS_PATH)).hexdigest()[:24]
