"""Faults of the disk and of the system, as a table: the name of a kind, and the function that plants one."""

import contextlib
import errno
import os
import resource
import shutil
import signal
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from unittest import mock

from flipped_bytes import flip_in_file, flip_stored

from faults.process_kinds import PROCESS_KINDS, SERVER_KINDS
from faults.seams import ALL, LOOK, NAME, OPEN, READING, STORE, WRITE, WRITING, Touch
from faults.stage import DEEDS, DONE, NEW, files_of, frames_of, new_run, track
from faults.trial import Trial
from studio.foundations.errors import RunError
from studio.results.verifying import repair, verify
from studio.sessions.results_store import is_being_written

STORE_NAME = "results.sqlite"


def _system(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def _fail(touch: Touch) -> None:
    """What the system says of a broken disk, or SQLite."""
    if touch.kind in (LOOK, STORE):
        raise _database(sqlite3.SQLITE_IOERR, "disk I/O error")
    raise _system(errno.EIO)


def _database(code: int, words: str) -> sqlite3.OperationalError:
    error = sqlite3.OperationalError(words)
    error.sqlite_errorcode = code
    return error


def _full(touch: Touch) -> None:
    """As a full disk: what is written fails, what is read does not."""
    if touch.kind == STORE:
        raise _database(sqlite3.SQLITE_FULL, "database or disk is full")
    if touch.kind in (WRITE, NAME):
        raise _system(errno.ENOSPC)


# ---------------------------------------------------------------------- at a touch of any deed


def full_disk(trial: Trial) -> None:
    """From a write on there is no room; then there is again."""
    trial.a_deed()
    trial.disturb(trial.once(WRITING, _full, for_good=True))


def full_for_a_moment(trial: Trial) -> None:
    """One write fails."""
    trial.a_deed()
    trial.disturb(trial.once(WRITING, _full))


def read_error(trial: Trial) -> None:
    """A block cannot be read, once."""
    trial.a_deed()
    trial.disturb(trial.once(READING, _fail))


def write_error(trial: Trial) -> None:
    """A block cannot be written, once."""
    trial.a_deed()
    trial.disturb(trial.once(WRITING, _fail))


def torn_write(trial: Trial) -> None:
    """Half of what is written arrives, then the disk refuses."""

    def tear(touch: Touch) -> None:
        touch.half()
        raise _system(errno.EIO)

    trial.a_deed([name for name in DEEDS if WRITE in trial.stage.touches[name]])
    trial.disturb(trial.once([WRITE], tear))


def no_permission(trial: Trial) -> None:
    """A file may not be opened, made or renamed."""

    def refuse(touch: Touch) -> None:
        if touch.kind == STORE:
            raise _database(sqlite3.SQLITE_READONLY, "attempt to write a readonly database")
        raise _system(errno.EACCES)

    trial.a_deed()
    trial.disturb(trial.once([OPEN, *WRITING], refuse))


def files_may_not_grow(trial: Trial) -> None:
    """The system's own limit on a file's size: writes are cut short wherever it lies."""
    trial.a_deed()
    size = int(trial.rng.integers(1, 40_000))
    with _limited(resource.RLIMIT_FSIZE, size):
        trial.disturb(lambda _: None)
    trial.struck = True


def too_many_open_files(trial: Trial) -> None:
    """The process may open a few files more, native libraries too."""
    trial.a_deed()
    known = len(os.listdir("/proc/self/fd"))
    with _limited(resource.RLIMIT_NOFILE, known + int(trial.rng.integers(0, 12))):
        trial.disturb(lambda _: None)
    trial.struck = True


def no_memory(trial: Trial) -> None:
    """An allocation fails."""

    def fail(_: Touch) -> None:
        raise MemoryError

    trial.a_deed()
    trial.disturb(trial.once(ALL, fail), (MemoryError,))


def interrupted(trial: Trial) -> None:
    """Ctrl-C."""
    trial.a_deed()
    strike = trial.once(ALL, lambda _: signal.raise_signal(signal.SIGINT))
    trial.disturb(strike, (KeyboardInterrupt,))


def slow_disk(trial: Trial) -> None:
    """Each touch takes a while, and meanwhile others look: they see whole frames, and never another state."""
    trial.a_deed(["track", "repair", "make a run"])
    waits = trial.rng.exponential(0.001, 400)
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.002):
            for run in trial.at.session.runs():
                if any(trial.stage.frames[frame] != digest for frame, digest in frames_of(run).items()):
                    trial.wrong.append(f"a watcher saw a frame of run {run.name} that was never tracked so")

    watcher = threading.Thread(target=lambda: trial.attempt(watch))
    watcher.start()
    trial.disturb(lambda touch: time.sleep(waits[touch.number % len(waits)]))
    over.set()
    watcher.join()
    trial.struck = True


