"""A session's calibration: what it is, files to take it from, its floor by clicks, its use and export, boards to print.

Everything but `apply` leaves the session as it is.
"""

import asyncio
import io
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import quote

import cv2
from fastapi import APIRouter, Query, Response

from studio.app.server import files
from studio.app.server.app_state import App, AppState, release
from studio.app.server.calibration_proposals import (
    Proposal,
    backdrop,
    proposal_in_use,
    proposal_of_file,
    with_floor,
)
from studio.app.server.calibration_views import (
    ApplyRequest,
    CalibrationFileRequest,
    CalibrationView,
    FloorRequest,
    ProposalView,
    calibration_view,
    proposal_view,
)
from studio.app.server.safe_paths import FootagePlace, chosen_file, place_of
from studio.app.server.session_routes import OpenSession
from studio.footage.calibration.board_pdf import usual_board, write_board_pdf
from studio.footage.calibration.boards import board_from_text
from studio.footage.calibration.coverage import coverage_picture
from studio.footage.calibration.floor import Click
from studio.footage.calibration.intrinsics import Lens
from studio.footage.calibration.world_picture import world_picture
from studio.footage.capture.calibration_files import (
    CALIBRATION_FORMATS,
    export_calibration,
    find_calibrations,
    read_calibration,
)
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import CalibrationError, NotFoundError
from studio.foundations.foreign_files import read_file as content_of
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.overlay_drawing import encode_jpeg
from studio.sessions.calibration_changes import earlier_calibration, replace_calibration
from studio.sessions.session import CAMERAS_PATH, Session

router = APIRouter(prefix="/api", tags=["calibration"])


HERE = "/sessions/{session}/calibration"
CURRENT = "current"


@router.get(HERE)
def calibration(session: OpenSession) -> CalibrationView:
    """The calibration in use with what speaks against it, and those before it."""
    return calibration_view(session, ())


@router.post(HERE + "/proposals", status_code=201)
async def read_file(session: OpenSession, request: CalibrationFileRequest, app: App) -> ProposalView:
    """Read a calibration file: unit, up axis, cameras, findings. It is not used before it is applied."""
    return proposal_view(app.proposals.keep(await asyncio.to_thread(_read, session, request, app)))


@router.get(HERE + "/proposals/{identifier}")
def proposal(session: OpenSession, identifier: str, app: App) -> ProposalView:
    """A calibration that was read or solved and is not in use yet."""
    return proposal_view(_found(session, identifier, app))


@router.post(HERE + "/floor", status_code=201)
def set_floor(session: OpenSession, request: FloorRequest, app: App) -> ProposalView:
    """The same cameras in the world that clicked points make: a new proposal with each point in space."""
    base = _found(session, request.proposal or CURRENT, app)
    points = [Click(point.pixels, point.world) for point in request.points]
    return proposal_view(app.proposals.keep(with_floor(session, base, points)))


@router.post(HERE + "/proposals/{identifier}/apply")
def apply(session: OpenSession, identifier: str, request: ApplyRequest, app: App) -> CalibrationView:
    """Use a proposal from now on; the calibration before is kept, and what becomes stale is said. 422 with the first
    finding that blocks, unless `anyway`; refused while a run of the session is being tracked.
    """
    new = _found(session, identifier, app).checked_new(request.anyway)
    release(app, session.name)
    change = replace_calibration(session, new)
    app.events.session_changed(session.name)
    return calibration_view(change.session, change.notes)


@router.get(HERE + "/proposals/{identifier}/views/{camera}.jpg", response_class=Response)
async def view(
    session: OpenSession,
    identifier: str,
    camera: str,
    app: App,
    height: Annotated[int, Query(ge=64, le=2160)] = 720,
    frame: Annotated[int, Query(ge=0, le=LARGEST)] = 0,
    board: bool = True,
    axes: bool = True,
) -> Response:
    """Floor, axes and a pole drawn on a camera's picture, upright; identifier "current" for the one in use. board:
    show the board's footage where the proposal has some; axes: false leaves the picture bare.
    """
    found = _found(session, identifier, app)
    placed = _camera(found, camera)
    picture = await asyncio.to_thread(backdrop, session, found, camera, board, frame)
    points: list[list[float]] = found.clicked.points.tolist() if found.clicked is not None else []
    drawn = world_picture(picture, placed, points, height, bare=not axes)
    return files.picture(encode_jpeg(drawn))


