"""Work in the background of a server: one life for every job, one runner for all of them.

A job is queued, runs in a thread, and is done, failed or cancelled; work that needs processes runs them through
an executor. How it stands is one value that is replaced whenever something becomes of it, and sent as an event.
"""

import logging
import secrets
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from string import Formatter
from typing import Any, Generic, TypeVar, cast
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, Field

from studio.foundations.errors import (
    NotFoundError,
    RunError,
    StudioError,
    UnforeseenError,
    WorkCancelledError,
)
from studio.foundations.foreign_files import MANIFEST_NAME
from studio.foundations.progress import TimeLeft
from studio.sessions.work_under_way import working_on
from studio.sessions.workspace import Workspace

KEPT = 50
MOST_AT_ONCE = 8
SECONDS_BETWEEN = 0.2

log = logging.getLogger("studio.operations.jobs")


class JobState(StrEnum):
    """The life of a job: the same words in Python, in JSON and on the page."""

    QUEUED = "queued"
    RUNNING = "running"
    CANCELLING = "cancelling"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_going(self) -> bool:
        return self in GOING


GOING = frozenset((JobState.QUEUED, JobState.RUNNING, JobState.CANCELLING))


class SessionJob(BaseModel):
    """How a job stands of which a session has one at a time. done, total: of the step. seconds_left: null while it is
    not known to a factor of two. message, hint and code say why it failed.
    """

    # Every answer holds all of it, and the API's description says so.
    model_config = ConfigDict(from_attributes=True, json_schema_serialization_defaults_required=True)

    state: JobState = JobState.QUEUED
    session: str = ""
    step: str = ""
    done: int = 0
    total: int = 0
    seconds_left: float | None = None
    message: str = ""
    hint: str = ""
    code: str = ""

    @property
    def key(self) -> str:
        """The name that it is requested by."""
        return self.session


class NumberedJob(SessionJob):
    """A job of which there may be several, distinguished by their identifiers."""

    identifier: str = Field(default_factory=lambda: secrets.token_hex(8))

    @property
    def key(self) -> str:
        """The name that it is requested by."""
        return self.identifier


State = TypeVar("State", bound=SessionJob)
SomeState = TypeVar("SomeState", bound=SessionJob, covariant=True)
Work = Callable[["Job"], Mapping[str, object]]
"""work(job) does it, in a thread; what it returns goes into the state, which is "done" unless that says otherwise."""
Publish = Callable[[dict[str, object]], None]


@dataclass(frozen=True, slots=True)
class JobKind(Generic[SomeState]):
    """One kind of work. event : type of its events. noun : what it is called, without article.

    states : the class of its states. changes_session : once it is done, all pages hear that the session has changed.
    busy : why no other of the kind can begin, with fields of the state in braces; "" where several may be under way.
    keeps_session : meanwhile its session stays where it is, under its name. makes_session : it may not be there before.
    at : the address of its state, page : the page that shows what came of it, both with fields of the state in braces.
    """

    event: str
    noun: str
    states: type[SomeState]
    changes_session: bool = False
    busy: str = ""
    keeps_session: bool = False
    makes_session: bool = False
    at: str = ""
    page: str = ""

    def address(self, state: SessionJob) -> str:
        """Where a state of this kind is asked for, "" where its page has it."""
        return _fill(self.at, state)

    def page_of(self, state: SessionJob) -> str:
        """The page that shows what came of it."""
        return _fill(self.page, state)

    def entries(self, record: object, **own: object) -> dict[str, object]:
        """The entries of the state that a record has. own : those that differ, or that it lacks."""
        names = self.states.model_fields.keys() - SessionJob.model_fields.keys() - own.keys()
        return {name: getattr(record, name) for name in names if hasattr(record, name)} | own


During = Callable[[JobKind[Any], SessionJob], AbstractContextManager[None]]
"""during(kind, state) is entered while a job runs."""


