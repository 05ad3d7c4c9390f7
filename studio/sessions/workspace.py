"""The folder in which a person's sessions live: listing, naming, copying, throwing away."""

import contextlib
import dataclasses
import os
import shutil
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import platformdirs

from studio.body.catalogue import body_file_text, body_path, load_body
from studio.body.subject import DEFAULT_BODY
from studio.footage.capture.footage_source import FootageSource
from studio.foundations.errors import NotFoundError, SessionError, StudioError
from studio.foundations.progress import Progress, no_progress
from studio.sessions import atomic_files
from studio.sessions.atomic_files import made_whole, write_text
from studio.sessions.file_checksums import forget_files, note_again
from studio.sessions.manifest import FILE_NAME, SessionManifest, now, read_manifest, write_manifest
from studio.sessions.names import checked_name, free_name, inside, is_name
from studio.sessions.object_stores import folder_of, is_address
from studio.sessions.remote_sessions import remote_session
from studio.sessions.results_reader import FILE_NAME as RESULTS_NAME
from studio.sessions.run_record import FILE_NAME as RECORD_NAME
from studio.sessions.run_record import read_run_record, write_run_record
from studio.sessions.session import BODIES_NAME, RUNS_NAME, THUMBNAIL_NAME, Session, redescribe
from studio.sessions.stored_run import RunSummary, StoredRun
from studio.sessions.work_under_way import moving, one_at_a_time, working_on

VARIABLE = "STUDIO_WORKSPACE"
TRASH_NAME = ".trash"
APPLICATION = "capture-studio"


@dataclass(frozen=True, slots=True)
class SessionSummary:
    """A session as a line of a list.

    cameras, frames, fps : of the footage. runs : oldest first. has_truth : whether there is a true motion.
    thumbnail : whether `Session.thumbnail` has been made. problem : why the session cannot be opened, "" if
    it can.
    """

    name: str
    title: str
    created: str
    body: str
    cameras: tuple[str, ...]
    frames: int
    fps: float
    has_truth: bool
    thumbnail: bool
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    runs: tuple[RunSummary, ...]
    problem: str = ""


def workspace_root() -> Path:
    """The folder of sessions: the environment variable STUDIO_WORKSPACE, or the user's data folder."""
    chosen = os.environ.get(VARIABLE, "").strip()
    if chosen:
        return Path(chosen).expanduser()
    return Path(platformdirs.user_data_dir(APPLICATION, appauthor=False)) / "workspace"


