"""Live cameras tracked and recorded at once, in this process: for commands and scripts."""

import contextlib
import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio.footage.capture.camera_addresses import CameraAddress
from studio.foundations.errors import RunError, StudioError
from studio.foundations.progress import Progress
from studio.operations.jobs.camera_readers import CameraReaders
from studio.operations.jobs.live_tracking import track_live
from studio.operations.jobs.send_addresses import SendAddress
from studio.operations.jobs.set_recording import SetRecording, SetStanding
from studio.runs.live.live_summary import LiveSummary
from studio.runs.new_run import prepare_run
from studio.sessions.live_recordings import begin_recording
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LONGEST_SECONDS = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class TrackedCameras:
    """session : what was recorded. standing : of its recording, at the end."""

    session: Session
    run: StoredRun
    summary: LiveSummary
    standing: SetStanding


@dataclass(frozen=True, slots=True)
class LiveRecordingRequest:
    """into : where the session is made. seconds : at most, None for an hour. fps : sets a second, 0 as measured.

    keep_start : the person begins in the session's start pose; else that is searched in the first set. send_to : where
    poses are sent; None: as the environment says.
    """

    into: Path
    seconds: float | None = None
    fps: float = 0.0
    keep_start: bool = True
    send_to: Sequence[SendAddress] | None = None


def open_recording(base: Session, readers: CameraReaders, request: LiveRecordingRequest) -> SetRecording:
    """Begin a recording of cameras that run, its first set recorded. Raises StudioError; then nothing is left of it."""
    seconds = LONGEST_SECONDS if request.seconds is None else request.seconds
    if not (math.isfinite(seconds) and 0.0 < seconds <= 24 * LONGEST_SECONDS):
        raise RunError(f"A recording cannot last {seconds:g} seconds.", "Give a number above 0.")
    readers.await_pictures()
    fps = request.fps or readers.await_rate()
    names = readers.cameras.names
    frames = math.ceil(seconds * fps) + 1
    session = begin_recording(base, request.into, names, fps, frames, keep_start=request.keep_start)
    recording = SetRecording(readers, session)
    try:
        recording.await_first()
    except BaseException:
        discard_recording(recording)
        raise
    return recording


def discard_recording(recording: SetRecording) -> None:
    """End a recording from which nothing came, and remove it."""
    with contextlib.suppress(StudioError):
        recording.close()
    shutil.rmtree(recording.session.path, ignore_errors=True)


def track_cameras(
    base: Session,
    addresses: Sequence[CameraAddress],
    request: LiveRecordingRequest,
    run: Mapping[str, Any],
    report: Progress,
) -> TrackedCameras:
    """Track what cameras see with a session's calibration, empty room and person, and keep it as a session of its own.

    run : of the live run, as `prepare_run` takes it. report : how it goes. Raises StudioError;
    KeyboardInterrupt is passed on, what was tracked is kept.
    """
    with CameraReaders(addresses) as opened:
        report("waiting for the cameras", 0, 1)
        recording = open_recording(base, opened, request)
        try:
            made = prepare_run(recording.session, **run, progress=report)
        except BaseException:
            discard_recording(recording)
            raise
        words = _Words(recording, report)
        try:
            summary = track_live(recording.session, made, words, send_to=request.send_to)
        finally:
            session = recording.close()
    return TrackedCameras(session, session.run(made.name), summary, recording.standing)


class _Words:
    """Reports of the tracker with what is to be said of the cameras."""

    def __init__(self, recording: SetRecording, report: Progress) -> None:
        self._recording, self._report = recording, report

    def __call__(self, step: str, done: int, total: int) -> None:
        standing = self._recording.standing
        self._report(f"{step} · {standing.in_words}" if standing.seconds else step, done, total)
