"""A session's calibration and those proposed, with what the checks say; their pictures and files."""

import io
import math
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import msgspec
import numpy as np
from annotated_types import Ge, Le
from pydantic import Field

from studio.body.scale import longest_side, scale_of
from studio.footage.calibration.board_footage_reading import find_board_footage
from studio.footage.calibration.coverage import coverage_picture
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.intrinsics import Lens
from studio.footage.calibration.report import report_of
from studio.footage.calibration.world_picture import PERSON_MM, world_picture
from studio.footage.capture.calibration_files import CALIBRATION_FORMATS, export_calibration
from studio.footage.capture.naming import CameraMatch
from studio.foundations.arrays import Array, Bytes
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import CalibrationError, NotFoundError, SessionError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.records import extended
from studio.foundations.typed_decoding import decode_json, is_list, is_table
from studio.operations.calibration_proposals import Proposal, proposal_in_use
from studio.sessions.calibration_changes import REPORT_NAME, earlier_calibrations, stale_runs
from studio.sessions.session import CAMERAS_PATH, Session


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedCamera:
    """A camera of a calibration.

    width, height : pixels.
    focal_px, centre_px : (2,).
    position : (3,) mm.
    forward : (3,) its optical axis.
    rms_px : of its board corners, null where no board was seen.
    """

    name: str
    width: int
    height: int
    focal_px: Array
    centre_px: Array
    position: Array
    forward: Array
    quarter_turns: int
    rms_px: float | None


