"""Calibrations that were solved or read but are not in use yet: to be looked at, turned, applied or left."""

import dataclasses
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from studio.footage.calibration.board_footage_reading import (
    HowTaken,
    by_camera,
    footage_picture,
    list_footage,
)
from studio.footage.calibration.checks import check_calibration
from studio.footage.calibration.extrinsics import moved, moved_cameras
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.floor import Click, ClickedFloor, Clicks, clicked_floor
from studio.footage.calibration.report import calibration_source
from studio.footage.calibration.verbs import Calibrated
from studio.footage.capture.calibration_files import AssumedCrop, Calibration, read_calibration
from studio.footage.capture.naming import CameraMatch
from studio.footage.capture.sanity import quarter_turns
from studio.foundations.arrays import Bytes
from studio.foundations.errors import CalibrationError, NotFoundError, StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.geometry.camera import Camera
from studio.runs.setup.levelling import LevelWorld, level_calibration
from studio.sessions.calibration_changes import NewCalibration, fit_to_session
from studio.sessions.session import CAMERAS_PATH, Session

KEPT = 12
WITHOUT_FLOOR = "no-floor"
WITHOUT_PLACES = Finding(
    "no-places",
    "blocks",
    "The lenses were solved, but there is no common footage to place the cameras from.",
    "Add footage (or one picture) of the board that all cameras took at once.",
)


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A calibration of a session, as it would be used. originals : name → content of the file it is of. pictures :
    camera → its picture of a moment of the board footage.
    in_use : made of the session's own. clicked : the points that its floor was set by. floor : what it was set by here,
    as text.
    """

    identifier: str
    session: str
    source: str
    cameras: tuple[Camera, ...]
    findings: tuple[Finding, ...]
    unit_note: str = ""
    notes: tuple[str, ...] = ()
    matching: tuple[CameraMatch, ...] = ()
    crops: Mapping[str, AssumedCrop] = field(default_factory=dict[str, AssumedCrop])
    originals: Mapping[str, bytes] = field(default_factory=dict[str, bytes])
    calibrated: Calibrated | None = None
    pictures: Mapping[str, Bytes] = field(default_factory=dict[str, Bytes])
    clicked: ClickedFloor | None = None
    floor: str = ""
    in_use: bool = False

    def checked_new(self, anyway: bool) -> NewCalibration:
        """What the session is to use. Raises CalibrationError with the first finding that blocks, unless `anyway`."""
        stops = blocking(self.findings)
        if stops and not anyway:
            raise CalibrationError(stops[0].message, stops[0].remedy)
        return NewCalibration(
            self.cameras,
            self.source,
            self.originals,
            self.crops,
            self.matching,
            tuple(note for note in (self.unit_note, *self.notes) if note),
            self.calibrated,
            self.floor if self.in_use else "",
        )


class Proposals:
    """The last few, by their identifiers."""

    def __init__(self) -> None:
        self._kept: dict[str, Proposal] = {}

    def keep(self, proposal: Proposal) -> Proposal:
        """Remember one; the oldest are forgotten."""
        self._kept[proposal.identifier] = proposal
        while len(self._kept) > KEPT:
            self._kept.pop(next(iter(self._kept)))
        return proposal

    def find(self, session: str, identifier: str) -> Proposal:
        """One of a session's. Raises NotFoundError."""
        found = self._kept.get(identifier)
        if found is None or found.session != session:
            raise NotFoundError(
                f"There is no calibration '{identifier[:40]}' to look at.", "Import or solve it again."
            )
        return found


def proposal_of_file(session: Session, read: Calibration) -> Proposal:
    """What a calibration file gives a session. Raises CalibrationError where it does not fit the footage."""
    fitted = fit_to_session(session, read.cameras, sizes_known=read.sizes_known, read=read)
    return Proposal(
        secrets.token_hex(8),
        session.name,
        read.label,
        fitted.cameras,
        check_calibration(fitted.cameras),
        read.unit_note,
        (*read.notes, *fitted.warnings),
        fitted.matching,
        fitted.crops,
        {path.name: read_file(path) for path in read.sources if path.is_file()},
    )


