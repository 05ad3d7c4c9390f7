"""Solving cameras from board footage in the background, with `calibration` events."""

import asyncio
import secrets
import threading
import time
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends

from studio.calibration.board_folders import find_board_footage
from studio.calibration.board_footage_reading import list_footage
from studio.calibration.boards import Board, board_from_text
from studio.calibration.verbs import calibrate
from studio.errors import CalibrationError, NotFoundError, StudioError
from studio.sessions.session import Session
from studio.web.calibration_places import place_of
from studio.web.calibration_proposals import footage_sizes, how_taken, proposal_of_boards
from studio.web.calibration_schemas import BoardRequest, SolveState
from studio.web.doors import Doors, doors_of
from studio.web.error_responses import UnforeseenError, log
from studio.web.session_routes import OpenSession

router = APIRouter(prefix="/api", tags=["calibration"])

Door = Annotated[Doors, Depends(doors_of)]

KEPT = 50
SECONDS_BETWEEN = 0.2
LOOKING = "Looking for the board"
LOOKING_SHARE = 0.95
"""Of all time, looking for the board takes about this much; solving the rest."""


class SolvingCancelledError(CalibrationError):
    """A person stopped it."""

    code = "cancelled"


class _Folders:
    """Where the board's footage lies. recordings : how many there are to be looked through."""

    def __init__(self, doors: Doors, session: Session, wish: BoardRequest) -> None:
        self.lenses = place_of(doors, wish.intrinsics) if wish.intrinsics else None
        self.common = place_of(doors, wish.extrinsics) if wish.extrinsics else None
        if self.lenses is None and self.common is None:
            whole = place_of(doors, wish.footage) if wish.footage else session.path
            self.lenses, self.common = find_board_footage(whole)
        lying = place_of(doors, wish.floor_footage) if wish.floor_footage else None
        self.floor = str(lying) if lying is not None else wish.floor or None
        places = [
            place for place in (self.lenses, self.common, lying) if place is not None and place.is_dir()
        ]
        self.recordings = sum(len(list_footage(place)) for place in places)


@router.post("/sessions/{session}/calibration/solve", status_code=202)
async def begin_solving(session: OpenSession, wish: BoardRequest, doors: Door) -> SolveState:
    """Begin to solve lenses and places from board footage. Nothing is changed: what comes of it is a proposal. Ask for
    its state, or wait for `calibration` events.
    """
    board = board_from_text(wish.board, wish.thickness_mm)
    how_taken(session, wish.offsets)
    folders = await asyncio.to_thread(_Folders, doors, session, wish)
    state = SolveState(identifier=secrets.token_hex(8), session=session.name, state="running")
    doors.calibration_jobs[state.identifier] = state
    doors.stops[state.identifier] = threading.Event()
    while len(doors.calibration_jobs) > KEPT:
        doors.calibration_jobs.pop(next(iter(doors.calibration_jobs)))
    work = asyncio.to_thread(_solve, doors, state.identifier, session, wish, board, folders)
    job = asyncio.create_task(work)
    doors.jobs.add(job)
    job.add_done_callback(doors.jobs.discard)
    return state


@router.get("/calibrations/{identifier}")
def solving_state(identifier: str, doors: Door) -> SolveState:
    """How it stands, and the proposal that came of it."""
    state = doors.calibration_jobs.get(identifier)
    if state is None:
        raise NotFoundError(f"There is no calibration '{identifier[:40]}' under way.", "Begin a new one.")
    return state


@router.delete("/calibrations/{identifier}", status_code=202)
def cancel_solving(identifier: str, doors: Door) -> SolveState:
    """Stop it; nothing is kept."""
    state = solving_state(identifier, doors)
    if identifier in doors.stops:
        doors.stops[identifier].set()
    return state


class _Progress:
    """How far all of it is, from what is reported step by step."""

    def __init__(self, doors: Doors, identifier: str, recordings: int) -> None:
        self._doors, self._identifier, self._recordings = doors, identifier, max(recordings, 1)
        self._began = time.monotonic()
        self._told, self._looked, self._last = 0.0, 0, ""

    def tell(self, **changes: object) -> None:
        """Keep and publish the state."""
        state = self._doors.calibration_jobs.get(self._identifier)
        if state is not None:
            self._doors.calibration_jobs[self._identifier] = state = state.model_copy(update=changes)
            message: dict[str, object] = {"type": "calibration", "run": ""}
            self._doors.events.publish(message | state.model_dump())

    def report(self, step: str, done: int, total: int) -> None:
        """A step got further. Raises SolvingCancelledError when it was stopped."""
        stop = self._doors.stops.get(self._identifier)
        if stop is not None and stop.is_set():
            raise SolvingCancelledError("The calibration was cancelled.", "Start it again when you like.")
        is_looking = step.startswith(LOOKING)
        if step != self._last:
            self._looked += self._last.startswith(LOOKING)
            self._last = step
        now = time.monotonic()
        if now - self._told < SECONDS_BETWEEN and done:
            return
        self._told = now
        looked = self._looked + (done / total if is_looking and total else 0.0)
        share = min(LOOKING_SHARE * looked / self._recordings, LOOKING_SHARE)
        left = (now - self._began) * (1.0 - share) / share if share > 0.02 else None
        self.tell(step=step, done=done, total=total, share=share, seconds_left=left)


def _solve(
    doors: Doors, identifier: str, session: Session, wish: BoardRequest, board: Board, folders: _Folders
) -> None:
    """Solve in this thread, keeping the state up to date; never raises."""
    progress = _Progress(doors, identifier, folders.recordings)
    try:
        taken = how_taken(session, wish.offsets)
        found = calibrate(
            board,
            intrinsics=folders.lenses,
            extrinsics=folders.common,
            floor=folders.floor,
            names=tuple(taken.sizes),
            footage_sizes=footage_sizes(session),
            distances_mm={(each.first, each.second): each.mm for each in wish.distances},
            refine_lenses=wish.refine_lenses,
            taken=taken,
            progress=progress.report,
        )
        lying = Path(folders.floor) if folders.floor and wish.floor_footage else None
        seen, moment = (lying, "frame:0") if lying is not None else (folders.common, wish.floor)
        proposal = proposal_of_boards(session, found, seen, moment, taken)
    except SolvingCancelledError as error:
        progress.tell(state="cancelled", code=error.code, message=error.message, hint=error.hint)
        return
    except StudioError as error:
        progress.tell(state="failed", code=error.code, message=error.message, hint=error.hint)
        return
    except Exception as error:
        log.exception("calibration of '%s' failed", session.name)
        wrong = UnforeseenError(
            f"The calibration failed: {type(error).__name__}.", f"See '{doors.log_path}'."
        )
        progress.tell(state="failed", code=wrong.code, message=wrong.message, hint=wrong.hint)
        return
    finally:
        doors.stops.pop(identifier, None)
    doors.proposals.keep(proposal)
    progress.tell(state="done", proposal=proposal.identifier, share=1.0, seconds_left=0.0)
