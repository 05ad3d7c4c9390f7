"""Live cameras and their recordings, as OpenAPI shows them."""

from typing import Literal

from pydantic import Field

from studio.jobs.camera_service import RecordingState
from studio.server.schemas import Answer, Number, Request

Knob = bool | int | float | str


class CameraRequest(Request):
    """A camera: its name in the calibration, and http://… (MJPEG), rtsp://…, /dev/video0 or the path of a video to be
    replayed. Names and passwords in it are neither shown nor logged.
    """

    name: str = Field(min_length=1, max_length=40)
    address: str = Field(min_length=1, max_length=2000)


class PreviewRequest(Request):
    """The cameras to look at, instead of those before; none closes all."""

    cameras: list[CameraRequest] = Field(max_length=16)


class LiveCameraView(Answer):
    """A camera now. state: connecting, running, stopped, ended. age: seconds since its last picture."""

    name: str
    shown: str
    state: Literal["connecting", "running", "stopped", "ended"]
    seconds: float
    age: Number
    fps: float
    pictures: int
    width: int
    height: int
    message: str
    attempts: int


class SpreadView(Answer):
    """How far apart the pictures of the last sets came, ms. apart: sets of more than half a frame, of `sets`."""

    median: Number
    most: Number
    worst: Number
    apart: int
    sets: int
    lagging: str


class CamerasView(Answer):
    """The cameras that are open, and the last recording."""

    cameras: list[LiveCameraView]
    spread: SpreadView
    fps: float
    recording: RecordingState | None
