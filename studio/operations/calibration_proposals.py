"""Calibrations that were solved or read but are not in use yet: to be looked at, turned, applied or dropped."""

import dataclasses
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from studio.footage.calibration.board_footage_reading import (
    HowTaken,
    by_camera,
    find_board_footage,
    footage_picture,
    list_footage,
)
from studio.footage.calibration.boards import Board, board_from_text
from studio.footage.calibration.checks import check_calibration
from studio.footage.calibration.extrinsics import moved, moved_cameras
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.floor import Click, ClickedFloor, Clicks, clicked_floor
from studio.footage.calibration.report import calibration_source
from studio.footage.calibration.verbs import Calibrated
from studio.footage.capture.calibration_files import (
    AssumedCrop,
    Calibration,
    find_calibrations,
    read_calibration,
)
from studio.footage.capture.naming import CameraMatch
from studio.footage.capture.sanity import quarter_turns
from studio.foundations.arrays import Bytes
from studio.foundations.errors import CalibrationError, NotFoundError, StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.runs.setup.levelling import level_by_run, level_by_silhouettes, level_calibration
from studio.sessions.archives import is_litter
from studio.sessions.board_calibration import BoardOptions, BoardPlace, how_taken, solve_boards
from studio.sessions.calibration_changes import (
    CalibrationChange,
    NewCalibration,
    earlier_calibration,
    fit_to_session,
    replace_calibration,
)
from studio.sessions.importers.importing import Unit, Up
from studio.sessions.names import place_in, relative_path
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
    """A calibration of a session that is not in use yet.

    originals : by name, the content of the files it was read from.
    pictures : by camera, its picture of one moment of the board footage.
    in_use : made from the session's own.
    clicked : the points that set its floor.
    floor : how it was set here, as text.
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

    def check(self) -> None:
        """Raise CalibrationError with the first finding that blocks."""
        stops = blocking(self.findings)
        if stops:
            raise CalibrationError(stops[0].message, stops[0].remedy)

    def camera(self, name: str) -> Camera:
        """One of its cameras. Raises NotFoundError."""
        for camera in self.cameras:
            if camera.name == name:
                return camera
        names = ", ".join(camera.name for camera in self.cameras)
        raise NotFoundError(f"There is no calibrated camera '{name[:64]}'.", f"There are {names}.")


class Proposals:
    """The last few, by their identifiers."""

    def __init__(self) -> None:
        self._kept: dict[str, Proposal] = {}

    def keep(self, proposal: Proposal) -> Proposal:
        """Remember a proposal; the oldest are forgotten."""
        self._kept[proposal.identifier] = proposal
        while len(self._kept) > KEPT:
            self._kept.pop(next(iter(self._kept)))
        return proposal

    def find(self, session: str, identifier: str) -> Proposal:
        """A proposal of a session. Raises NotFoundError."""
        proposal = self._kept.get(identifier)
        if proposal is None or proposal.session != session:
            raise NotFoundError(
                f"There is no calibration '{identifier[:40]}' to look at.", "Import or solve it again."
            )
        return proposal


def propose_file(session: Session, place: Path, file: str = "", unit: Unit = "", up: Up = "z") -> Proposal:
    """A session's calibration from a file.

    place : the file, or a folder in which it is the only one or is called `file`.

    Raises CalibrationError where there is none, or several, or it does not fit the footage; NotFoundError.
    """
    return _proposal_of_file(session, read_calibration(_chosen_file(place, file), unit, up))


def propose_earlier(session: Session, name: str, unit: Unit = "", up: Up = "z") -> Proposal:
    """A calibration that the session used before. Raises NotFoundError, CalibrationError."""
    path = earlier_calibration(session, name) / CAMERAS_PATH.name
    return _proposal_of_file(session, read_calibration(path, unit, up))


def _chosen_file(place: Path, file: str) -> Path:
    if place.is_file():
        return place
    if file:
        named = place_in(place, relative_path(file))
        if not named.exists():
            raise NotFoundError(f"There is no '{file[:200]}' in '{place.name}'.", "Choose another file.")
        return named
    readable = find_calibrations(place)
    if len(readable) == 1:
        return readable[0]
    if readable:
        names = ", ".join(path.name for path in readable)
        raise CalibrationError(
            f"'{place.name}' holds several calibrations ({names}).", "Say which one to take."
        )
    files = [path for path in place.iterdir() if path.is_file() and not is_litter(path.name)]
    if len(files) == 1:
        return files[0]
    raise CalibrationError(
        f"'{place.name}' holds no calibration that can be read.",
        "Give a Pose2Sim, anipose, FreeMoCap or Caliscope TOML, EasyMocap's or OpenCV's YAML, or Qualisys's file.",
    )


def _proposal_of_file(session: Session, read: Calibration) -> Proposal:
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


@dataclass(frozen=True, slots=True)
class BoardFootage:
    """Where footage of a board lies.

    lenses : a video or folder a camera.
    common : of all cameras at once.
    lying : pictures of the board on the floor.
    floor : else "frame:N" of the common footage, "" for none.
    """

    lenses: Path | None
    common: Path | None
    lying: Path | None = None
    floor: str = ""

    @property
    def recordings(self) -> int:
        """The number of recordings to look through."""
        places = [place for place in (self.lenses, self.common, self.lying) if place and place.is_dir()]
        return sum(len(list_footage(place)) for place in places)

    def completed(self, whole: Path) -> "BoardFootage":
        """The same with the folders of a session where none is named. Raises CalibrationError."""
        if self.lenses is not None or self.common is not None:
            return self
        lenses, common = find_board_footage(whole)
        return dataclasses.replace(self, lenses=lenses, common=common)


def checked_board(session: Session, text: str, options: BoardOptions) -> Board:
    """The board of a text. Raises CalibrationError for an impossible one, or offsets of unknown cameras."""
    how_taken(session, options.offsets or {})
    return board_from_text(text, options.thickness_mm)


def propose_boards(
    session: Session,
    footage: BoardFootage,
    board: Board,
    options: BoardOptions,
    progress: Progress = no_progress,
) -> Proposal:
    """A session's calibration from board footage. Lenses alone give no cameras, and a finding that blocks.

    Raises CalibrationError, FootageError.
    """
    solved = solve_boards(
        BoardPlace(session.path, session),
        board,
        dataclasses.replace(
            options,
            intrinsics=footage.lenses,
            extrinsics=footage.common,
            floor=str(footage.lying) if footage.lying is not None else footage.floor or None,
        ),
        progress,
    )
    taken = how_taken(session, options.offsets or {})
    if solved.rig is None:
        findings = (WITHOUT_PLACES, *solved.findings)
        return Proposal(
            secrets.token_hex(8), session.name, calibration_source(solved), (), findings, calibrated=solved
        )
    fitted = fit_to_session(session, solved.rig.cameras)
    return Proposal(
        secrets.token_hex(8),
        session.name,
        calibration_source(solved),
        fitted.cameras,
        solved.findings,
        notes=fitted.warnings,
        matching=fitted.matching,
        crops=fitted.crops,
        calibrated=solved,
        pictures=_board_pictures(solved, footage, taken),
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


def propose_level(session: Session, run: str = "", progress: Progress = no_progress) -> Proposal:
    """The calibration in use, its world levelled by a run's feet, else by the silhouettes.

    Raises NotFoundError, CalibrationError where nothing shows the vertical or the floor.
    """
    level = (
        level_by_run(session, session.run(run)) if run else level_by_silhouettes(session, progress=progress)
    )
    new = level_calibration(session, level)
    return dataclasses.replace(
        proposal_in_use(session),
        identifier=secrets.token_hex(8),
        source=new.source,
        cameras=new.cameras,
        findings=check_calibration(new.cameras),
        notes=new.notes,
        floor=new.floor,
    )


def with_floor(base: Proposal, points: Sequence[Click]) -> Proposal:
    """The same cameras in the world that clicked points define; nothing of `base` is kept. Raises CalibrationError."""
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


def apply_proposal(session: Session, proposal: Proposal) -> CalibrationChange:
    """Let the session use a proposal from now on, whatever its findings say; the earlier calibration is kept.

    Raises SessionError while a run is being tracked.
    """
    new = NewCalibration(
        proposal.cameras,
        proposal.source,
        proposal.originals,
        proposal.crops,
        proposal.matching,
        tuple(note for note in (proposal.unit_note, *proposal.notes) if note),
        proposal.calibrated,
        proposal.floor if proposal.in_use else "",
    )
    return replace_calibration(session, new)


def _board_pictures(solved: Calibrated, footage: BoardFootage, taken: HowTaken) -> dict[str, Bytes]:
    """Each camera's picture of the floor's moment, else of the moment when most cameras saw the board."""
    folder, floor = (
        (footage.lying, "frame:0") if footage.lying is not None else (footage.common, footage.floor)
    )
    rig = solved.rig
    if folder is None or rig is None or not rig.boards:
        return {}
    frame = (
        int(floor.removeprefix("frame:"))
        if floor.startswith("frame:")
        else sorted(rig.boards)[len(rig.boards) // 2]
    )
    try:
        recordings = by_camera(list_footage(folder), [camera.name for camera in rig.cameras])
        return {
            name: taken.upright(name, footage_picture(entry, frame + taken.offsets.get(name, 0)))
            for name, entry in recordings.items()
        }
    except StudioError:
        return {}
