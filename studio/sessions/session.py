"""A session on disk: footage, cameras, subject, truth and runs, each read on demand.

Folder: `session.json`, `videos/` or `pictures/<camera>/`, `masks/<camera>/`, `background/`,
`calibration/original.*` and `calibration/cameras.toml`, `truth/*.trc`, `subject.toml`, `start_pose.csv`,
`sigma.csv`, `thumbnail.jpg`, `bodies/*.toml` (bodies of this session's own), `beside/<n>/` (of other subjects in view:
`subject.toml`, `start_pose.csv`, `truth.trc`), `runs/<run>/`.
"""

import itertools
from collections.abc import Callable
from functools import cached_property, lru_cache
from pathlib import Path

import av
import msgspec
import numpy as np

from studio.body.branches import within_limits
from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.motion_files.trc import read_marker_names
from studio.body.subject import Subject, fit_subject, read_subject
from studio.footage.capture.calibration_files import calibration_text, read_calibration
from studio.footage.capture.footage import Footage, open_footage
from studio.footage.capture.footage_source import CameraSource
from studio.foundations.errors import NotFoundError, RunError, SessionError, StudioError
from studio.foundations.foreign_files import check_links, read_file
from studio.foundations.geometry.camera import Camera
from studio.sessions import atomic_files
from studio.sessions.atomic_files import NameTakenError, writing
from studio.sessions.file_checksums import note_files
from studio.sessions.manifest import SessionManifest, read_manifest, write_manifest
from studio.sessions.named_rows import Array, named_columns, pose_frame, read_pose, read_sigma
from studio.sessions.names import checked_name, free_name, inside
from studio.sessions.results_store import create_store
from studio.sessions.run_record import BEHAVIOUR_NAME, CAMERAS_NAME, RunRecord, write_run_record
from studio.sessions.stored_run import BODY_FOLDER, StoredRun
from studio.sessions.work_under_way import check_there, one_at_a_time

WIDTH = 320
QUALITY = 5


