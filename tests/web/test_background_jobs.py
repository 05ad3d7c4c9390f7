"""Work in the background: what becomes of it, how far it is, and which of it is remembered."""

import asyncio
import logging
import math
import threading
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace

import pytest

from studio.errors import FootageError, NotFoundError, WorkCancelledError
from studio.web import background_jobs
from studio.web.background_jobs import KEPT, BackgroundJobs, Job, JobKind, Work
from studio.web.job_schemas import NumberedJob, SessionJob
from studio.web.schemas import Number

PATIENCE = 20.0


class WeighingState(NumberedJob):
    """A job that finds a number."""

    weight: Number = None


WEIGHING = JobKind("weighing", "weighing", WeighingState, changes_session=True)
SHOPPING = JobKind("shopping", "shopping", SessionJob)


class Office:
    """Jobs, and every message that they sent."""

    def __init__(self) -> None:
        self.said: list[dict[str, object]] = []
        self.jobs = BackgroundJobs(self.said.append, Path("server.log"))

    def ended(self, work: Work) -> WeighingState:
        """How a job ends that does this."""

        async def run() -> str:
            begun = self.jobs.begin(WEIGHING, WeighingState(session="take1"), work)
            assert begun.state == "running"
            while self.jobs.state(WEIGHING, begun.identifier).state == "running":
                await asyncio.sleep(0.001)
            await self.jobs.end()
            return begun.identifier

        key = asyncio.run(asyncio.wait_for(run(), PATIENCE))
        return self.jobs.state(WEIGHING, key)


@pytest.fixture
def office() -> Office:
    return Office()


def test_what_work_returns_goes_into_its_state(office: Office) -> None:
    def work(job: Job) -> Mapping[str, object]:
        job.found = "the scales"
        job.report("reading", 1, 4)
        return {"weight": 71.5}

    told = office.ended(work)
    assert (told.state, told.weight, told.seconds_left) == ("done", 71.5, 0.0)
    assert office.jobs.found(WEIGHING, told.identifier) == "the scales"
    steps = [(message["type"], message["run"], message.get("step")) for message in office.said]
    assert steps == [("weighing", "", "reading"), ("weighing", "", "reading"), ("sessions", "", None)]
    assert [message["session"] for message in office.said] == ["take1"] * 3


def test_numbers_that_are_none_become_null(office: Office) -> None:
    assert office.ended(lambda _job: {"weight": math.nan}).weight is None


def test_a_refusal_is_told_in_its_own_words(office: Office) -> None:
    def work(_job: Job) -> Mapping[str, object]:
        raise FootageError("The clip ends.", "Give another.")

    told = office.ended(work)
    assert (told.state, told.code, told.message, told.hint) == (
        "failed",
        "footage",
        "The clip ends.",
        "Give another.",
    )
    assert not [message for message in office.said if message["type"] == "sessions"]


@pytest.mark.parametrize("answer", [None, {"weight": "much"}])
def test_a_fault_is_logged_and_told_without_its_traceback(
    office: Office, caplog: pytest.LogCaptureFixture, answer: dict[str, object] | None
) -> None:
    """Also one that shows only when the answer is put into the state."""

    def work(_job: Job) -> Mapping[str, object]:
        if answer is None:
            raise ZeroDivisionError("deep inside")
        return answer

    with caplog.at_level(logging.ERROR, "studio.web"):
        told = office.ended(work)
    kind = "ZeroDivisionError" if answer is None else "ValidationError"
    assert (told.state, told.code) == ("failed", "unforeseen")
    assert told.message == f"The weighing failed: {kind}."
    assert told.hint == "See 'server.log'."
    (entry,) = caplog.records
    assert entry.exc_info is not None
    assert entry.exc_info[0] is not None
    assert entry.exc_info[0].__name__ == kind
    assert told.identifier in entry.getMessage()


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
    [
        (stopped_by_its_report, "The weighing was cancelled."),
        (stopped_by_asking, "Nobody waits any more."),
    ],
)
def test_a_job_can_be_cancelled(office: Office, work: Work, message: str) -> None:
    async def run() -> WeighingState:
        begun = office.jobs.begin(WEIGHING, WeighingState(session="take1"), work)
        office.jobs.cancel(WEIGHING, begun.identifier)
        while (told := office.jobs.state(WEIGHING, begun.identifier)).state == "running":
            await asyncio.sleep(0.001)
        return told

    told = asyncio.run(asyncio.wait_for(run(), PATIENCE))
    assert (told.state, told.message) == ("cancelled", message)
    assert not [said for said in office.said if said["type"] == "sessions"]


