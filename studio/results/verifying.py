"""Compares everything that a session stores with its checksums; tracks damaged frames again.

Files have theirs in `.checksums.json` (`sessions.file_checksums`), frames, layers and settings in the results store
(`sessions.results_codec`). Data from before there were checksums is unpacked and counted as unchecked.
"""

import contextlib
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.foundations.errors import SessionError, StudioError
from studio.foundations.progress import Progress, no_progress
from studio.runs.problem_source import ProblemSource
from studio.runs.run_footage import footage_of
from studio.runs.tracking_run import TrackingRun
from studio.search.settings import SettingsHistory, settings_from_values
from studio.sessions.atomic_files import PARTIAL_PREFIX, discard
from studio.sessions.file_checksums import check_files
from studio.sessions.results_store import FILE_NAME, ResultsWriter
from studio.sessions.salvaging import faults_of_database, salvage
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

ENDINGS = ("", "cancelled", "finished")
UNTOUCHED_SECONDS = 3600.0
COPY = "Put back a copy of the file."
REPAIR = "Track it again: studio verify --repair, or resume the run."


@dataclass(frozen=True, slots=True)
class Fault:
    """Damaged data.

    place : a path in the session, and for a store the part of it.
    run, frame : of a damaged frame.
    """

    place: str
    what: str
    remedy: str
    run: str = ""
    frame: int | None = None


@dataclass(frozen=True, slots=True)
class Verification:
    """The result of a verification.

    files, frames : how many were read.
    unchecked : frames without checksums, all of which could be unpacked.
    written_again : files written since, which is no fault.
    new : files with a checksum for the first time.
    left : places of what interrupted work left behind, in the session or beside it.
    """

    files: int
    frames: int
    unchecked: int
    written_again: tuple[str, ...]
    new: int
    faults: tuple[Fault, ...]
    left: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Repair:
    """The result of a repair. frames : tracked again. same : number of them with bit for bit the stored pose, of
    `compared` whose stored pose was intact. problem : why not all could be tracked, or "".
    """

    run: str
    frames: tuple[int, ...]
    same: int
    compared: int
    problem: str = ""


def verify(session: Session, progress: Progress = no_progress) -> Verification:
    runs = session.runs()
    faults: list[Fault] = []
    again: list[str] = []
    files = new = frames = unchecked = 0
    for done, (folder, prefix) in enumerate(
        [(session.path, ""), *((run.folder, f"runs/{run.name}/") for run in runs)]
    ):
        progress(f"checking {prefix or session.name}", done, len(runs) + 1)
        checked = check_files(folder)
        files, new = files + checked.count, new + len(checked.new)
        again += [prefix + name for name in checked.written_again]
        faults += [Fault(prefix + name, what, COPY) for name, what in sorted(checked.damaged.items())]
    for done, run in enumerate(runs):
        progress(f"checking run {run.name}", done, len(runs))
        count, without, wrong = _verify_results(run)
        frames, unchecked, faults = frames + count, unchecked + without, faults + wrong
    left = tuple(str(path) for path in left_behind(session))
    return Verification(files, frames, unchecked, tuple(again), new, tuple(faults), left)


def left_behind(session: Session) -> tuple[Path, ...]:
    """Unfinished files and folders in a session and beside it, in which nothing has changed for an hour: an import, a
    mask or a copy that was killed.
    """
    partial = [*session.path.parent.glob(f"{PARTIAL_PREFIX}*"), *_partial_below(session.path)]
    before = time.time() - UNTOUCHED_SECONDS
    return tuple(sorted(path for path in partial if not path.is_symlink() and _newest(path) < before))


def _partial_below(folder: Path) -> list[Path]:
    """Unfinished files and folders in a folder. What goes while it is looked through is left out."""
    return [
        Path(place) / name
        for place, folders, files in os.walk(folder)
        for name in (*folders, *files)
        if name.startswith(PARTIAL_PREFIX)
    ]


def remove_left_behind(session: Session) -> None:
    """Remove `left_behind`. What the disk refuses stays."""
    for path in left_behind(session):
        if path.is_dir():
            discard(path)
        else:
            with contextlib.suppress(OSError):
                path.unlink()


def _newest(path: Path) -> float:
    """When something was last changed in a folder, or the file; just now, where it is gone by now."""
    try:
        times = [path.lstat().st_mtime]
    except FileNotFoundError:
        return time.time()
    for parent, _, names in os.walk(path):
        for entry in (parent, *(os.path.join(parent, name) for name in names)):
            with contextlib.suppress(OSError):
                times.append(os.lstat(entry).st_mtime)
    return max(times)