class Workspace:
    """A folder of sessions, made when it is first written to. Every command and the server work on one."""

    def __init__(self, root: Path | None = None) -> None:
        self.root = (root or workspace_root()).expanduser().absolute()

    def sessions(self) -> tuple[SessionSummary, ...]:
        """All sessions by name, with their runs; those that cannot be opened carry the reason."""
        return tuple(_summary(folder) for folder in _named_folders(self.root, FILE_NAME))

    def manifests(self) -> dict[str, SessionManifest]:
        """What all sessions that can be read say of themselves, by name."""
        read: dict[str, SessionManifest] = {}
        for folder in _named_folders(self.root, FILE_NAME):
            with contextlib.suppress(StudioError):
                read[folder.name] = read_manifest(folder)
        return read

    def usual_body(self) -> str:
        """The body of most sessions, of several the newest session's; else that of a new session."""
        usable = [entry for entry in self.sessions() if not entry.problem]
        count = Counter(entry.body for entry in usable)
        usable.sort(key=lambda entry: (count[entry.body], entry.created))
        return usable[-1].body if usable else DEFAULT_BODY

    def session(self, name: str) -> Session:
        """The session of that name. Raises NameRefused, NotFoundError."""
        path = inside(self.root, name)
        if not (path / FILE_NAME).is_file():
            raise NotFoundError(
                f"There is no session '{name}' in '{self.root}'.",
                "Import one with 'studio import SOURCE --into SESSION', or set STUDIO_WORKSPACE.",
            )
        return Session(path)

    def resolve(
        self, name_or_path: str | Path, *, remote: bool = False, progress: Progress = no_progress
    ) -> Session:
        """The session of that name, else the one in that folder (commands only: it may lie anywhere). remote : an
        address of a store is brought, too.

        Raises NotFoundError naming both places, SessionError for an address that cannot be used.
        """
        text = folder_of(str(name_or_path))
        if is_address(text):
            if remote:
                return remote_session(text, progress)
            raise SessionError(
                f"The session at '{text}' is not on this machine, and this would change it.",
                f"Bring it first: studio download {text} --into NAME. Only track, batch, compare, sweep and runs take"
                " addresses.",
            )
        if is_name(text) and (self.root / text / FILE_NAME).is_file():
            return self.session(text)
        if "\0" not in text and (Path(text).expanduser() / FILE_NAME).is_file():
            return Session(Path(text).expanduser())
        known = ", ".join(f"'{folder.name}'" for folder in _named_folders(self.root, FILE_NAME)) or "none yet"
        raise NotFoundError(
            f"There is no session '{text}', neither in '{self.root}' nor as a folder.",
            f"Give the folder that holds session.json, or a name of the workspace ({known}).",
        )

    def place_for(self, name_or_path: str | Path) -> Path:
        """The place of a new session: a name means the workspace, a path itself. Raises SessionError if it is taken."""
        text = folder_of(str(name_or_path))
        if is_address(text):
            raise SessionError(
                f"A new session cannot begin at '{text}'.",
                f"Make it on this machine, then: studio upload NAME --to {text}",
            )
        if is_name(text):
            self.root.mkdir(parents=True, exist_ok=True)
            path = inside(self.root, text)
        else:
            path = Path(checked_name(text) if "/" not in text and os.sep not in text else text)
            path = path.expanduser().absolute()
            checked_name(path.name)
        if path.exists():
            raise atomic_files.taken(path)
        return path

    def rename(self, name: str, new_name: str) -> Session:
        """Give a session another name. Raises SessionError if it is taken or a run of it is being tracked."""
        with moving(self.session(name).path):
            session = self._idle(name)
            place = self._free(new_name)
            os.rename(session.path, place)
            atomic_files.sync_folder(self.root)
            moved = Session(place)
            title = new_name if moved.manifest.title in ("", name) else moved.manifest.title
            return redescribe(moved, msgspec.structs.replace(moved.manifest, name=new_name, title=title))

    def retitle(self, name: str, title: str) -> Session:
        """Change the text that people see. Raises SessionError if it is empty or longer than 200 characters."""
        words = " ".join(title.split())
        if not 0 < len(words) <= 200:
            raise SessionError(
                f"A title of {len(words)} characters cannot be shown.", "Use 1 to 200 characters."
            )
        with one_at_a_time(self.session(name).path):
            session = self.session(name)
            return redescribe(session, msgspec.structs.replace(session.manifest, title=words))

    def duplicate(self, name: str, new_name: str | None = None) -> Session:
        """Copy a session with its runs, atomically; results being written are copied in their current state."""
        session = self.session(name)
        wanted = new_name or free_name(name, {path.name for path in self.root.iterdir()})
        place = self._free(wanted)
        with working_on(session.path, "duplicate"), atomic_files.made_whole(place) as folder:
            try:
                shutil.copytree(session.path, folder, symlinks=True, dirs_exist_ok=True, ignore=_transient)
            except shutil.Error as error:
                if not (gone := Path(error.args[0][0][0])).exists():
                    raise atomic_files.changed_while_copied(name, gone.name) from None
                raise SessionError(
                    f"Session '{name}' cannot be copied: {error.args[0][0][2]}.",
                    "Run 'studio inspect' on it, and remove whatever is not a file.",
                ) from None
            for store in session.path.glob(f"{RUNS_NAME}/*/{RESULTS_NAME}"):
                copy = folder / store.relative_to(session.path)
                # A run that was made meanwhile is not in the copy.
                if copy.parent.is_dir():
                    atomic_files.copy_database(store, copy)
            title = f"{session.manifest.title} (copy)"
            write_manifest(folder, msgspec.structs.replace(session.manifest, name=wanted, title=title))
        return Session(place)

    def trash(self, name: str) -> Path:
        """Move a session to the trash folder and return where it lies. Raises SessionError while it is tracked."""
        with moving(self.session(name).path):
            return self.to_trash(self._idle(name).path, name)

    def trash_run(self, session_name: str, run_name: str) -> Path:
        """Move a run to the trash folder. Raises SessionError while it is tracked."""
        run = self.session(session_name).run(run_name)
        with moving(run.folder.parent.parent, run_name):
            _check_idle(run)
            return self.to_trash(run.folder, f"{session_name}--{run_name}")

    def rename_run(self, session_name: str, run_name: str, new_name: str) -> StoredRun:
        """Give a run another name. Raises SessionError if it is taken or the run is being tracked."""
        session = self.session(session_name)
        run = session.run(run_name)
        place = inside(session.path / RUNS_NAME, new_name, "run")
        with moving(session.path, run_name):
            _check_idle(run)
            taken = {entry.name.lower() for entry in place.parent.iterdir() if entry.name != run_name}
            if new_name.lower() in taken:
                raise SessionError(f"There is a run '{new_name}' already.", "Choose another name.")
            record = msgspec.structs.replace(run.record, name=new_name)
            # Killed before it is noted again, the record would be taken for damaged.
            forget_files(run.folder, [RECORD_NAME])
            os.rename(run.folder, place)
            write_run_record(place, record)
            note_again(place, RECORD_NAME)
            return session.run(new_name)

    def to_trash(self, path: Path, label: str) -> Path:
        """Move a folder to the trash under a free name that begins with `label`; returns where it lies then."""
        trash = self.root / TRASH_NAME
        trash.mkdir(exist_ok=True)
        stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime())
        place = trash / free_name(f"{label[:44]}--{stamp}", {entry.name for entry in trash.iterdir()})
        os.rename(path, place)
        atomic_files.sync_folder(trash)
        return place

    def trashed(self) -> tuple[str, ...]:
        """The content of the trash, oldest first; sessions in it can be given to `restore`."""
        folder = self.root / TRASH_NAME
        folders = [path for path in folder.iterdir() if path.is_dir()] if folder.is_dir() else []
        return tuple(path.name for path in sorted(folders, key=lambda path: path.stat().st_ctime_ns))

    def restore(self, trashed_name: str) -> Session:
        """Bring a session back under its own name, or one like it if that is taken. Raises NotFoundError."""
        path = inside(self.root / TRASH_NAME, trashed_name)
        if not (path / FILE_NAME).is_file():
            raise NotFoundError(
                f"There is no session '{trashed_name}' in the trash.", "List its content first."
            )
        with one_at_a_time(self.root / trashed_name):
            name = free_name(Session(path).manifest.name, {entry.name for entry in self.root.iterdir()})
            os.rename(path, inside(self.root, name))
            return self.session(name)

    def restore_run(self, trashed_name: str) -> StoredRun:
        """Bring a run back into its session, under its own name or one like it. Raises NotFoundError."""
        with one_at_a_time(self.root / trashed_name):
            return self._restored_run(inside(self.root / TRASH_NAME, trashed_name), trashed_name)

    def _restored_run(self, path: Path, trashed_name: str) -> StoredRun:
        record = read_run_record(path)
        owners = [name for name in (trashed_name.partition("--")[0], record.session) if is_name(name)]
        for owner in owners:
            if (self.root / owner / FILE_NAME).is_file():
                session = self.session(owner)
                (session.path / RUNS_NAME).mkdir(exist_ok=True)
                name = free_name(record.name, {entry.name for entry in (session.path / RUNS_NAME).iterdir()})
                forget_files(path, [RECORD_NAME])
                write_run_record(path, msgspec.structs.replace(record, name=name))
                note_again(path, RECORD_NAME)
                os.rename(path, inside(session.path / RUNS_NAME, name, "run"))
                return session.run(name)
        raise NotFoundError(f"Session '{owners[0]}' of this run is missing.", "Restore the session first.")

    def _free(self, name: str) -> Path:
        """The place for a session of this name. Raises SessionError if there is something."""
        path = inside(self.root, name)
        taken = {entry.name.lower() for entry in self.root.iterdir()}
        if name.lower() in taken:
            raise SessionError(f"There is a session '{name}' already.", "Choose another name.")
        return path

    def _idle(self, name: str) -> Session:
        session = self.session(name)
        for run in session.runs():
            _check_idle(run)
        return session