def test_work_that_stopped_of_itself_keeps_what_it_reached(office: Office) -> None:
    told = office.ended(lambda _job: {"weight": 3.0, "state": "cancelled"})
    assert (told.state, told.weight) == ("cancelled", 3.0)


def test_the_oldest_are_forgotten_but_none_that_goes_on(office: Office) -> None:
    go = threading.Event()

    def waits(_job: Job) -> Mapping[str, object]:
        assert go.wait(PATIENCE)
        return {}

    async def run() -> None:
        jobs = office.jobs
        first = jobs.begin(WEIGHING, WeighingState(session="long"), waits)
        others = []
        for _ in range(KEPT + 5):
            begun = jobs.begin(WEIGHING, WeighingState(session="short"), lambda _job: {})
            while jobs.state(WEIGHING, begun.identifier).state == "running":
                await asyncio.sleep(0.001)
            others.append(begun)
        assert [state.identifier for state in jobs.running(WEIGHING, "long")] == [first.identifier]
        assert jobs.running(WEIGHING, "short") == []
        known = [jobs.known(WEIGHING, state.identifier) is not None for state in others]
        assert known == [False] * 6 + [True] * (KEPT - 1)
        go.set()
        await jobs.end()

    asyncio.run(asyncio.wait_for(run(), PATIENCE))


def test_one_nobody_knows_is_refused_by_name(office: Office) -> None:
    assert office.jobs.known(WEIGHING, "none") is None
    office.jobs.cancel(WEIGHING, "none")
    for ask in (office.jobs.state, office.jobs.change, office.jobs.found):
        with pytest.raises(NotFoundError, match="no weighing 'none'"):
            ask(WEIGHING, "none")


def test_kinds_do_not_meet_and_a_session_has_one_of_its_own(office: Office) -> None:
    async def run() -> None:
        jobs = office.jobs
        jobs.begin(SHOPPING, SessionJob(session="take1", step="first"), lambda _job: {})
        jobs.begin(SHOPPING, SessionJob(session="take1", step="second"), lambda _job: {})
        await jobs.end()
        assert jobs.state(SHOPPING, "take1").step == "second"
        assert jobs.known(WEIGHING, "take1") is None

    asyncio.run(asyncio.wait_for(run(), PATIENCE))


def test_ending_stops_all_and_waits_for_them(office: Office) -> None:
    async def run() -> list[str]:
        begun = [
            office.jobs.begin(WEIGHING, WeighingState(session="take1"), stopped_by_asking) for _ in range(2)
        ]
        await office.jobs.end()
        return [office.jobs.state(WEIGHING, state.identifier).state for state in begun]

    assert asyncio.run(asyncio.wait_for(run(), PATIENCE)) == ["cancelled", "cancelled"]


class Clock:
    """Seconds that pass when told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(background_jobs, "time", SimpleNamespace(monotonic=made.monotonic))
    return made


def test_progress_is_told_as_often_as_it_is_read(office: Office, clock: Clock) -> None:
    """Each step's beginning, its end, and between them what is a fifth of a second apart."""
    job = Job(WEIGHING, WeighingState(session="take1"), office.said.append)
    for step, done, seconds in [
        ("reading", 0, 0.05), ("reading", 1, 0.05), ("reading", 2, 0.2), ("reading", 3, 0.05),
        ("reading", 4, 0.01), ("weighing", 0, 0.01), ("weighing", 1, 0.01),
    ]:  # fmt: skip
        clock.now += seconds
        job.report(step, done, 4)
    told = [(message["step"], message["done"]) for message in office.said]
    assert told == [("reading", 0), ("reading", 2), ("reading", 4), ("weighing", 0)]


def test_the_rest_of_a_step_is_estimated_from_what_of_it_is_done(office: Office, clock: Clock) -> None:
    """Also of one that goes on where the step before it ended."""
    job = Job(WEIGHING, WeighingState(session="take1"), office.said.append)
    for step, done, total in [
        ("reading", 0, 10),
        ("reading", 2, 10),
        ("weighing", 6, 10),
        ("weighing", 8, 10),
    ]:
        clock.now += 3.0
        job.report(step, done, total)
    assert [message["seconds_left"] for message in office.said] == [None, 12.0, None, 3.0]
    job.report("writing", 1, 2, seconds_left=7.0, weight=1.0)
    assert (office.said[-1]["seconds_left"], office.said[-1]["weight"]) == (7.0, 1.0)


def test_a_report_stops_only_who_was_cancelled(office: Office) -> None:
    job = Job(WEIGHING, WeighingState(session="take1"), office.said.append)
    job.report_or_stop("reading", 0, 2)
    job.cancel()
    with pytest.raises(WorkCancelledError):
        job.report_or_stop("reading", 1, 2)
    assert [message["done"] for message in office.said] == [0]
