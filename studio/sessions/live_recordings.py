"""A session recorded from live cameras while it is tracked.

It has the calibration, the subject and the empty room of its base session, and its own pictures. The tracked pictures
are those on disk, so a recording can be tracked again bit for bit.

pictures/<camera>/000041.jpg   a camera's picture of set 41; none where the camera gave none live/sets.csv
a line a set: number, moment, spread, lagging camera, missing cameras, arrival of each picture live/go
exists once the sets may begin: the first one comes before, for warming up live/lock                      held by the
recorder
"""

import contextlib
import csv
import dataclasses
import io
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage import REGIONS
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.live_cameras import PictureSet, SpreadFigures, spread_figures
from studio.footage.capture.pictures import picture_path
from studio.footage.capture.stream_files import jpeg_of
from studio.foundations.errors import FootageError, SessionError
from studio.foundations.foreign_files import foreign_file, leads_out, read_text
from studio.foundations.words import sentence
from studio.sessions import atomic_files
from studio.sessions.background_files import BACKGROUND_NAME, EVIDENCE_NAME, read_evidence
from studio.sessions.manifest import now, write_manifest
from studio.sessions.names import checked_name
from studio.sessions.process_lock import ProcessLock
from studio.sessions.session import (
    BODIES_NAME,
    CAMERAS_PATH,
    SIGMA_NAME,
    SUBJECT_NAME,
    Session,
    redescribe,
    start_pose_files,
)

LIVE, SETS_NAME, GO_NAME, LOCK_NAME = "live", "sets.csv", "go", "lock"
COLUMNS = ("frame", "moment", "spread_ms", "lagging", "left_out", "arrivals")
END = "end"
BEING_RECORDED, RECORDED = "live take, being recorded", "live take"
FROM_PLATES = ("auto", "gaussian")
COPIED = (SUBJECT_NAME, SIGMA_NAME, EVIDENCE_NAME, BODIES_NAME, *REGIONS, "calibration")


@dataclass(frozen=True, slots=True)
class RecordedSet:
    """A line of `sets.csv`. times : arrival of each camera's picture, seconds of this machine's clock since it was
    switched on. spread : seconds.
    """

    frame: int
    spread: float
    lagging: str
    left_out: tuple[str, ...]
    times: dict[str, float]


@dataclass(frozen=True, slots=True)
class RecordedSets:
    """The sets of a recording. ended : why it ended, "" while it is recorded or if it was killed."""

    sets: tuple[RecordedSet, ...]
    ended: str

    @property
    def spreads(self) -> SpreadFigures:
        return spread_figures(np.array([one.spread for one in self.sets]), [one.lagging for one in self.sets])


class SetWriter:
    """Records into a session; one at a time, by a lock that is released when its process ends. Raises SessionError."""

    def __init__(self, session: Session) -> None:
        self.folder = session.path
        (self.folder / LIVE).mkdir(exist_ok=True)
        lock = ProcessLock.take(self.folder / LIVE / LOCK_NAME)
        if lock is None:
            raise SessionError(f"'{session.name}' is being recorded already.", "Stop that recording first.")
        self._lock = lock
        self._cameras = {source.name: source for source in session.manifest.footage.cameras}
        self._file = (self.folder / LIVE / SETS_NAME).open("a", encoding="utf-8", newline="", buffering=1)
        if not self._file.tell():
            self._line(COLUMNS)

    @property
    def may_go(self) -> bool:
        """Whether sets after the first one are awaited."""
        return (self.folder / LIVE / GO_NAME).exists()

    def put(self, frame: int, pictures: PictureSet) -> None:
        """Store a set. Raises FootageError for a picture of another size, OSError if it cannot be written."""
        for name, shot in pictures.shots.items():
            source = self._cameras[name]
            check_size(source, shot.pixels.shape[1], shot.pixels.shape[0])
            picture_path(self.folder / source.path, frame).write_bytes(jpeg_of(shot))
        arrivals = ";".join(f"{name}={shot.came:.6f}" for name, shot in pictures.shots.items())
        spread = f"{1e3 * pictures.spread:.3f}"
        self._line(
            (frame, f"{pictures.moment:.6f}", spread, pictures.lagging, ";".join(pictures.left_out), arrivals)
        )

    def end(self, why: str) -> None:
        """End the recording. Never raises: the disk may be the reason."""
        with contextlib.suppress(OSError):
            self._line((END, "", "", "", "", why))
        self.close()

    def close(self) -> None:
        """Close the file and release the lock."""
        with contextlib.suppress(OSError):
            self._file.close()
        self._lock.free()

    def _line(self, values: tuple[object, ...]) -> None:
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(values)
        self._file.write(line.getvalue())


