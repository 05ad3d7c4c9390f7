"""A comparison worked at until all of its trials are done: outcomes are kept one by one, those that are there are not
measured again.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from studio.comparison.kept_comparison import KeptComparison, trial_key
from studio.comparison.kept_trials import KeptOutcome, measured_by, plain
from studio.comparison.plan import Comparison, Plan, conclude, trials
from studio.comparison.tracked import measure_tracking
from studio.comparison.trials import Outcome, Trial, TrialJob
from studio.errors import RunError
from studio.progress import Progress
from studio.sessions.manifest import now
from studio.sessions.session import Session
from studio.worker.trials import TrialResult, run_jobs


@dataclass(frozen=True, slots=True)
class _Work:
    """A comparison's trials under their keys, in order."""

    plan: Plan
    trials: dict[str, Trial]

    @staticmethod
    def of(plan: Plan) -> "_Work":
        return _Work(plan, {trial_key(trial): trial for trial in trials(plan)})


def run_comparison(
    kept: KeptComparison,
    session: Session,
    report: Progress,
    *,
    processes: int | None = None,
    executor: Executor | None = None,
    checkpoint: Callable[[], None] = lambda: None,
) -> Comparison:
    """Do what is still to be done of a comparison and write its result.

    processes, executor, checkpoint : see `trials.run_jobs`. What ends it leaves the finished trials. Raises RunError
    where another process works at it or a trial fails.
    """
    lock = kept.lock()
    if lock is None:
        raise RunError(
            f"Another process works at comparison '{kept.name}'.", "Wait for it, or start a new one."
        )
    try:
        kept.end("")
        work = _Work.of(kept.plan(session))
        found = _outcomes(kept, work)
        jobs = [_job(work, key) for key in work.trials if key not in found]
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

        footage = Path(work.plan.footage).parent
        run_jobs(jobs, footage, on_result, processes, executor=executor, checkpoint=checkpoint)
        comparison = conclude(work.plan, [found[key] for key in work.trials])
        kept.finish(comparison)
    finally:
        lock.free()
    return comparison


def done_before(kept: KeptComparison, plan: Plan) -> int:
    """How many of a comparison's trials are there."""
    return len(_outcomes(kept, _Work.of(plan)))


def _job(work: _Work, key: str) -> TrialJob:
    trial = work.trials[key]
    return TrialJob(
        key=key,
        experiment="comparison",
        label=trial.label,
        arguments=plain(trial.arguments),
        measure=measure_tracking,
        footage=(work.plan.footage,),
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
