"""The plan of a command: the trials of all requested experiments, each once, and the footage that they need."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from studio.foundations.errors import StudioError
from studio.foundations.typed_decoding import is_list
from studio.garden.reproduction.experiment import Experiment
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Plain, Scale, Trial, TrialJob, is_mapping, measure_name
from studio.results.drawing_footage.real_data import PREFIX
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe
from studio.results.drawing_footage.recipes import RECIPE_COPY
from studio.sessions.manifest import read_manifest

FULL_SEEDS, QUICK_SEEDS = 10, 3


@dataclass(frozen=True, slots=True)
class PlannedExperiment:
    """An experiment with its trials and their jobs, in the same order. problem : why it cannot be run, or ""."""

    experiment: Experiment
    scale: Scale
    trials: tuple[Trial, ...] = ()
    jobs: tuple[TrialJob, ...] = ()
    problem: str = ""


def scale_of(seeds: int | None = None, quick: bool = False) -> Scale:
    """The scale: ten seeds, three for a preview, or `seeds`.

    Raises StudioError for fewer than one.
    """
    count = seeds if seeds is not None else QUICK_SEEDS if quick else FULL_SEEDS
    if count < 1:
        raise StudioError(f"--seeds is {count}.", "Give one seed or more.")
    return Scale(tuple(range(count)), quick)


def plan(experiment: Experiment, scale: Scale) -> PlannedExperiment:
    """An experiment's jobs, or the reason why there are none."""
    try:
        recipes = {name: recipe_digest(name) for name in experiment.footage}
        trials = experiment.trials(scale)
    except StudioError as error:
        return PlannedExperiment(experiment, scale, problem=str(error))
    jobs = tuple(
        TrialJob(
            trial_key(experiment, trial, recipes),
            experiment.name,
            trial.label,
            plain(trial.arguments),
            experiment.measure,
            footage_of(experiment, trial),
            frames_of(trial.arguments),
            experiment.alone,
        )
        for trial in trials
    )
    return PlannedExperiment(experiment, scale, trials, jobs)


def trial_key(experiment: Experiment, trial: Trial, recipes: Mapping[str, str]) -> str:
    """The key under which a trial's outcome is stored. recipes : digests of the experiment's footage, by name."""
    made_by = {
        "measure": measure_name(experiment.measure),
        "alone": experiment.alone,
        "arguments": plain(trial.arguments),
        "footage": {name: recipes[name] for name in footage_of(experiment, trial)},
    }
    return hashlib.sha256(json.dumps(made_by, sort_keys=True).encode()).hexdigest()[:24]


def footage_of(experiment: Experiment, trial: Trial) -> tuple[str, ...]:
    """The experiment's recipes named in a trial's arguments; all of them where they name neither one nor real data."""
    texts = _texts(trial.arguments)
    named = tuple(name for name in experiment.footage if name in texts)
    is_real = any(text.startswith(PREFIX) for text in texts)
    return named if named or is_real else experiment.footage


def each_once(planned: Iterable[PlannedExperiment]) -> dict[str, TrialJob]:
    """All jobs by key, in the order in which they were planned."""
    jobs: dict[str, TrialJob] = {}
    for entry in planned:
        for job in entry.jobs:
            jobs.setdefault(job.key, job)
    return jobs


def recipe_digest(name: str) -> str:
    """The digest of a recipe's footage. Raises StudioError for an unknown recipe."""
    return hashlib.sha256(find_recipe(name).read_bytes()).hexdigest()[:16]


def footage_needed(jobs: Iterable[TrialJob]) -> dict[str, int | None]:
    """The recipes that jobs use, and the number of frames of each from the first (None: all)."""
    needed: dict[str, int | None] = {}
    for job in jobs:
        for name in job.footage:
            before = needed.get(name, 0)
            needed[name] = None if before is None or job.frames is None else max(before, job.frames)
    return needed


def frames_of(arguments: Plain) -> int | None:
    """The last frame named in a trial's arguments, as in `TrackingTrial` ("last", half open); None without one. If
    there is one among them, parts without a last frame do not count.
    """
    if not is_mapping(arguments):
        return None
    if "attempt" in arguments:
        frames = [value["last"] for value in arguments.values() if is_mapping(value) and "last" in value]
        return None if None in frames else max(frames, default=None)
    if "last" in arguments:
        return arguments["last"]
    within = [frames_of(value) for value in arguments.values() if is_mapping(value)]
    named = [frames for frames in within if frames is not None]
    return max(named) if named and len(named) == len(within) else None


def is_rendered(name: str, folder: Path, frames: int | None) -> bool:
    """Whether `frames` frames of the footage (None: all) are in `folder`, rendered by the present recipe.

    Raises StudioError for an unknown recipe, SessionError for a session that cannot be read.
    """
    session, recipe = folder / name, find_recipe(name)
    if not (session / RECIPE_COPY).is_file() or (session / RECIPE_COPY).read_bytes() != recipe.read_bytes():
        return False
    whole = read_recipe(recipe).frames
    return read_manifest(session).frame_count >= min(whole if frames is None else frames, whole)


def _texts(value: Plain) -> set[str]:
    """All strings in a plain value."""
    if isinstance(value, str):
        return {value}
    if is_mapping(value):
        value = list(value.values())
    return set[str]().union(*map(_texts, value)) if is_list(value) else set()
