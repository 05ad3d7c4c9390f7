"""Work in the background: its one life, how far it is, and which of it is remembered."""

import logging
import math
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace

import pytest
from waiting import PATIENCE

from studio.app.server.schemas import Number
from studio.foundations.errors import FootageError, NotFoundError, RunError, WorkCancelledError
from studio.foundations.progress import TimeLeft
from studio.operations.jobs import job_runner
from studio.operations.jobs.job_runner import (
    KEPT,
    MOST_AT_ONCE,
    Job,
    JobKind,
    JobRunner,
    JobState,
    NumberedJob,
    SessionJob,
    Work,
)

QUEUED, RUNNING, CANCELLING, DONE, FAILED, CANCELLED = JobState


class WeighingState(NumberedJob):
    """A job that finds a number."""

    weight: Number = None


WEIGHING = JobKind(
    "weighing", "weighing", WeighingState, changes_session=True, at="/weighings/{identifier}?of={session}"
)
SHOPPING = JobKind("shopping", "shopping", SessionJob)


BAKING = JobKind("baking", "baking", SessionJob, busy="The oven is used by '{session}'.")


class Office:
    """Jobs, and every message that they sent."""

    def __init__(self) -> None:
        self.said: list[dict[str, object]] = []
        self._changed = threading.Condition()
        self.jobs = JobRunner(self._hear, Path("server.log"))

    def _hear(self, message: dict[str, object]) -> None:
        with self._changed:
            self.said.append(message)
            self._changed.notify_all()

    def until(self, key: str, *states: JobState) -> None:
        """Wait for a job to be told of in one of these states."""
        with self._changed:
            assert self._changed.wait_for(
                lambda: any(key in said.values() and said.get("state") in states for said in self.said),
                PATIENCE,
            ), self.said

    def begin(self, work: Work, session: str = "take1") -> WeighingState:
        return self.jobs.begin(WEIGHING, WeighingState(session=session), work)

    def ended(self, work: Work) -> WeighingState:
        """How a job ends that does this."""
        begun = self.begin(work)
        assert begun.state is QUEUED
        self.until(begun.identifier, DONE, FAILED, CANCELLED)
        self.jobs.close()
        return self.jobs.state(WEIGHING, begun.identifier)

    def states(self, key: str) -> list[object]:
        """The life of a job as it was told."""
        reported = [said["state"] for said in self.said if key in said.values() and "state" in said]
        return [state for at, state in enumerate(reported) if not at or reported[at - 1] != state]


@pytest.fixture
def office() -> Iterator[Office]:
    made = Office()
    yield made
    made.jobs.close()


def test_what_work_returns_goes_into_its_state(office: Office) -> None:
    def work(job: Job) -> Mapping[str, object]:
        job.result = "the scales"
        job.report("reading", 1, 4)
        return {"weight": 71.5}

    reported = office.ended(work)
    assert (reported.state, reported.weight, reported.seconds_left) == ("done", 71.5, 0.0)
    assert office.jobs.result(WEIGHING, reported.identifier) == "the scales"
    steps = [
        (message["type"], message["run"], message.get("state"), message.get("step"))
        for message in office.said
    ]
    assert steps == [
        ("weighing", "", "queued", ""), ("weighing", "", "running", ""), ("weighing", "", "running", "reading"),
        ("weighing", "", "done", "reading"),
        ("sessions", "", None, None),
    ]  # fmt: skip
    assert [message["session"] for message in office.said] == ["take1"] * 5


def test_who_begins_to_watch_is_told_of_what_is_not_over(office: Office) -> None:
    go = threading.Event()

    def waits(job: Job) -> Mapping[str, object]:
        job.report("reading", 1, 4)
        assert go.wait(PATIENCE)
        return {}

    begun = office.begin(waits)
    office.until("reading", RUNNING)
    [message] = office.jobs.messages()
    assert message == office.said[-1]
    at = f"/weighings/{begun.identifier}?of=take1"
    assert (message["key"], message["at"], message["step"]) == (begun.identifier, at, "reading")
    go.set()
    office.until(begun.identifier, DONE)
    assert office.jobs.messages() == []


@pytest.mark.parametrize("kind", [WEIGHING, SHOPPING, BAKING])
def test_nothing_is_renamed_under_a_job_and_no_job_begins_meanwhile(
    office: Office, kind: JobKind[SessionJob]
) -> None:
    begun, go = threading.Event(), threading.Event()

    def work(_job: Job) -> Mapping[str, object]:
        begun.set()
        go.wait(PATIENCE)
        return {}

    office.jobs.begin(kind, kind.states(session="take1"), work)
    assert begun.wait(PATIENCE)
    with pytest.raises(RunError, match=f"while its {kind.noun} is under way"), office.jobs.moving("take1"):
        pass
    with office.jobs.moving("take2"):
        pass
    go.set()
    while office.jobs.going(kind):
        time.sleep(0.01)
    with office.jobs.moving("take1"), pytest.raises(RunError, match="is being renamed or deleted"):
        office.jobs.begin(kind, kind.states(session="take1"), work)
    office.jobs.begin(kind, kind.states(session="take1"), work)


