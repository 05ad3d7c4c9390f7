"""Live cameras: looked at, recorded, tracked. One set of cameras at a time; `recording` events tell of progress.

Cameras in the local network may be asked, the studio's own ports may not; files only from the folders that footage may
be taken from.
"""

import asyncio
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from pydantic import Field

from studio.capture.camera_addresses import CameraAddress, camera_address, without_own
from studio.capture.stream_files import preview_jpeg
from studio.errors import NotFoundError
from studio.operations.tracking import live
from studio.sessions.names import PathRefused
from studio.sessions.recordings import calibration_given
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.web.camera_schemas import (
    CamerasView,
    CameraWish,
    LiveCameraView,
    PreviewWish,
    SpreadView,
)
from studio.web.doors import Door, Doors
from studio.web.requests import Asked, body_of
from studio.web.safe_paths import folder_to_import
from studio.web.schemas import RunName
from studio.worker.camera_service import RecordingState
from studio.worker.camera_tracking import TakeWish
from studio.worker.commands import Start, about

router = APIRouter(prefix="/api", tags=["cameras"])

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
def cameras(doors: Door) -> CamerasView:
    """The cameras that are open: state, rate, age of the last picture, how far apart their pictures come."""
    return _view(doors)


@router.post("/cameras/preview")
async def preview(wish: PreviewWish, request: Request, doors: Door) -> CamerasView:
    """Open these cameras instead of those before. They close when nobody asks for them for a while."""
    server = request.scope.get("server") or ("", 0)
    ports = {int(server[1] or 0), *(scene.port for scene in doors.scenes.open_scenes().values())}
    addresses = [_address(one, doors) for one in wish.cameras]
    await asyncio.to_thread(_open, doors, addresses, ports)
    return _view(doors)


@router.get("/cameras/{name}.jpg", response_class=Response)
def picture(
    name: str,
    doors: Door,
    height: Annotated[int | None, Query(ge=16, le=4320, description="Empty: as it came.")] = None,
) -> Response:
    """A camera's last picture (JPEG)."""
    shot = doors.cameras.newest(name)
    return Response(
        preview_jpeg(shot, height), media_type="image/jpeg", headers={"cache-control": "no-store"}
    )


@router.get("/recordings")
def recording(doors: Door) -> RecordingState:
    """The recording that is under way, or the last one."""
    found = doors.cameras.standing.recording
    if found is None:
        raise NotFoundError("Nothing was recorded yet.", "Begin a recording.")
    return found


@router.post("/recordings", status_code=202)
async def begin(
    asked: Annotated[Asked, body_of(live, "RecordingWish", only=TRACKED, **RECORDED)], doors: Door
) -> RecordingState:
    """Record the open cameras into a new session; with `track` follow the body at once."""
    base = doors.workspace.session(asked.more["calibration"])
    place = doors.workspace.place_for(asked.more["name"])
    if not asked.more["track"]:
        calibration = calibration_given(base.path)
        return await asyncio.to_thread(doors.cameras.record, place, calibration, asked.get("seconds"))
    request = {name: asked[name] for name in asked if name in OF_RUN} | {"live": True}

    def track(session: Session, run: StoredRun) -> None:
        doors.control.send(Start(**about(run.folder)))
        doors.events.session_changed(session.name)

    take = TakeWish(place, asked.get("seconds"), keep_start=asked["keep_start"])
    begun = await asyncio.to_thread(doors.cameras.track, base, take, request, track)
    return begun


@router.post("/recordings/stop", status_code=202)
def stop(doors: Door) -> RecordingState:
    """End the recording; it becomes a session in the background."""
    found = doors.cameras.stop()
    if found is None:
        raise NotFoundError("Nothing is being recorded.", "Begin a recording.")
    return found


def _address(wish: CameraWish, doors: Doors) -> CameraAddress:
    """A camera that a page asked for. Raises FootageError, PathRefused."""
    text = wish.address.strip()
    if "://" in text or text.startswith("/dev/"):
        return camera_address(wish.name, text)
    path = Path(text).expanduser()
    if not path.is_absolute():
        raise PathRefused(
            f"'{text[:80]}' is no camera's address and no full path.",
            "Give http://…, rtsp://… or /dev/video0.",
        )
    folder = folder_to_import(str(path.parent), doors.footage_roots)
    return camera_address(wish.name, str(folder / path.name), replays=True)


def _open(doors: Doors, addresses: list[CameraAddress], ports: set[int]) -> None:
    doors.cameras.open([without_own(address, ports) for address in addresses])


def _view(doors: Doors) -> CamerasView:
    standing = doors.cameras.standing
    return CamerasView(
        cameras=[LiveCameraView.model_validate(one) for one in standing.cameras],
        spread=SpreadView.model_validate(standing.spreads),
        fps=standing.fps,
        recording=standing.recording,
    )