def thumbnail_of(session: "Session") -> bytes | None:
    """JPEG bytes, at most 320 pixels on the longer side; None if the footage or a calibration cannot be read."""
    try:
        turns = session.cameras()[0].quarter_turns if session.is_calibrated else 0
        footage = session.footage()
        try:
            picture = footage.picture(footage.cameras[0], footage.frame_count // 2)
        finally:
            footage.close()
    except (StudioError, IndexError):
        return None
    return jpeg(np.rot90(picture, -turns))


def jpeg(picture: np.ndarray, longest: int = WIDTH) -> bytes:
    """A BGR picture (H, W, 3) uint8 as JPEG bytes, its longer side shrunk to `longest` pixels."""
    height, width = picture.shape[:2]
    scale = min(1.0, longest / max(height, width))
    # JPEG's halved colour planes want even sides.
    size = (max(2, round(width * scale / 2) * 2), max(2, round(height * scale / 2) * 2))
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
    small = frame.reformat(width=size[0], height=size[1], format="yuvj420p", interpolation="AREA")
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width, encoder.height = size
    encoder.pix_fmt = "yuvj420p"
    encoder.time_base = 1  # pyright: ignore[reportAttributeAccessIssue]
    encoder.options = {"qmin": str(QUALITY), "qmax": str(QUALITY)}
    packets = encoder.encode(small) + encoder.encode(None)  # pyright: ignore[reportUnknownVariableType] - of no stream
    return b"".join(map(bytes, packets))  # pyright: ignore[reportUnknownArgumentType]


CAMERAS_PATH = Path("calibration") / "cameras.toml"
SUBJECT_NAME, START_POSE_NAME, SIGMA_NAME = "subject.toml", "start_pose.csv", "sigma.csv"
OTHERS_START_POSE = "start_pose-of-{}.csv"
THUMBNAIL_NAME, BODIES_NAME, RUNS_NAME = "thumbnail.jpg", "bodies", "runs"
BESIDE = "beside"
"""Folder of what is known of other subjects in view, a folder each: `subject.toml`, `start_pose.csv`, `truth.trc`."""


@lru_cache(maxsize=64)
def _marker_names(path: Path, _stamp: int) -> frozenset[str]:
    """The markers that a TRC file names, read again when the file's time of change differs."""
    return frozenset(read_marker_names(path))


class Session:
    """A session's folder. Raises NotFoundError if there is no manifest in it, SessionError where that is invalid, or a
    link leads out of the folder to anything but footage.
    """

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()
        self.manifest: SessionManifest = read_manifest(self.path)
        footage = self.manifest.footage.cameras
        check_links(
            self.path, beside={Path(place).parts[0] for camera in footage for place in camera.places if place}
        )
        check_links(self.path / CAMERAS_PATH.parent)

    @property
    def name(self) -> str:
        """The session's name: its folder's."""
        return self.path.name

    @property
    def has_footage(self) -> bool:
        """Whether any camera's footage is there; a session begins without."""
        return bool(self.manifest.footage.cameras)

    @property
    def is_calibrated(self) -> bool:
        """Whether there is a calibration; a session may begin without."""
        return (self.path / CAMERAS_PATH).is_file()

    @property
    def is_comparable(self) -> bool:
        """Whether two cameras or more are calibrated, so that views can be compared."""
        return self.is_calibrated and len(self.manifest.footage.cameras) > 1

    def camera_source(self, camera: str) -> CameraSource:
        """The footage of a camera. Raises NotFoundError."""
        sources = {source.name: source for source in self.manifest.footage.cameras}
        if camera not in sources:
            raise NotFoundError(
                f"Session '{self.name}' has no camera '{camera[:64]}'.", f"It has {', '.join(sources)}."
            )
        return sources[camera]

    def cameras(self) -> tuple[Camera, ...]:
        """The calibrated cameras in the order of the footage. Raises CalibrationError; SessionError without any."""
        self._check_begun()
        by_name = {camera.name: camera for camera in self._calibrated}
        sources = self.manifest.footage.cameras
        missing = [source.name for source in sources if source.name not in by_name]
        if missing:
            raise SessionError(
                f"Session '{self.name}' has footage of '{missing[0]}' but no calibration of it.",
                "Import the session again with a calibration that names it.",
            )
        return tuple(by_name[source.name] for source in sources)

    def checked_frames(self, first: int, last: int | None, *, endless: bool = False) -> tuple[int, int]:
        """The frames of a run, half open. endless : the last may lie behind the footage's end. Raises RunError if any
        lies outside the footage, or there are none.
        """
        self.cameras()  # report missing footage or calibration first
        count = self.manifest.frame_count
        end = count if last is None else last
        if not 0 <= first < (min(end, count) if endless else end) <= count:
            raise RunError(
                f"Frames {first}:{end} do not lie in the footage of '{self.name}'.",
                f"It has frames 0:{count} (the last one not included).",
            )
        return first, end

    def _check_footage(self) -> None:
        if not self.has_footage:
            raise SessionError(
                f"Session '{self.name}' has no footage yet.",
                "Add it in the guided set-up, or with 'studio add-footage'.",
            )

    def _check_begun(self) -> None:
        self._check_footage()
        if not self.is_calibrated:
            raise SessionError(
                f"Session '{self.name}' has no calibration yet.",
                "Calibrate its cameras in the guided set-up, or with 'studio calibrate'.",
            )

    @cached_property
    def _calibrated(self) -> tuple[Camera, ...]:
        return tuple(read_calibration(self.path / CAMERAS_PATH).cameras)

    def footage(self) -> Footage:
        """The session's footage, newly opened; close it when done. Raises FootageError; SessionError without any."""
        self._check_footage()
        return open_footage(self.manifest.footage, self.path)

    def subject(self) -> Subject | None:
        """The person's measures, if the session has them. Raises BodyError."""
        path = self.path / SUBJECT_NAME
        return read_subject(path, self.manifest.body) if path.exists() else None

    def body(self, name: str | None = None, subject: Subject | None = None) -> BodyModel:
        """The body `name` (default: the session's) scaled to `subject` (default: the session's). Raises BodyError."""
        return self.body_with_notes(name, subject)[0]

    def body_with_notes(
        self, name: str | None = None, subject: Subject | None = None
    ) -> tuple[BodyModel, tuple[str, ...]]:
        """Like `body`, with notes on measures of the subject that the body cannot follow."""
        measures = subject or self.subject()
        wanted = name or (subject.body if subject else "") or self.manifest.body
        tree = load_body(wanted, self.body_folders)
        return fit_subject(tree, measures, self.body_folders) if measures else (tree, ())

    @property
    def body_folders(self) -> tuple[Path, ...]:
        """The folders searched for user-defined bodies: the session's, then its workspace's."""
        folders = (self.path / BODIES_NAME, self.path.parent / BODIES_NAME)
        return tuple(folder for folder in folders if folder.is_dir())

    def start_pose_path(self, body: str = "") -> Path:
        """Where the start pose of a body (a name, "" for the session's) lies, if there is one."""
        own = not body or body == self.manifest.body
        return self.path / (START_POSE_NAME if own else OTHERS_START_POSE.format(body))

    def start_pose(self, body: BodyModel | None = None) -> Array | None:
        """(D,) the session's start pose in the order of the body's parameters, None without one of this body.

        Its angles are rewritten into the body's limits (`body.branches`), the attitude stays. Raises BodyError if
        the session's own does not name its body's parameters.
        """
        model = body or self.body()
        path, names = self._start_pose_file(model.name), _parameter_names(model)
        if not path.exists():
            return None
        if model.name != self.manifest.body and not set(names) <= set(named_columns(path)):
            return None
        return within_limits(model, read_pose(path, names))

    def start_pose_frame(self, body: str = "") -> int:
        """The frame of a body's start pose (a name, "" for the session's), in which tracking begins by default; 0 if it
        is not given or outside the footage. Raises BodyError.
        """
        path = self._start_pose_file(body)
        frame = pose_frame(path) if path.exists() else None
        return frame if frame is not None and 0 <= frame < self.manifest.frame_count else 0

    def _start_pose_file(self, body: str) -> Path:
        """A body's start pose; the session's own where there is none: bodies of other sizes or limits share it."""
        path = self.start_pose_path(body)
        return path if path.exists() else self.path / START_POSE_NAME

    def sigma(self, fps: float | None = None, body: BodyModel | None = None) -> Array | None:
        """(D,) the session's own σ0 from frame to frame at `fps` (default: its own), None without one.

        It belongs to the session's body; None for any other.
        """
        path = self.path / SIGMA_NAME
        model = body or self.body()
        if not path.exists() or model.name != self.manifest.body:
            return None
        return read_sigma(path, _parameter_names(model), fps or self.manifest.fps)

    @property
    def truth_path(self) -> Path | None:
        """The TRC file with the true motion, None without one. Of several it is the first that names a marker of the
        session's body, else the first.
        """
        files = sorted((self.path / "truth").glob("*.trc"))
        fitting = (path for path in files if self._has_markers_of(path)) if len(files) > 1 else ()
        return next(itertools.chain(fitting, files), None)

    def _has_markers_of(self, truth: Path) -> bool:
        """Whether a TRC file names a marker of the session's body."""
        try:
            names = _marker_names(truth, truth.stat().st_mtime_ns)
            body = load_body(self.manifest.body, self.body_folders)
        except (StudioError, OSError):
            return False
        return any(marker.name in names for marker in body.markers)

    def thumbnail(self) -> Path | None:
        """A small picture of the session (JPEG), made on first use; None if the footage cannot be read."""
        path = self.path / THUMBNAIL_NAME
        if not path.exists():
            content = thumbnail_of(self)
            if content is None:
                return None
            atomic_files.write_bytes(path, content)
        return path

    def check_idle(self) -> None:
        """Raise SessionError while a run is being tracked."""
        for run in self.runs():
            if run.summary().status == "tracking":
                raise SessionError(
                    f"Run '{run.name}' of session '{self.name}' is being tracked.", "Stop it, or wait for it."
                )

    def runs(self) -> tuple[StoredRun, ...]:
        """The session's runs, oldest first."""
        folder = self.path / RUNS_NAME
        runs = [StoredRun(path) for path in folder.iterdir() if _is_run(path)] if folder.is_dir() else []
        return tuple(sorted(runs, key=lambda run: (run.folder / "run.json").stat().st_mtime_ns))

    def run(self, name: str) -> StoredRun:
        """The run of that name. Raises NotFoundError, NameRefused."""
        path = inside(self.path / RUNS_NAME, name, "run")
        if not _is_run(path):
            raise NotFoundError(
                f"Session '{self.name}' has no run '{name}'.",
                "List the runs with 'studio runs', or start one.",
            )
        check_links(path)
        return StoredRun(path)

    def new_run(
        self,
        record: RunRecord,
        body_text: str = "",
        behaviour: Path | None = None,
        calibration: bytes | None = None,
    ) -> StoredRun:
        """Make the folder of a run: its record, the calibration's and the body file's snapshot, an empty
        store.

        It is made atomically. `runs.new_run.prepare_run` fills in the record. body_text : content of the body's file,
        "" to keep none. behaviour : the file of its behaviour model, to be copied. calibration : of another run; by
        default the session's, of the cameras that have footage. Raises SessionError if the name is taken, or the disk
        is full.
        """
        place = self.path / RUNS_NAME / checked_name(record.name, "run")
        if place.exists():
            raise NameTakenError(f"Session '{self.name}' has a run '{record.name}'.", "Choose another name.")
        with writing("The run", place), atomic_files.made_whole(place, parents=False) as folder:
            content = self.calibration_of_footage() if calibration is None else calibration
            atomic_files.write_bytes(folder / CAMERAS_NAME, content)
            if body_text:
                (folder / BODY_FOLDER).mkdir()
                name = Path(record.body).stem
                atomic_files.write_text(folder / BODY_FOLDER / f"{name}.toml", body_text)
            if behaviour is not None:
                atomic_files.copy_file(behaviour, folder / BEHAVIOUR_NAME)
            create_store(folder)
            write_run_record(folder, record)
            note_files(folder)
        return StoredRun(place)

    def calibration_of_footage(self) -> bytes:
        """The calibration's file, without cameras that have no footage. Raises CalibrationError."""
        path = self.path / CAMERAS_PATH
        known = read_calibration(path)
        filmed = {source.name for source in self.manifest.footage.cameras}
        kept = tuple(camera for camera in known.cameras if camera.name in filmed)
        if len(kept) == len(known.cameras):
            return read_file(path)
        return calibration_text(kept, known.crops).encode()


def start_pose_files(folder: Path) -> tuple[Path, ...]:
    """The start poses in a session's folder, of its body and of others."""
    own = folder / START_POSE_NAME
    return (*((own,) if own.is_file() else ()), *sorted(folder.glob(OTHERS_START_POSE.format("*"))))


def make_numbered_run(
    session: Session, record: RunRecord, name: str, make: Callable[[RunRecord], StoredRun]
) -> StoredRun:
    """Make the run of a record. name : that was requested; without one, the next free number is taken.

    Raises what `make` raises.
    """
    while True:
        try:
            return make(record)
        except NameTakenError:
            if name:
                raise
            record = msgspec.structs.replace(record, name=free_run_name(session))


def free_run_name(session: Session) -> str:
    """A name for the session's next run: run-1, run-2, …"""
    folder = session.path / RUNS_NAME
    taken: set[str] = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    return free_name(f"run-{len(taken) + 1}", taken)


def redescribe(session: Session, manifest: SessionManifest) -> Session:
    """Write changed entries of a session's description, and return the new session; changes that others made since it
    was opened are kept.

    Raises SessionError where they changed the same entries.
    """
    with one_at_a_time(session.path):
        now = _described_now(session)
        names = manifest.__struct_fields__
        changes = {
            name: getattr(manifest, name) for name in names if _differs(name, manifest, session.manifest)
        }
        check_unchanged(session, *(name for name in changes if _differs(name, manifest, now)))
        write_manifest(session.path, msgspec.structs.replace(now, **changes))
        return Session(session.path)


def check_unchanged(session: Session, *names: str) -> None:
    """Raise SessionError where others have changed one of these entries of the description since it was opened."""
    now = _described_now(session)
    changed = [name for name in names if _differs(name, now, session.manifest)]
    if changed:
        raise changed_meanwhile(session, changed[0].removesuffix("_changed").replace("_", " "))


def changed_meanwhile(session: Session, what: str) -> SessionError:
    """The error for a change of what others have changed since it was read."""
    return SessionError(
        f"The {what} of session '{session.name}' was changed by other work meanwhile.",
        "Do this again: it then begins from what there is now.",
    )


def _described_now(session: Session) -> SessionManifest:
    check_there(session.path)
    return read_manifest(session.path)


def _differs(name: str, one: SessionManifest, other: SessionManifest) -> bool:
    return getattr(one, name) != getattr(other, name)


def _is_run(path: Path) -> bool:
    return not path.name.startswith(".") and (path / "run.json").is_file()


def _parameter_names(body: BodyModel) -> tuple[str, ...]:
    return tuple(entry.name for entry in body.parameters)