def proposal_of_boards(
    session: Session, found: Calibrated, folder: Path | None, floor: str, taken: HowTaken
) -> Proposal:
    """What boards give a session; folder : the common footage, for pictures. Lenses alone give no cameras, and a
    finding that blocks. Raises CalibrationError.
    """
    if found.rig is None:
        findings = (WITHOUT_PLACES, *found.findings)
        return Proposal(
            secrets.token_hex(8), session.name, calibration_source(found), (), findings, calibrated=found
        )
    fitted = fit_to_session(session, found.rig.cameras)
    return Proposal(
        secrets.token_hex(8),
        session.name,
        calibration_source(found),
        fitted.cameras,
        found.findings,
        notes=fitted.warnings,
        matching=fitted.matching,
        crops=fitted.crops,
        calibrated=found,
        pictures=_board_pictures(found, folder, floor, taken) if folder is not None else {},
    )


def proposal_in_use(session: Session) -> Proposal:
    """The session's own calibration as it is. Raises CalibrationError, SessionError without one."""
    cameras = (
        session.cameras() if session.has_footage else read_calibration(session.path / CAMERAS_PATH).cameras
    )
    read = read_calibration(session.path / CAMERAS_PATH)
    return Proposal(
        secrets.token_hex(8),
        session.name,
        session.manifest.calibration_source,
        cameras,
        check_calibration(cameras),
        crops=read.crops,
        matching=session.manifest.matching,
        in_use=True,
    )


def level_proposal(session: Session, found: LevelWorld) -> Proposal:
    """The calibration in use, its world levelled."""
    new = level_calibration(session, found)
    return dataclasses.replace(
        proposal_in_use(session),
        identifier=secrets.token_hex(8),
        source=new.source,
        cameras=new.cameras,
        findings=check_calibration(new.cameras),
        notes=new.notes,
        floor=new.floor,
    )


def with_floor(session: Session, base: Proposal, points: Sequence[Click]) -> Proposal:
    """The same cameras in the world that clicked points make; nothing is kept of `base`. Raises CalibrationError."""
    clicked = clicked_floor(Clicks(tuple(points)), base.cameras)
    turned = moved_cameras(base.cameras, clicked.new_from_old)
    cameras = tuple(dataclasses.replace(camera, quarter_turns=quarter_turns(camera)) for camera in turned)
    calibrated = base.calibrated
    words = f"{len(points)} clicked points"
    if calibrated is not None and calibrated.rig is not None:
        calibrated = dataclasses.replace(
            calibrated, rig=moved(calibrated.rig, clicked.new_from_old), floor=words
        )
    of_cameras = {finding.code for finding in check_calibration(base.cameras)} | {WITHOUT_FLOOR}
    of_boards = tuple(finding for finding in base.findings if finding.code not in of_cameras)
    findings = (*check_calibration(cameras), *of_boards)
    return dataclasses.replace(
        base,
        identifier=secrets.token_hex(8),
        source=base.source if "clicked" in base.source else f"{base.source}, floor from {words}",
        cameras=cameras,
        findings=(*blocking(findings), *(each for each in findings if each.severity != "blocks")),
        calibrated=calibrated,
        clicked=clicked,
        floor=words,
    )


def backdrop(session: Session, proposal: Proposal, camera: str, board: bool, frame: int) -> Bytes:
    """(H, W, 3) a camera's picture: of the board footage where that is meant and there, else of the session's.

    Raises FootageError, SessionError where there is no picture.
    """
    own = proposal.pictures.get(camera)
    if own is not None and (board or not session.has_footage):
        return own
    footage = session.footage()
    try:
        return footage.picture(camera, min(max(frame, 0), footage.frame_count - 1))
    finally:
        footage.close()


def _board_pictures(found: Calibrated, folder: Path, floor: str, taken: HowTaken) -> dict[str, Bytes]:
    """Each camera's picture of the floor's moment, else of the moment that most cameras saw the board in."""
    rig = found.rig
    if rig is None or not rig.boards:
        return {}
    frame = (
        int(floor.removeprefix("frame:"))
        if floor.startswith("frame:")
        else sorted(rig.boards)[len(rig.boards) // 2]
    )
    try:
        footage = by_camera(list_footage(folder), [camera.name for camera in rig.cameras])
        return {
            name: taken.upright(name, footage_picture(entry, frame + taken.offsets.get(name, 0)))
            for name, entry in footage.items()
        }
    except StudioError:
        return {}
