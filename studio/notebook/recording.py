"""Live cameras, recorded all at once."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from studio.capture.camera_addresses import address_from_text, check_names
from studio.errors import FootageError
from studio.notebook.opening import SessionName
from studio.notebook.progress import Told, told
from studio.progress import Progress
from studio.sessions.recordings import SpreadFigures, calibration_given, check_cameras, import_recording
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace
from studio.worker.camera_readers import CameraReaders
from studio.worker.stream_recording import StreamRecording, recording_folder

LOOK_SECONDS = 0.2


@dataclass(frozen=True, slots=True)
class Recorded:
    """What was recorded. spread : of the pictures of a frame over time. notes : for a person, warnings last."""

    session: Session
    spread: SpreadFigures
    notes: tuple[str, ...]


def record(
    cameras: Mapping[str, str],
    into: str | Path,
    calibration: SessionName,
    *,
    seconds: float | None = None,
    fps: float = 0.0,
    progress: Told = None,
) -> Recorded:
    """Record live cameras all at once into a session, each picture with the time at which it came.

    cameras : by their names in the calibration, addresses: http://… (MJPEG), rtsp://…, /dev/video0, or a video to be
    replayed. calibration : a file or folder, or a session that has it. seconds : for so long; default until the streams
    end or Ctrl-C (a notebook's stop button), which ends the recording and keeps it. fps : default as measured. Raises
    FootageError, SessionError.
    """
    place = Workspace().place_for(into)
    known = _calibration(calibration)
    if not cameras:
        raise FootageError(
            "No camera was given.", "Give each by its name in the calibration, with its address."
        )
    addresses = [address_from_text(f"{name}={address}", replays=True) for name, address in cameras.items()]
    check_names(addresses)
    check_cameras(known, list(cameras))
    folder = recording_folder(place)
    with told(progress, f"{place.name}: recording") as report:
        with CameraReaders(addresses) as readers:
            readers.await_pictures()
            recording = StreamRecording(readers, folder, fps or readers.await_rate())
            try:
                _until(recording, seconds, report)
            except KeyboardInterrupt:
                report("stopped", 0, 0)
            finally:
                standing = recording.close()
        found, spread = import_recording(folder, place, known, standing.notes, report)
    return Recorded(found.session, spread, (*found.notes, *found.warnings))


def _calibration(given: SessionName) -> Path:
    """The calibration's file: of a session by name or value, else as it is given."""
    return calibration_given(given.path if isinstance(given, Session) else given, Workspace())


def _until(recording: StreamRecording, seconds: float | None, report: Progress) -> None:
    """Record for so long, or until it ends by itself."""
    began = time.monotonic()
    while seconds is None or time.monotonic() - began < seconds:
        if recording.wait(LOOK_SECONDS):
            return
        standing = recording.standing
        total = round(seconds) if seconds else 0
        report(standing.in_words, min(total, round(standing.seconds)), total)