def clock_set_back(trial: Trial) -> None:
    """The clock goes back by up to ten years in the middle, and stays there; files made from then on are old."""
    trial.a_deed()
    back, real, moved = float(10.0 ** trial.rng.uniform(0.0, 8.5)), time.time, [0.0]
    with mock.patch.object(time, "time", side_effect=lambda: real() - moved[0]):
        trial.disturb(trial.once(ALL, lambda _: moved.__setitem__(0, back)))
        for path in trial.at.folder.rglob("*"):
            if path.is_file() and trial.rng.random() < 0.5:
                os.utime(path, (real() - back, real() - back))
        trial.look()


def tracked_twice(trial: Trial) -> None:
    """While a run is tracked, someone else tries to track it, repair it, or make one of its name. Whoever comes before
    the first holds it may track it; then the first finds it done. Whoever comes when the last frame is stored has
    nothing to track.
    """
    refused: list[str] = []

    def again(_: Touch) -> None:
        if not is_being_written(trial.at.run(NEW).folder):
            refused.append("not yet held")
        elif trial.at.run(NEW).summary().status == "finished":
            refused.append("nothing left to track")
        try:
            track(trial.at.session, trial.at.run(NEW))
        except RunError as error:
            refused.append(error.message)

    trial.disturb(trial.once([STORE], again))
    if trial.struck and not refused:
        trial.wrong.append("a second tracker was let in")


# ---------------------------------------------------------------------- on what lies on the disk


def flipped_in_frame(trial: Trial) -> None:
    """A bit of a stored frame flips: the frame is named, left out, and tracked again."""
    run = trial.at.run(DONE)
    frame = flip_stored(run.folder / STORE_NAME, trial.rng)
    trial.struck = True
    if [fault.frame for fault in verify(trial.at.session).faults if fault.run == DONE] != [frame]:
        trial.wrong.append(f"the flip in frame {frame} is not named")
    if run.summary().damaged != (frame,) or frame in frames_of(run):
        trial.wrong.append(f"frame {frame} counts as whole")
    _mend(trial, DONE)


def flipped_in_store(trial: Trial) -> None:
    """A bit of a database's file flips, anywhere in it."""
    run = trial.at.run(DONE)
    flip_in_file(run.folder / STORE_NAME, trial.rng)
    trial.struck = True
    _named_or_harmless(trial)
    _mend(trial, DONE)


def store_cut_short(trial: Trial) -> None:
    """A database's file ends too early."""
    path = trial.at.run(DONE).folder / STORE_NAME
    os.truncate(path, int(trial.rng.integers(4096, path.stat().st_size)))
    trial.struck = True
    _named_or_harmless(trial)
    _mend(trial, DONE)


def power_cut(trial: Trial) -> None:
    """The run's folder as it lay on the disk at some moment of the tracking, the end of its log not yet written."""
    run, kept = trial.at.run(NEW), trial.at.folder / "kept"

    def keep(_: Touch) -> None:
        with contextlib.suppress(shutil.Error):
            shutil.copytree(run.folder, kept, ignore=shutil.ignore_patterns("*-shm"))

    trial.disturb(trial.once(ALL, keep))
    shutil.rmtree(run.folder)
    kept.rename(run.folder)
    log = run.folder / f"{STORE_NAME}-wal"
    if log.exists():
        os.truncate(log, int(trial.rng.integers(0, log.stat().st_size + 1)))


