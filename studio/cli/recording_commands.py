"""`studio record`, and what `studio live --camera` does."""

import time
from pathlib import Path

import click

from studio.capture.camera_addresses import CameraAddress, address_from_text, check_names
from studio.cli.output import command, note, progress
from studio.errors import FootageError, SessionError
from studio.sessions.recordings import calibration_given, check_cameras, import_recording
from studio.sessions.workspace import Workspace
from studio.worker.camera_readers import CameraReaders
from studio.worker.stream_recording import RecordingStanding, StreamRecording, recording_folder

LOOK_SECONDS = 0.2
CAMERA_OPTION = click.option(
    "--camera",
    "cameras",
    multiple=True,
    metavar="NAME=ADDRESS",
    help="A camera by its name in the calibration: http://… (MJPEG), rtsp://…, /dev/video0, or a video to be replayed"
    " (repeatable).",
)


@click.command()
@CAMERA_OPTION
@click.option("--seconds", type=float, help="For so long; default: until Ctrl-C.")
@click.option("--into", required=True, metavar="SESSION", help="Name or path of the session that is made.")
@click.option(
    "--calibration",
    required=True,
    metavar="CALIBRATION|SESSION",
    help="The cameras' calibration, a file or folder; or a session that has it, by its name or folder.",
)
@click.option("--fps", type=float, default=0.0, help="Pictures a second; default: as measured.")
@click.option("--finish", type=click.Path(path_type=Path, exists=True, file_okay=False), metavar="FOLDER",
              help="Make a session of a recording that was cut off.")  # fmt: skip
@command
def record(
    cameras: tuple[str, ...],
    seconds: float | None,
    into: str,
    calibration: str,
    fps: float,
    finish: Path | None,
) -> dict[str, object]:
    """Record live cameras all at once into a session, each picture with the time at which it came.

    What is recorded lies in a folder beside the session until it is imported; a kill or a full disk loses less than a
    second of it, and --finish makes a session of the rest.
    """
    place = Workspace().place_for(into)
    if place.exists():
        raise SessionError(f"There is something at '{place}' already.", "Choose another name.")
    known = calibration_given(calibration, Workspace())
    if finish is not None:
        return _imported(finish, place, known, None)
    addresses = addresses_of(cameras)
    check_cameras(known, [address.name for address in addresses])
    folder = recording_folder(place)
    with CameraReaders(addresses) as readers:
        note("Waiting for the cameras.")
        readers.await_pictures()
        for one in readers.cameras.standings:
            note(f"{one.name}: {one.width}x{one.height}, {one.shown}")
        recording = StreamRecording(readers, folder, fps or readers.await_rate())
        try:
            _until(recording, seconds)
        except KeyboardInterrupt:
            note("Stopped.")
        finally:
            standing = recording.close()
    return _imported(folder, place, known, standing)


def addresses_of(cameras: tuple[str, ...]) -> list[CameraAddress]:
    """Cameras from the command line. Raises FootageError."""
    if not cameras:
        raise FootageError("No camera was given.", "Give each with --camera NAME=ADDRESS.")
    addresses = [address_from_text(text, replays=True) for text in cameras]
    check_names(addresses)
    return addresses


def _until(recording: StreamRecording, seconds: float | None) -> None:
    """Record for so long, or until it ends by itself."""
    began = time.monotonic()
    stopped: set[str] = set()
    with progress("recording") as report:
        while seconds is None or time.monotonic() - began < seconds:
            if recording.wait(LOOK_SECONDS):
                return
            standing = recording.standing
            for one in standing.cameras:
                if one.state == "stopped" and one.name not in stopped:
                    note(f"{one.in_words}. {one.message}")
            stopped = {one.name for one in standing.cameras if one.state == "stopped"}
            total = round(seconds) if seconds else 0
            report(standing.in_words, min(total, round(standing.seconds)), total)


def _imported(
    folder: Path, place: Path, calibration: Path, standing: RecordingStanding | None
) -> dict[str, object]:
    """The session of a recording, told."""
    notes = standing.notes if standing else ()
    with progress(f"{place.name}: importing") as report:
        found, spreads = import_recording(folder, place, calibration, notes, report)
    for line in (*found.notes, *found.warnings):
        note(line)
    footage = found.session.manifest.footage
    told: dict[str, object] = {
        "session": found.session.name,
        "frames": footage.frame_count,
        "fps": footage.fps,
        "offsets": {camera.name: camera.offset for camera in footage.cameras},
        "spread_ms": {"median": spreads.median, "p95": spreads.most, "worst": spreads.worst},
        "apart": spreads.apart,
        "lagging": spreads.lagging,
        "warnings": list(found.warnings),
    }
    if standing is not None:
        told["cameras"] = {
            name: {
                "pictures": one.pictures,
                "repeated": one.repeated,
                "left_out": one.left_out,
                "missed": standing.missed[name],
            }
            for name, one in standing.figures.items()
        }
    words = f"{found.session.name}: {footage.frame_count} frames of {len(footage.cameras)} cameras at {footage.fps:g}"
    return {**told, "text": f"{words} a second; {spreads.in_words}"}
