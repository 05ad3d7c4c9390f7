"""Sessions in object stores, worked on through copies on each machine; runs and comparisons are put back.

A session lies in a store as in a folder, file by file. What says that something is whole, `session.json`, a run's
`run.json` and a comparison's `comparison.json`, is put last and taken away first: whatever breaks off, nothing half
written is seen as whole.

A copy lies in a cache (`STUDIO_CACHE`) under a digest of the address and of the stamps that the store gives its files,
so footage that changed is another copy. It is made beside its place by one process while others wait, compared with
the list and with the session's checksums, then renamed. Copies that no process uses are removed, those unused longest
first, beyond `STUDIO_CACHE_GB`.
"""

import contextlib
import hashlib
import json
import os
import threading
from collections import OrderedDict
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

import platformdirs

from studio.foundations.errors import NotFoundError, SessionError, StudioError
from studio.foundations.foreign_files import LARGEST_RECORD, check_inside, read_file, read_text
from studio.foundations.progress import Progress, no_progress
from studio.sessions.atomic_files import (
    PARTIAL_PREFIX,
    changed_while_copied,
    copy_database,
    copy_file,
    discard,
    made_whole,
    write_bytes,
    writing,
)
from studio.sessions.file_checksums import NAME as CHECKSUMS
from studio.sessions.file_checksums import check_files
from studio.sessions.manifest import FILE_NAME as MANIFEST
from studio.sessions.names import checked_name, free_name, name_from
from studio.sessions.object_stores import Listed, Store, above, below, is_address
from studio.sessions.process_lock import ProcessLock, alone
from studio.sessions.results_reader import FILE_NAME as RESULTS_NAME
from studio.sessions.run_record import FILE_NAME as RUN_RECORD
from studio.sessions.session import RUNS_NAME, Session
from studio.sessions.stored_run import StoredRun

CACHE_VARIABLE, SIZE_VARIABLE = "STUDIO_CACHE", "STUDIO_CACHE_GB"
USUAL_GB = 50.0
ORIGIN_NAME, IN_USE_NAME = "origin.json", "in-use.lock"
COMPARISONS, COMPARISON_RECORD = "comparisons", "comparison.json"
NOT_BROUGHT = (f"{RUNS_NAME}/", f"{COMPARISONS}/")
"""What a copy begins without; a run or a comparison comes when it is wanted."""
TRIES, PATIENCE = 3, 30.0
HELD_AT_MOST = 16
"""Copies that a process keeps from being removed: those that it opened last."""


@dataclass(frozen=True, slots=True)
class RemoteSession:
    """A session in a store. whole : False where its upload was broken off. runs : names of those that are whole."""

    name: str
    address: str
    whole: bool
    bytes: int
    runs: tuple[str, ...]


def cache_folder() -> Path:
    """Where copies lie: the environment variable STUDIO_CACHE, or the user's cache folder."""
    chosen = os.environ.get(CACHE_VARIABLE, "").strip()
    return (
        Path(chosen).expanduser() if chosen else platformdirs.user_cache_path("capture-studio") / "sessions"
    )


def work_folder(address: str) -> Path:
    """A folder of this machine for what is made below an address; not among the copies, which are removed."""
    key = hashlib.sha256(address.rstrip("/").encode()).hexdigest()[:24]
    return cache_folder() / "work" / f"{name_from(PurePosixPath(address).name)}-{key}"


def remote_session(address: str, progress: Progress = no_progress) -> Session:
    """A copy of the session at an address, of its present footage; brought where there is none yet.

    Raises NotFoundError, SessionError where it is half written, damaged, or the store refuses.
    """
    store = Store(address)
    name = checked_name(PurePosixPath(store.address).name)
    for _ in range(TRIES):
        files = _needed_files(store)
        key = _key(store.address, files)
        place = cache_folder() / key
        if not (place / name / MANIFEST).is_file():
            _bring(store, files, key, name, progress)
            if _key(store.address, _needed_files(store)) != key:
                continue
        if _hold(place) and (place / name / MANIFEST).is_file():
            (place / ORIGIN_NAME).touch()
            return Session(place / name)
    raise SessionError(
        f"'{address}' changes while it is brought.", "Wait until it is put there, then try again."
    )


