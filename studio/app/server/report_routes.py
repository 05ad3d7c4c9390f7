"""The papers' experiments: run again in the background; their results, for the page of reports and as downloads."""

from dataclasses import dataclass

from pydantic import Field
from starlette.responses import FileResponse, Response

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.schemas import Request
from studio.foundations.errors import NotFoundError
from studio.operations.experiments import (
    ALL,
    DOWNLOADS,
    ExperimentLine,
    Reports,
    kept_reports,
    report_file,
    reproductions_folder,
)
from studio.operations.experiments import experiments as known_experiments
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob

router = Router(tags=["reports"])


class ReproductionRequest(Request):
    """name: of an experiment, or "all". quick: a look with fewer seeds, frames and settings. seeds: null for as many
    as the form has. What is measured already is kept and not run again.
    """

    name: str = Field(max_length=64)
    quick: bool = True
    seeds: int | None = Field(None, ge=1, le=1000)


class ReproductionState(SessionJob):
    """How an experiment stands that is run again. measured, kept, failed: trials run now, stored before, and failed."""

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


@dataclass(frozen=True, slots=True)
class ExperimentList:
    """What can be run, in the order of the report, and how the running stands; null before the first."""

    experiments: tuple[ExperimentLine, ...]
    job: ReproductionState | None


@router.get("/api/reports/experiments")
def experiments(app: App) -> ExperimentList:
    """The papers' experiments that can be run again, and how the one stands that was begun last."""
    return ExperimentList(known_experiments().lines(), app.jobs.known(REPRODUCTION, KEY))


@router.post("/api/reports/experiments", status_code=202)
def begin_experiment(request: ReproductionRequest, app: App) -> ReproductionState:
    """Begin to run an experiment again, in the background (`reproduction` events). What is measured is kept as it
    comes: when begun again it continues where it was stopped.
    """
    if request.name != ALL and request.name not in [one.name for one in known_experiments().lines()]:
        raise NotFoundError(f"There is no experiment '{request.name}'.", "Choose one of the list.")
    folder = reproductions_folder(app.workspace)

    def work(job: Job) -> dict[str, object]:
        counts = known_experiments().reproduce(
            request.name, folder, quick=request.quick, seeds=request.seeds, progress=job.report_or_stop
        )
        return REPRODUCTION.entries(counts)

    return app.jobs.begin(REPRODUCTION, ReproductionState(name=request.name, quick=request.quick), work)


@router.get("/api/reports")
def reports(app: App) -> Reports:
    """What `studio reproduce` wrote into the workspace."""
    return kept_reports(app.workspace)


@router.get("/api/reports/{name}", response_class=Response)
def download(name: str, app: App) -> Response:
    """results.json, summary.md or report.html (the whole report in one file) as a download."""
    path = report_file(app.workspace, name)
    return FileResponse(path, media_type=DOWNLOADS[name], filename=name)