def _summary(folder: Path) -> SessionSummary:
    try:
        return _summed_up(folder)
    except StudioError as error:
        return unusable(folder.name, str(error))
    except Exception as error:  # whatever a foreign session holds, the others are listed
        return unusable(folder.name, f"The session cannot be summed up ({type(error).__name__}: {error}).")


def unusable(name: str, problem: str) -> SessionSummary:
    """The line of a session that cannot be opened."""
    return SessionSummary(name, name, "", "", (), 0, 0.0, False, False, (), (), (), problem)


def _summed_up(folder: Path) -> SessionSummary:
    manifest = Session(folder).manifest
    runs, unread = _run_summaries(folder / RUNS_NAME)
    return SessionSummary(
        name=folder.name,
        title=manifest.title,
        created=manifest.created,
        body=manifest.body,
        cameras=tuple(camera.name for camera in manifest.footage.cameras),
        frames=manifest.frame_count,
        fps=manifest.fps,
        has_truth=any((folder / "truth").glob("*.trc")),
        thumbnail=(folder / THUMBNAIL_NAME).exists(),
        notes=manifest.notes,
        warnings=(*manifest.warnings, *unread),
        runs=runs,
    )


def _run_summaries(folder: Path) -> tuple[tuple[RunSummary, ...], tuple[str, ...]]:
    """Runs by creation time, damaged results in the status; and what is said of those whose record cannot be read."""
    summaries: list[RunSummary] = []
    unread: list[str] = []
    for path in _named_folders(folder, RECORD_NAME):
        try:
            run = StoredRun(path, read_run_record(path))
        except StudioError as error:
            unread.append(f"Run '{path.name}' is left out: {error}")
            continue
        try:
            summaries.append(run.summary(blobs=False))
        except Exception:  # whatever a foreign store holds, the others are listed
            summaries.append(dataclasses.replace(run.empty_summary(), status="damaged"))
    return tuple(sorted(summaries, key=lambda run: (run.created, run.name))), tuple(unread)


