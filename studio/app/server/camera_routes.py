"""Live cameras: looked at, recorded, tracked. One set of cameras at a time; `recording` events report progress.

Cameras in the local network may be read, the studio's own ports may not; files only from the folders that footage may
be taken from.
"""

import asyncio
from pathlib import Path
from typing import Annotated, Any

from fastapi import Query
from fastapi import Request as HttpRequest
from fastapi.responses import Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.requests import Arguments, body_of
from studio.app.server.safe_paths import folder_to_import
from studio.app.server.schemas import Request, RunName
from studio.footage.capture.camera_addresses import DEVICE
from studio.foundations.errors import NotFoundError
from studio.operations.jobs.camera_service import CamerasStanding, RecordingState
from studio.operations.jobs.camera_tracking import LiveRecordingRequest
from studio.operations.jobs.commands import Start, about
from studio.operations.tracking import live
from studio.sessions.names import PathRefused
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = Router(prefix="/api", tags=["cameras"])


class CameraRequest(Request):
    """A camera: its name in the calibration, and http://… (MJPEG), rtsp://…, /dev/video0 or the path of a video to be
    replayed. Names and passwords in it are neither shown nor logged.
    """

    name: str = Field(min_length=1, max_length=40)
    address: str = Field(min_length=1, max_length=2000)


class CamerasRequest(Request):
    """The cameras to look at, instead of those before; none closes all."""

    cameras: list[CameraRequest] = Field(max_length=16)


OF_RUN = ("tracker", "weighting", "body", "behaviour", "seed", "knobs")
TRACKED = ("seconds", "keep_start", *OF_RUN)
RECORDED: dict[str, Any] = {
    "name": (RunName, Field(description="Of the session that is made.")),
    "calibration": (str, Field(description="A session whose calibration is taken.")),
    "track": (
        bool,
        Field(False, description="Follow the body at once, with that session's person and room."),
    ),
}


@router.get("/cameras")
def cameras(app: App) -> CamerasStanding:
    """The cameras that are open: state, rate, age of the last picture, how far apart their pictures come."""
    return app.cameras.standing


@router.post("/cameras/preview")
async def preview(request: CamerasRequest, http: HttpRequest, app: App) -> CamerasStanding:
    """Open these cameras instead of those before. They close when they are not read for a while."""
    server = http.scope.get("server") or ("", 0)
    ports = {int(server[1] or 0), *(scene.port for scene in app.scenes.open_scenes().values())}
    cameras = [(one.name, _place(one.address.strip(), app)) for one in request.cameras]
    await asyncio.to_thread(app.cameras.open, cameras, ports)
    return app.cameras.standing


@router.get("/cameras/{name}.jpg", response_class=Response)
def picture(
    name: str,
    app: App,
    height: Annotated[int | None, Query(ge=16, le=4320, description="Empty: as it came.")] = None,
) -> Response:
    """A camera's last picture (JPEG)."""
    return files.picture(app.cameras.picture(name, height))


@router.get("/recordings")
def recording(app: App) -> RecordingState:
    """The recording that is under way, or the last one."""
    last = app.cameras.standing.recording
    if last is None:
        raise NotFoundError("Nothing was recorded yet.", "Begin a recording.")
    return last


@router.post("/recordings", status_code=202)
async def begin(
    arguments: Annotated[Arguments, body_of(live, "RecordingRequest", only=TRACKED, **RECORDED)], app: App
) -> RecordingState:
    """Record the open cameras into a new session; with `track` follow the body at once."""
    base = app.workspace.session(arguments.more["calibration"])
    place = app.workspace.place_for(arguments.more["name"])
    if not arguments.more["track"]:
        return await asyncio.to_thread(app.cameras.record, base, place, arguments.get("seconds"))
    run_options = {name: arguments[name] for name in arguments if name in OF_RUN} | {"live": True}

    def track(session: Session, run: StoredRun) -> None:
        app.control.send(Start(**about(run.folder)))
        app.events.session_changed(session.name)

    recording = LiveRecordingRequest(place, arguments.get("seconds"), keep_start=arguments["keep_start"])
    return await asyncio.to_thread(app.cameras.track, base, recording, run_options, track)


@router.post("/recordings/stop", status_code=202)
def stop(app: App) -> RecordingState:
    """End the recording; it becomes a session in the background."""
    stopped = app.cameras.stop()
    if stopped is None:
        raise NotFoundError("Nothing is being recorded.", "Begin a recording.")
    return stopped


def _place(text: str, app: AppState) -> str:
    """Where a camera is that a page names, a video only where footage may be taken from. Raises PathRefused."""
    if text.partition("://")[0] not in ("", text) or DEVICE.fullmatch(text):
        return text
    path = Path(text).expanduser()
    if not path.is_absolute():
        raise PathRefused(
            f"'{text[:80]}' is no camera's address and no full path.",
            "Give http://…, rtsp://… or /dev/video0.",
        )
    return str(folder_to_import(str(path.parent), app.footage_roots) / path.name)
