"""A comparison worked at until all of its trials are done: outcomes are kept one by one, those that are there are not
measured again.
"""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

from studio.foundations.errors import RunError
from studio.foundations.progress import Progress
from studio.operations.jobs.swept_runs import measure_run
from studio.operations.jobs.trials import TrialResult, run_jobs
from studio.results.comparison.kept_comparison import KeptComparison, trial_key
from studio.results.comparison.kept_trials import KeptOutcome, measured_by, plain
from studio.results.comparison.plan import Comparison, Plan, trials
from studio.results.comparison.sweep import Sweep, run_name, sweep_trials
from studio.results.comparison.tracked import measure_tracking
from studio.results.comparison.trials import Outcome, Trial, TrialJob
from studio.sessions.manifest import now
from studio.sessions.object_stores import above
from studio.sessions.session import Session

Found = TypeVar("Found", bound=Comparison | Sweep)


@dataclass(frozen=True, slots=True)
class _Work:
    """A comparison's trials under their keys, in order."""

    plan: Plan
    trials: dict[str, Trial]

    @staticmethod
    def of(plan: Plan) -> "_Work":
        made = sweep_trials(plan) if plan.vary else trials(plan)
        return _Work(plan, {trial_key(trial): trial for trial in made})


def run_comparison(
    kept: KeptComparison,
    session: Session,
    report: Progress,
    conclusion: Callable[[Plan, Sequence[Outcome]], Found],
    *,
    processes: int | None = None,
    executor: Executor | None = None,
    checkpoint: Callable[[], None] = lambda: None,
) -> Found:
    """Do what is still to be done of a comparison, and write what `conclusion` makes of it.

    conclusion : `conclude`, of a sweep `conclude_sweep`. processes, executor, checkpoint : see `trials.run_jobs`. What
    ends it leaves the finished trials, and of runs the finished frames. Raises RunError where another process works at
    it or a trial fails.
    """
    with _held(kept):
        plan, outcomes = _measured(kept, session, report, processes, executor, checkpoint)
        found = conclusion(plan, outcomes)
        kept.finish(found)
    return found


def done_before(kept: KeptComparison, plan: Plan) -> int:
    """How many of a comparison's trials are there."""
    return len(_outcomes(kept, _Work.of(plan)))


@contextmanager
def _held(kept: KeptComparison) -> Generator[None]:
    """While it is worked at. Raises RunError where another process does."""
    lock = kept.lock()
    if lock is None:
        raise RunError(
            f"Another process works at comparison '{kept.name}'.", "Wait for it, or start a new one."
        )
    try:
        kept.end("")
        yield
    finally:
        lock.free()


def _measured(
    kept: KeptComparison,
    session: Session,
    report: Progress,
    processes: int | None,
    executor: Executor | None,
    checkpoint: Callable[[], None],
) -> tuple[Plan, list[Outcome]]:
    """The outcomes of all trials, in their order; those that are not there yet are measured."""
    work = _Work.of(kept.plan(session))
    found = _outcomes(kept, work)
    jobs = [_job(kept, work, key) for key in work.trials if key not in found]
    report("", len(found), len(work.trials))

    def on_result(job: TrialJob, result: TrialResult) -> None:
        if result.measured is None:
            raise RunError(
                f"{job.label} could not be tracked: {result.failure}",
                "Change what it says and try again.",
            )
        outcome = KeptOutcome(
            result.measured, "", result.seconds, measured_by(), now(), job.label, job.arguments
        )
        kept.kept_trials.write(job.key, outcome)
        found[job.key] = Outcome(work.trials[job.key], result.measured)
        report(job.label, len(found), len(work.trials))

    run_jobs(jobs, above(work.plan.footage), on_result, processes, executor=executor, checkpoint=checkpoint)
    return work.plan, [found[key] for key in work.trials]


def _job(kept: KeptComparison, work: _Work, key: str) -> TrialJob:
    trial, plan = work.trials[key], work.plan
    arguments = plain(trial.arguments)
    if plan.vary:
        arguments["run"] = run_name(kept.name, plan, list(work.trials).index(key))
        arguments["note"] = kept.note_of(trial.label)
    return TrialJob(
        key=key,
        experiment="comparison",
        label=trial.label,
        arguments=arguments,
        measure=measure_run if plan.vary else measure_tracking,
        footage=(plan.footage,),
        frames=None,
        alone=False,
    )


def _outcomes(kept: KeptComparison, work: _Work) -> dict[str, Outcome]:
    """The outcomes that this version of the studio measured."""
    found: dict[str, Outcome] = {}
    for key, trial in work.trials.items():
        outcome = kept.kept_trials.read(key)
        if outcome is not None and outcome.measured is not None and outcome.software == measured_by():
            found[key] = Outcome(trial, outcome.measured)
    return found
