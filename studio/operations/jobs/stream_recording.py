"""Recording cameras into files, each picture as it comes; imported as a session like any other when it ends.

A writer's thread a camera takes pictures from a queue, so that a slow disk keeps no reader waiting: what the queue
cannot hold is left out and counted. A full disk ends the recording; what was written until then stays.
"""

import errno
import queue
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from studio.footage.capture.camera_streams import Shot
from studio.footage.capture.live_cameras import CameraStanding, LiveCamera
from studio.footage.capture.stream_files import StreamFigures, StreamWriter, TimesFile
from studio.foundations.errors import FootageError, StudioError
from studio.operations.jobs.camera_readers import CameraReaders

WAITING_SHOTS = 60
"""Pictures of a camera that wait for the disk: two seconds at 30 a second."""
LEAST_ROOM = 200_000_000
"""Bytes that a disk must have left when a recording begins, and are left when it ends by itself."""
LOOK_SECONDS = 0.1
FULL = frozenset((errno.ENOSPC, errno.EDQUOT))
VIDEOS = "videos"
OVER = "all replayed videos are over"


@dataclass(frozen=True, slots=True)
class RecordingStanding:
    """A recording at this moment.

    seconds : since it began.
    figures : by camera.
    missed : by camera, pictures that the disk was too slow for.
    bytes : written so far.
    ended : why, "" while it goes on.
    """

    seconds: float
    figures: dict[str, StreamFigures]
    missed: dict[str, int]
    bytes: int
    cameras: tuple[CameraStanding, ...]
    ended: str

    @property
    def in_words(self) -> str:
        """As a status line says it."""
        words = [
            f"{sum(one.pictures for one in self.figures.values())} pictures",
            f"{self.bytes / 1e6:.0f} MB",
        ]
        words += [one.in_words for one in self.cameras if one.state in ("stopped", "ended")]
        late = sum(self.missed.values())
        words += [f"{late} left out by a slow disk"] if late else []
        return " · ".join(words)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of it, sentences."""
        notes = [f"The recording ended early: {self.ended}."] if self.ended not in ("", OVER) else []
        for name, one in self.figures.items():
            if one.repeated:
                notes.append(
                    f"Camera {name} lost {one.repeated} of {one.pictures} pictures; the one before stands in."
                )
            if self.missed[name]:
                notes.append(f"The disk was too slow for {self.missed[name]} pictures of camera {name}.")
        for camera in self.cameras:
            if camera.state == "stopped":
                notes.append(
                    f"Camera {camera.name} stopped {camera.seconds:.1f} s before the end. {camera.message}"
                )
        return tuple(notes)


class StreamRecording:
    """Records all cameras into `folder`/videos from now on. Close it when done.

    fps : of the files; a faster camera's pictures too many are left out. Raises SessionError, FootageError, OSError.
    """

    def __init__(
        self, readers: CameraReaders, folder: Path, fps: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.folder, self._readers, self._clock = folder, readers, clock
        check_disk(folder.parent)
        (folder / VIDEOS).mkdir(parents=True)
        self._times = TimesFile(folder / "timestamps.csv")
        self._began, self._ended = clock(), ""
        self._over = threading.Event()
        self._tracks = [self._track(camera, fps) for camera in readers.cameras.cameras]
        for track in self._tracks:
            track.camera.listen(track.put)
            track.thread.start()
        readers.release()

    @property
    def standing(self) -> RecordingStanding:
        return RecordingStanding(
            self._clock() - self._began,
            {track.camera.name: track.writer.figures for track in self._tracks},
            {track.camera.name: track.missed for track in self._tracks},
            sum(path.stat().st_size for path in (self.folder / VIDEOS).glob("*.mp4")),
            self._readers.cameras.standings,
            self._ended,
        )

    def wait(self, seconds: float) -> bool:
        """Let so many seconds pass; whether the recording has ended by itself."""
        if self._over.wait(seconds):
            return True
        states = [one.state for one in self._readers.cameras.standings]
        if all(state == "ended" for state in states):
            self._end(OVER)
        elif shutil.disk_usage(self.folder).free < LEAST_ROOM // 4:
            self._end("the disk is nearly full")
        return self._over.is_set()

    def close(self) -> RecordingStanding:
        """End it and its files; how it went."""
        standing = self.standing
        for track in self._tracks:
            track.camera.forget(track.put)
            track.waiting.put(None)
        for track in self._tracks:
            track.thread.join()
        self._times.close()
        figures = {track.camera.name: track.writer.figures for track in self._tracks}
        return RecordingStanding(
            standing.seconds, figures, standing.missed, self.standing.bytes, standing.cameras, self._ended
        )

    def _track(self, camera: LiveCamera, fps: float) -> "_Track":
        path = self.folder / VIDEOS / f"{camera.name}.mp4"
        return _Track(camera, StreamWriter(camera.name, path, fps, self._times), self._end)

    def _end(self, why: str) -> None:
        self._ended = self._ended or why
        self._over.set()


class _Track:
    """One camera's queue and the thread that empties it."""

    def __init__(self, camera: LiveCamera, writer: StreamWriter, end: Callable[[str], None]) -> None:
        self.camera, self.writer, self._end = camera, writer, end
        self.waiting: queue.Queue[Shot | None] = queue.Queue()
        self.missed = 0
        self.thread = threading.Thread(target=self._run, name=f"recording-{camera.name}", daemon=True)

    def put(self, name: str, shot: Shot) -> None:
        if self.waiting.qsize() >= WAITING_SHOTS:
            self.missed += 1
        else:
            self.waiting.put(shot)

    def _run(self) -> None:
        broken = False
        while (shot := self.waiting.get()) is not None:
            if not broken:
                broken = not self._write_safely(lambda shot=shot: self.writer.write(shot))
        self._write_safely(self.writer.close)

    def _write_safely(self, act: Callable[[], None]) -> bool:
        try:
            act()
        except OSError as problem:
            full = problem.errno in FULL
            self._end("the disk is full" if full else f"the disk refused ({problem.strerror or problem})")
            return False
        except StudioError as problem:
            self._end(problem.message)
            return False
        return True


def check_disk(folder: Path) -> None:
    """Raises FootageError where a recording has no room."""
    place = next(part for part in (folder, *folder.absolute().parents) if part.exists())
    free = shutil.disk_usage(place).free
    if free < LEAST_ROOM:
        raise FootageError(
            f"The disk has {free / 1e6:.0f} MB left, a recording needs {LEAST_ROOM / 1e6:.0f} MB.",
            "Make room.",
        )


def recording_folder(place: Path) -> Path:
    """Where what becomes the session at `place` is recorded: beside it. Raises FootageError if it is there."""
    folder = place.with_name(f"{place.name}.recording")
    if folder.exists():
        raise FootageError(
            f"An unfinished recording lies at '{folder}'.",
            "Make a session of it with 'studio record --finish', or remove it.",
        )
    return folder
