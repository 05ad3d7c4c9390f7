"""Behaviour models of the workspace: what they learnt, movement made from them, their names, and the way to the trash.

Learning one is in `behaviour_learning_routes`.
"""

from functools import lru_cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, Query

from studio.behaviour.model import BehaviourModel
from studio.behaviour.model_file import read_model
from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.errors import BehaviourError, BodyError
from studio.server.app_state import App, AppState
from studio.server.behaviour_schemas import (
    BehaviourDetail,
    BehaviourList,
    Entropies,
    GeneratedWalk,
    ModelName,
)
from studio.server.behaviour_views import bodiless_detail, detail_of, entropies_of, line_of, walk_of
from studio.server.schemas import TrashEntry
from studio.server.session_routes import trash_entry
from studio.sessions.session import BODIES_NAME
from studio.training.model_repository import (
    list_models,
    rename_model,
    stored_model,
    summary_of,
    throw_away_model,
)

router = APIRouter(prefix="/api/behaviours", tags=["behaviours"])

MOST_FRAMES = 1800
KEPT_MODELS = 4


def model_path(behaviour: str, app: App) -> Path:
    """The file of the model that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return stored_model(app.workspace, behaviour)


Named = Annotated[Path, Depends(model_path)]


@router.get("")
def behaviours(app: App) -> BehaviourList:
    """The workspace's behaviour models."""
    return BehaviourList(models=[line_of(summary) for summary in list_models(app.workspace)])


@router.get("/{behaviour}")
def behaviour_detail(path: Named, app: App) -> BehaviourDetail:
    """Clusters as poses, which follows which, the automaton's states by the length of their history.

    Of a model whose body is gone or another one by now, `problem` says so; it has no poses to show then.
    """
    summary, model = summary_of(path), _model(path, path.stat().st_mtime_ns)
    try:
        return detail_of(summary, model, _body_of(model, app))
    except BehaviourError as problem:
        return bodiless_detail(summary, model, str(problem))


@router.patch("/{behaviour}")
def rename(behaviour: str, request: ModelName, app: App) -> ModelName:
    """Give it another name. Runs keep the copy that they were made with."""
    return ModelName(name=rename_model(app.workspace, behaviour, request.name).stem)


@router.delete("/{behaviour}")
def delete(behaviour: str, app: App) -> TrashEntry:
    """Move it to the trash. Runs keep the copy that they were made with."""
    return trash_entry(throw_away_model(app.workspace, behaviour))


@router.get("/{behaviour}/entropies")
def behaviour_entropies(path: Named) -> Entropies:
    """Entropies over memory, for choosing memory and ε by; takes some seconds for large models."""
    return entropies_of(_model(path, path.stat().st_mtime_ns))


@router.get("/{behaviour}/walk")
def behaviour_walk(
    path: Named,
    app: App,
    frames: Annotated[int, Query(ge=2, le=MOST_FRAMES)] = 300,
    seed: Annotated[int, Query(ge=0, le=2**31 - 1)] = 0,
) -> GeneratedWalk:
    """A walk through the automaton, as movement."""
    model = _model(path, path.stat().st_mtime_ns)
    return walk_of(model, _body_of(model, app), frames, seed)


@lru_cache(maxsize=KEPT_MODELS)
def _model(path: Path, _changed: int) -> BehaviourModel:
    return read_model(path)


def _body_of(model: BehaviourModel, app: AppState) -> BodyModel:
    """A body of the model's kind, the studio's or the workspace's own. Raises BehaviourError where it is gone."""
    name = model.space.body
    try:
        body = load_body(name, (app.workspace.root / BODIES_NAME,))
        model.space.check_body(body)
    except BodyError:
        raise BehaviourError(
            f"The model's body '{name}' is not here any more, so its movements cannot be drawn.",
            "Put the body back, or learn the model anew on another one.",
        ) from None
    except BehaviourError as problem:
        raise BehaviourError(
            f"The body '{name}' has changed since the model was learnt: {problem.message}",
            "Put the old body back or learn the model anew.",
        ) from None
    return body
