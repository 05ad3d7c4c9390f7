"""Solving cameras from board footage, and levelling them, in the background, with `calibration` events."""

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from studio.app.server.app_state import App, AppState
from studio.app.server.calibration_proposals import Proposal, level_proposal, proposal_of_boards
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.safe_paths import FootagePlace, place_of
from studio.app.server.schemas import Number, Request
from studio.app.server.session_routes import OpenSession
from studio.footage.calibration.board_footage_reading import find_board_footage, list_footage
from studio.footage.calibration.boards import Board, board_from_text
from studio.footage.calibration.verbs import calibrate as solve
from studio.foundations.progress import Progress, TimeLeft
from studio.operations.cameras import calibrate, level
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.runs.setup.levelling import level_by_run, level_by_silhouettes
from studio.sessions.board_calibration import footage_sizes, how_taken
from studio.sessions.session import Session

router = APIRouter(prefix="/api", tags=["calibration"])


class DistanceRequest(Request):
    """A measured distance between two cameras' lenses."""

    first: str = Field(max_length=64)
    second: str = Field(max_length=64)
    mm: float = Field(gt=0, le=1e6)


class SolveState(NumberedJob):
    """How a calibration from boards, or its levelling, stands. share: of all, about, null while unknown; seconds_left:
    of all; proposal: what came of it.
    """

    share: Number = None
    proposal: str = ""


CALIBRATION = JobKind(
    "calibration",
    "calibration",
    SolveState,
    at="/api/calibrations/{identifier}",
    page="/way?session={session}&step=calibration",
)


LOOKING = "Looking for the board"
LOOKING_SHARE = 0.95
"""Of all time, looking for the board takes about this much; solving the rest."""
PARTS = 1000

SOLVED = ("board", "thickness_mm", "offsets", "refine_lenses")
FOOTAGE: dict[str, Any] = {
    "footage": (
        FootagePlace | None,
        Field(None, description="Holds intrinsics/ and extrinsics/; null: the session does."),
    ),
    "intrinsics": (FootagePlace | None, Field(None, description="One video or folder of pictures a camera.")),
    "extrinsics": (FootagePlace | None, Field(None, description="The same, of all cameras at once.")),
    "floor": (
        Annotated[str, Field(max_length=24, pattern=r"^(frame:\d{1,7})?$")],
        Field("", description="frame:N, empty for none."),
    ),
    "floor_footage": (
        FootagePlace | None,
        Field(None, description="Pictures of the board on the floor, one a camera."),
    ),
    "distances": (Annotated[list[DistanceRequest], Field(max_length=64)], []),
}
"""Where the board's footage lies, for a body."""


class _Folders:
    """Where the board's footage lies. recordings : how many there are to be looked through."""

    def __init__(self, app: AppState, session: Session, request: Mapping[str, Any]) -> None:
        self.lenses = place_of(app, request["intrinsics"]) if request["intrinsics"] else None
        self.common = place_of(app, request["extrinsics"]) if request["extrinsics"] else None
        if self.lenses is None and self.common is None:
            whole = place_of(app, request["footage"]) if request["footage"] else session.path
            self.lenses, self.common = find_board_footage(whole)
        lying = place_of(app, request["floor_footage"]) if request["floor_footage"] else None
        self.floor = str(lying) if lying is not None else request["floor"] or None
        places = [
            place for place in (self.lenses, self.common, lying) if place is not None and place.is_dir()
        ]
        self.recordings = sum(len(list_footage(place)) for place in places)


@router.post("/sessions/{session}/calibration/solve", status_code=202)
async def begin_solving(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(calibrate, "BoardRequest", only=SOLVED, **FOOTAGE)],
    app: App,
) -> SolveState:
    """Begin to solve lenses and places from board footage. Nothing is changed: what comes of it is a proposal. Ask for
    its state, or wait for `calibration` events.
    """
    board = board_from_text(arguments["board"], arguments["thickness_mm"])
    how_taken(session, arguments["offsets"])
    folders = await asyncio.to_thread(_Folders, app, session, arguments.more)

    def work(job: Job) -> dict[str, object]:
        proposal = _solved(session, arguments, board, folders, _Progress(job, folders.recordings).report)
        app.proposals.keep(proposal)
        return {"proposal": proposal.identifier, "share": 1.0}

    return app.jobs.begin(CALIBRATION, SolveState(session=session.name), work)


@router.post("/sessions/{session}/calibration/level", status_code=202)
def begin_levelling(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(level, "LevelRequest", only=("run",))],
    app: App,
) -> SolveState:
    """Begin to find the vertical and the floor for the calibration in use: by a run's feet, else by the silhouettes.
    Nothing is changed: what comes of it is a proposal. Ask for its state, or wait for `calibration` events.
    """
    run = session.run(arguments["run"]) if arguments.get("run") else None

    def work(job: Job) -> dict[str, object]:
        found = (
            level_by_silhouettes(session, progress=job.report_or_stop)
            if run is None
            else level_by_run(session, run)
        )
        proposal = level_proposal(session, found)
        app.proposals.keep(proposal)
        return {"proposal": proposal.identifier, "share": 1.0}

    return app.jobs.begin(CALIBRATION, SolveState(session=session.name), work)


add_job_routes(router, "/calibrations/{identifier}", CALIBRATION)


class _Progress:
    """How far all of it is, from what is reported step by step."""

    def __init__(self, job: Job, recordings: int) -> None:
        self._job, self._recordings = job, max(recordings, 1)
        self._left = TimeLeft()
        self._looked, self._last = 0, ""

    def report(self, step: str, done: int, total: int) -> None:
        """A step got further. Raises WorkCancelledError when it was stopped."""
        if step != self._last:
            self._looked += self._last.startswith(LOOKING)
            self._last = step
        looked = self._looked + (done / total if step.startswith(LOOKING) and total else 0.0)
        share = min(LOOKING_SHARE * looked / self._recordings, LOOKING_SHARE)
        left = self._left.after("all", round(PARTS * share), PARTS)
        self._job.report_or_stop(step, done, total, share=share, seconds_left=left)


def _solved(
    session: Session, arguments: Arguments, board: Board, folders: _Folders, progress: Progress
) -> Proposal:
    """What comes of the footage, to be looked at. Raises CalibrationError, FootageError, WorkCancelledError."""
    taken = how_taken(session, arguments["offsets"])
    found = solve(
        board,
        intrinsics=folders.lenses,
        extrinsics=folders.common,
        floor=folders.floor,
        names=tuple(taken.sizes),
        footage_sizes=footage_sizes(session),
        distances_mm={(each.first, each.second): each.mm for each in arguments.more["distances"]},
        refine_lenses=arguments["refine_lenses"],
        taken=taken,
        progress=progress,
    )
    lying = Path(folders.floor) if folders.floor and arguments.more["floor_footage"] else None
    seen, moment = (lying, "frame:0") if lying is not None else (folders.common, arguments.more["floor"])
    return proposal_of_boards(session, found, seen, moment, taken)
