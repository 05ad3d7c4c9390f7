"""The trash of a workspace."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from studio.foundations.errors import StudioError
from studio.operations.comparison_folders import bring_back
from studio.operations.model_repository import bring_back_model, thrown_model
from studio.results.comparison.kept_comparison import RECORD_NAME as COMPARISON_FILE_NAME
from studio.results.comparison.kept_comparison import KeptComparison
from studio.sessions.manifest import FILE_NAME, read_manifest
from studio.sessions.names import inside
from studio.sessions.run_record import FILE_NAME as RUN_FILE_NAME
from studio.sessions.run_record import read_run_record
from studio.sessions.workspace import TRASH_NAME, Workspace


@dataclass(frozen=True, slots=True)
class TrashEntry:
    """Something in the trash.

    name : its former name.
    kind : "other" cannot be restored.
    """

    id: str
    name: str
    kind: Literal["session", "run", "comparison", "model", "other"]
    restorable: bool = True


@dataclass(frozen=True, slots=True)
class TrashList:
    """What lies in the trash, oldest first."""

    entries: tuple[TrashEntry, ...]


@dataclass(frozen=True, slots=True)
class Restored:
    """Where something was restored to.

    name : the session, "" for a model.
    run, comparison, model : "" where it is none.
    """

    name: str
    run: str = ""
    comparison: str = ""
    model: str = ""


def list_trash(workspace: Workspace) -> TrashList:
    """What lies in the trash, oldest first."""
    folder = workspace.root / TRASH_NAME
    return TrashList(tuple(trash_entry(folder / name) for name in workspace.trashed()))


def restore(workspace: Workspace, identifier: str) -> Restored:
    """Restore a session, a model, or a session's run or comparison, under its own name or a similar one.

    Raises NotFoundError.
    """
    place = inside(workspace.root / TRASH_NAME, identifier)
    if (place / RUN_FILE_NAME).is_file():
        run = workspace.restore_run(identifier)
        return Restored(run.session_name, run=run.name)
    if (place / COMPARISON_FILE_NAME).is_file():
        session, comparison = bring_back(workspace, identifier)
        return Restored(session.name, comparison=comparison.name)
    if thrown_model(place):
        return Restored("", model=bring_back_model(workspace, identifier).stem)
    return Restored(workspace.restore(identifier).name)


def trash_entry(place: Path) -> TrashEntry:
    try:
        if (place / FILE_NAME).is_file():
            return TrashEntry(place.name, read_manifest(place).name, "session")
        if (place / RUN_FILE_NAME).is_file():
            run = read_run_record(place)
            return TrashEntry(place.name, f"{run.session} / {run.name}", "run")
        if (place / COMPARISON_FILE_NAME).is_file():
            comparison = KeptComparison(place).record()
            return TrashEntry(place.name, f"{comparison.plan.session} / {comparison.name}", "comparison")
        if model := thrown_model(place):
            return TrashEntry(place.name, model, "model")
    except StudioError:
        pass
    return TrashEntry(place.name, place.name, "other", restorable=False)
