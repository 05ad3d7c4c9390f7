"""Where live cameras are looked at, recorded and tracked from for the page: one set of cameras at a time."""

import contextlib
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from studio.capture.camera_addresses import CameraAddress
from studio.capture.camera_sets import SpreadFigures
from studio.capture.camera_streams import Shot
from studio.capture.live_cameras import CameraStanding
from studio.errors import NotFoundError, RunError, StudioError
from studio.runs.new_run import prepare_run
from studio.sessions.recordings import check_cameras, import_recording
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.worker.camera_readers import CameraReaders
from studio.worker.camera_tracking import TakeWish, discard_take, open_take
from studio.worker.stream_recording import StreamRecording, recording_folder

IDLE_SECONDS = 90.0
"""Cameras that nobody looks at or records are closed after so long."""
TELL_SECONDS = 0.25


@dataclass(frozen=True, slots=True)
class DeskRecording:
    """A recording as the page sees it. kind : "record" or "track". state : "getting ready", "recording", "importing",
    "done" or "failed". session : that it becomes; run : that is tracked, "" without. words : how it stands, in short.
    notes : what a person should know of it. message, hint : what went wrong.
    """

    kind: str
    session: str
    state: str
    seconds: float = 0.0
    limit: float | None = None
    run: str = ""
    words: str = ""
    notes: tuple[str, ...] = ()
    message: str = ""
    hint: str = ""

    @property
    def going(self) -> bool:
        """Whether it is under way."""
        return self.state in ("getting ready", "recording", "importing")


@dataclass(frozen=True, slots=True)
class DeskStanding:
    """cameras : those that are open, spreads : of their pictures. recording : the last one, None before the first."""

    cameras: tuple[CameraStanding, ...]
    spreads: SpreadFigures
    fps: float
    recording: DeskRecording | None


# Told when a take's run is ready to be tracked, in the desk's thread.
OnRun = Callable[[Session, StoredRun], None]


