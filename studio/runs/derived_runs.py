"""Runs made from another one, which is not changed: corrected, or tracked with other knobs from a frame on."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from studio.foundations.errors import RunError
from studio.foundations.package import software_version
from studio.sessions import atomic_files
from studio.sessions.atomic_files import taken
from studio.sessions.file_checksums import note_files
from studio.sessions.manifest import now
from studio.sessions.names import checked_name
from studio.sessions.results_store import copy_frames, create_store
from studio.sessions.run_record import BEHAVIOUR_NAME, CAMERAS_NAME, RunRecord, write_run_record
from studio.sessions.session import Session, free_run_name
from studio.sessions.stored_run import BODY_FOLDER, StoredRun


def derived_record(
    session: Session,
    run: StoredRun,
    name: str,
    note: str,
    **changes: Any,  # noqa: ANN401
) -> RunRecord:
    """The record of a run made from another one. name : "" for the next free one. note : how it was made, a sentence.
    changes : entries that differ besides.
    """
    record = run.record
    return msgspec.structs.replace(
        record,
        name=name or free_run_name(session),
        session=session.name,
        created=now(),
        software=software_version(),
        live=False,
        made_from=run.name,
        notes=(*record.notes, note),
        **changes,
    )


def check_branching_frame(run: StoredRun, frame: int, *, beyond: bool = True) -> list[int]:
    """The run's finished frames, if another run can leave it at `frame`. beyond : also at the one after its last.

    Raises RunError.
    """
    record = run.record
    if record.ping_pong:
        raise RunError(
            f"Run '{run.name}' plays its footage forwards and backwards.", "Track the footage once instead."
        )
    with run.results() as results:
        frames = results.frames()
    if not frames:
        raise RunError(f"Run '{run.name}' has no finished frame.", "Track it first, or start a new run.")
    latest = min(frames[-1] + 1, record.last - 1) if beyond else frames[-1]
    if not frames[0] <= frame <= latest:
        raise RunError(
            f"Frame {frame} of run '{run.name}' cannot be tracked again.",
            f"Choose a frame from {frames[0]} to {latest}.",
        )
    return frames


def new_folder(
    run: StoredRun,
    record: RunRecord,
    last: int | None,
    complete: Callable[[StoredRun], None] = lambda made: None,
) -> StoredRun:
    """A run's folder with the old snapshots and the frames before `last`; atomic. complete : called before that."""
    place = run.folder.parent / checked_name(record.name, "run")
    if place.exists():
        raise taken(place)
    folder = copied_beside(run, record, last)
    try:
        complete(StoredRun(folder))
        atomic_files.move_into_place(folder, Path(place))
    except FileExistsError:
        raise taken(place) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return StoredRun(place)


def copied_beside(run: StoredRun, record: RunRecord, last: int | None = None) -> Path:
    """A hidden folder beside the run's own with its snapshots, its frames before `last` (None: all) and a record."""
    folder = atomic_files.new_folder_beside(run.folder, parents=False)
    try:
        for part in (CAMERAS_NAME, BEHAVIOUR_NAME):
            if (run.folder / part).exists():
                atomic_files.copy_file(run.folder / part, folder / part)
        if (run.folder / BODY_FOLDER).is_dir():
            shutil.copytree(run.folder / BODY_FOLDER, folder / BODY_FOLDER)
        create_store(folder)
        copy_frames(run.folder, folder, last)
        write_run_record(folder, record)
        note_files(folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder
