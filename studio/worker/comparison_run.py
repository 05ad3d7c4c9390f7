"""A comparison worked at until all of its trials are done: outcomes are kept one by one, those that are there are not
measured again.
"""

from collections.abc import Callable
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
from studio.worker.trial_pool import run_jobs
from studio.worker.trial_process import TrialResult


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
    checkpoint: Callable[[], None] = lambda: None,
) -> Comparison:
    """Do what is still to be done of a comparison and write its result.

    processes : how many trials at once, None for one a core. checkpoint : called several times a second; what it
    raises ends the comparison, whose finished trials stay. Raises RunError where another process works at it or a
    trial fails.
    """
    lock = kept.lock()
    if lock is None:
        raise RunError(
            f"Another process works at comparison '{kept.name}'.", "Wait for it, or start a new one."
        )
    try:
        kept.end("")
        comparison = _run(kept, _Work.of(kept.plan(session)), report, processes, checkpoint)
        kept.finish(comparison)
    finally:
        lock.free()
    return comparison


def done_before(kept: KeptComparison, plan: Plan) -> int:
    """How many of a comparison's trials are there."""
    return len(_outcomes(kept, _Work.of(plan)))


def _run(
    kept: KeptComparison,
    work: _Work,
    report: Progress,
    processes: int | None,
    checkpoint: Callable[[], None],
) -> Comparison:
    found = _outcomes(kept, work)
    total = len(work.trials)
    report("", len(found), total)
    jobs = [
        TrialJob(
            key=key,
            experiment="comparison",
            label=trial.label,
            arguments=plain(trial.arguments),
            measure=measure_tracking,
            footage=(work.plan.footage,),
            frames=None,
            alone=False,
        )
        for key, trial in work.trials.items()
        if key not in found
    ]

    def on_result(job: TrialJob, result: TrialResult) -> None:
        if result.measured is None:
            raise RunError(
                f"{job.label} could not be tracked: {result.failure}", "Change what it says and try again."
            )
        outcome = KeptOutcome(
            result.measured, "", result.seconds, measured_by(), now(), job.label, job.arguments
        )
        kept.kept_trials.write(job.key, outcome)
        found[job.key] = Outcome(work.trials[job.key], result.measured)
        report(job.label, len(found), total)

    if jobs:
        run_jobs(jobs, Path(work.plan.footage).parent, on_result, processes, checkpoint=checkpoint)
    return conclude(work.plan, [found[key] for key in work.trials])


def _outcomes(kept: KeptComparison, work: _Work) -> dict[str, Outcome]:
    """The outcomes that this version of the studio measured."""
    found: dict[str, Outcome] = {}
    for key, trial in work.trials.items():
        outcome = kept.kept_trials.read(key)
        if outcome is not None and outcome.measured is not None and outcome.software == measured_by():
            found[key] = Outcome(trial, outcome.measured)
    return found