def begin_recording(
    base: Session,
    into: Path,
    cameras: tuple[str, ...],
    fps: float,
    frame_count: int,
    *,
    keep_start: bool = True,
) -> Session:
    """A new session at `into` whose pictures are still to come.

    cameras : of the base session, those recorded. fps : sets a second. frame_count : sets at most.
    keep_start : the person begins in the base's start pose; else that is searched. Raises SessionError, FootageError.
    """
    checked_name(into.name, "session")
    known = {source.name: source for source in base.manifest.footage.cameras}
    for name in cameras:
        if name not in known:
            raise FootageError(
                f"Session '{base.name}' has no camera '{name}'.", f"Name them as it does: {', '.join(known)}."
            )
    calibrated = {camera.name: camera for camera in base.cameras()}
    _check_backgrounds(base, [known[name] for name in cameras])
    with atomic_files.made_whole(into) as folder:
        _copy_known(base, folder, keep_start)
        write_calibration(tuple(calibrated[name] for name in cameras), folder / CAMERAS_PATH)
        sources = tuple(_source(base, folder, known[name], frame_count) for name in cameras)
        manifest = msgspec.structs.replace(
            base.manifest,
            name=into.name,
            title=f"Live, from {base.manifest.title}",
            created=now(),
            footage=FootageSource(fps, frame_count, sources),
            notes=(
                *base.manifest.notes,
                f"Recorded from live cameras with the calibration of '{base.name}'.",
            ),
            imported_from="live cameras",
            layout=BEING_RECORDED,
            footage_changed="",
        )
        (folder / LIVE).mkdir()
        write_manifest(folder, manifest)
    return Session(into)


def read_sets(folder: Path) -> RecordedSets:
    """The sets of a recording so far; a line that is not whole yet is left for the next look. Raises SessionError."""
    path = folder / LIVE / SETS_NAME
    if not path.exists():
        return RecordedSets((), "")
    sets: list[RecordedSet] = []
    with foreign_file(
        path, SessionError, "a recording's list of sets", "Put back a copy of it, or record again."
    ):
        text = read_text(path)
        for row in csv.reader(text[: text.rfind("\n") + 1].splitlines()[1:]):
            if row[0] == END:
                return RecordedSets(tuple(sets), row[5])
            sets.append(recorded_set(row))
    return RecordedSets(tuple(sets), "")


def recorded_set(row: list[str]) -> RecordedSet:
    """A row of `sets.csv`."""
    times = dict(entry.split("=") for entry in row[5].split(";"))
    left_out = tuple(name for name in row[4].split(";") if name)
    return RecordedSet(
        int(row[0]), float(row[2]) / 1e3, row[3], left_out, {k: float(v) for k, v in times.items()}
    )


def is_being_recorded(folder: Path) -> bool:
    return ProcessLock.is_held(folder / LIVE / LOCK_NAME)


def start_sets(folder: Path) -> None:
    (folder / LIVE / GO_NAME).touch()


def finish_recording(session: Session, notes: tuple[str, ...] = ()) -> Session:
    """The session with the recorded number of frames, also after its recorder was killed; notes : added to its own.

    Raises SessionError without any set.
    """
    recorded = read_sets(session.path)
    if not recorded.sets:
        raise SessionError(f"'{session.name}' has no set of pictures.", "Record again.")
    count, footage = recorded.sets[-1].frame + 1, session.manifest.footage
    if session.manifest.layout != BEING_RECORDED:
        return session
    cameras = tuple(dataclasses.replace(source, frame_count=count) for source in footage.cameras)
    for source in cameras:
        # A picture without a line may be truncated.
        for path in (session.path / source.path).glob("*.jpg"):
            if path.stem.isdigit() and int(path.stem) >= count and not leads_out(path):
                path.unlink()
    ending = [f"{sentence(recorded.spreads.in_words)}."]
    ending += (
        [f"The recording ended: {recorded.ended}."] if recorded.ended else ["The recording was cut off."]
    )
    manifest = msgspec.structs.replace(
        session.manifest,
        layout=RECORDED,
        footage=FootageSource(footage.fps, count, cameras),
        notes=(*session.manifest.notes, *ending, *notes),
        warnings=(*session.manifest.warnings, *(ending[:1] if recorded.spreads.apart else ())),
    )
    return redescribe(session, manifest)


def check_size(source: CameraSource, width: int, height: int) -> None:
    """Raises FootageError where a stream's pictures are not those that the camera was calibrated with."""
    wanted = (source.width, source.height) if source.turned in (0, 180) else (source.height, source.width)
    if (width, height) != wanted:
        raise FootageError(
            f"Camera {source.name} sends {width}x{height} pixels and was calibrated at {wanted[0]}x{wanted[1]}.",
            "Set it to that resolution, or calibrate it at this one.",
        )


def _check_backgrounds(base: Session, sources: list[CameraSource]) -> None:
    for source in sources:
        if not source.background:
            raise FootageError(
                f"Camera {source.name} of session '{base.name}' has no picture of the empty room.",
                "Record one, and set it with 'studio background'.",
            )
    model = read_evidence(base).knobs.get("background_model", "auto")
    if model not in FROM_PLATES:
        raise FootageError(
            f"Masks of session '{base.name}' are made with '{model}', which needs footage that does not exist yet.",
            "Choose the plate or the empty clip with 'studio background'.",
        )


def _copy_known(base: Session, folder: Path, keep_start: bool) -> None:
    starts = [path.name for path in start_pose_files(base.path)] if keep_start else []
    for entry in (*COPIED, *starts):
        path = base.path / entry
        if path.exists():
            atomic_files.copy_part(path, folder / entry)


def _source(base: Session, folder: Path, source: CameraSource, frame_count: int) -> CameraSource:
    place = f"pictures/{source.name}"
    (folder / place).mkdir(parents=True)
    background = base.path / source.background
    kept = f"{BACKGROUND_NAME}/{source.name}{background.suffix.lower()}"
    (folder / BACKGROUND_NAME).mkdir(exist_ok=True)
    atomic_files.copy_part(background, folder / kept)
    return dataclasses.replace(
        source, kind="numbered", path=place, masks="", background=kept, frame_count=frame_count, offset=0
    )