def test_numbers_that_are_none_become_null(office: Office) -> None:
    assert office.ended(lambda _job: {"weight": math.nan}).weight is None


def test_a_refusal_is_reported_in_its_own_words(office: Office) -> None:
    def work(_job: Job) -> Mapping[str, object]:
        raise FootageError("The clip ends.", "Give another.")

    reported = office.ended(work)
    assert (reported.state, reported.code, reported.message, reported.hint) == (
        "failed",
        "footage",
        "The clip ends.",
        "Give another.",
    )
    assert not [message for message in office.said if message["type"] == "sessions"]


@pytest.mark.parametrize("answer", [None, {"weight": "much"}])
def test_a_fault_is_logged_and_reported_without_its_traceback(
    office: Office, caplog: pytest.LogCaptureFixture, answer: dict[str, object] | None
) -> None:
    """Also one that shows only when the answer is put into the state."""

    def work(_job: Job) -> Mapping[str, object]:
        if answer is None:
            raise ZeroDivisionError("deep inside")
        return answer

    with caplog.at_level(logging.ERROR, "studio.operations.jobs"):
        reported = office.ended(work)
    kind = "ZeroDivisionError" if answer is None else "ValidationError"
    assert (reported.state, reported.code) == ("failed", "unforeseen")
    assert reported.message == f"The weighing failed: {kind}."
    assert reported.hint == "See 'server.log'."
    (entry,) = caplog.records
    assert entry.exc_info[0] is not None
    assert entry.exc_info[0].__name__ == kind
    assert reported.identifier in entry.getMessage()


def stopped_by_its_report(job: Job) -> Mapping[str, object]:
    for done in range(10_000_000):
        job.report_or_stop("waiting", done, 10_000_000)
    return {}


def stopped_by_asking(job: Job) -> Mapping[str, object]:
    """As functions do that know of nothing but `cancelled`, and raise an error of their own."""
    while not job.cancelled():
        threading.Event().wait(0.001)
    raise FootageError("Nobody waits any more.", "Begin anew.")


@pytest.mark.parametrize(
    ("work", "message"),
    [(stopped_by_its_report, "The weighing was cancelled."), (stopped_by_asking, "Nobody waits any more.")],
)
def test_a_job_can_be_cancelled(office: Office, work: Work, message: str) -> None:
    begun = office.begin(work)
    office.until(begun.identifier, RUNNING)
    office.jobs.cancel(WEIGHING, begun.identifier)
    office.until(begun.identifier, CANCELLED)
    reported = office.jobs.state(WEIGHING, begun.identifier)
    assert (reported.state, reported.message) == (CANCELLED, message)
    assert office.states(begun.identifier) == ["queued", "running", "cancelling", "cancelled"]
    office.jobs.cancel(WEIGHING, begun.identifier)
    assert office.jobs.state(WEIGHING, begun.identifier).state is CANCELLED, "what is over stays over"
    assert not [said for said in office.said if said["type"] == "sessions"]


def test_one_that_waits_is_queued_and_cancelled_without_being_begun(office: Office) -> None:
    go = threading.Event()
    running = [office.begin(lambda _job: {"weight": float(go.wait(PATIENCE))}) for _ in range(MOST_AT_ONCE)]
    for each in running:
        office.until(each.identifier, RUNNING)
    waiting, unwanted = office.begin(lambda _job: {"weight": 2.0}), office.begin(lambda _job: {"weight": 3.0})
    assert office.jobs.state(WEIGHING, waiting.identifier).state is QUEUED
    office.jobs.cancel(WEIGHING, unwanted.identifier)
    go.set()
    office.until(unwanted.identifier, CANCELLED)
    office.until(waiting.identifier, DONE)
    assert office.states(waiting.identifier) == ["queued", "running", "done"]
    assert office.states(unwanted.identifier) == ["queued", "cancelling", "cancelled"]


def test_of_some_kinds_there_is_one_at_a_time(office: Office) -> None:
    go = threading.Event()

    def waits(_job: Job) -> Mapping[str, object]:
        assert go.wait(PATIENCE)
        return {}

    office.jobs.begin(BAKING, SessionJob(session="bread"), waits)
    for _ in range(2):
        with pytest.raises(RunError, match="The oven is used by 'bread'"):
            office.jobs.begin(BAKING, SessionJob(session="cake"), waits)
    go.set()
    office.until("bread", DONE)
    office.jobs.begin(BAKING, SessionJob(session="cake"), waits)
    office.until("cake", DONE)