class Job:
    """One job, as its work sees it. state : how it stands. found : what it found, for others to use. closing : it is
    cancelled because the server ends. began : seconds since 1970.
    """

    def __init__(self, kind: JobKind[State], state: State, publish: Publish) -> None:
        self.state: SessionJob = state
        self.result: object = None
        self.closing = False
        self.began = time.time()
        self.kind, self._publish = kind, publish
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._left, self._step, self._reported = TimeLeft(), "", 0.0

    def cancel(self, *, closing: bool = False) -> None:
        """Let it end where it stands."""
        self.closing = closing
        self._stop.set()
        self._enter(JobState.CANCELLING, JobState.QUEUED, JobState.RUNNING)

    def cancelled(self) -> bool:
        """Whether it is to end."""
        return self._stop.is_set()

    @property
    def message(self) -> dict[str, object]:
        """How it stands, as an event: by `at` whoever follows it knows it, and asks for the same."""
        state, kind = self.state, self.kind
        head = {"type": kind.event, "run": "", "key": state.key, "at": kind.address(state)}
        return {**head, **state.model_dump(mode="json", by_alias=True)}

    def change(self, **changes: object) -> None:
        """Replace entries of the state and report to all pages; from any thread."""
        with self._lock:
            # Validated, so that numbers that are none become null.
            self.state = self.kind.states.model_validate({**dict(self.state), **changes})
            self._publish(self.message)

    def report(self, step: str, done: int, total: int, **more: object) -> None:
        """Tell how far the work is: at once for a new step and for its end, else as often as is read.

        more : other entries of the state.
        """
        now, left = time.monotonic(), self._left.after(step, done, total)
        if step == self._step and now - self._reported < SECONDS_BETWEEN and done < total:
            return
        self._step, self._reported = step, now
        self.change(**{"step": step, "done": done, "total": total, "seconds_left": left, **more})

    def check(self) -> None:
        """Raises WorkCancelledError once it shall end."""
        if self.cancelled():
            raise WorkCancelledError(f"The {self.kind.noun} was cancelled.", "Start it again when you like.")

    def report_or_stop(self, step: str, done: int, total: int, **more: object) -> None:
        """`report` and `check`, for work that cannot be ended in another way."""
        self.check()
        self.report(step, done, total, **more)

    def do(self, work: Work, log_path: Path | None) -> None:
        """Work in this thread, and report what becomes of it; never raises."""
        kind, state = self.kind, self.state
        try:
            self.check()
            self._enter(JobState.RUNNING, JobState.QUEUED)
            self.change(**{"state": JobState.DONE, "seconds_left": 0.0, **work(self)})
        except StudioError as error:
            unwanted = self.cancelled() or isinstance(error, WorkCancelledError)
            self._end(error, JobState.CANCELLED if unwanted else JobState.FAILED)
        except Exception as error:
            log.exception("%s '%s' of '%s' failed", kind.noun, state.key, state.session)
            message = f"The {kind.noun} failed: {type(error).__name__}."
            self._end(UnforeseenError(message, f"See '{log_path}'."), JobState.FAILED)
        if kind.changes_session and self.state.state is JobState.DONE:
            self._publish({"type": "sessions", "session": self.state.session, "run": ""})

    def _enter(self, state: JobState, *before: JobState) -> None:
        """Go from one of these states into another, if it is in one of them."""
        with self._lock:
            if self.state.state in before:
                self.change(state=state)

    def _end(self, error: StudioError, state: JobState) -> None:
        self.change(state=state, seconds_left=None, code=error.code, message=error.message, hint=error.hint)


