"""A comparison run until all of its trials are done: outcomes are kept one by one and not measured again."""

import json
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import TypeVar

import numpy as np

from studio.foundations.errors import RunError, StudioError, WorkCancelledError
from studio.foundations.progress import Progress
from studio.operations.jobs.cluster import chosen_executor
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.jobs.process_executor import cores
from studio.operations.jobs.swept_runs import measure_run, measure_runs
from studio.operations.jobs.trials import TrialResult, run_jobs
from studio.results.comparison.kept_comparison import KeptComparison, trial_key
from studio.results.comparison.kept_trials import KeptOutcome, measured_by, plain
from studio.results.comparison.plan import Comparison, Plan, conclude, trials
from studio.results.comparison.sweep import Sweep, conclude_sweep, run_name, sweep_trials
from studio.results.comparison.tracked import (
    TrackingTrial,
    measure_seeds,
    measure_tracking,
    runs_at_once,
    seeds_at_once,
)
from studio.results.comparison.trials import Outcome, Trial, TrialJob
from studio.runs.search_space import search_space
from studio.runs.setup.session_settings import session_settings
from studio.search.likelihood.devices import CPU, DEVICE_KNOB, is_processor
from studio.search.settings import RunSettings
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.manifest import now
from studio.sessions.object_stores import above
from studio.sessions.session import Session

Result = TypeVar("Result", bound=Comparison | Sweep)


class ComparisonState(SessionJob):
    """How a comparison stands that is being worked at. step: the trial that was done last; done, total: trials."""

    name: str

    @property
    def key(self) -> str:
        """The name that it is requested by."""
        return f"{self.session}/{self.name}"


COMPARISON = JobKind(
    "comparison",
    "comparison",
    ComparisonState,
    busy="Comparison '{name}' of '{session}' is running; one runs at a time.",
    keeps_session=True,
    page="/comparisons?session={session}&name={name}",
)


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
    conclusion: Callable[[Plan, Sequence[Outcome]], Result],
    *,
    processes: int | None = None,
    executor: Executor | None = None,
    checkpoint: Callable[[], None] = lambda: None,
) -> Result:
    """Do what is still to be done of a comparison, and write what `conclusion` makes of it.

    conclusion : `conclude`, of a sweep `conclude_sweep`. processes, executor, checkpoint : see `trials.run_jobs`.
    However it ends, finished trials stay, and of runs the finished frames. Raises RunError where another process works
    at it or a trial fails.
    """
    with _hold(kept):
        plan, outcomes = _measure(kept, session, report, processes, executor, checkpoint)
        result = conclusion(plan, outcomes)
        kept.finish(result)
    return result


def run_in_background(
    kept: KeptComparison, session: Session, job: Job, report: Progress
) -> dict[str, object]:
    """Work at a comparison as a job, and write into its record why it ended before it was done."""
    try:
        with chosen_executor("", session.path) as executor:
            run_comparison(
                kept,
                session,
                report,
                conclude_sweep if kept.plan().vary else conclude,
                processes=processes_beside(),
                executor=executor,
                checkpoint=job.check,
            )
    except WorkCancelledError:
        if not job.closing:
            kept.end("cancelled")
        raise
    except Exception as error:
        words = str(error) if isinstance(error, StudioError) else f"{type(error).__name__}: {error}"
        kept.end("failed", words)
        raise
    return {}


def processes_beside() -> int:
    """How many trials run at once beside the studio, for which one core stays free."""
    return max(1, cores() - 1)


def done_before(kept: KeptComparison, plan: Plan) -> int:
    """How many of a comparison's trials are done."""
    return len(_outcomes(kept, _Work.of(plan)))


@contextmanager
def _hold(kept: KeptComparison) -> Generator[None]:
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


