"""The papers' experiments: run again in the background; what was found, for the page of reports and as downloads."""

from pathlib import Path
from typing import Any

import msgspec
from fastapi import APIRouter
from pydantic import Field
from starlette.responses import FileResponse, Response

from studio.app.server.app_state import App, AppState
from studio.app.server.schemas import Answer, Request
from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.foreign_files import read_file
from studio.foundations.typed_decoding import decode_json
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.results.comparison.findings_document import REPORT, REPRODUCTIONS, RESULTS, SUMMARY
from studio.results.experiments import ALL
from studio.results.experiments import experiments as known_experiments

router = APIRouter(tags=["reports"])

DOWNLOADS = {RESULTS: "application/json", SUMMARY: "text/markdown; charset=utf-8", REPORT: "text/html"}


class Reports(Answer):
    """What was reproduced so far. experiments: documents as results.json has them; none before the first command."""

    software: str = ""
    date: str = ""
    experiments: list[dict[str, Any]] = Field(default_factory=list[dict[str, Any]])


class ExperimentView(Answer):
    """An experiment that can be run. is_long: with all seeds it takes hours."""

    name: str
    title: str
    source: str
    claim: str
    is_long: bool


class ExperimentList(Answer):
    """What can be run, in the order of the report, and how the running stands; null before the first."""

    experiments: list[ExperimentView]
    job: "ReproductionState | None"


class ReproductionRequest(Request):
    """name: of an experiment, or "all". quick: a look with fewer seeds, frames and settings. seeds: null for as many
    as the form has. What is measured already is kept and not run again.
    """

    name: str = Field(max_length=64)
    quick: bool = True
    seeds: int | None = Field(None, ge=1, le=1000)


class ReproductionState(SessionJob):
    """How an experiment stands that is run again. measured, kept, failed: trials run now, found stored, and failed."""

    name: str
    quick: bool
    measured: int = 0
    kept: int = 0
    failed: int = 0

    @property
    def key(self) -> str:
        """There is one at a time."""
        return KEY


KEY = "reproduction"
REPRODUCTION = JobKind(
    "reproduction",
    "experiment",
    ReproductionState,
    busy="Experiment '{name}' is running; one runs at a time.",
    page="/reports",
)


@router.get("/api/reports/experiments")
def experiments(app: App) -> ExperimentList:
    """The papers' experiments that can be run again, and how the one stands that was begun last."""
    listed = [ExperimentView.of(one) for one in known_experiments().lines()]
    return ExperimentList(experiments=listed, job=app.jobs.known(REPRODUCTION, KEY))


@router.post("/api/reports/experiments", status_code=202)
def begin_experiment(request: ReproductionRequest, app: App) -> ReproductionState:
    """Begin to run an experiment again, in the background (`reproduction` events). What is measured is kept as it
    comes: begun again it goes on where it was stopped.
    """
    if request.name != ALL and request.name not in [one.name for one in known_experiments().lines()]:
        raise NotFoundError(f"There is no experiment '{request.name}'.", "Choose one of the list.")
    folder = _folder(app)

    def work(job: Job) -> dict[str, object]:
        counts = known_experiments().reproduce(
            request.name, folder, quick=request.quick, seeds=request.seeds, progress=job.report_or_stop
        )
        return REPRODUCTION.entries(counts)

    return app.jobs.begin(REPRODUCTION, ReproductionState(name=request.name, quick=request.quick), work)


@router.get("/api/reports")
def reports(app: App) -> Reports:
    """What `studio reproduce` wrote into the workspace."""
    path = _folder(app) / RESULTS
    if not path.is_file():
        return Reports()
    try:
        return decode_json(read_file(path), _Results).as_reports()
    except (msgspec.DecodeError, OSError) as error:
        raise SessionError(
            f"'{path}' cannot be read: {error}.", "Run 'studio reproduce' again; what is measured is kept."
        ) from None


@router.get("/api/reports/{name}", response_class=Response)
def report_file(name: str, app: App) -> Response:
    """results.json, summary.md or report.html (the whole report in one file) as a download."""
    path = _folder(app) / name
    if name not in DOWNLOADS or not path.is_file():
        raise NotFoundError(f"There is no report '{name[:40]}'.", "Make one: studio reproduce all --quick.")
    return FileResponse(path, media_type=DOWNLOADS[name], filename=name)


class _Results(msgspec.Struct, frozen=True):
    software: str = ""
    date: str = ""
    experiments: list[dict[str, Any]] = msgspec.field(default_factory=list[dict[str, Any]])

    def as_reports(self) -> Reports:
        return Reports(software=self.software, date=self.date, experiments=self.experiments)


def _folder(app: AppState) -> Path:
    return app.workspace.root / REPRODUCTIONS