@router.get(HERE + "/proposals/{identifier}/coverage/{camera}.png", response_class=Response)
def coverage(session: OpenSession, identifier: str, camera: str, app: App) -> Response:
    """Where in the picture the board's corners were seen: used ones white, those left out red."""
    found = _found(session, identifier, app)
    lenses: Mapping[str, Lens] = found.calibrated.lenses if found.calibrated is not None else {}
    name = camera if camera in lenses else _camera(found, camera).name
    kept = session.path / CAMERAS_PATH.with_name(f"cameras.coverage-{name}.png")
    if found.calibrated is None and identifier == CURRENT and kept.is_file():
        content = content_of(kept)
    elif found.calibrated is not None and name in lenses:
        lens = lenses[name]
        dropped = {residual.frame for residual in lens.residuals if residual.dropped}
        seen = found.calibrated.sightings.get(name, ())
        picture = coverage_picture(
            lens.coverage,
            [sighting for sighting in seen if sighting.frame not in dropped],
            [sighting for sighting in seen if sighting.frame in dropped],
        )
        content = bytes(cv2.imencode(".png", picture)[1])
    else:
        raise NotFoundError(
            f"Camera '{name}' was not calibrated from a board here.", "Calibrate it from boards."
        )
    return files.picture(content, "png")


@router.get(HERE + "/export", response_class=Response)
def export(session: OpenSession, form: Annotated[str, Query(alias="format", max_length=64)]) -> Response:
    """The calibration in use for another tool; several files as a zip. What the format cannot hold is named in the
    header x-studio-notes (percent-encoded lines).
    """
    cameras = proposal_in_use(session).cameras
    with tempfile.TemporaryDirectory() as folder:
        writer = CALIBRATION_FORMATS[form]
        place = Path(folder) / (writer.file_name.format(session.name) + writer.suffix)
        written = export_calibration(cameras, place, form)
        name, content = _packed(written.files, f"{session.name}-{form}.zip")
    return files.download(content, name, files.BINARY, x_studio_notes=quote("\n".join(written.notes)))


@router.get("/calibration-boards.pdf", response_class=Response)
def board_pdf(
    kind: Literal["charuco", "chessboard"] = "charuco",
    page: Literal["a4", "a3", "letter"] = "a4",
    board: Annotated[str, Query(max_length=120, description="Empty: one that fills the page.")] = "",
) -> Response:
    """A board to print in true size; its text form is in the file's name, and in the header x-studio-board."""
    made = board_from_text(board) if board else usual_board(kind, page)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "board.pdf"
        write_board_pdf(made, place, page)
        content = content_of(place)
    plain = made.text.replace(":", "-").replace(",", "-")
    return files.download(content, f"{plain}.pdf", "application/pdf", x_studio_board=made.text)


def _read(session: Session, request: CalibrationFileRequest, app: AppState) -> Proposal:
    if request.earlier:
        path = earlier_calibration(session, request.earlier) / CAMERAS_PATH.name
    elif not request.path and request.upload is None:
        raise CalibrationError("No calibration was named.", "Choose a file.")
    else:
        place = place_of(app, FootagePlace(path=request.path, upload=request.upload))
        path = chosen_file(place, request.file, find_calibrations(place) if place.is_dir() else ())
    return proposal_of_file(session, read_calibration(path, request.unit, request.up))


def _found(session: Session, identifier: str, app: AppState) -> Proposal:
    return proposal_in_use(session) if identifier == CURRENT else app.proposals.find(session.name, identifier)


def _camera(found: Proposal, name: str) -> Camera:
    for camera in found.cameras:
        if camera.name == name:
            return camera
    names = ", ".join(camera.name for camera in found.cameras)
    raise NotFoundError(f"There is no calibrated camera '{name[:64]}'.", f"There are {names}.")


def _packed(files: tuple[Path, ...], name: str) -> tuple[str, bytes]:
    """The only file itself, or all in a zip of that name."""
    if len(files) == 1:
        return files[0].name, content_of(files[0])
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            archive.write(path, path.name)
    return name, packed.getvalue()