def test_many_that_begin_at_once_are_one(office: Office) -> None:
    go, begun, refused = threading.Event(), [], []

    def begin(name: str) -> None:
        try:
            begun.append(
                office.jobs.begin(BAKING, SessionJob(session=name), lambda _job: {"done": go.wait(PATIENCE)})
            )
        except RunError as problem:
            refused.append(problem)

    threads = [threading.Thread(target=begin, args=(str(number),)) for number in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    go.set()
    assert (len(begun), len(refused)) == (1, 19)


def test_work_that_stopped_of_itself_keeps_what_it_reached(office: Office) -> None:
    reported = office.ended(lambda _job: {"weight": 3.0, "state": "cancelled"})
    assert (reported.state, reported.weight) == ("cancelled", 3.0)


def test_the_oldest_are_forgotten_but_none_that_goes_on(office: Office) -> None:
    go = threading.Event()
    first = office.begin(lambda _job: {"weight": float(go.wait(PATIENCE))}, "long")
    others = []
    for _ in range(KEPT + 5):
        begun = office.begin(lambda _job: {}, "short")
        office.until(begun.identifier, DONE)
        others.append(begun)
    assert [state.identifier for state in office.jobs.going(WEIGHING, "long")] == [first.identifier]
    assert office.jobs.going(WEIGHING, "short") == []
    known = [office.jobs.known(WEIGHING, state.identifier) is not None for state in others]
    assert known == [False] * 6 + [True] * (KEPT - 1)
    go.set()


def test_one_nobody_knows_is_refused_by_name(office: Office) -> None:
    assert office.jobs.known(WEIGHING, "none") is None
    office.jobs.cancel(WEIGHING, "none")
    for ask in (office.jobs.state, office.jobs.change, office.jobs.result):
        with pytest.raises(NotFoundError, match="no weighing 'none'"):
            ask(WEIGHING, "none")


def test_kinds_do_not_meet_and_a_session_has_one_of_its_own(office: Office) -> None:
    assert office.jobs.last(SHOPPING) is None
    office.jobs.begin(SHOPPING, SessionJob(session="take1", step="first"), lambda _job: {})
    office.jobs.begin(SHOPPING, SessionJob(session="take1", step="second"), lambda _job: {})
    office.until("second", DONE)
    assert office.jobs.state(SHOPPING, "take1").step == "second"
    last = office.jobs.last(SHOPPING)
    assert last.step == "second"
    assert office.jobs.known(WEIGHING, "take1") is None


def test_closing_cancels_all_and_waits_for_them(office: Office) -> None:
    closing = []

    def work(job: Job) -> Mapping[str, object]:
        try:
            return stopped_by_asking(job)
        finally:
            closing.append(job.closing)

    begun = [office.begin(work) for _ in range(2)]
    for each in begun:
        office.until(each.identifier, RUNNING)
    office.jobs.close()
    assert [office.jobs.state(WEIGHING, state.identifier).state for state in begun] == [CANCELLED, CANCELLED]
    assert closing == [True, True]


class Clock:
    """Seconds that pass when told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(job_runner, "time", SimpleNamespace(monotonic=made.monotonic, time=made.monotonic))
    return made


def test_progress_is_reported_as_often_as_it_is_read(office: Office, clock: Clock) -> None:
    """Each step's beginning, its end, and between them what is a fifth of a second apart."""
    job = Job(WEIGHING, WeighingState(session="take1"), office.said.append)
    for step, done, seconds in [
        ("reading", 0, 0.05), ("reading", 1, 0.05), ("reading", 2, 0.2), ("reading", 3, 0.05),
        ("reading", 4, 0.01), ("weighing", 0, 0.01), ("weighing", 1, 0.01),
    ]:  # fmt: skip
        clock.now += seconds
        job.report(step, done, 4)
    reported = [(message["step"], message["done"]) for message in office.said]
    assert reported == [("reading", 0), ("reading", 2), ("reading", 4), ("weighing", 0)]


def test_the_time_left_is_reported_once_it_is_known(
    office: Office, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job_runner, "TimeLeft", lambda: TimeLeft(clock.monotonic))
    job = Job(WEIGHING, WeighingState(session="take1"), office.said.append)
    for done in range(0, 8):
        clock.now += 3.0
        job.report("reading", done, 10)
    left = [message["seconds_left"] for message in office.said]
    assert left == [None] * 5 + [pytest.approx(3.0 * (10 - done)) for done in (5, 6, 7)]
    job.report("writing", 1, 2, seconds_left=7.0, weight=1.0)
    assert (office.said[-1]["seconds_left"], office.said[-1]["weight"]) == (7.0, 1.0)


def test_a_report_stops_only_who_was_cancelled(office: Office) -> None:
    job = Job(WEIGHING, WeighingState(session="take1"), office.said.append)
    job.report_or_stop("reading", 0, 2)
    job.cancel()
    with pytest.raises(WorkCancelledError):
        job.report_or_stop("reading", 1, 2)
    assert [(message["state"], message["done"]) for message in office.said] == [
        ("queued", 0),
        ("cancelling", 0),
    ]