def _named_folders(parent: Path, marker: str) -> Iterator[Path]:
    """The folders that have a lawful name and hold the file `marker`; links that lead out are left aside."""
    for folder in sorted(parent.iterdir()) if parent.is_dir() else ():
        inside = not folder.is_symlink() or folder.resolve().is_relative_to(parent.resolve())
        if is_name(folder.name) and (folder / marker).is_file() and inside:
            yield folder


def _check_idle(run: StoredRun) -> None:
    if run.being_tracked():
        raise SessionError(f"Run '{run.name}' is being tracked.", "Cancel it first.")


def _transient(folder: str, names: list[str]) -> set[str]:
    """The files that a copy omits: locks, unfinished files, and databases, which are copied by SQLite itself."""
    left_out = {name for name in names if name.startswith((RESULTS_NAME, "results.lock"))}
    return left_out | {name for name in names if name.startswith(atomic_files.PARTIAL_PREFIX)}


NO_FOOTAGE = FootageSource(0.0, 0, ())
LONGEST_TITLE = 200


def begin_session(place: Path, title: str = "", body: str = "") -> Session:
    """Make an empty session at `place` (as `Workspace.place_for` gives it). title : its name unless given.

    Raises BodyError for an unknown body, SessionError for an invalid title or a place that is taken.
    """
    words = " ".join(title.split()) or place.name
    if len(words) > LONGEST_TITLE:
        raise SessionError(
            f"A title of {len(words)} characters cannot be shown.", f"Use 1 to {LONGEST_TITLE} characters."
        )
    name = load_body(body).name if body else DEFAULT_BODY
    own_text = body_file_text(body) if body_path(body) else ""
    manifest = SessionManifest(name=place.name, title=words, created=now(), body=name, footage=NO_FOOTAGE)
    with made_whole(place) as folder:
        write_manifest(folder, manifest)
        if own_text:
            (folder / BODIES_NAME).mkdir()
            write_text(folder / BODIES_NAME / f"{name}.toml", own_text)
    return Session(place)


def next_step(cameras: int, calibrated: bool) -> str:
    """What a session lacks for tracking: "footage", "calibration", or "" if nothing."""
    if not cameras:
        return "footage"
    return "" if calibrated else "calibration"