def flipped_in_file(trial: Trial) -> None:
    """A bit of a file of the session or of a run flips: `verify` names it, and it does no harm beyond that file."""
    name = _a_file(trial)
    path = trial.at.session.path / name
    before, times = path.read_bytes(), path.stat()
    flip_in_file(path, trial.rng)
    _file_is_named(trial, name)
    _read_everything(trial)
    path.write_bytes(before)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def file_cut_short(trial: Trial) -> None:
    """A file ends too early."""
    name = _a_file(trial)
    path = trial.at.session.path / name
    before, times = path.read_bytes(), path.stat()
    path.write_bytes(before[: int(trial.rng.integers(0, len(before)))])
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    _file_is_named(trial, name)
    _read_everything(trial)
    path.write_bytes(before)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def file_gone(trial: Trial) -> None:
    """A file, or a folder in its place, is gone while the deed is done, and put back later."""
    name = _a_file(trial)
    path = trial.at.session.path / name
    path.rename(trial.at.folder / "away")
    if trial.rng.random() < 0.3:
        path.mkdir()
    _read_everything(trial)
    if path.is_dir():
        path.rmdir()
    (trial.at.folder / "away").rename(path)


def _a_file(trial: Trial) -> str:
    verify(trial.at.session)
    runs = [f"runs/{DONE}/{name}" for name in ("run.json", "cameras.toml")]
    name = str(trial.rng.choice(sorted([*files_of(trial.at), *runs])))
    trial.struck = True
    return name


def _file_is_named(trial: Trial, name: str) -> None:
    def look() -> None:
        if name not in {fault.place for fault in verify(trial.at.session).faults}:
            trial.wrong.append(f"the damage of {name} is not named")

    if name != "session.json":  # without it there is no session to be asked
        trial.attempt(look)


def _read_everything(trial: Trial) -> None:
    """Do what reads all files; each may be refused in words."""
    trial.attempt(lambda: DEEDS["track"].do(trial.at))
    trial.attempt(lambda: DEEDS["export"].do(trial.at))
    trial.attempt(lambda: trial.at.session.thumbnail())
    trial.attempt(lambda: new_run(trial.at.session, "other"))
    # What was tracked on damaged footage is not the run that is compared.
    for run in (NEW, "other"):
        shutil.rmtree(trial.at.workspace.root / "toy" / "runs" / run, ignore_errors=True)
    first = trial.stage.folder / "first" / "workspace" / "toy" / "runs" / NEW
    shutil.copytree(first, trial.at.workspace.root / "toy" / "runs" / NEW)


def _named_or_harmless(trial: Trial) -> None:
    faults = [fault for fault in verify(trial.at.session).faults if fault.run == DONE]
    if not faults and frames_of(trial.at.run(DONE)) != trial.stage.frames:
        trial.wrong.append("frames are missing or changed, and nothing is named")


def _mend(trial: Trial, name: str) -> None:
    """As the remedy says: repair, and resume."""

    def mended() -> None:
        faults = tuple(fault for fault in verify(trial.at.session).faults if fault.run == name)
        for entry in repair(trial.at.session, faults):
            if entry.problem:
                trial.said.append(entry.problem)
        track(trial.at.session, trial.at.run(name))

    trial.attempt(mended)


@contextmanager
def _limited(what: int, soft: int) -> Iterator[None]:
    before = resource.getrlimit(what)
    resource.setrlimit(what, (soft, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(what, before)


Kind = Callable[[Trial], None]

KINDS: Mapping[str, Kind] = {
    "disk full": full_disk,
    "disk full for a moment": full_for_a_moment,
    "read error": read_error,
    "write error": write_error,
    "torn write": torn_write,
    "no permission": no_permission,
    "files may not grow": files_may_not_grow,
    "too many open files": too_many_open_files,
    "no memory": no_memory,
    "interrupted": interrupted,
    "slow disk": slow_disk,
    "clock set back": clock_set_back,
    "tracked twice": tracked_twice,
    "flipped bit in a frame": flipped_in_frame,
    "flipped bit in a store": flipped_in_store,
    "store cut short": store_cut_short,
    "power cut": power_cut,
    "flipped bit in a file": flipped_in_file,
    "file cut short": file_cut_short,
    "file gone": file_gone,
    **PROCESS_KINDS,
    **SERVER_KINDS,
}
