"""The comparisons of a session: folders, listing, trash and restoring."""

import contextlib
import os
from collections.abc import Mapping
from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import Any

from studio.foundations.errors import NotFoundError, SessionError, StudioError
from studio.foundations.package import software_version
from studio.results.comparison.kept_comparison import (
    BEHAVIOUR_NAME,
    RECORD,
    RECORD_NAME,
    ComparisonRecord,
    KeptComparison,
)
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.plan import Plan
from studio.sessions import atomic_files
from studio.sessions.manifest import now
from studio.sessions.names import checked_name, free_name, inside, is_name
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import check_there, one_at_a_time
from studio.sessions.workspace import TRASH_NAME, Workspace

FOLDER_NAME = "comparisons"


def new_comparison(folder: Path, plan: Plan, of: Session | None = None) -> KeptComparison:
    """Make a comparison's folder, atomically. of : the session that it lies in, if any.

    Raises SessionError if it exists, NotFoundError if the session was moved meanwhile.
    """
    if of is None:
        return _begin(folder, plan)
    with one_at_a_time(of.path):
        check_there(of.path)
        return _begin(folder, plan)


def _begin(folder: Path, plan: Plan) -> KeptComparison:
    record = ComparisonRecord(name=folder.name, created=now(), software=software_version(), plan=plan)
    made = atomic_files.new_folder_beside(folder)
    try:
        if plan.behaviour_path:
            atomic_files.copy_file(Path(plan.behaviour_path), made / BEHAVIOUR_NAME)
        RECORD.write(made / RECORD_NAME, record)
        atomic_files.move_into_place(made, folder)
    except FileExistsError:
        raise SessionError(f"'{folder}' already exists.", "Choose another name or folder.") from None
    finally:
        atomic_files.discard(made)
    return KeptComparison(folder)


def place_of(session: Session, name: str = "", *, sweep: bool = False) -> Path:
    """The folder for a comparison of a session; without a name comparison-1, comparison-2, … or sweep-1, sweep-2, …

    A sweep gets no name that runs of an earlier one have.
    """
    folder = session.path / FOLDER_NAME
    taken: set[str] = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if name:
        return folder / checked_name(name, "comparison")
    if not sweep:
        return folder / free_name(f"comparison-{len(taken) + 1}", taken)
    taken |= {run.name.rpartition("-p")[0] for run in session.runs()}
    return folder / next(name for number in count(1) if (name := f"sweep-{number}") not in taken)


def kept_comparisons(session: Session) -> tuple[KeptComparison, ...]:
    """A session's comparisons, newest first."""
    return tuple(KeptComparison(path) for path in sorted(_folders(session), key=_age_key, reverse=True))


def comparison_count(session: Session) -> int:
    return len(_folders(session))


def kept_comparison(session: Session, name: str) -> KeptComparison:
    """A session's comparison by name. Raises NotFoundError, NameRefused."""
    path = inside(session.path / FOLDER_NAME, name, "comparison")
    if not _is_comparison(path):
        raise NotFoundError(
            f"Session '{session.name}' has no comparison '{name}'.",
            "List them, or start one with 'studio compare'.",
        )
    return KeptComparison(path)


def unfinished_like(session: Session, plan: Plan) -> KeptComparison | None:
    """The newest comparison of a session with the same plan that can be resumed, None without one."""
    for kept in kept_comparisons(session):
        try:
            same = not differences(plan, kept.plan(session))
        except SessionError:
            continue
        if same and kept.status() in ("interrupted", "cancelled", "failed"):
            return kept
    return None


def runs_of(session: Session, kept: KeptComparison) -> dict[str, StoredRun]:
    """The runs that were made for a comparison's trials, recognised by their notes (`KeptComparison.note_of`)."""
    begin = kept.note_of("")
    runs: dict[str, StoredRun] = {}
    for run in session.runs():
        # One that cannot be read is none of them.
        with contextlib.suppress(StudioError):
            runs |= {note: run for note in run.record.notes if note.startswith(begin)}
    return runs


def throw_away(workspace: Workspace, session: Session, kept: KeptComparison) -> Path:
    """Move a comparison to the workspace's trash. Raises SessionError while a process works on it."""
    if kept.is_running():
        raise SessionError(f"Comparison '{kept.name}' is running.", "Cancel it first.")
    return workspace.to_trash(kept.folder, f"{session.name}--{kept.name}")


def bring_back(workspace: Workspace, trashed_name: str) -> tuple[Session, KeptComparison]:
    """Restore a comparison from the trash into its session. Raises NotFoundError."""
    thrown = KeptComparison(inside(workspace.root / TRASH_NAME, trashed_name))
    record = thrown.record()
    for owner in (trashed_name.partition("--")[0], record.plan.session):
        if is_name(owner) and (workspace.root / owner).is_dir():
            session = workspace.session(owner)
            folder = session.path / FOLDER_NAME
            folder.mkdir(exist_ok=True)
            place = folder / free_name(record.name, {path.name for path in folder.iterdir()})
            os.rename(thrown.folder, place)
            return session, KeptComparison(place)
    raise NotFoundError(
        f"Session '{record.plan.session}' of this comparison does not exist.", "Restore the session first."
    )


def differences(requested: Plan, kept: Plan) -> tuple[str, ...]:
    """The names of the fields in which two plans differ; the session's path does not count."""
    first, second = _comparable(requested), _comparable(kept)
    return tuple(name for name in first if first[name] != second[name])


def _comparable(plan: Plan) -> Mapping[str, Any]:
    places = ("footage", "session", "behaviour_path")
    return plain({name: value for name, value in asdict(plan).items() if name not in places})


def _folders(session: Session) -> list[Path]:
    folder = session.path / FOLDER_NAME
    return [path for path in folder.iterdir() if _is_comparison(path)] if folder.is_dir() else []


def _is_comparison(path: Path) -> bool:
    return not path.name.startswith(".") and (path / RECORD_NAME).is_file()


def _age_key(path: Path) -> tuple[str, int, str]:
    """Sort key of folders by age; one that cannot be read counts as oldest."""
    try:
        created = KeptComparison(path).record().created
    except SessionError:
        created = ""
    return created, len(path.name), path.name