class JobRunner:
    """All jobs of a server; may be used from any thread. publish : sends an event to all who watch. log_path : where
    faults are written. during : what tells other processes.
    """

    def __init__(
        self,
        publish: Publish,
        log_path: Path | None = None,
        during: During = lambda kind, state: nullcontext(),
    ) -> None:
        self._publish, self._log_path, self._during = publish, log_path, during
        self._lock = threading.RLock()
        self._jobs: dict[str, dict[str, Job]] = {}
        self._moving: list[str] = []
        self._threads = ThreadPoolExecutor(MOST_AT_ONCE, thread_name_prefix="job")

    def begin(self, kind: JobKind[State], state: State, work: Work) -> State:
        """Queue work. The oldest that are over are forgotten. Raises RunError while one of a kind is under way of which
        there is one at a time.
        """
        with self._lock:
            if state.session in self._moving:
                raise RunError(
                    f"Session '{state.session}' is being renamed or deleted.", "Begin it again in a moment."
                )
            self.check_free(kind)
            jobs = self._jobs.setdefault(kind.event, {})
            jobs.pop(state.key, None)
            jobs[state.key] = job = Job(kind, state, self._publish)
            over = [key for key, known in jobs.items() if not known.state.state.is_going]
            for key in over[: max(0, len(jobs) - KEPT)]:
                del jobs[key]
            self._publish(job.message)
            self._threads.submit(job.do, self._known_to_others(work), self._log_path)
        return state

    def _known_to_others(self, work: Work) -> Work:
        def known(job: Job) -> Mapping[str, object]:
            with self._during(job.kind, job.state):
                return work(job)

        return known

    def check_free(self, kind: JobKind[State]) -> None:
        """Raise RunError where another of the kind cannot begin."""
        going = self.going(kind)
        if kind.busy and going:
            raise _busy(kind, going[0])

    @contextmanager
    def moving(self, session: str, run: str = "") -> Generator[None]:
        """Inside, no job of a session (or a run of it) begins. Raises RunError while one is under way."""
        with self._lock:
            for kind, state in self._going_on(session):
                if not run or getattr(state, "run", run) in ("", run):
                    verb = getattr(state, "verb", "")
                    name = getattr(state, "run", "")
                    of = f" of run '{name}'" if name else ""
                    what = f"'{verb}'{of}" if verb else f"its {kind.noun}"
                    raise RunError(
                        f"Session '{session}' stays as it is while {what} is under way.",
                        "Wait for it, or cancel it.",
                    )
            self._moving.append(session)
        try:
            yield
        finally:
            with self._lock:
                self._moving.remove(session)

    def _going_on(self, session: str) -> Iterator[tuple[JobKind[SessionJob], SessionJob]]:
        """What is under way of a session."""
        for job in [job for jobs in list(self._jobs.values()) for job in list(jobs.values())]:
            if job.state.session == session and job.state.state.is_going:
                yield job.kind, job.state

    def check_movable(self, session: str) -> None:
        """Raise RunError while a job is under way that keeps a session where it is."""
        for kind, state in self._going_on(session):
            if kind.keeps_session:
                raise _busy(kind, state)

    def known(self, kind: JobKind[State], key: str) -> State | None:
        """How a job stands, None where there is none."""
        job = self._jobs.get(kind.event, {}).get(key)
        return None if job is None else cast("State", job.state)

    def state(self, kind: JobKind[State], key: str) -> State:
        """How a job stands. Raises NotFoundError."""
        return cast("State", self._job(kind, key).state)

    def jobs(self, session: str | None = None, event: str = "") -> list[Job]:
        """All that are known, those that are over too, of a session and kind or of all; the oldest first."""
        known = [
            job
            for name, jobs in list(self._jobs.items())
            if event in ("", name)
            for job in list(jobs.values())
            if session in (None, job.state.session)
        ]
        return sorted(known, key=lambda job: job.began)

    def messages(self) -> list[dict[str, object]]:
        """How each that is not over stands, for whoever begins to watch."""
        return [job.message for job in self.jobs() if job.state.state.is_going]

    def stop(self, event: str, key: str) -> Job:
        """Let a job of a kind end where it stands. Raises NotFoundError."""
        job = self._jobs.get(event, {}).get(key)
        if job is None:
            raise NotFoundError(f"There is no job '{key[:80]}'.", "It is over and forgotten.")
        job.cancel()
        return job

    def forget(self, kind: JobKind[State], session: str) -> None:
        """Forget what is over of a session, because its answer no longer holds."""
        with self._lock:
            jobs = self._jobs.get(kind.event, {})
            over = [
                key
                for key, job in jobs.items()
                if job.state.session == session and not job.state.state.is_going
            ]
            for key in over:
                del jobs[key]

    def last(self, kind: JobKind[State]) -> State | None:
        """How the newest of a kind stands, None before the first."""
        jobs = list(self._jobs.get(kind.event, {}).values())
        return cast("State", jobs[-1].state) if jobs else None

    def result(self, kind: JobKind[State], key: str) -> object:
        """What a job found, None where it found nothing (yet). Raises NotFoundError."""
        return self._job(kind, key).result

    def going(self, kind: JobKind[State], session: str | None = None) -> list[State]:
        """Those that are not over, of a session or of all, the oldest first."""
        states = [cast("State", job.state) for job in list(self._jobs.get(kind.event, {}).values())]
        return [state for state in states if state.state.is_going and session in (None, state.session)]

    def cancel(self, kind: JobKind[State], key: str) -> None:
        """Let a job end where it stands, if there is one."""
        job = self._jobs.get(kind.event, {}).get(key)
        if job is not None:
            job.cancel()

    def change(self, kind: JobKind[State], key: str, **changes: object) -> State:
        """Replace entries of a job's state and report to all pages. Raises NotFoundError."""
        job = self._job(kind, key)
        job.change(**changes)
        return cast("State", job.state)

    def close(self) -> None:
        """Cancel all of them and wait for their ends."""
        with self._lock:
            for job in [job for jobs in self._jobs.values() for job in jobs.values()]:
                job.cancel(closing=True)
        self._threads.shutdown()

    def _job(self, kind: JobKind[State], key: str) -> Job:
        job = self._jobs.get(kind.event, {}).get(key)
        if job is None:
            raise NotFoundError(f"There is no {kind.noun} '{key[:40]}'.", "Begin a new one.")
        return job


def entries_of(state: SessionJob) -> dict[str, object]:
    """A state's entries; `run` is the one that a job made, where it made one."""
    entries = dict(state)
    return {**entries, "run": entries.get("made_run") or entries.get("run")}


def _fill(address: str, state: SessionJob) -> str:
    fields = entries_of(state)
    names = {name for _, name, _, _ in Formatter().parse(address) if name}
    return address.format(**{name: quote(str(fields.get(name) or ""), safe="") for name in names})


def _busy(kind: JobKind[State], state: State) -> RunError:
    return RunError(kind.busy.format(**dict(state)), "Wait for it, or cancel it.")


def keep_in_place(
    workspace: Workspace, kind: JobKind[Any], state: SessionJob
) -> AbstractContextManager[None]:
    """Entered while a job runs: other processes do not move its session, unless that is only being made."""
    session = workspace.root / state.session
    if not state.session or (kind.makes_session and not (session / MANIFEST_NAME).is_file()):
        return nullcontext()
    verb = str(getattr(state, "verb", "") or kind.noun)
    return working_on(session.resolve(), verb, str(getattr(state, "run", "") or ""))
