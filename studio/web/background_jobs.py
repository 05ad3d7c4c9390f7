"""Work in the background of the server: begun by a route, told of as events, asked for and stopped by its key.

The kinds of work are in `job_kinds`. A job is one state that is replaced whenever something becomes of it, in a thread
of its own; whatever goes wrong there becomes a state too.
"""

import asyncio
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar, cast

from studio.errors import NotFoundError, StudioError, WorkCancelledError
from studio.web.error_responses import UnforeseenError, log
from studio.web.job_schemas import SessionJob

State = TypeVar("State", bound=SessionJob)
SomeState = TypeVar("SomeState", bound=SessionJob, covariant=True)
Work = Callable[["Job"], Mapping[str, object]]
"""work(job) does it, in a thread; what it returns goes into the state, which is "done" unless that says otherwise."""
Report = Callable[[str, int, int], None]
"""report(step, done, total)"""

KEPT = 50
SECONDS_BETWEEN = 0.2
RUNNING, CANCELLED = "running", "cancelled"
"""CANCELLED: the state of what a person did not want any more, and the code of every error that says so."""


@dataclass(frozen=True, slots=True)
class JobKind(Generic[SomeState]):
    """One kind of work. event : type of the events that tell of it. noun : what it is called, without article.

    states : the class of its states. changes_session : once it is done, all pages hear that the session has changed.
    """

    event: str
    noun: str
    states: type[SomeState]
    changes_session: bool = False


class Job:
    """One job, as its work sees it. state : how it stands. found : what it found, for other routes to use."""

    def __init__(
        self, kind: JobKind[State], state: State, publish: Callable[[dict[str, object]], None]
    ) -> None:
        self.state: SessionJob = state
        self.found: object = None
        self._kind = kind
        self._publish = publish
        self._stop = threading.Event()
        self._step, self._began, self._first, self._told = "", 0.0, 0, 0.0

    def cancel(self) -> None:
        """Wish that it ends where it stands."""
        self._stop.set()

    def cancelled(self) -> bool:
        """Whether somebody wants it to end."""
        return self._stop.is_set()

    def tell(self, **changes: object) -> None:
        """Replace entries of the state and tell all pages; from any thread."""
        # Validated, so that numbers that are none become null.
        self.state = self._kind.states.model_validate({**dict(self.state), **changes})
        self._publish({"type": self._kind.event, "run": "", **self.state.model_dump()})

    def report(self, step: str, done: int, total: int, **more: object) -> None:
        """Tell how far the work is, with an estimate of the step's rest: at once for a new step and for its end, else
        as often as is read. more : other entries of the state.
        """
        now = time.monotonic()
        if step != self._step:
            self._step, self._began, self._first = step, now, done
        elif now - self._told < SECONDS_BETWEEN and done < total:
            return
        self._told = now
        gone = done - self._first
        left = (now - self._began) * (total - done) / gone if gone > 0 else None
        self.tell(**{"step": step, "done": done, "total": total, "seconds_left": left, **more})

    def report_or_stop(self, step: str, done: int, total: int, **more: object) -> None:
        """`report` for work that cannot be told to end in another way. Raises WorkCancelledError once it shall."""
        if self.cancelled():
            raise WorkCancelledError(f"The {self._kind.noun} was cancelled.", "Start it again when you like.")
        self.report(step, done, total, **more)

    def do(self, work: Work, log_path: Path | None) -> None:
        """Work in this thread, and tell what becomes of it; never raises."""
        kind, state = self._kind, self.state
        try:
            self.tell(**{"state": "done", "seconds_left": 0.0, **work(self)})
        except StudioError as error:
            unwanted = self.cancelled() or isinstance(error, WorkCancelledError)
            self._tell_error(error, CANCELLED if unwanted else "failed")
        except Exception as error:
            log.exception("%s '%s' of '%s' failed", kind.noun, state.key, state.session)
            message = f"The {kind.noun} failed: {type(error).__name__}."
            self._tell_error(UnforeseenError(message, f"See '{log_path}'."), "failed")
        if kind.changes_session and self.state.state == "done":
            self._publish({"type": "sessions", "session": state.session, "run": ""})

    def _tell_error(self, error: StudioError, state: str) -> None:
        self.tell(state=state, code=error.code, message=error.message, hint=error.hint)


class BackgroundJobs:
    """All jobs of a server. publish : sends an event to every page. log_path : where faults are written."""

    def __init__(self, publish: Callable[[dict[str, object]], None], log_path: Path | None = None) -> None:
        self._publish = publish
        self._log_path = log_path
        self._jobs: dict[str, dict[str, Job]] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def begin(self, kind: JobKind[State], state: State, work: Work) -> State:
        """Begin work in a thread of its own; call on the event loop. The oldest that are over are forgotten."""
        jobs = self._jobs.setdefault(kind.event, {})
        jobs.pop(state.key, None)
        jobs[state.key] = job = Job(kind, state, self._publish)
        over = [key for key, known in jobs.items() if known.state.state != RUNNING]
        for key in over[: max(0, len(jobs) - KEPT)]:
            del jobs[key]
        task = asyncio.create_task(asyncio.to_thread(job.do, work, self._log_path))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return state

    def known(self, kind: JobKind[State], key: str) -> State | None:
        """How a job stands, None where there is none."""
        job = self._jobs.get(kind.event, {}).get(key)
        return None if job is None else cast("State", job.state)

    def state(self, kind: JobKind[State], key: str) -> State:
        """How a job stands. Raises NotFoundError."""
        return cast("State", self._job(kind, key).state)

    def found(self, kind: JobKind[State], key: str) -> object:
        """What a job found, None where it found nothing (yet). Raises NotFoundError."""
        return self._job(kind, key).found

    def running(self, kind: JobKind[State], session: str) -> list[State]:
        """Those of a session that are under way, the oldest first."""
        states = [cast("State", job.state) for job in list(self._jobs.get(kind.event, {}).values())]
        return [state for state in states if (state.session, state.state) == (session, RUNNING)]

    def cancel(self, kind: JobKind[State], key: str) -> None:
        """Let a job end where it stands, if there is one."""
        job = self._jobs.get(kind.event, {}).get(key)
        if job is not None:
            job.cancel()

    def change(self, kind: JobKind[State], key: str, **changes: object) -> State:
        """Replace entries of a job's state and tell all pages. Raises NotFoundError."""
        job = self._job(kind, key)
        job.tell(**changes)
        return cast("State", job.state)

    async def end(self) -> None:
        """Stop all of them and wait for their threads."""
        for job in [job for jobs in self._jobs.values() for job in jobs.values()]:
            job.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _job(self, kind: JobKind[State], key: str) -> Job:
        job = self._jobs.get(kind.event, {}).get(key)
        if job is None:
            raise NotFoundError(f"There is no {kind.noun} '{key[:40]}'.", "Begin a new one.")
        return job
