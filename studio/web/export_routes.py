"""Exporting a run: in the background, with progress as `export` events; the files lie in the run's folder."""

import asyncio
import secrets
import threading
import time
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.responses import FileResponse, Response

from studio.capture.calibration_files import CALIBRATION_WRITERS
from studio.errors import NotFoundError, StudioError
from studio.export.exporting import settled
from studio.export.formats import FORMATS, ExportFormat, format_of
from studio.export.kept_exports import discard_export, export_into_run, kept_exports, kept_file
from studio.export.options import ExportOptions
from studio.export.task import ExportCancelledError
from studio.knobs import knobs_of
from studio.runs.tracks import track_names
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.web.doors import Doors, doors_of
from studio.web.error_responses import UnforeseenError, log
from studio.web.export_schemas import (
    ExportChoices,
    ExportLine,
    ExportList,
    ExportRequest,
    ExportState,
    FormatView,
)
from studio.web.run_routes import RUN, OpenRun
from studio.web.session_routes import OpenSession
from studio.web.setting_views import knob_view

router = APIRouter(prefix="/api", tags=["exports"])

Door = Annotated[Doors, Depends(doors_of)]

KEPT = 50
SECONDS_BETWEEN = 0.2


@router.get("/exports/choices")
def choices() -> ExportChoices:
    """The formats, what opens them, and the options that they take."""
    calibrations: dict[str, list[str]] = {}
    for name, writer in CALIBRATION_WRITERS.items():
        calibrations.setdefault(writer.suffix, []).append(name)
    return ExportChoices(
        formats=[FormatView.model_validate(form) for form in FORMATS.values()],
        options=[knob_view(entry) for entry in knobs_of(ExportOptions)],
        calibrations=calibrations,
    )


@router.get(RUN + "/exports")
def exports(session: OpenSession, run: OpenRun, doors: Door) -> ExportList:
    """The run's exports, newest first, and those under way."""
    going = [
        state
        for state in doors.exports.values()
        if (state.session, state.run, state.state) == (session.name, run.name, "running")
    ]
    lines = [ExportLine.model_validate(kept) for kept in kept_exports(run)]
    names = [camera.name for camera in run.cameras()]
    return ExportList(exports=lines, running=going, tracks=list(track_names(run)), cameras=names)


@router.post(RUN + "/exports", status_code=202)
async def begin_export(session: OpenSession, run: OpenRun, wish: ExportRequest, doors: Door) -> ExportState:
    """Begin an export. 422 for a format or option that there is not; ask for its state, or wait for `export` events."""
    form = format_of(wish.format)
    settled(form, wish.options)
    state = ExportState(
        identifier=secrets.token_hex(8), session=session.name, run=run.name, format=form.name, state="running"
    )
    doors.exports[state.identifier] = state
    doors.stops[state.identifier] = threading.Event()
    while len(doors.exports) > KEPT:
        doors.exports.pop(next(iter(doors.exports)))
    job = asyncio.create_task(asyncio.to_thread(_export, doors, state.identifier, session, run, form, wish))
    doors.jobs.add(job)
    job.add_done_callback(doors.jobs.discard)
    return state


@router.get("/exports/{identifier}")
def export_state(identifier: str, doors: Door) -> ExportState:
    """How an export stands, and what came of it."""
    state = doors.exports.get(identifier)
    if state is None:
        raise NotFoundError(f"There is no export '{identifier[:40]}' under way.", "Begin a new one.")
    return state


@router.delete("/exports/{identifier}", status_code=202)
def cancel_export(identifier: str, doors: Door) -> ExportState:
    """Stop an export; nothing of it is kept."""
    state = export_state(identifier, doors)
    if identifier in doors.stops:
        doors.stops[identifier].set()
    return state


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


def _export(
    doors: Doors, identifier: str, session: Session, run: StoredRun, form: ExportFormat, wish: ExportRequest
) -> None:
    """Export in this thread, keeping the state up to date; never raises."""
    stop, began, told = doors.stops[identifier], time.monotonic(), 0.0

    def tell(**changes: object) -> None:
        state = doors.exports.get(identifier)
        if state is not None:
            doors.exports[identifier] = state = state.model_copy(update=changes)
            message: dict[str, object] = {"type": "export", "session": session.name, "run": run.name}
            doors.events.publish(message | state.model_dump())

    def report(step: str, done: int, total: int) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told < SECONDS_BETWEEN and done < total:
            return
        told = now
        left = (now - began) * (total - done) / done if done else None
        tell(step=step, done=done, total=total, seconds_left=left)

    try:
        kept = export_into_run(
            session,
            run,
            form,
            wish.options,
            progress=report,
            cancelled=stop.is_set,
            record_scene=doors.stage.record_scene,
        )
    except ExportCancelledError as error:
        tell(state="cancelled", code=error.code, message=error.message, hint=error.hint)
        return
    except StudioError as error:
        tell(state="failed", code=error.code, message=error.message, hint=error.hint)
        return
    except Exception as error:
        log.exception("export of '%s' of '%s' failed", run.name, session.name)
        wrong = UnforeseenError(f"The export failed: {type(error).__name__}.", f"See '{doors.log_path}'.")
        tell(state="failed", code=wrong.code, message=wrong.message, hint=wrong.hint)
        return
    finally:
        doors.stops.pop(identifier, None)
    tell(state="done", result=ExportLine.model_validate(kept))
