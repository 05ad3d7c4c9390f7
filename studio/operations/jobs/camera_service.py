"""Where live cameras are looked at, recorded and tracked from for the page: one set of cameras at a time."""

import contextlib
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, FiniteFloat

from studio.footage.capture.camera_addresses import camera_address, without_own
from studio.footage.capture.live_cameras import CameraStanding, SpreadFigures
from studio.footage.capture.stream_files import preview_jpeg
from studio.foundations.errors import NotFoundError, RunError, StudioError
from studio.foundations.words import counted
from studio.operations.jobs.camera_readers import CameraReaders
from studio.operations.jobs.camera_tracking import LiveRecordingRequest, discard_recording, open_recording
from studio.operations.jobs.job_runner import Job, JobKind, JobRunner, SessionJob
from studio.operations.jobs.stream_recording import RecordingStanding, StreamRecording, recording_folder
from studio.runs.new_run import prepare_run
from studio.sessions.recordings import calibration_given, check_cameras, import_recording
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

IDLE_SECONDS = 90.0
"""Cameras that are neither looked at nor recorded are closed after so long."""
TELL_SECONDS = 0.25
GETTING_READY, RECORDING, IMPORTING = "getting ready", "recording", "importing"


class RecordingState(SessionJob):
    """How a recording stands. kind: "record" or "track". session: that it becomes; run: that is tracked, "" without.
    step: getting ready, recording, importing. words: how it stands, in short. notes: what a person should know of it.
    """

    kind: str
    run: str = ""
    seconds: float = 0.0
    limit: float | None = None
    words: str = ""
    notes: tuple[str, ...] = ()


RECORDINGS = JobKind(
    "recording",
    "recording",
    RecordingState,
    changes_session=True,
    makes_session=True,
    busy="The cameras are being recorded.",
)


@dataclass(frozen=True, slots=True)
class CamerasStanding:
    """cameras : those that are open, spreads : of their pictures. recording : the last one, None before the first."""

    cameras: tuple[CameraStanding, ...]
    spreads: Annotated[SpreadFigures, Field(serialization_alias="spread")]
    fps: FiniteFloat
    recording: RecordingState | None


# Called when a recording's run is ready to be tracked, in the job's thread.
OnRun = Callable[[Session, StoredRun], None]


