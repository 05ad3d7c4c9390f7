"""Solving cameras from board footage, and levelling them, in the background, with `calibration` events."""

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.safe_paths import FootagePlace, place_of
from studio.app.server.schemas import Number, Request
from studio.app.server.session_routes import OpenSession
from studio.foundations.progress import TimeLeft
from studio.operations.calibration_proposals import (
    BoardFootage,
    Proposal,
    checked_board,
    propose_boards,
    propose_level,
)
from studio.operations.cameras import calibrate, level
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.sessions.board_calibration import BoardOptions
from studio.sessions.session import Session

router = Router(prefix="/api", tags=["calibration"])


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


@router.post("/sessions/{session}/calibration/solve", status_code=202)
async def begin_solving(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(calibrate, "BoardRequest", only=SOLVED, **FOOTAGE)],
    app: App,
) -> SolveState:
    """Begin to solve lenses and places from board footage. Nothing is changed: what comes of it is a proposal. Ask for
    its state, or wait for `calibration` events.
    """
    more = arguments.more
    distances = {(each.first, each.second): each.mm for each in more["distances"]}
    given = dict(arguments)
    text, options = given.pop("board"), BoardOptions(**given, distances_mm=distances)
    board = checked_board(session, text, options)
    footage = await asyncio.to_thread(_footage, app, session, more)

    def work(job: Job) -> dict[str, object]:
        report = _Progress(job, footage.recordings).report
        return _keep(app, propose_boards(session, footage, board, options, report))

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
    run = session.run(arguments["run"]).name if arguments.get("run") else ""

    def work(job: Job) -> dict[str, object]:
        return _keep(app, propose_level(session, run, job.report_or_stop))

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


def _footage(app: AppState, session: Session, request: Mapping[str, Any]) -> BoardFootage:
    """Where a request's footage lies. Raises PathRefused, NotFoundError, CalibrationError."""

    def place(name: str) -> Path | None:
        return place_of(app, request[name]) if request[name] else None

    named = BoardFootage(place("intrinsics"), place("extrinsics"), place("floor_footage"), request["floor"])
    return named.completed(place("footage") or session.path)


def _keep(app: AppState, proposal: Proposal) -> dict[str, object]:
    return {"proposal": app.proposals.keep(proposal).identifier, "share": 1.0}
