"""Behaviour models of the workspace: what they learnt, and movement made from them. Learning is `studio learn`."""

from functools import lru_cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, Query

from studio.behaviour.model import BehaviourModel
from studio.behaviour.model_file import read_model
from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.errors import NotFoundError
from studio.runs.behaviour_models import SUFFIX, models_folder
from studio.sessions.names import checked_name
from studio.training.model_shelf import list_models, summary_of
from studio.web.behaviour_schemas import BehaviourDetail, BehaviourList, Entropies, GeneratedWalk
from studio.web.behaviour_views import detail_of, entropies_of, line_of, walk_of
from studio.web.doors import Doors, doors_of

router = APIRouter(prefix="/api/behaviours", tags=["behaviours"])

MOST_FRAMES = 1800
KEPT_MODELS = 4

Door = Annotated[Doors, Depends(doors_of)]


def model_path(behaviour: str, doors: Door) -> Path:
    """The file of the model that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    path = models_folder(doors.workspace.root) / f"{checked_name(behaviour, 'model')}{SUFFIX}"
    if not path.is_file():
        raise NotFoundError(f"There is no behaviour model '{behaviour}'.", "List them with 'studio models'.")
    return path


Named = Annotated[Path, Depends(model_path)]


@router.get("")
def behaviours(doors: Door) -> BehaviourList:
    """The workspace's behaviour models."""
    return BehaviourList(models=[line_of(summary) for summary in list_models(doors.workspace)])


@router.get("/{behaviour}")
def behaviour_detail(path: Named) -> BehaviourDetail:
    """Clusters as poses, which follows which, the automaton's states by the length of their history."""
    return detail_of(summary_of(path), *_opened(path))


@router.get("/{behaviour}/entropies")
def behaviour_entropies(path: Named) -> Entropies:
    """Entropies over memory, for choosing memory and ε by; takes some seconds for large models."""
    return entropies_of(_opened(path)[0])


@router.get("/{behaviour}/walk")
def behaviour_walk(
    path: Named,
    frames: Annotated[int, Query(ge=2, le=MOST_FRAMES)] = 300,
    seed: Annotated[int, Query(ge=0, le=2**31 - 1)] = 0,
) -> GeneratedWalk:
    """A walk through the automaton, as movement."""
    return walk_of(*_opened(path), frames, seed)


def _opened(path: Path) -> tuple[BehaviourModel, BodyModel]:
    """The model and a body of its kind. Raises BehaviourError, BodyError."""
    return _kept(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=KEPT_MODELS)
def _kept(path: Path, _changed: int) -> tuple[BehaviourModel, BodyModel]:
    model = read_model(path)
    body = load_body(model.space.body)
    model.space.check_body(body)
    return model, body