class CameraService:
    """The cameras that are open. jobs : where recordings run. idle : seconds until they are closed."""

    def __init__(self, jobs: JobRunner, idle: float = IDLE_SECONDS) -> None:
        self._jobs, self._idle = jobs, idle
        self._lock = threading.Lock()
        self._readers: CameraReaders | None = None
        self._timer: threading.Timer | None = None
        self._stop = threading.Event()
        self._after = 0.0

    def open(self, cameras: Sequence[tuple[str, str]], own_ports: Collection[int] = ()) -> None:
        """Look at these cameras instead of those before.

        cameras : name in the calibration and address of each; whoever asks may read a video that is named.
        own_ports : the studio's, where no camera is.
        Raises RunError while cameras are recorded, FootageError.
        """
        self._jobs.check_free(RECORDINGS)
        addresses = [camera_address(name, place, replays=True) for name, place in cameras]
        kept_off = [without_own(address, own_ports) for address in addresses]
        readers = CameraReaders(kept_off) if kept_off else None
        with self._lock:
            before, self._readers = self._readers, readers
        if before is not None:
            before.stop()
        self._keep_open()

    @property
    def standing(self) -> CamerasStanding:
        """How all stands; also pairs the newest pictures, so that their spread is known before anything is recorded."""
        self._keep_open()
        readers, recording = self._readers, self._jobs.last(RECORDINGS)
        if readers is None:
            nan = float("nan")
            return CamerasStanding((), SpreadFigures(nan, nan, nan, 0, 0, ""), 0.0, recording)
        if recording is None or not recording.state.is_going:
            newest = readers.cameras.newest_set(self._after)
            if newest is not None:
                self._after = max(shot.came for shot in newest.shots.values())
        cameras = readers.cameras
        return CamerasStanding(cameras.standings, cameras.spreads, cameras.fps, recording)

    def picture(self, name: str, height: int | None = None) -> bytes:
        """A camera's last picture as JPEG, at most so many pixels high. Raises NotFoundError."""
        self._keep_open()
        for camera in self._readers.cameras.cameras if self._readers else ():
            if camera.name == name and camera.newest is not None:
                return preview_jpeg(camera.newest, height)
        raise NotFoundError(f"Camera '{name[:40]}' shows no picture.", "Add it, and wait until it runs.")

    def record(self, base: Session, place: Path, seconds: float | None) -> RecordingState:
        """Record the cameras into a session at `place`, with the calibration of another one.

        Raises RunError, FootageError.
        """
        calibration = calibration_given(base.path)
        readers = self._free_readers(place)
        check_cameras(calibration, readers.cameras.names)
        folder = recording_folder(place)

        def work(job: Job) -> dict[str, object]:
            standing = self._record(job, readers, folder, seconds)
            report, spreads = import_recording(folder, place, calibration, standing.notes)
            return {"step": "", "words": spreads.in_words, "notes": report.warnings}

        return self._begin(RecordingState(kind="record", session=place.name, limit=seconds), work)

    def track(
        self, base: Session, request: LiveRecordingRequest, wanted: Mapping[str, Any], on_run: OnRun
    ) -> RecordingState:
        """Record the cameras into a session and hand its live run to the tracker. Raises RunError, FootageError."""
        readers = self._free_readers(request.into)
        return self._begin(
            RecordingState(kind="track", session=request.into.name, limit=request.seconds),
            lambda job: self._track(job, readers, base, request, wanted, on_run),
        )

    def stop(self) -> RecordingState | None:
        """End the recording; what it becomes is still to be made."""
        self._stop.set()
        return self._jobs.last(RECORDINGS)

    def close(self) -> None:
        """Let go of the cameras, after their recordings."""
        with self._lock:
            readers, self._readers = self._readers, None
            if self._timer is not None:
                self._timer.cancel()
        if readers is not None:
            readers.close()

    # ------------------------------------------------------------------ in the job's thread

    def _begin(self, first: RecordingState, work: Callable[[Job], dict[str, object]]) -> RecordingState:
        def guarded(job: Job) -> dict[str, object]:
            try:
                return work(job)
            except OSError as problem:
                raise StudioError(f"The disk refused ({problem.strerror}).", "Make room on it.") from problem

        self._jobs.check_free(RECORDINGS)
        self._stop.clear()
        return self._jobs.begin(RECORDINGS, first.model_copy(update={"step": GETTING_READY}), guarded)

    def _record(
        self, job: Job, readers: CameraReaders, folder: Path, seconds: float | None
    ) -> RecordingStanding:
        """Record until it is to end; how it went."""
        readers.await_pictures()
        recording = StreamRecording(readers, folder, readers.await_rate())
        try:
            began = time.monotonic()
            while not self._is_over(job) and (seconds is None or time.monotonic() - began < seconds):
                standing = recording.standing
                job.change(step=RECORDING, seconds=standing.seconds, words=standing.in_words)
                if recording.wait(TELL_SECONDS):
                    break
        finally:
            standing = recording.close()
        job.change(step=IMPORTING, seconds=standing.seconds, words=standing.in_words)
        return standing

    def _track(
        self,
        job: Job,
        readers: CameraReaders,
        base: Session,
        request: LiveRecordingRequest,
        wanted: Mapping[str, Any],
        on_run: OnRun,
    ) -> dict[str, object]:
        recording = open_recording(base, readers, request)
        try:
            run = prepare_run(recording.session, **wanted)
            on_run(recording.session, run)
        except BaseException:
            discard_recording(recording)
            raise
        job.change(run=run.name)
        try:
            while not self._is_over(job) and not recording.standing.ended:
                standing = recording.standing
                step = RECORDING if standing.seconds else GETTING_READY
                job.change(step=step, seconds=standing.seconds, words=standing.in_words)
                self._stop.wait(TELL_SECONDS)
        finally:
            recording.close()
        standing = recording.standing
        words = (
            f"{counted(standing.sets, 'set of pictures', 'sets of pictures')}; {standing.spreads.in_words}"
        )
        return {"step": "", "words": words, "notes": [notice.in_words for notice in standing.notices]}

    def _is_over(self, job: Job) -> bool:
        return self._stop.is_set() or job.cancelled()

    # ------------------------------------------------------------------ state

    def _free_readers(self, place: Path) -> CameraReaders:
        self._jobs.check_free(RECORDINGS)
        if self._readers is None:
            raise RunError("No camera is open.", "Add cameras first.")
        if place.exists():
            raise RunError(f"There is a session '{place.name}' already.", "Choose another name.")
        return self._readers

    def _keep_open(self) -> None:
        """The cameras are looked at: they stay open for another while."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if self._readers is not None:
                self._timer = threading.Timer(self._idle, self._leave)
                self._timer.daemon = True
                self._timer.start()

    def _leave(self) -> None:
        """Close the cameras, unless they are recorded."""
        if self._jobs.going(RECORDINGS):
            self._keep_open()
            return
        with contextlib.suppress(StudioError):
            self.open(())