def _verify_results(run: StoredRun) -> tuple[int, int, list[Fault]]:
    """The number of frames read, of those without checksums, and the faults."""
    place = f"runs/{run.name}/{FILE_NAME}"
    broken = [
        Fault(place, f"the database is damaged ({text})", REPAIR, run.name)
        for text in faults_of_database(run.folder)
    ]
    faults: list[Fault] = []
    with run.results() as results:
        try:
            results.check_all_again()
            damaged, unchecked, whole = dict(results.damaged()), results.unchecked(), results.frames()
            damaged |= {frame: part for frame in unchecked if (part := results.check_again(frame))}
            remedy = "Its frames came on a clock: make the run again." if _is_live(run) else REPAIR
            faults += [
                Fault(f"{place}: frame {frame}", f"{part} is not what was written", remedy, run.name, frame)
                for frame, part in sorted(damaged.items())
            ]
            faults += [
                Fault(f"{place}: settings version {version}", "is not what was written", REPAIR, run.name)
                for version in results.damaged_settings()
            ]
            if results.partial_is_damaged():
                remedy = "The unfinished frame is searched from its first layer when the run is resumed."
                faults.append(
                    Fault(f"{place}: the unfinished frame", "is not what was written", remedy, run.name)
                )
            if results.ended() not in ENDINGS:
                faults.append(
                    Fault(f"{place}: the end of the run", "is not what was written", REPAIR, run.name)
                )
        except SessionError as error:
            return 0, 0, broken or [Fault(place, error.message, REPAIR, run.name)]
    return len(whole) + len(damaged), len(unchecked), broken + faults


def _is_live(run: StoredRun) -> bool:
    """Whether the run was live; an unreadable record is reported separately."""
    with contextlib.suppress(SessionError):
        return run.record.live
    return False


def repair(
    session: Session, faults: tuple[Fault, ...], progress: Progress = no_progress
) -> tuple[Repair, ...]:
    """Track the damaged frames of each run again from the stored frames before them. Other faults stay."""
    names = dict.fromkeys(fault.run for fault in faults if fault.run)
    return tuple(_repair_run(session, session.run(name), faults, progress) for name in names)


def _repair_run(session: Session, run: StoredRun, faults: tuple[Fault, ...], progress: Progress) -> Repair:
    mine = [fault for fault in faults if fault.run == run.name]
    frames: list[int] = []
    before: dict[int, NDArray[np.float64]] = {}
    try:
        if faults_of_database(run.folder):
            salvage(run.folder, run.record.first, run.record.last)
        with run.results() as results:
            without = set(results.unchecked())
            before = results.stored_poses()
        with ResultsWriter(run.folder) as writer:
            for fault in mine:
                if fault.frame in without:
                    writer.give_up(fault.frame)
            _mend_rest(run, writer)
        if run.record.live:
            raise SessionError(f"Run '{run.name}' is a live one: its frames came on a clock.", "")
        frames = _track_damaged(session, run, progress)
    except StudioError as error:
        return Repair(run.name, tuple(frames), 0, 0, error.message)
    with run.results() as results:
        now = results.stored_poses()
    compared = [frame for frame in frames if frame in before]
    same = sum(before[frame].tobytes() == now[frame].tobytes() for frame in compared)
    return Repair(run.name, tuple(frames), same, len(compared))


def _mend_rest(run: StoredRun, writer: ResultsWriter) -> None:
    """Restore the first settings from the record, and drop a damaged unfinished frame. Raises SessionError."""
    record = run.record
    with run.results() as results:
        wrong, partial, ended = results.damaged_settings(), results.partial_is_damaged(), results.ended()
    if wrong and (wrong != [1] or record.made_from):
        raise SessionError(
            f"Version {wrong[-1]} of the settings of run '{run.name}' is lost.", "Start the run again."
        )
    if wrong:
        settings = settings_from_values(record.tracker, record.weighting, record.settings)
        first = SettingsHistory(()).with_applied(1, record.first, 0, settings).entries[-1]
        writer.write_settings(1, first.frame, first.layer, first.values)
    if partial:
        writer.forget_partial()
    if ended not in ENDINGS:
        writer.mark_ended("")


def _track_damaged(session: Session, run: StoredRun, progress: Progress) -> list[int]:
    """Track only the damaged frames; returns them in the order of tracking."""
    with run.results() as results:
        if not results.damaged():
            return []
    frames: list[int] = []
    problems = ProblemSource(session, run.body(), run.cameras(), footage=footage_of(session, run))
    with contextlib.closing(problems), contextlib.closing(TrackingRun(run, problems)) as tracking:
        total = tracking.damaged
        while tracking.damaged:
            stepped = tracking.step_layer()
            if stepped.result is not None:
                if stepped.result.frame in frames:
                    raise SessionError(
                        f"Frame {stepped.result.frame} of run '{run.name}' is damaged again once it is tracked.",
                        "Start the run again.",
                    )
                frames.append(stepped.result.frame)
                progress(f"tracking damaged frames of {run.name} again", len(frames), total)
    return frames