@dataclass(frozen=True, slots=True, eq=False)
class ClickedPoint:
    """A clicked point in space, (3,) mm, and how many pixels each camera's click misses it by."""

    place: Array
    missed_px: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """Cameras and what the checks say of them.

    report : as the command writes it, {} for files.
    """

    source: str
    cameras: tuple[CalibratedCamera, ...]
    notes: tuple[str, ...]
    findings: tuple[Finding, ...]
    usable: bool
    floor: str
    report: dict[str, object]
    points: tuple[ClickedPoint, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ProposalView(Rig):
    """A calibration to look at before it is applied; it lives until the studio ends.

    unit_note : how the unit was recognised.
    matching : the footage's cameras to the calibration's names.
    """

    identifier: str
    session: str
    unit_note: str
    matching: tuple[CameraMatch, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationView:
    """The calibration in use, if there is one.

    earlier : older ones, newest first.
    stale_runs : tracked with an older one.
    changed : when it was replaced (ISO 8601).
    board_footage : whether the session has folders of it.
    notes : what the last change means.
    """

    session: str
    present: Rig | None
    changed: str
    earlier: tuple[str, ...]
    stale_runs: tuple[str, ...]
    board_footage: bool
    footage: Annotated[tuple[str, ...], Field(description="Names of the cameras that have footage.")]
    formats: Annotated[dict[str, str], Field(description="Formats of the export.")]
    notes: tuple[str, ...]


Report = dict[str, object]


def calibration_view(session: Session, notes: tuple[str, ...] = ()) -> CalibrationView:
    """The calibration of a session. notes : on the last change.

    Raises CalibrationError for one that cannot be read.
    """
    present = None
    if session.is_calibrated:
        present = _rig(proposal_in_use(session), _kept_report(session))
    return CalibrationView(
        session.name,
        present,
        session.manifest.calibration_changed,
        earlier_calibrations(session),
        stale_runs(session),
        _has_boards(session),
        tuple(source.name for source in session.manifest.footage.cameras),
        {name: writer.label for name, writer in CALIBRATION_FORMATS.items()},
        notes,
    )


def proposal_view(proposal: Proposal) -> ProposalView:
    report = report_of(proposal.calibrated) if proposal.calibrated is not None else {}
    return extended(
        ProposalView,
        _rig(proposal, report),
        identifier=proposal.identifier,
        session=proposal.session,
        unit_note=proposal.unit_note,
        matching=proposal.matching,
    )


def _rig(proposal: Proposal, report: Report) -> Rig:
    off = _residuals(report)
    cameras = tuple(
        CalibratedCamera(
            camera.name,
            camera.width,
            camera.height,
            np.diag(camera.matrix)[:2],
            camera.matrix[:2, 2],
            camera.centre,
            camera.rotation[2],
            camera.quarter_turns,
            off.get(camera.name),
        )
        for camera in proposal.cameras
    )
    return Rig(
        proposal.source,
        cameras,
        proposal.notes,
        proposal.findings,
        not blocking(proposal.findings),
        str(report.get("floor", "")),
        report,
        _points(proposal),
    )


def _points(proposal: Proposal) -> tuple[ClickedPoint, ...]:
    clicked = proposal.clicked
    if clicked is None:
        return ()
    return tuple(
        ClickedPoint(
            place,
            {name: float(off[number]) for name, off in clicked.missed.items() if math.isfinite(off[number])},
        )
        for number, place in enumerate(clicked.points)
    )


def _residuals(report: Report) -> dict[str, float]:
    """By camera, by how many pixels its corners are off in the rig."""
    entries = report.get("cameras", [])
    off = {
        str(entry.get("name")): entry.get("rig_rms_px")
        for entry in (entries if is_list(entries) else ())
        if is_table(entry)
    }
    return {name: float(pixels) for name, pixels in off.items() if isinstance(pixels, int | float)}


def _kept_report(session: Session) -> Report:
    """The report beside the calibration in use, {} where there is none or it cannot be read."""
    path = session.path / CAMERAS_PATH.with_name(REPORT_NAME)
    try:
        return decode_json(read_file(path, LARGEST_RECORD), dict[str, object])
    except (OSError, SessionError, msgspec.DecodeError):
        return {}


def _has_boards(session: Session) -> bool:
    try:
        return any(find_board_footage(session.path))
    except CalibrationError:
        return False


@dataclass(frozen=True, slots=True)
class WorldPicture:
    """How a picture of a calibration's world is made.

    height : pixels.
    frame : of the session's footage.
    board : of the board's footage where the proposal has some.
    axes : whether floor, axes and a pole are drawn.
    """

    height: Annotated[int, Ge(64), Le(2160)] = 720
    frame: Annotated[int, Ge(0), Le(LARGEST)] = 0
    board: bool = True
    axes: bool = True


def draw_world(session: Session, proposal: Proposal, camera: str, how: WorldPicture) -> Bytes:
    """(h, w, 3) BGR: floor, axes and a pole on a camera's picture, upright. Raises NotFoundError, FootageError."""
    placed, own = proposal.camera(camera), proposal.pictures.get(camera)
    if own is None or (session.has_footage and not how.board):
        footage = session.footage()
        try:
            own = footage.picture(camera, min(how.frame, footage.frame_count - 1))
        finally:
            footage.close()
    points: list[list[float]] = proposal.clicked.points.tolist() if proposal.clicked is not None else []
    return world_picture(own, placed, points, how.height, pole=pole_of(session), bare=not how.axes)


def pole_of(session: Session) -> float:
    """mm of the pole: a person's height beside bodies of a person's size, else the longest side of the body, to two
    digits.
    """
    body = session.body()
    if scale_of(body) == 1.0:
        return PERSON_MM
    longest = longest_side(body)
    return round(longest, 1 - math.floor(math.log10(longest)))


def draw_coverage(session: Session, proposal: Proposal, camera: str) -> bytes:
    """PNG: where in the picture the board's corners were seen, used ones white, those left out red.

    Raises NotFoundError for a camera that was not calibrated from a board.
    """
    solved = proposal.calibrated
    lenses: Mapping[str, Lens] = solved.lenses if solved is not None else {}
    name = camera if camera in lenses else proposal.camera(camera).name
    kept = session.path / CAMERAS_PATH.with_name(f"cameras.coverage-{name}.png")
    if solved is None and proposal.in_use and kept.is_file():
        return read_file(kept)
    if solved is None or name not in lenses:
        raise NotFoundError(
            f"Camera '{name}' was not calibrated from a board here.", "Calibrate it from boards."
        )
    lens, seen = lenses[name], solved.detections.get(name, ())
    dropped = {residual.frame for residual in lens.residuals if residual.dropped}
    picture = coverage_picture(
        lens.coverage,
        [detection for detection in seen if detection.frame not in dropped],
        [detection for detection in seen if detection.frame in dropped],
    )
    return bytes(cv2.imencode(".png", picture)[1])


@dataclass(frozen=True, slots=True)
class CalibrationFile:
    """A calibration for another tool.

    notes : what its format cannot hold.
    """

    name: str
    content: bytes
    notes: tuple[str, ...]


def calibration_file(session: Session, form: str) -> CalibrationFile:
    """The calibration in use for another tool; several files as a zip. form : one of `CALIBRATION_FORMATS`.

    Raises CalibrationError, SessionError; NotFoundError for an unknown format.
    """
    cameras, writer = proposal_in_use(session).cameras, CALIBRATION_FORMATS[form]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / (writer.file_name.format(session.name) + writer.suffix)
        written = export_calibration(cameras, place, form)
        if len(written.files) == 1:
            return CalibrationFile(written.files[0].name, read_file(written.files[0]), tuple(written.notes))
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for path in written.files:
                archive.write(path, path.name)
        return CalibrationFile(f"{session.name}-{form}.zip", packed.getvalue(), tuple(written.notes))
