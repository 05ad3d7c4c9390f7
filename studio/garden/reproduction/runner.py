"""A reproduction from the first picture to the report: footage, trials, conclusions, files.

Every result is stored at once: the same command resumes a killed one, and runs nothing twice.
"""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from studio.foundations.errors import RunError, SessionError, StudioError
from studio.foundations.progress import Progress
from studio.garden.reproduction.experiment import Experiment
from studio.garden.reproduction.findings_files import FOOTAGE, TRIALS, write_findings, write_overview
from studio.garden.reproduction.plan import PlannedExperiment, each_once, footage_needed, is_rendered, plan
from studio.garden.reproduction.provenance import commit
from studio.operations.jobs.cluster import chosen_executor
from studio.operations.jobs.trials import TrialResult, run_jobs
from studio.results.comparison.findings import VERDICTS, Findings
from studio.results.comparison.findings_document import Document, Making, as_document, failed_document
from studio.results.comparison.kept_trials import KeptOutcome, KeptTrials, measured_by
from studio.results.comparison.trials import Outcome, Scale, Trial, TrialJob, failure_in_words
from studio.results.drawing_footage.recipes import synthesize
from studio.sessions.atomic_files import PARTIAL_PREFIX, discard, move_into_place, new_folder_beside
from studio.sessions.manifest import FILE_NAME as MANIFEST
from studio.sessions.manifest import now
from studio.sessions.object_stores import below, is_address
from studio.sessions.process_lock import ProcessLock
from studio.sessions.remote_sessions import bring_work, put_work, upload_unless_there
from studio.sessions.session import Session

LOCK = "reproduction.lock"
SECONDS_BETWEEN_REPORTS = 30.0


@dataclass(frozen=True, slots=True)
class Reproduction:
    """The result of a command.

    documents : of the requested experiments, in their order. results : of all experiments run in the folder.
    measured, kept, failed : numbers of trials run now, found stored, and failed.
    """

    documents: tuple[Document, ...]
    results: Document
    measured: int
    kept: int
    failed: int


def reproduce(
    experiments: Sequence[Experiment],
    out: Path | str,
    scale: Scale,
    report: Progress,
    *,
    catalogue: Sequence[Experiment] = (),
    processes: int | None = None,
    cluster: str = "",
    executor: Executor | None = None,
) -> Reproduction:
    """Run the missing trials of some experiments and write the folder `out`.

    out : a folder, or an address of a store: then all but footage is worked at in a folder of this machine and put
    there at the end; footage is put there before it is tracked. catalogue : experiments whose findings the report
    shows, by default the experiments. processes, executor : see `operations.jobs.trials.run_jobs`. cluster : where no
    executor is given, see `operations.jobs.cluster.chosen_executor`. A trial or a conclusion that fails makes its
    experiment "failed" and no other. Raises SessionError for a folder that cannot be used, RunError while another
    process works in it and for a cluster that cannot be used, KeyboardInterrupt with all results stored.
    """
    address = str(out) if is_address(out) else ""
    out = bring_work(address, FOOTAGE) if address else Path(out)
    lock = _taken(out)
    try:
        planned = [plan(experiment, scale) for experiment in experiments]
        work = _Work(out, planned, tuple(catalogue or experiments), report, address)
        try:
            with nullcontext(executor) if executor else chosen_executor(cluster, address or out) as chosen:
                work.run(processes, chosen)
        finally:
            results = work.write_overview()
            if address:
                put_work(address, FOOTAGE)
        documents = tuple(work.documents[entry.experiment.name] for entry in planned)
        return Reproduction(documents, results, work.measured, work.found, work.failed)
    finally:
        lock.free()


