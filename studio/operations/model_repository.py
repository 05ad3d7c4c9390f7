"""The behaviour models of the workspace."""

import os
from pathlib import Path

from studio.foundations.errors import BehaviourError, NotFoundError
from studio.runs.behaviour_models import SUFFIX, ModelSummary, models_folder, models_in
from studio.sessions import atomic_files
from studio.sessions.names import checked_name, free_name, inside
from studio.sessions.workspace import TRASH_NAME, Workspace


def place_for_model(name_or_path: str, workspace: Workspace, *, replace: bool = False) -> Path:
    """The file for a new model: of a name in the workspace's models, or a path.

    Raises NameRefused, and BehaviourError where it exists and `replace` is not set.
    """
    if os.sep in name_or_path or "/" in name_or_path:
        path = Path(name_or_path).expanduser().absolute()
        path = path if path.suffix == SUFFIX else path.with_name(f"{path.name}{SUFFIX}")
        if not path.parent.is_dir():
            raise BehaviourError(f"There is no folder '{path.parent}'.", "Create it first, or give a name.")
    else:
        name = checked_name(name_or_path.removesuffix(SUFFIX), "model")
        path = models_folder(workspace.root) / f"{name}{SUFFIX}"
    if path.is_dir() or (path.exists() and not replace):
        raise BehaviourError(
            f"A model already exists at '{path}'.", "Choose another name, or replace it with --force."
        )
    return path


def stored_model(workspace: Workspace, name: str) -> Path:
    """The file of a model of the workspace. Raises NameRefused, NotFoundError."""
    path = models_folder(workspace.root) / f"{checked_name(name, 'model')}{SUFFIX}"
    if not path.is_file():
        raise NotFoundError(f"There is no behaviour model '{name}'.", "List them with 'studio models'.")
    return path


def rename_model(workspace: Workspace, name: str, new_name: str) -> Path:
    """Rename a model; runs keep their own copy. Raises BehaviourError if the name is taken."""
    path = stored_model(workspace, name)
    place = path.with_name(f"{checked_name(new_name, 'model')}{SUFFIX}")
    taken = {entry.stem.lower() for entry in path.parent.glob(f"*{SUFFIX}") if entry != path}
    if new_name.lower() in taken:
        raise BehaviourError(f"A model '{new_name}' already exists.", "Choose another name.")
    os.rename(path, place)
    atomic_files.sync_folder(place.parent)
    return place


def throw_away_model(workspace: Workspace, name: str) -> Path:
    """Move a model to the workspace's trash; returns its folder there."""
    path = stored_model(workspace, name)
    folder = atomic_files.new_folder_beside(path)
    os.rename(path, folder / path.name)
    return workspace.to_trash(folder, name)


def thrown_model(place: Path) -> str:
    """The name of the model in a folder of the trash, "" if it holds none."""
    models = sorted(place.glob(f"*{SUFFIX}")) if place.is_dir() else []
    return models[0].stem if len(models) == 1 else ""


def bring_back_model(workspace: Workspace, trashed_name: str) -> Path:
    """Restore a model under its own name, or a similar one if that is taken. Raises NotFoundError."""
    place = inside(workspace.root / TRASH_NAME, trashed_name)
    name = thrown_model(place)
    if not name:
        raise NotFoundError(f"There is no model '{trashed_name}' in the trash.", "List the trash first.")
    folder = models_folder(workspace.root)
    folder.mkdir(parents=True, exist_ok=True)
    free = free_name(name, {entry.stem for entry in folder.glob(f"*{SUFFIX}")})
    os.rename(place / f"{name}{SUFFIX}", folder / f"{free}{SUFFIX}")
    place.rmdir()
    return folder / f"{free}{SUFFIX}"


def list_models(workspace: Workspace) -> tuple[ModelSummary, ...]:
    """The workspace's models by name; for those that cannot be read, why."""
    return models_in((models_folder(workspace.root),))
