"""Exporting a run: in the background, with progress as `export` events; the files lie in the run's folder."""

from typing import Annotated

from fastapi import APIRouter
from fastapi.responses import FileResponse, Response
from pydantic import Field

from studio.app.server.answers import Shown
from studio.app.server.app_state import App
from studio.app.server.job_routes import add_job_routes
from studio.app.server.run_routes import RUN, OpenRun
from studio.app.server.schemas import Answer, Request
from studio.app.server.session_routes import OpenSession
from studio.footage.capture.calibration_files import CALIBRATION_FORMATS
from studio.foundations.knobs import Knob, Value, knobs_of
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.results.export.exporting import settled
from studio.results.export.formats import FORMATS, format_of
from studio.results.export.kept_exports import (
    discard_export,
    export_into_run,
    kept_exports,
    kept_file,
    stale_export,
)
from studio.results.export.options import ExportOptions
from studio.runs.tracks import best_track, track_names

router = APIRouter(prefix="/api", tags=["exports"])


class FormatView(Answer):
    """A format. opens: what opens it. takes: names of the options that mean something here. unit, up: what auto is."""

    name: str
    title: str
    opens: str
    takes: list[str]
    unit: str
    up: str
    what: str = Field(description="motion, video, scene or cameras.")


class ExportChoices(Answer):
    """What a run can be exported to, and how. calibrations: writers by the ending of their files."""

    formats: list[FormatView]
    options: list[Annotated[Knob, Shown]]
    calibrations: dict[str, list[str]]


class ExportRequest(Request):
    """A format's name, and options by name where they are not the usual ones."""

    format: str = Field(max_length=20)
    options: dict[str, Value] = Field(default_factory=dict)


class ExportLine(Answer):
    """A finished export. checked: what reading the file back showed. notes: on gaps, names and axes. stale: why it does
    not hold its track as it is now.
    """

    file: str
    format: str
    made: str
    bytes: int
    frames: int
    fps: float
    checked: str
    notes: list[str]
    options: dict[str, Value]
    track: str = ""
    stale: str = ""


class ExportState(NumberedJob):
    """How an export stands. result: of one that is done."""

    run: str
    format: str
    result: ExportLine | None = None


EXPORT = JobKind(
    "export",
    "export",
    ExportState,
    at="/api/exports/{identifier}",
    page="/?session={session}&run={run}&panel=export",
)


class ExportList(Answer):
    """A run's exports, newest first, those under way, and its tracks and cameras to choose among. best: the track that
    is written unless another is chosen; note: on better ones that are out of date.
    """

    exports: list[ExportLine]
    running: list[ExportState]
    tracks: list[str]
    best: str
    note: str = ""
    cameras: list[str]


@router.get("/exports/choices")
def choices() -> ExportChoices:
    """The formats, what opens them, and the options that they take."""
    calibrations: dict[str, list[str]] = {}
    for name, writer in CALIBRATION_FORMATS.items():
        calibrations.setdefault(writer.suffix, []).append(name)
    return ExportChoices(
        formats=[FormatView.model_validate(form) for form in FORMATS.values()],
        options=list(knobs_of(ExportOptions)),
        calibrations=calibrations,
    )


@router.get(RUN + "/exports")
def exports(session: OpenSession, run: OpenRun, app: App) -> ExportList:
    """The run's exports, newest first, and those under way."""
    going = [state for state in app.jobs.going(EXPORT, session.name) if state.run == run.name]
    lines = [
        ExportLine.model_validate(kept).model_copy(update={"stale": stale_export(run, kept)})
        for kept in kept_exports(run)
    ]
    names = [camera.name for camera in run.cameras()]
    best = best_track(run)
    return ExportList(
        exports=lines,
        running=going,
        tracks=list(track_names(run)),
        best=best.name,
        note=best.note,
        cameras=names,
    )


@router.post(RUN + "/exports", status_code=202)
async def begin_export(session: OpenSession, run: OpenRun, request: ExportRequest, app: App) -> ExportState:
    """Begin an export. 422 for a format or option that there is not; ask for its state, or wait for `export` events."""
    form = format_of(request.format)
    settled(form, request.options)

    def work(job: Job) -> dict[str, object]:
        return {"result": export_into_run(session, run, form, request.options, progress=job.report_or_stop)}

    state = ExportState(session=session.name, run=run.name, format=form.name)
    return app.jobs.begin(EXPORT, state, work)


add_job_routes(router, "/exports/{identifier}", EXPORT)


@router.get(RUN + "/exports/{file}", response_class=FileResponse)
def download(run: OpenRun, file: str) -> FileResponse:
    """An export's file."""
    path = kept_file(run, file)
    form = FORMATS.get(path.suffix.removeprefix("."))
    # Never shown as a page of ours, whatever is in it.
    kind = form.media_type if form and form.name != "html" else "application/octet-stream"
    return FileResponse(path, filename=file, media_type=kind, content_disposition_type="attachment")


@router.delete(RUN + "/exports/{file}", status_code=204)
def delete(run: OpenRun, file: str) -> Response:
    """Delete an export for good: it can be made again from the run."""
    discard_export(run, file)
    return Response(status_code=204)