class _Work:
    """The command's state: stored outcomes, conclusions, remaining jobs."""

    def __init__(
        self,
        out: Path,
        planned: list[PlannedExperiment],
        catalogue: tuple[Experiment, ...],
        report: Progress,
        address: str,
    ) -> None:
        self.documents: dict[str, Document] = {}
        self._out, self._planned, self._catalogue = out, planned, catalogue
        self._report, self._address = report, address
        self._folder = KeptTrials(out / TRIALS)
        self._jobs = each_once(planned)
        self._kept: dict[str, KeptOutcome] = {}
        for key in self._jobs:
            outcome = self._folder.read(key)
            # Failed trials are run again: the cause may have been removed.
            if outcome is not None and outcome.measured is not None:
                self._kept[key] = outcome
        self.found, self.measured, self.failed = len(self._kept), 0, 0
        self._written = 0.0

    def run(self, processes: int | None, executor: Executor | None) -> None:
        """Render, run and conclude what is missing."""
        self._conclude_what_is_done()
        missing = [job for key, job in self._jobs.items() if key not in self._kept]
        runnable: list[TrialJob] = []
        problems = self._render(footage_needed(missing))
        for job in missing:
            problem = next((problems[name] for name in job.footage if name in problems), "")
            if problem:
                self._keep(job, TrialResult(job.key, None, problem, 0.0))
            else:
                runnable.append(job)
        self._conclude_what_is_done()
        if runnable:
            self._report_step("starting")
            footage = below(self._address, FOOTAGE) if self._address else self._out / FOOTAGE
            run_jobs(runnable, footage, self._done, processes, executor=executor)

    def write_overview(self) -> Document:
        """The files of all experiments together."""
        self._written = time.monotonic()
        return write_overview(self._out, self._catalogue, measured_by(), now())

    def _render(self, needed: dict[str, int | None]) -> dict[str, str]:
        """Render missing footage; returns the failures with their reasons. needed : recipes to frames."""
        problems: dict[str, str] = {}
        for left_by_a_killed_command in (self._out / FOOTAGE).glob(f"{PARTIAL_PREFIX}*"):
            discard(left_by_a_killed_command)
        for name, frames in needed.items():
            try:
                if not is_rendered(name, self._out / FOOTAGE, frames):
                    self._render_one(name, frames)
                if self._address:
                    place = below(self._address, FOOTAGE, name)
                    upload_unless_there(Session(self._out / FOOTAGE / name), place)
            except StudioError as error:
                problems[name] = f"The footage '{name}' cannot be made. {error}"
        return problems

    def _render_one(self, name: str, frames: int | None) -> None:
        place = self._out / FOOTAGE / name
        beside = new_folder_beside(place)
        try:
            synthesize(
                name,
                beside / name,
                lambda step, done, total: self._report(f"footage {name}: {step}", done, total),
                frames,
            )
            discard(place)
            move_into_place(beside / name, place)
        finally:
            discard(beside)

    def _done(self, job: TrialJob, result: TrialResult) -> None:
        self._keep(job, result)
        self._report_step(f"{job.experiment}: {job.label}")
        self._conclude_what_is_done()

    def _keep(self, job: TrialJob, result: TrialResult) -> None:
        outcome = KeptOutcome(
            result.measured,
            result.failure,
            round(result.seconds, 3),
            measured_by(),
            now(),
            job.label,
            job.arguments,
            commit(),
        )
        self._folder.write(job.key, outcome)
        self._kept[job.key] = outcome
        if outcome.measured is None:
            self.failed += 1
        else:
            self.measured += 1

    def _conclude_what_is_done(self) -> None:
        """Write the findings of every experiment whose trials are all done."""
        concluded = False
        for entry in self._planned:
            name = entry.experiment.name
            if name not in self.documents and all(job.key in self._kept for job in entry.jobs):
                self.documents[name] = conclude(entry, self._kept)
                write_findings(self._out, self.documents[name])
                concluded = True
        if concluded and time.monotonic() - self._written > SECONDS_BETWEEN_REPORTS:
            self.write_overview()

    def _report_step(self, step: str) -> None:
        self._report(step, len(self._kept), len(self._jobs))


def conclude(planned: PlannedExperiment, kept: Mapping[str, KeptOutcome]) -> Document:
    """The document of an experiment whose trials have all been run. kept : their outcomes by key.

    A trial that failed, and a conclusion that cannot be drawn, give a document with the verdict "failed".
    """
    outcomes = [kept[job.key] for job in planned.jobs]
    making = Making(
        planned.scale,
        len(outcomes),
        sum(outcome.seconds for outcome in outcomes),
        measured_by(),
        tuple(sorted({outcome.software for outcome in outcomes})),
        now(),
        tuple(sorted({outcome.commit for outcome in outcomes} - {""})),
        max((outcome.finished for outcome in outcomes), default=""),
    )
    reasons = [("", planned.problem)] if planned.problem else []
    reasons += [(outcome.label, outcome.failure) for outcome in outcomes if outcome.measured is None]
    if not reasons:
        try:
            return as_document(planned.experiment, _findings(planned, outcomes), making)
        except Exception as error:
            reasons = [("The conclusion", failure_in_words(error))]
    return failed_document(planned.experiment, reasons, making)


def _findings(planned: PlannedExperiment, outcomes: list[KeptOutcome]) -> Findings:
    """The experiment's findings. Raises the errors of its conclusion, and StudioError for an unknown verdict."""
    findings = planned.experiment.conclude(
        [
            Outcome(Trial(trial.label, job.arguments), outcome.measured or {})
            for trial, job, outcome in zip(planned.trials, planned.jobs, outcomes, strict=True)
        ]
    )
    for verdict in (findings.verdict, *(number.verdict for number in findings.numbers)):
        if verdict not in VERDICTS:
            raise StudioError(f"'{verdict}' is not a verdict.", f"Use one of {', '.join(VERDICTS)}.")
    return findings


def _taken(out: Path) -> ProcessLock:
    if (out / MANIFEST).is_file():
        raise SessionError(f"'{out}' is a session.", "Give another folder with --out.")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise SessionError(f"'{out}' is a file.", "Give a folder with --out.") from None
    lock = ProcessLock.take(out / LOCK)
    if lock is None:
        raise RunError(
            f"Another process reproduces into '{out}'.", "Wait for it, or give another folder with --out."
        )
    return lock
