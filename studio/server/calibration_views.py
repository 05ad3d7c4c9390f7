"""Calibrations as the API shows them."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from studio.calibration.board_footage_reading import find_board_footage
from studio.calibration.findings import blocking
from studio.calibration.report import report_of
from studio.capture.calibration_files import CALIBRATION_FORMATS
from studio.errors import CalibrationError
from studio.server.calibration_proposals import Proposal, proposal_in_use
from studio.server.calibration_schemas import (
    CalibratedCamera,
    CalibrationView,
    ClickedPoint,
    ProposalView,
    Rig,
)
from studio.sessions.calibration_changes import earlier_calibrations, stale_runs
from studio.sessions.session import CAMERAS_PATH, Session
from studio.typed_decoding import decode_json, is_list, is_table

Report = dict[str, object]


def calibration_view(session: Session, notes: Sequence[str]) -> CalibrationView:
    """What a session has. Raises CalibrationError for one that cannot be read."""
    present = None
    if session.is_calibrated:
        own = proposal_in_use(session)
        present = Rig.model_validate(_rig(own, _kept_report(session)))
    return CalibrationView(
        session=session.name,
        present=present,
        changed=session.manifest.calibration_changed,
        earlier=list(earlier_calibrations(session)),
        stale_runs=list(stale_runs(session)),
        board_footage=_has_boards(session),
        footage=[source.name for source in session.manifest.footage.cameras],
        formats={name: writer.label for name, writer in CALIBRATION_FORMATS.items()},
        notes=list(notes),
    )


def proposal_view(proposal: Proposal) -> ProposalView:
    """A proposal with all that speaks for and against it."""
    report = report_of(proposal.calibrated) if proposal.calibrated is not None else {}
    shown = {
        "identifier": proposal.identifier,
        "session": proposal.session,
        "unit_note": proposal.unit_note,
        "matching": list(proposal.matching),
    }
    return ProposalView.model_validate(shown | _rig(proposal, report))


def _rig(proposal: Proposal, report: Report) -> dict[str, object]:
    off = _residuals(report)
    return {
        "source": proposal.source,
        "cameras": [
            CalibratedCamera(
                name=camera.name,
                width=camera.width,
                height=camera.height,
                focal_px=np.diag(camera.matrix)[:2].tolist(),
                centre_px=camera.matrix[:2, 2].tolist(),
                position=camera.centre.tolist(),
                forward=camera.rotation[2].tolist(),
                quarter_turns=camera.quarter_turns,
                rms_px=off.get(camera.name),
            )
            for camera in proposal.cameras
        ],
        "notes": list(proposal.notes),
        "findings": list(proposal.findings),
        "usable": not blocking(proposal.findings),
        "floor": str(report.get("floor", "")),
        "report": report,
        "points": _points(proposal),
    }


def _points(proposal: Proposal) -> list[ClickedPoint]:
    clicked = proposal.clicked
    if clicked is None:
        return []
    return [
        ClickedPoint(
            place=place.tolist(),
            missed_px={
                name: float(off[number]) for name, off in clicked.missed.items() if math.isfinite(off[number])
            },
        )
        for number, place in enumerate(clicked.points)
    ]


def _residuals(report: Report) -> dict[str, float]:
    """Camera → pixels that its corners are off in the rig."""
    entries = report.get("cameras", [])
    found: dict[str, float] = {}
    for entry in entries if is_list(entries) else ():
        if is_table(entry) and isinstance(off := entry.get("rig_rms_px"), int | float):
            found[str(entry.get("name"))] = float(off)
    return found


def _kept_report(session: Session) -> Report:
    """The report beside the calibration in use, {} where there is none or it cannot be read."""
    path = session.path / CAMERAS_PATH.with_name("cameras.report.json")
    try:
        return decode_json(path.read_bytes(), dict[str, object])
    except (OSError, msgspec.DecodeError):
        return {}


def _has_boards(session: Session) -> bool:
    try:
        return any(find_board_footage(session.path))
    except CalibrationError:
        return False