class CameraDesk:
    """tell : called with every change of a recording, in any thread."""

    def __init__(self, tell: Callable[[DeskRecording], None], idle: float = IDLE_SECONDS) -> None:
        self._tell, self._idle = tell, idle
        self._lock = threading.Lock()
        self._readers: CameraReaders | None = None
        self._recording: DeskRecording | None = None
        self._thread: threading.Thread | None = None
        self._timer: threading.Timer | None = None
        self._stop = threading.Event()
        self._after = 0.0

    def open(self, addresses: Sequence[CameraAddress]) -> None:
        """Look at these cameras instead of those before. Raises RunError while they are recorded, FootageError."""
        self._check_free()
        readers = CameraReaders(addresses) if addresses else None
        with self._lock:
            before, self._readers = self._readers, readers
        if before is not None:
            before.stop()
        self._asked()

    @property
    def standing(self) -> DeskStanding:
        """How all stands; also pairs the newest pictures, so that their spread is known before anything is recorded."""
        self._asked()
        readers = self._readers
        if readers is None:
            return DeskStanding(
                (), SpreadFigures(float("nan"), float("nan"), float("nan"), 0, 0, ""), 0.0, self._recording
            )
        if self._recording is None or not self._recording.going:
            found = readers.cameras.newest_set(self._after)
            if found is not None:
                self._after = max(shot.came for shot in found.shots.values())
        cameras = readers.cameras
        return DeskStanding(cameras.standings, cameras.spreads, cameras.fps, self._recording)

    def newest(self, name: str) -> Shot:
        """A camera's last picture. Raises NotFoundError."""
        self._asked()
        for camera in self._readers.cameras.cameras if self._readers else ():
            if camera.name == name and camera.newest is not None:
                return camera.newest
        raise NotFoundError(f"Camera '{name[:40]}' shows no picture.", "Add it, and wait until it runs.")

    def record(self, place: Path, calibration: Path, seconds: float | None) -> DeskRecording:
        """Record the cameras into a session at `place`. Raises RunError, FootageError."""
        readers = self._free_readers(place)
        check_cameras(calibration, readers.cameras.names)
        folder = recording_folder(place)
        return self._begin(
            DeskRecording("record", place.name, "getting ready", limit=seconds),
            lambda: self._record(readers, folder, place, calibration, seconds),
        )

    def track(self, base: Session, wish: TakeWish, wanted: Mapping[str, Any], on_run: OnRun) -> DeskRecording:
        """Record the cameras into a take and hand its live run to whoever tracks. Raises RunError, FootageError."""
        readers = self._free_readers(wish.into)
        return self._begin(
            DeskRecording("track", wish.into.name, "getting ready", limit=wish.seconds),
            lambda: self._track(readers, base, wish, wanted, on_run),
        )

    def stop(self) -> DeskRecording | None:
        """End the recording; what it becomes is still to be made."""
        self._stop.set()
        return self._recording

    def close(self) -> None:
        """End everything."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        with self._lock:
            readers, self._readers = self._readers, None
            if self._timer is not None:
                self._timer.cancel()
        if readers is not None:
            readers.close()

    # ------------------------------------------------------------------ in the desk's thread

    def _begin(self, first: DeskRecording, work: Callable[[], None]) -> DeskRecording:
        with self._lock:
            self._check_free()
            self._stop.clear()
            self._set(first)
            self._thread = threading.Thread(target=self._run, args=(work,), name="camera-desk", daemon=True)
        self._thread.start()
        return first

    def _run(self, work: Callable[[], None]) -> None:
        try:
            work()
        except StudioError as problem:
            self._change(state="failed", message=problem.message, hint=problem.hint)
        except OSError as problem:
            self._change(
                state="failed", message=f"The disk refused ({problem.strerror}).", hint="Make room on it."
            )
        except Exception as problem:  # a thread that dies in silence would leave the page waiting
            self._change(
                state="failed",
                message=f"A fault of the studio ({type(problem).__name__}).",
                hint="See its log.",
            )
            raise

    def _record(
        self, readers: CameraReaders, folder: Path, place: Path, calibration: Path, seconds: float | None
    ) -> None:
        readers.await_pictures()
        recording = StreamRecording(readers, folder, readers.await_rate())
        try:
            began = time.monotonic()
            while not self._stop.is_set() and (seconds is None or time.monotonic() - began < seconds):
                standing = recording.standing
                self._change(state="recording", seconds=standing.seconds, words=standing.in_words)
                if recording.wait(TELL_SECONDS):
                    break
        finally:
            standing = recording.close()
        self._change(state="importing", seconds=standing.seconds, words=standing.in_words)
        report, spreads = import_recording(folder, place, calibration, standing.notes)
        self._change(state="done", words=spreads.in_words, notes=report.warnings)

    def _track(
        self, readers: CameraReaders, base: Session, wish: TakeWish, wanted: Mapping[str, Any], on_run: OnRun
    ) -> None:
        recording = open_take(base, readers, wish)
        try:
            run = prepare_run(recording.session, **wanted)
            on_run(recording.session, run)
        except BaseException:
            discard_take(recording)
            raise
        self._change(run=run.name)
        try:
            while not self._stop.wait(TELL_SECONDS) and not recording.standing.ended:
                standing = recording.standing
                state = "recording" if standing.seconds else "getting ready"
                self._change(state=state, seconds=standing.seconds, words=standing.in_words)
        finally:
            recording.close()
        standing = recording.standing
        notes = tuple(notice.in_words for notice in standing.notices)
        self._change(
            state="done", words=f"{standing.sets} sets of pictures; {standing.spreads.in_words}", notes=notes
        )

    # ------------------------------------------------------------------ state

    def _set(self, recording: DeskRecording) -> None:
        self._recording = recording
        self._tell(recording)

    def _change(self, **changes: object) -> None:
        assert self._recording is not None
        self._set(replace(self._recording, **changes))  # pyright: ignore[reportArgumentType]

    def _free_readers(self, place: Path) -> CameraReaders:
        self._check_free()
        if self._readers is None:
            raise RunError("No camera is open.", "Add cameras first.")
        if place.exists():
            raise RunError(f"There is a session '{place.name}' already.", "Choose another name.")
        return self._readers

    def _check_free(self) -> None:
        if self._recording is not None and self._recording.going:
            raise RunError("The cameras are being recorded.", "Stop the recording first.")

    def _asked(self) -> None:
        """Somebody looks: the cameras stay open for another while."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if self._readers is not None:
                self._timer = threading.Timer(self._idle, self._leave)
                self._timer.daemon = True
                self._timer.start()

    def _leave(self) -> None:
        """Nobody looked for long: close the cameras, unless they are recorded."""
        if self._recording is not None and self._recording.going:
            self._asked()
            return
        with contextlib.suppress(StudioError):
            self.open(())