def _measure(
    kept: KeptComparison,
    session: Session,
    report: Progress,
    processes: int | None,
    executor: Executor | None,
    checkpoint: Callable[[], None],
) -> tuple[Plan, list[Outcome]]:
    """The outcomes of all trials, in their order; missing ones are measured."""
    work = _Work.of(kept.plan(session))
    outcomes = _outcomes(kept, work)
    missing = [_job(kept, work, key) for key in work.trials if key not in outcomes]
    groups = {group[0].key: group for group in _side_by_side(session, missing, processes or cores())}
    report("", len(outcomes), len(work.trials))

    def on_result(first: TrialJob, result: TrialResult) -> None:
        if result.measured is None:
            raise RunError(
                f"{first.label} could not be tracked: {result.failure}", "Change what it says and try again."
            )
        group = groups[first.key]
        measured = [result.measured] if len(group) == 1 else result.measured["measured"]
        for job, values in zip(group, measured, strict=True):
            seconds = result.seconds / len(group)
            outcome = KeptOutcome(values, "", seconds, measured_by(), now(), job.label, job.arguments)
            kept.kept_trials.write(job.key, outcome)
            outcomes[job.key] = Outcome(work.trials[job.key], values)
            report(job.label, len(outcomes), len(work.trials))

    jobs = [_as_one(group) for group in groups.values()]
    run_jobs(jobs, above(work.plan.footage), on_result, processes, executor=executor, checkpoint=checkpoint)
    return work.plan, [outcomes[key] for key in work.trials]


def _side_by_side(session: Session, jobs: Sequence[TrialJob], processes: int) -> list[list[TrialJob]]:
    """The jobs in groups that a card searches side by side: tracking trials that differ by seed alone, and runs of a
    sweep that differ by seed and by what leaves their likelihood and the search's shared knobs as they are.
    """
    alike = dict[str, list[TrialJob]]()
    for job in jobs:
        alike.setdefault(_in_common(session, job), []).append(job)
    groups = list[list[TrialJob]]()
    for together in alike.values():
        first = together[0]
        if first.measure is measure_run:
            most = _runs_at_once(session, first, len(together), processes)
        else:
            most = seeds_at_once(TrackingTrial.of_plain(first.arguments), len(together), processes)
        groups += [together[at : at + most] for at in range(0, len(together), most)]
    places = {job.key: place for place, job in enumerate(jobs)}
    return sorted(groups, key=lambda group: places[group[0].key])


def _in_common(session: Session, job: TrialJob) -> str:
    known: dict[str, object] = {**job.arguments, "seed": None}
    if job.measure is measure_run:
        settings = _settings(session, job)
        shared = TRACKERS[settings.tracker_name].shared_knobs(settings.tracker)
        known |= {
            "run": None,
            "note": None,
            "changes": [shared, asdict(settings.weighting), asdict(settings.evidence)],
        }
    return json.dumps(known, sort_keys=True)


def _runs_at_once(session: Session, job: TrialJob, runs: int, processes: int) -> int:
    """How many of a sweep's runs are tracked side by side; 1 where the processor would search them in turn."""
    settings, body = _settings(session, job), session.body(job.arguments["body"] or None)
    space = search_space(body, np.zeros(len(body.parameters)))
    fits = TRACKERS[settings.tracker_name].fits_device(0, space, settings.tracker, {})
    if (
        not fits
        or job.arguments.get("behaviour")
        or is_processor(getattr(settings.weighting, DEVICE_KNOB, CPU))
    ):
        return 1
    return runs_at_once(settings, runs, processes)


def _settings(session: Session, job: TrialJob) -> RunSettings:
    """Those of a sweep's run."""
    given = job.arguments
    return session_settings(session, given["tracker"], given["weighting"], given["changes"])


def _as_one(group: Sequence[TrialJob]) -> TrialJob:
    """The job that measures a group."""
    first = group[0]
    if len(group) == 1:
        return first
    arguments = {"trials": [job.arguments for job in group]}
    label = f"{first.label} and {len(group) - 1} more"
    measure = measure_runs if first.measure is measure_run else measure_seeds
    return replace(first, label=label, arguments=arguments, measure=measure)


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
    outcomes: dict[str, Outcome] = {}
    for key, trial in work.trials.items():
        known = kept.kept_trials.read(key)
        if known is not None and known.measured is not None and known.software == measured_by():
            outcomes[key] = Outcome(trial, known.measured)
    return outcomes
