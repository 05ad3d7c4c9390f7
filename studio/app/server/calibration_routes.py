"""A session's calibration: what it is, files to take it from, its floor by clicks, its use and export, boards to print.

Everything but `apply` leaves the session as it is.
"""

import asyncio
import tempfile
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import quote

from fastapi import Depends, Query, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState, release
from studio.app.server.safe_paths import FootagePlace, PlaceName, place_of
from studio.app.server.schemas import Request
from studio.app.server.session_routes import OpenSession
from studio.footage.calibration.floor import Click
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import read_file as content_of
from studio.operations.calibration_proposals import (
    Proposal,
    apply_proposal,
    proposal_in_use,
    propose_earlier,
    propose_file,
    with_floor,
)
from studio.operations.calibration_views import (
    CalibrationView,
    ProposalView,
    WorldPicture,
    calibration_file,
    calibration_view,
    draw_coverage,
    draw_world,
    proposal_view,
)
from studio.operations.cameras import board as make_board
from studio.runs.drawing.overlay_drawing import encode_jpeg
from studio.sessions.importers.importing import Unit, Up
from studio.sessions.session import Session

router = Router(prefix="/api", tags=["calibration"])


HERE = "/sessions/{session}/calibration"
CURRENT = "current"
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


@router.get(HERE)
def calibration(session: OpenSession) -> CalibrationView:
    """The calibration in use with what speaks against it, and those before it."""
    return calibration_view(session)


@router.post(HERE + "/proposals", status_code=201)
async def read_file(session: OpenSession, request: CalibrationFileRequest, app: App) -> ProposalView:
    """Read a calibration file: unit, up axis, cameras, findings. It is not used before it is applied."""
    return proposal_view(app.proposals.keep(await asyncio.to_thread(_read_proposal, session, request, app)))


@router.get(HERE + "/proposals/{identifier}")
def proposal(session: OpenSession, identifier: str, app: App) -> ProposalView:
    """A calibration that was read or solved and is not in use yet."""
    return proposal_view(_proposal(session, identifier, app))


@router.post(HERE + "/floor", status_code=201)
def set_floor(session: OpenSession, request: FloorRequest, app: App) -> ProposalView:
    """The same cameras in the world that clicked points make: a new proposal with each point in space."""
    base = _proposal(session, request.proposal or CURRENT, app)
    points = [Click(point.pixels, point.world) for point in request.points]
    return proposal_view(app.proposals.keep(with_floor(base, points)))


@router.post(HERE + "/proposals/{identifier}/apply")
def apply(session: OpenSession, identifier: str, request: ApplyRequest, app: App) -> CalibrationView:
    """Use a proposal from now on; the earlier calibration is kept, and stale runs are named. 422 with the first
    finding that blocks, unless `anyway`; refused while a run of the session is being tracked.
    """
    proposal = _proposal(session, identifier, app)
    if not request.anyway:
        proposal.check()
    release(app, session.name)
    change = apply_proposal(session, proposal)
    app.events.session_changed(session.name)
    return calibration_view(change.session, change.notes)


@router.get(HERE + "/proposals/{identifier}/views/{camera}.jpg", response_class=Response)
async def view(
    session: OpenSession,
    identifier: str,
    camera: str,
    app: App,
    how: Annotated[WorldPicture, Depends(WorldPicture)],
) -> Response:
    """Floor, axes and a pole drawn on a camera's picture, upright; identifier "current" for the one in use. board:
    show the board's footage where the proposal has some; axes: false leaves the picture bare.
    """
    drawn = await asyncio.to_thread(draw_world, session, _proposal(session, identifier, app), camera, how)
    return files.picture(encode_jpeg(drawn))


@router.get(HERE + "/proposals/{identifier}/coverage/{camera}.png", response_class=Response)
def coverage(session: OpenSession, identifier: str, camera: str, app: App) -> Response:
    """Where in the picture the board's corners were seen: used ones white, those left out red."""
    return files.picture(draw_coverage(session, _proposal(session, identifier, app), camera), "png")


@router.get(HERE + "/export", response_class=Response)
def export(session: OpenSession, form: Annotated[str, Query(alias="format", max_length=64)]) -> Response:
    """The calibration in use for another tool; several files as a zip. What the format cannot hold is named in the
    header x-studio-notes (percent-encoded lines).
    """
    made = calibration_file(session, form)
    return files.download(made.content, made.name, files.BINARY, x_studio_notes=quote("\n".join(made.notes)))


@router.get("/calibration-boards.pdf", response_class=Response)
def board_pdf(
    kind: Literal["charuco", "chessboard"] = "charuco",
    page: Literal["a4", "a3", "letter"] = "a4",
    board: Annotated[str, Query(max_length=120, description="Empty: one that fills the page.")] = "",
) -> Response:
    """A board to print in true size; its text form is in the file's name, and in the header x-studio-board."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "board.pdf"
        made = make_board(place, kind=kind, board=board, page=page)
        content = content_of(place)
    plain = made.text.replace(":", "-").replace(",", "-")
    return files.download(content, f"{plain}.pdf", "application/pdf", x_studio_board=made.text)


def _read_proposal(session: Session, request: CalibrationFileRequest, app: AppState) -> Proposal:
    if request.earlier:
        return propose_earlier(session, request.earlier, request.unit, request.up)
    if not request.path and request.upload is None:
        raise CalibrationError("No calibration was named.", "Choose a file.")
    place = place_of(app, FootagePlace(path=request.path, upload=request.upload))
    return propose_file(session, place, request.file, request.unit, request.up)


def _proposal(session: Session, identifier: str, app: AppState) -> Proposal:
    return proposal_in_use(session) if identifier == CURRENT else app.proposals.find(session.name, identifier)
