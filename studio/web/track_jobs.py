"""Work on a session's poses and tracks in the background: one state each, kept up to date, told as `track` events."""

import asyncio
import secrets
import threading
import time
from collections.abc import Callable
from typing import Any

from studio.errors import RunError, StudioError
from studio.web.doors import Doors
from studio.web.error_responses import UnforeseenError, log
from studio.web.track_schemas import TrackJobState

Report = Callable[[str, int, int], None]
Work = Callable[[Report, Callable[[], bool]], dict[str, Any]]

KEPT = 50
SECONDS_BETWEEN = 0.2
CANCELLED = "cancelled"
"""The code of every error that says that a person wanted the end."""


def begin_job(doors: Doors, verb: str, session: str, run: str, work: Work) -> TrackJobState:
    """Begin `work` in a thread; its answer goes into the state. verb : as TrackJobState has it. run : "" for none."""
    state = TrackJobState.model_validate(
        {
            "identifier": secrets.token_hex(8),
            "verb": verb,
            "session": session,
            "run": run,
            "state": "running",
        }
    )
    doors.track_jobs[state.identifier] = state
    doors.stops[state.identifier] = threading.Event()
    while len(doors.track_jobs) > KEPT:
        doors.track_jobs.pop(next(iter(doors.track_jobs)))
    job = asyncio.create_task(asyncio.to_thread(_make, doors, state, work))
    doors.jobs.add(job)
    job.add_done_callback(doors.jobs.discard)
    return state


def _make(doors: Doors, begun: TrackJobState, work: Work) -> None:
    """Work in this thread, keeping the state up to date; never raises."""
    stop, began, told = doors.stops[begun.identifier], time.monotonic(), 0.0

    def tell(**changes: object) -> None:
        state = doors.track_jobs.get(begun.identifier)
        if state is not None:
            # Validated, so that numbers that are none become null.
            entries = {**state.model_dump(), **changes}
            doors.track_jobs[begun.identifier] = state = TrackJobState.model_validate(entries)
            doors.events.publish({"type": "track", **state.model_dump()})

    def report(step: str, done: int, total: int) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told < SECONDS_BETWEEN and done < total:
            return
        told = now
        left = (now - began) * (total - done) / done if done else None
        tell(step=step, done=done, total=total, seconds_left=left)

    try:
        answer = work(report, stop.is_set)
    except StudioError as error:
        ended = "cancelled" if isinstance(error, RunError) and error.code == CANCELLED else "failed"
        tell(state=ended, code=error.code, message=error.message, hint=error.hint)
        return
    except Exception as error:
        log.exception("%s of '%s' of '%s' failed", begun.verb, begun.run, begun.session)
        wrong = UnforeseenError(f"It failed: {type(error).__name__}.", f"See '{doors.log_path}'.")
        tell(state="failed", code=wrong.code, message=wrong.message, hint=wrong.hint)
        return
    finally:
        doors.stops.pop(begun.identifier, None)
    tell(**{"state": "done", **answer})
