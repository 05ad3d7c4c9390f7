"""The behaviour models of a workspace, and the choice of one for a run.

Models lie in `models/NAME.behaviour` of the workspace. A run names one and keeps a copy of its file, so that it can be
replayed when the model changes. A model fits any body with the same parameters, whatever its dimensions.
"""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from studio.body.model import BodyModel
from studio.foundations.declaring import Web
from studio.foundations.errors import BehaviourError, NotFoundError, SettingsError, StudioError
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import read_model
from studio.search.settings import RunSettings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.shared_knobs import BEHAVIOUR
from studio.sessions.names import is_name
from studio.sessions.session import Session
from studio.sessions.workspace import workspace_root

MODELS_NAME, SUFFIX = "models", ".behaviour"


@dataclass(frozen=True, slots=True)
class ModelSummary:
    """A behaviour model in a list.

    parameters : of its body's pose.
    fps, frames, sources : of its learning, each recording once.
    problem : why it cannot be read (the rest is empty then), else "".
    """

    name: str
    path: Annotated[Path, Web(left_out=True)]
    body: str = ""
    parameters: tuple[str, ...] = ()
    fps: float = 0.0
    frames: int = 0
    clusters: int = 0
    states: int = 0
    memory: int = 0
    epsilon: float = 0.0
    entropy_train: float = math.nan
    entropy_test: float = math.nan
    sources: tuple[str, ...] = ()
    problem: str = ""


@dataclass(frozen=True, slots=True)
class ChosenModel:
    """The model of a new run. note : why it was chosen, "" if it was requested."""

    name: str
    path: Path
    note: str = ""


def models_folder(root: Path) -> Path:
    return root / MODELS_NAME


def model_folders(session: Session) -> tuple[Path, ...]:
    """The folders searched for a session's models: its workspace's, then the user's own."""
    folders = (models_folder(session.path.parent), models_folder(workspace_root().absolute()))
    return tuple(dict.fromkeys(folder for folder in folders if folder.is_dir()))


def models_in(folders: Sequence[Path]) -> tuple[ModelSummary, ...]:
    """The models in some folders by name; of two with one name, the first folder's."""
    models: dict[str, ModelSummary] = {}
    for folder in folders:
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            # A file deleted meanwhile is skipped.
            with contextlib.suppress(FileNotFoundError):
                about = path.stat()
                models.setdefault(path.stem, _line(path, about.st_mtime_ns, about.st_size))
    return tuple(models[name] for name in sorted(models))


def model_path(folders: Sequence[Path], name_or_path: str) -> Path:
    """The file of a model: a name in one of the folders, else a path. Raises NotFoundError listing the models."""
    for folder in folders:
        path = folder / f"{name_or_path.removesuffix(SUFFIX)}{SUFFIX}"
        if path.parent == folder and path.is_file():
            return path
    path = Path(name_or_path).expanduser()
    if not is_name(name_or_path) and "\0" not in name_or_path and path.is_file():
        return path.absolute()
    raise NotFoundError(f"There is no behaviour model '{name_or_path}'.", _known_in_words(models_in(folders)))


def fitting(model: BehaviourModel, body: BodyModel, fps: float) -> BehaviourModel:
    """The model for footage of `fps` of that body.

    Raises BehaviourError naming the first parameter that differs.
    """
    wanted, has = model.space.parameters, tuple(entry.name for entry in body.parameters)
    if wanted == has:
        return model.at_rate(fps)
    pairs = [(one, other) for one, other in zip(wanted, has, strict=False) if one != other]
    if len(wanted) != len(has):
        differs = f"it has {len(wanted)} parameters, '{body.name}' {len(has)}"
    else:
        differs = f"it has '{pairs[0][0]}' where '{body.name}' has '{pairs[0][1]}'"
    raise BehaviourError(
        f"The behaviour model is of body '{model.space.body}': {differs}.",
        f"Learn one with 'studio learn … --body {body.name}', or track with --body {model.space.body}.",
    )


def needs_model(tracker: str, settings: object) -> bool:
    """Whether a tracker with these knobs requires a behaviour model."""
    return TRACKERS[tracker].needs_behaviour or getattr(settings, "prediction", "") == BEHAVIOUR


def check_prediction(settings: RunSettings, has_model: bool) -> None:
    """Raises SettingsError if the settings require a model and the run has none."""
    if not has_model and needs_model(settings.tracker_name, settings.tracker):
        raise SettingsError(
            "Setting 'prediction' cannot be 'behaviour': the run has no behaviour model.",
            "Start a new run with one (--behaviour MODEL).",
        )


def chosen_model(
    session: Session, body: BodyModel, settings: RunSettings, requested: str
) -> ChosenModel | None:
    """The model of a new run: the requested one, else (where the settings need one) the only one of that body.

    Raises NotFoundError for a missing model, BehaviourError for one that does not fit, and where the settings need a
    model and none or several fit.
    """
    folders = model_folders(session)
    if requested:
        path = model_path(folders, requested)
        fitting(read_model(path), body, session.manifest.fps)
        return ChosenModel(path.stem, path)
    if not needs_model(settings.tracker_name, settings.tracker):
        return None
    names = tuple(entry.name for entry in body.parameters)
    models = models_in(folders)
    fit = [line for line in models if not line.problem and line.parameters == names]
    if len(fit) == 1:
        note = f"Behaviour model '{fit[0].name}': the only one of body '{body.name}'."
        return ChosenModel(fit[0].name, fit[0].path, note)
    name = settings.tracker_name
    wants = f"Tracker '{name}'" if TRACKERS[name].needs_behaviour else "Prediction by behaviour"
    if fit:
        several = ", ".join(f"'{line.name}'" for line in fit)
        raise BehaviourError(
            f"{wants} needs a behaviour model, and several are of body '{body.name}': {several}.",
            "Choose one with --behaviour MODEL.",
        )
    raise BehaviourError(
        f"{wants} needs a behaviour model, and there is none of body '{body.name}'.",
        f"Learn one with 'studio learn SOURCES… --body {body.name} --into MODEL'. {_known_in_words(models)}",
    )


def summary_of(path: Path) -> ModelSummary:
    """The line of a model's file. Raises BehaviourError for one that cannot be read."""
    model = read_model(path)
    making = model.making
    return ModelSummary(
        name=path.stem,
        path=path,
        body=model.space.body,
        parameters=model.space.parameters,
        fps=making.learnt_fps,
        frames=making.frames,
        clusters=model.clusters,
        states=model.states,
        memory=making.settings.memory,
        epsilon=making.settings.epsilon,
        entropy_train=making.entropy_train,
        entropy_test=making.entropy_test,
        sources=tuple(dict.fromkeys(making.sources)),
    )


@lru_cache(maxsize=256)
def _line(path: Path, _written: int, _size: int) -> ModelSummary:
    """The list entry of a model's file; cached by write time and size."""
    try:
        return summary_of(path)
    except StudioError as error:
        return ModelSummary(path.stem, path, problem=error.message)


def _known_in_words(models: Sequence[ModelSummary]) -> str:
    if not models:
        return "There are no models yet; 'studio learn' makes them."
    words = (f"'{line.name}' ({line.problem or f'of {line.body}'})" for line in models)
    return f"There are {', '.join(words)}."
