"""Solving cameras from board footage in the background, with `calibration` events."""

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from studio.calibration.board_footage_reading import find_board_footage, list_footage
from studio.calibration.boards import Board, board_from_text
from studio.calibration.verbs import calibrate as solve
from studio.operations.cameras import calibrate
from studio.progress import Progress, TimeLeft
from studio.sessions.board_calibration import footage_sizes, how_taken
from studio.sessions.session import Session
from studio.web.calibration_places import place_of
from studio.web.calibration_proposals import Proposal, proposal_of_boards
from studio.web.calibration_schemas import DistanceWish, FootagePlace, SolveState
from studio.web.doors import Door, Doors
from studio.web.job_kinds import CALIBRATION
from studio.web.job_routes import add_job_routes
from studio.web.requests import Asked, body_of
from studio.web.session_routes import OpenSession
from studio.worker.jobs import Job

router = APIRouter(prefix="/api", tags=["calibration"])


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
    "distances": (Annotated[list[DistanceWish], Field(max_length=64)], []),
}
"""Where the board's footage lies, for a body."""


class _Folders:
    """Where the board's footage lies. recordings : how many there are to be looked through."""

    def __init__(self, doors: Doors, session: Session, wish: Mapping[str, Any]) -> None:
        self.lenses = place_of(doors, wish["intrinsics"]) if wish["intrinsics"] else None
        self.common = place_of(doors, wish["extrinsics"]) if wish["extrinsics"] else None
        if self.lenses is None and self.common is None:
            whole = place_of(doors, wish["footage"]) if wish["footage"] else session.path
            self.lenses, self.common = find_board_footage(whole)
        lying = place_of(doors, wish["floor_footage"]) if wish["floor_footage"] else None
        self.floor = str(lying) if lying is not None else wish["floor"] or None
        places = [
            place for place in (self.lenses, self.common, lying) if place is not None and place.is_dir()
        ]
        self.recordings = sum(len(list_footage(place)) for place in places)


@router.post("/sessions/{session}/calibration/solve", status_code=202)
async def begin_solving(
    session: OpenSession,
    asked: Annotated[Asked, body_of(calibrate, "BoardRequest", only=SOLVED, **FOOTAGE)],
    doors: Door,
) -> SolveState:
    """Begin to solve lenses and places from board footage. Nothing is changed: what comes of it is a proposal. Ask for
    its state, or wait for `calibration` events.
    """
    board = board_from_text(asked["board"], asked["thickness_mm"])
    how_taken(session, asked["offsets"])
    folders = await asyncio.to_thread(_Folders, doors, session, asked.more)

    def work(job: Job) -> dict[str, object]:
        proposal = _solved(session, asked, board, folders, _Progress(job, folders.recordings).report)
        doors.proposals.keep(proposal)
        return {"proposal": proposal.identifier, "share": 1.0}

    return doors.jobs.begin(CALIBRATION, SolveState(session=session.name), work)


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


def _solved(session: Session, asked: Asked, board: Board, folders: _Folders, progress: Progress) -> Proposal:
    """What comes of the footage, to be looked at. Raises CalibrationError, FootageError, WorkCancelledError."""
    taken = how_taken(session, asked["offsets"])
    found = solve(
        board,
        intrinsics=folders.lenses,
        extrinsics=folders.common,
        floor=folders.floor,
        names=tuple(taken.sizes),
        footage_sizes=footage_sizes(session),
        distances_mm={(each.first, each.second): each.mm for each in asked.more["distances"]},
        refine_lenses=asked["refine_lenses"],
        taken=taken,
        progress=progress,
    )
    lying = Path(folders.floor) if folders.floor and asked.more["floor_footage"] else None
    seen, moment = (lying, "frame:0") if lying is not None else (folders.common, asked.more["floor"])
    return proposal_of_boards(session, found, seen, moment, taken)
