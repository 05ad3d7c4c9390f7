"""Behaviour models of the workspace: what they learnt, movement made from them, their names, and the way to the trash.

Learning one is in `behaviour_learning_routes`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from fastapi import Depends, Query

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.schemas import Request, RunName
from studio.operations.behaviour_details import (
    BehaviourDetail,
    Entropies,
    GeneratedWalk,
    behaviour_detail,
    entropies_of,
    walk_of,
)
from studio.operations.model_repository import list_models, rename_model, stored_model, throw_away_model
from studio.operations.trash import TrashEntry, trash_entry
from studio.runs.behaviour_models import ModelSummary

router = Router(prefix="/api/behaviours", tags=["behaviours"])
MOST_FRAMES = 1800


class ModelName(Request):
    """Another name for a model."""

    name: RunName


@dataclass(frozen=True, slots=True)
class BehaviourList:
    """The workspace's models by name."""

    models: tuple[ModelSummary, ...]


def model_path(behaviour: str, app: App) -> Path:
    """The file of the model that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return stored_model(app.workspace, behaviour)


Named = Annotated[Path, Depends(model_path)]


@router.get("")
def behaviours(app: App) -> BehaviourList:
    """The workspace's behaviour models."""
    return BehaviourList(list_models(app.workspace))


@router.get("/{behaviour}")
def detail(path: Named, app: App) -> BehaviourDetail:
    """Clusters as poses, which follows which, the automaton's states by the length of their history.

    Of a model whose body is gone or another one by now, `problem` says so; it has no poses to show then.
    """
    return behaviour_detail(path, app.workspace)


@router.patch("/{behaviour}")
def rename(behaviour: str, request: ModelName, app: App) -> ModelName:
    """Give it another name. Runs keep the copy that they were made with."""
    return ModelName(name=rename_model(app.workspace, behaviour, request.name).stem)


@router.delete("/{behaviour}")
def delete(behaviour: str, app: App) -> TrashEntry:
    """Move it to the trash. Runs keep the copy that they were made with."""
    return trash_entry(throw_away_model(app.workspace, behaviour))


@router.get("/{behaviour}/entropies")
def entropies(path: Named) -> Entropies:
    """Entropies over memory, for choosing memory and ε by; takes some seconds for large models."""
    return entropies_of(path)


@router.get("/{behaviour}/walk")
def walk(
    path: Named,
    app: App,
    frames: Annotated[int, Query(ge=2, le=MOST_FRAMES)] = 300,
    seed: Annotated[int, Query(ge=0, le=2**31 - 1)] = 0,
) -> GeneratedWalk:
    """A walk through the automaton, as movement."""
    return walk_of(path, app.workspace, frames, seed)
