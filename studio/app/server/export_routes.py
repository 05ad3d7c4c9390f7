"""Exporting a run: in the background, with progress as `export` events; the files lie in the run's folder."""

from dataclasses import dataclass
from typing import Annotated

from fastapi.responses import FileResponse, Response
from pydantic import Field

from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App
from studio.app.server.job_routes import add_job_routes
from studio.app.server.run_routes import RUN, RunInPath
from studio.app.server.schemas import Request
from studio.app.server.session_routes import OpenSession
from studio.foundations.knobs import Value
from studio.operations.exports import (
    ExportChoices,
    ExportLine,
    RunExports,
    discard_export,
    export_choices,
    export_into_run,
    exports_of,
    kept_file,
    requested_format,
)
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.results.export.formats import FORMATS

router = Router(prefix="/api", tags=["exports"])


class ExportRequest(Request):
    """A format's name, and options by name where they are not the usual ones."""

    format: str = Field(max_length=20)
    options: dict[str, Value] = Field(default_factory=dict)


class ExportState(NumberedJob):
    """How an export stands. result: of one that is done."""

    run: str
    format: str
    result: Annotated[ExportLine, Shown] | None = None


EXPORT = JobKind(
    "export",
    "export",
    ExportState,
    at="/api/exports/{identifier}",
    page="/?session={session}&run={run}&panel=export",
)


@dataclass(frozen=True, slots=True)
class ExportList(RunExports):
    """A run's exports, newest first, those under way, and its tracks and cameras to choose among. best: the track that
    is written unless another is chosen; note: on better ones that are out of date.
    """

    running: list[ExportState]


@router.get("/exports/choices")
def choices() -> ExportChoices:
    """The formats, what opens them, and the options that they take."""
    return export_choices()


@router.get(RUN + "/exports")
def exports(session: OpenSession, run: RunInPath, app: App) -> ExportList:
    """The run's exports, newest first, and those under way."""
    going = [state for state in app.jobs.going(EXPORT, session.name) if state.run == run.name]
    of = exports_of(run)
    return ExportList(of.exports, of.tracks, of.best, of.note, of.cameras, going)


@router.post(RUN + "/exports", status_code=202)
async def begin_export(session: OpenSession, run: RunInPath, request: ExportRequest, app: App) -> ExportState:
    """Begin an export. 422 for an unknown format or option; ask for its state, or wait for `export` events."""
    form = requested_format(request.format, request.options)

    def work(job: Job) -> dict[str, object]:
        return {"result": export_into_run(session, run, form, request.options, progress=job.report_or_stop)}

    state = ExportState(session=session.name, run=run.name, format=form.name)
    return app.jobs.begin(EXPORT, state, work)


add_job_routes(router, "/exports/{identifier}", EXPORT)


@router.get(RUN + "/exports/{file}", response_class=FileResponse)
def download(run: RunInPath, file: str) -> FileResponse:
    """An export's file."""
    path = kept_file(run, file)
    form = FORMATS.get(path.suffix.removeprefix("."))
    # Never shown as a page of ours, whatever is in it.
    kind = form.media_type if form and form.name != "html" else "application/octet-stream"
    return FileResponse(path, filename=file, media_type=kind, content_disposition_type="attachment")


@router.delete(RUN + "/exports/{file}", status_code=204)
def delete(run: RunInPath, file: str) -> Response:
    """Delete an export for good: it can be made again from the run."""
    discard_export(run, file)
    return Response(status_code=204)
