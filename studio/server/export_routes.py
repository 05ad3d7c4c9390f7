"""Exporting a run: in the background, with progress as `export` events; the files lie in the run's folder."""

from fastapi import APIRouter
from fastapi.responses import FileResponse, Response

from studio.capture.calibration_files import CALIBRATION_FORMATS
from studio.export.exporting import settled
from studio.export.formats import FORMATS, format_of
from studio.export.kept_exports import (
    discard_export,
    export_into_run,
    kept_exports,
    kept_file,
    stale_export,
)
from studio.export.options import ExportOptions
from studio.jobs.job_runner import Job
from studio.knobs import knobs_of
from studio.runs.tracks import best_track, track_names
from studio.server.app_state import App
from studio.server.export_schemas import (
    ExportChoices,
    ExportLine,
    ExportList,
    ExportRequest,
    ExportState,
    FormatView,
)
from studio.server.job_kinds import EXPORT
from studio.server.job_routes import add_job_routes
from studio.server.run_routes import RUN, OpenRun
from studio.server.session_routes import OpenSession
from studio.server.setting_views import knob_view

router = APIRouter(prefix="/api", tags=["exports"])


@router.get("/exports/choices")
def choices() -> ExportChoices:
    """The formats, what opens them, and the options that they take."""
    calibrations: dict[str, list[str]] = {}
    for name, writer in CALIBRATION_FORMATS.items():
        calibrations.setdefault(writer.suffix, []).append(name)
    return ExportChoices(
        formats=[FormatView.model_validate(form) for form in FORMATS.values()],
        options=[knob_view(entry) for entry in knobs_of(ExportOptions)],
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
        kept = export_into_run(
            session,
            run,
            form,
            request.options,
            progress=job.report_or_stop,
            record_scene=app.scenes.record_scene,
        )
        return {"result": kept}

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
