"""Calibrations as the API shows them."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from pydantic import Field

from studio.app.server.calibration_proposals import Proposal, proposal_in_use
from studio.app.server.safe_paths import FootagePlace, PlaceName
from studio.app.server.schemas import Answer, Number, Numbers, Request
from studio.footage.calibration.board_footage_reading import find_board_footage
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.report import report_of
from studio.footage.capture.calibration_files import CALIBRATION_FORMATS
from studio.footage.capture.naming import CameraMatch
from studio.foundations.errors import CalibrationError, SessionError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.typed_decoding import decode_json, is_list, is_table
from studio.sessions.calibration_changes import earlier_calibrations, stale_runs
from studio.sessions.importers.importing import Unit, Up
from studio.sessions.session import CAMERAS_PATH, Session

Pixel = tuple[float, float]


class CalibrationFileRequest(FootagePlace):
    """A calibration to look at. Nothing is changed by it. file: which one of a folder or upload that holds several;
    earlier: one that the session used before, instead of a path.
    """

    file: PlaceName = ""
    earlier: str = Field("", max_length=64)
    unit: Unit = ""
    up: Up = "z"


class PointRequest(Request):
    """A point clicked in two cameras or more. world: where it is known to lie, mm; for all points or for none."""

    pixels: dict[str, Pixel] = Field(min_length=2, max_length=64)
    world: tuple[float, float, float] | None = None


class FloorRequest(Request):
    """Points of the floor: the first is the origin, the second lies on X. proposal: "" for the calibration in use."""

    proposal: str = Field("", max_length=64)
    points: list[PointRequest] = Field(min_length=3, max_length=64)


class ApplyRequest(Request):
    """anyway: also if a finding says that results would be wrong."""

    anyway: bool = False


class CalibratedCamera(Answer):
    """A camera as it stands. forward: its optical axis; rms_px: of its board corners, null where no board was seen."""

    name: str
    width: int
    height: int
    focal_px: Numbers
    centre_px: Numbers
    position: Numbers
    forward: Numbers
    quarter_turns: int
    rms_px: Number = None


class ClickedPoint(Answer):
    """A clicked point in space, mm, and how many pixels each camera's click misses it by."""

    place: Numbers
    missed_px: dict[str, Number]


class Rig(Answer):
    """Cameras with what speaks for and against them. report: as the command writes it, {} for files."""

    source: str
    cameras: list[CalibratedCamera]
    notes: list[str] = Field(default_factory=list)
    findings: list[Finding] = Field(default_factory=list[Finding])
    usable: bool = True
    floor: str = ""
    report: dict[str, object] = Field(default_factory=dict)
    points: list[ClickedPoint] = Field(default_factory=list[ClickedPoint])


class ProposalView(Rig):
    """A calibration to look at before it is applied; it lives until the studio ends. unit_note: how the unit was
    found. matching: the footage's cameras to the calibration's own names.
    """

    identifier: str
    session: str
    unit_note: str = ""
    matching: list[CameraMatch] = Field(default_factory=list[CameraMatch])


class CalibrationView(Answer):
    """The calibration in use, null while there is none. earlier: those before it, newest first. stale_runs: tracked
    with another one. changed: when it was replaced (ISO 8601). board_footage: folders in the session, if any. notes:
    what the change that was just made means.
    """

    session: str
    present: Rig | None
    changed: str = ""
    earlier: list[str] = Field(default_factory=list)
    stale_runs: list[str] = Field(default_factory=list)
    board_footage: bool = False
    footage: list[str] = Field(default_factory=list, description="Names of the cameras that have footage.")
    formats: dict[str, str] = Field(default_factory=dict, description="Formats of the export.")
    notes: list[str] = Field(default_factory=list)


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
        return decode_json(read_file(path, LARGEST_RECORD), dict[str, object])
    except (OSError, SessionError, msgspec.DecodeError):
        return {}


def _has_boards(session: Session) -> bool:
    try:
        return any(find_board_footage(session.path))
    except CalibrationError:
        return False
