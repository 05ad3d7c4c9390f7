"""From the outcomes of an experiment's trials to the document of its findings, whatever goes wrong on the way."""

from collections.abc import Mapping

from studio.comparison.findings import VERDICTS, Findings
from studio.comparison.findings_document import Document, Making, as_document, failed_document
from studio.comparison.kept_trials import KeptOutcome, measured_by
from studio.comparison.trials import Outcome, Trial, failure_in_words
from studio.errors import StudioError
from studio.reproduction.plan import PlannedExperiment
from studio.sessions.manifest import now


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
    )
    reasons = [("", planned.problem)] if planned.problem else []
    reasons += [(outcome.label, outcome.failure) for outcome in outcomes if outcome.measured is None]
    if reasons:
        return failed_document(planned.experiment, reasons, making)
    try:
        return as_document(planned.experiment, _findings(planned, outcomes), making)
    except Exception as error:
        return failed_document(planned.experiment, [("The conclusion", failure_in_words(error))], making)


def _findings(planned: PlannedExperiment, outcomes: list[KeptOutcome]) -> Findings:
    """Raises what the experiment's conclusion raises, and StudioError for a verdict that is none."""
    found = planned.experiment.conclude(
        [
            Outcome(Trial(trial.label, job.arguments), outcome.measured or {})
            for trial, job, outcome in zip(planned.trials, planned.jobs, outcomes, strict=True)
        ]
    )
    for verdict in (found.verdict, *(number.verdict for number in found.numbers)):
        if verdict not in VERDICTS:
            raise StudioError(f"'{verdict}' is no verdict.", f"Use one of {', '.join(VERDICTS)}.")
    return found