def address_of(session: Session) -> str:
    """The address that a session is a copy from, "" for any other session."""
    try:
        return str(json.loads(read_text(session.path.parent / ORIGIN_NAME))["address"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def place_in_words(session: Session) -> str:
    """Where any machine finds a session: its address, or its folder."""
    return address_of(session) or str(session.path.absolute())


def remote_runs(session: Session) -> frozenset[str]:
    """Names of the runs that lie beside a copy's original; none for any other session."""
    address = address_of(session)
    return (
        frozenset(_complete_folders(Store(below(address, RUNS_NAME)).listed(), RUN_RECORD))
        if address
        else frozenset()
    )


def free_run_name_at(session: Session, wanted: str = "") -> str:
    """A name for a copy's next run, which no run of its original has. Raises SessionError where `wanted` is taken."""
    taken = {run.name for run in session.runs()} | remote_runs(session)
    if wanted and wanted in taken:
        raise SessionError(f"Session '{session.name}' has a run '{wanted}'.", "Choose another name.")
    return wanted or free_name(f"run-{len(taken) + 1}", taken)


def bring_runs(session: Session, begin: str) -> None:
    """Bring a copy the runs whose names begin so and which it has not; nothing for any other session."""
    for name in sorted(remote_runs(session)):
        if name.startswith(begin):
            bring_part(session, RUNS_NAME, name)


def bring_part(session: Session, kind: str, name: str) -> None:
    """Bring a copy one run or comparison of its original that it has not. Raises NotFoundError, SessionError."""
    place = session.path / kind / name
    if place.is_dir():
        return
    store = Store(below(address_of(session), kind, name))
    files = store.listed()
    if not files.keys() & {RUN_RECORD, COMPARISON_RECORD}:
        raise NotFoundError(
            f"There is no complete session at '{store.address}'.", "List what there is: studio runs."
        )
    try:
        with made_whole(place) as folder:
            store.bring(files, folder, lambda _: None)
    except SessionError:
        # Another process may have brought it meanwhile.
        if not place.is_dir():
            raise


def bring_comparisons(session: Session) -> None:
    """Bring a copy the new comparisons of its original; nothing for any other session."""
    address = address_of(session)
    if not address:
        return
    store = Store(below(address, COMPARISONS))
    files = store.listed()
    for name in _complete_folders(files, COMPARISON_RECORD):
        place = session.path / COMPARISONS / name
        if not place.is_dir():
            bring_part(session, COMPARISONS, name)
            continue
        new = {path: one for path, one in files.items() if path.startswith(f"{name}/")}
        new = {path: one for path, one in new.items() if not (session.path / COMPARISONS / path).is_file()}
        store.bring(new, session.path / COMPARISONS, lambda _: None)


def put_run(session: Session, run: StoredRun) -> None:
    """Put a copy's run beside its original, whole or not at all; nothing for any other session."""
    _put_part(session, run.folder, RUN_RECORD)


@contextmanager
def comparison_put_back(session: Session, folder: Path) -> Generator[None]:
    """Put a copy's comparison beside its original before and after work on it, however that ends."""
    _put_part(session, folder, COMPARISON_RECORD)
    try:
        yield
    finally:
        _put_part(session, folder, COMPARISON_RECORD)


def upload(session: Session, address: str, progress: Progress = no_progress) -> str:
    """Put a session with its runs at an address, from which any machine works on it; returns the address.

    Raises SessionError where there is a session already, where footage lies outside the session's folder, where other
    work changes the session meanwhile, or where the store refuses. An interrupted upload is begun again.
    """
    store = Store(address)
    checked_name(PurePosixPath(store.address).name)
    outside = [
        place for one in session.manifest.footage.cameras for place in one.places if Path(place).is_absolute()
    ]
    if outside:
        raise SessionError(
            f"The footage of session '{session.name}' lies elsewhere ('{outside[0]}').",
            "Import it again with --copy, so that the session has its own.",
        )
    if store.has(MANIFEST):
        raise SessionError(
            f"There is a session at '{store.address}' already.",
            "Choose another address, or delete it there first.",
        )
    _put_whole(store, session.path, MANIFEST, progress)
    return store.address


def download(address: str, place: Path, progress: Progress = no_progress) -> Session:
    """The session at an address with its runs and comparisons as a folder of this machine, made whole.

    Raises NotFoundError, SessionError.
    """
    store = Store(address)
    files = store.listed()
    wanted = _needed_files(store, files)
    for kind, record in ((RUNS_NAME, RUN_RECORD), (COMPARISONS, COMPARISON_RECORD)):
        parts = {name: one for name, one in files.items() if name.startswith(f"{kind}/")}
        whole = _complete_folders({name.partition("/")[2]: one for name, one in parts.items()}, record)
        wanted |= {name: one for name, one in parts.items() if name.split("/")[1] in whole}
    with made_whole(place) as folder:
        _bring_checked(store, wanted, folder, progress)
    return Session(place)


def sessions_at(address: str) -> tuple[RemoteSession, ...]:
    """The session at an address, or those directly below it. Raises NotFoundError where there is nothing."""
    store = Store(address)
    files = store.listed()
    if MANIFEST in files:
        return (_describe(store.address, files),)
    names = store.folders()
    sessions = [
        _describe(
            below(store.address, name),
            {
                path.removeprefix(f"{name}/"): one
                for path, one in files.items()
                if path.startswith(f"{name}/")
            },
        )
        for name in names
    ]
    return tuple(one for one in sessions if one.whole or one.bytes)


def upload_unless_there(session: Session, address: str) -> None:
    """Put a session at an address, in place of another one there; files of the same names and sizes are the same."""
    store = Store(address)
    stored, own = store.listed(), dict(_own_files(session.path))
    # These say when it was made.
    dated = {MANIFEST, CHECKSUMS}
    sizes = {name: path.stat().st_size for name, path in own.items() if name not in dated}
    if MANIFEST in stored and sizes == {name: one.size for name, one in stored.items() if name not in dated}:
        return
    store.remove([MANIFEST, *stored])
    upload(session, address)


def bring_work(address: str, *left_out: str) -> Path:
    """The folder of this machine for what is kept at an address, with all of it that it lacked. left_out : folders."""
    folder, store = work_folder(address), Store(address)
    files = {
        name: one
        for name, one in store.listed().items()
        if name.split("/")[0] not in left_out and not (folder / name).is_file()
    }
    store.bring(files, folder, lambda _: None)
    return folder


def put_work(address: str, *left_out: str) -> None:
    files = {
        name: path for name, path in _own_files(work_folder(address)) if name.split("/")[0] not in left_out
    }
    Store(address).put(files, lambda _: None)


def remote_file(address: str) -> str:
    """The path of a copy of one small file at an address, named by its content; any other place as it is."""
    if not is_address(address):
        return address
    content = Store(above(address)).read(PurePosixPath(address).name)
    place = (
        cache_folder()
        / "files"
        / f"{hashlib.sha256(content).hexdigest()[:24]}{PurePosixPath(address).suffix}"
    )
    if not place.is_file():
        place.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(place, content)
    return str(place)


def _describe(address: str, files: Mapping[str, Listed]) -> RemoteSession:
    runs = {
        name.removeprefix(f"{RUNS_NAME}/"): one
        for name, one in files.items()
        if name.startswith(f"{RUNS_NAME}/")
    }
    total = sum(one.size for one in files.values())
    whole = tuple(sorted(_complete_folders(runs, RUN_RECORD)))
    return RemoteSession(PurePosixPath(address).name, address, MANIFEST in files, total, whole)


# ------------------------------------------------------------------ copies


def _needed_files(store: Store, files: Mapping[str, Listed] | None = None) -> dict[str, Listed]:
    """The files of a session without its runs and comparisons. Raises NotFoundError, SessionError."""
    files = store.listed() if files is None else files
    if MANIFEST not in files:
        if not files:
            raise NotFoundError(
                f"There is no session at '{store.address}'.",
                "List what is there with 'studio runs ADDRESS', or put one there with 'studio upload'.",
            )
        raise SessionError(
            f"What lies at '{store.address}' is no complete session: it has no '{MANIFEST}', which is put last.",
            "Its upload was interrupted or is not finished: wait, or upload it again.",
        )
    return {name: one for name, one in files.items() if not name.startswith(NOT_BROUGHT)}


def _key(address: str, files: Mapping[str, Listed]) -> str:
    content = [address, *(f"{name} {files[name].size} {files[name].stamp}" for name in sorted(files))]
    digest = hashlib.sha256("\n".join(content).encode()).hexdigest()[:24]
    return f"{name_from(PurePosixPath(address).name)}-{digest}"


def _bring(store: Store, files: Mapping[str, Listed], key: str, name: str, progress: Progress) -> None:
    """Make the copy of a key, or wait for the process that does. Raises SessionError."""
    cache = cache_folder()
    with writing("The copy", cache):
        cache.mkdir(parents=True, exist_ok=True)
    with alone(cache / f"{key}.lock"):
        place, partial = cache / key, cache / f"{PARTIAL_PREFIX}{key}"
        if (place / name / MANIFEST).is_file():
            return
        # The lock is held, so whoever began these is gone.
        discard(partial)
        discard(place)
        _make_room(sum(one.size for one in files.values()))
        try:
            with writing("The copy", partial):
                (partial / name).mkdir(parents=True)
                _bring_checked(store, files, partial / name, progress)
                about = {"address": store.address, "bytes": sum(one.size for one in files.values())}
                (partial / ORIGIN_NAME).write_text(json.dumps(about), encoding="utf-8")
                os.rename(partial, place)
        finally:
            discard(partial)


def _bring_checked(store: Store, files: Mapping[str, Listed], folder: Path, progress: Progress) -> None:
    """Copy files and compare them with their checksums. Raises SessionError."""
    total, came = sum(one.size for one in files.values()), 0

    def on_bytes(count: int) -> None:
        nonlocal came
        came += count
        progress(f"bringing {store.address}", came, total)

    progress(f"bringing {store.address}", 0, total)
    store.bring(files, folder, on_bytes)
    damaged = check_files(folder, note=False).damaged
    if damaged:
        name, what = next(iter(damaged.items()))
        raise SessionError(
            f"'{below(store.address, name)}' {what}.",
            "Delete the session there and upload it again completely.",
        )


_holds: "OrderedDict[Path, ProcessLock]" = OrderedDict()
_changing = threading.Lock()


def _hold(place: Path) -> bool:
    """Keep a copy from being removed while this process is likely to use it; False where it is gone."""
    with _changing:
        if place not in _holds:
            try:
                lock = ProcessLock.share(place / IN_USE_NAME, PATIENCE)
            except SessionError:
                return False
            if lock is None:
                return False
            _holds[place] = lock
            while len(_holds) > HELD_AT_MOST:
                _holds.popitem(last=False)[1].free()
        _holds.move_to_end(place)
        return True


def _make_room(needed: int) -> None:
    """Remove copies that no process uses, those unused longest first, until so many bytes fit the bound."""
    try:
        most = float(os.environ.get(SIZE_VARIABLE, "") or USUAL_GB) * 1e9
    except ValueError:
        raise SessionError(
            f"{SIZE_VARIABLE} is '{os.environ[SIZE_VARIABLE]}', no number.", "Give gigabytes, such as 50."
        ) from None
    copies = [(path.stat().st_mtime_ns, path.parent) for path in cache_folder().glob(f"*/{ORIGIN_NAME}")]
    sizes = {place: _bytes(place) for _, place in copies}
    used = sum(sizes.values())
    for _, place in sorted(copies):
        if used + needed <= most:
            return
        with contextlib.suppress(SessionError, OSError):
            lock = ProcessLock.take(place / IN_USE_NAME)
            if lock is None:
                continue
            try:
                gone = place.with_name(f"{PARTIAL_PREFIX}{place.name}-gone")
                os.rename(place, gone)
            finally:
                lock.free()
            discard(gone)
            used -= sizes[place]


def _bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


# ------------------------------------------------------------------ putting back


def _put_part(session: Session, folder: Path, record: str) -> None:
    address = address_of(session)
    if address and folder.is_relative_to(session.path):
        _put_whole(Store(below(address, folder.parent.name, folder.name)), folder, record, no_progress)


def _put_whole(store: Store, folder: Path, record: str, progress: Progress) -> None:
    """Put a folder, its record last and taken away first; each run and comparison within likewise.

    What says which files belong to it is read first, so that what other work adds meanwhile is not half in it.

    Raises SessionError where a file goes meanwhile: what was put is no session then.
    """
    files = dict(_own_files(folder))
    try:
        _put_files(store, files, record, progress)
    except (StudioError, OSError):
        gone = next((name for name, path in files.items() if not path.exists()), "")
        if gone and folder.exists():
            raise changed_while_copied(folder.name, gone) from None
        raise


def _put_files(store: Store, files: Mapping[str, Path], record: str, progress: Progress) -> None:
    last = sorted((name for name in files if _is_record(name, record)), key=lambda name: -name.count("/"))
    records = [(name, read_file(files[name], LARGEST_RECORD)) for name in last]
    store.remove(reversed(last))
    first = {name: path for name, path in files.items() if name not in last}
    total, came = sum(path.stat().st_size for path in files.values()), 0

    def on_bytes(count: int) -> None:
        nonlocal came
        came += count
        progress(f"putting to {store.address}", came, total)

    progress(f"putting to {store.address}", 0, total)
    with TemporaryDirectory(prefix="studio-put-") as copies:
        for number, name in enumerate(first):
            copy = Path(copies) / str(number)
            if PurePosixPath(name).name == RESULTS_NAME:
                # A store that is open has its newest pages in another file.
                copy_database(files[name], copy)
            elif name == CHECKSUMS:
                copy_file(files[name], copy)
            else:
                continue
            first[name] = copy
        store.put(first, on_bytes)
    for name, content in records:
        store.write(name, content)


def _is_record(name: str, record: str) -> bool:
    """Whether a file says that the whole, or a run or comparison within, is whole."""
    path = PurePosixPath(name)
    return name == record or (len(path.parts) == 3 and path.name in (RUN_RECORD, COMPARISON_RECORD))


def _own_files(folder: Path) -> Generator[tuple[str, Path]]:
    """What is copied of a session, run or comparison: all but locks, databases' side files and unfinished files."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        left_out = path.name.endswith((".lock", "-wal", "-shm", "-journal"))
        if path.is_symlink():
            check_inside(path)
        if path.is_file() and not left_out and f"/{PARTIAL_PREFIX}" not in f"/{name}":
            yield name, path


def _complete_folders(files: Iterable[str], record: str) -> frozenset[str]:
    return frozenset(
        name.split("/")[0] for name in files if name.count("/") == 1 and name.endswith(f"/{record}")
    )
