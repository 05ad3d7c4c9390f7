"""Training sets of behaviour models, and the models, learnt once and kept beside the footage.

Three performances of each exercise as in the paper: the recording itself and two more, made as the test is (the
recipe's option `performance`: tempo and joints change slowly by a little); each is smoothed by several amounts (section
7.1), which makes about 13 000 frames of two exercises. Everything is on the body in its own proportions: a model fits
the body in any size.
"""

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.person import first_frames, sampled
from studio.foundations.arrays import Array
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.kept_trials import code_digest, plain
from studio.results.comparison.trials import Plain
from studio.results.drawing_footage.recipe_file import JOINED, find_recipe, read_recipe
from studio.results.drawing_footage.recipes import recipe_motion
from studio.runs.learning.learning import learn
from studio.runs.learning.oversampling import OversamplingSettings, performed
from studio.runs.learning.recordings import FPS, Recording, fitted_person
from studio.runs.learning.resampling import frame_times
from studio.runs.learning.targets import skeleton_of_body
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import read_model, write_model
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.atomic_files import discard, move_into_place, new_folder_beside
from studio.sessions.process_lock import ProcessLock

# What trials learn or fit once and share: folders of files beside the footage, each made by one process.
# A folder is keyed by its inputs and by the code that makes it, so another version of the studio makes its own. It is
# written atomically; a process that needs one that another process is making waits for it, and makes it where that
# process died.


LEARNT = "learnt"
# Code that affects what is learnt or fitted.
ROOMS = ("foundations/geometry", "body", "search/behaviour", "results/drawing_footage", "runs/learning")
WAIT_SECONDS = 0.2


def made_once(
    cache: FootageCache, kind: str, making: Mapping[str, Plain], make: Callable[[Path], None]
) -> Path:
    """The folder of some data, made by `make(folder)` if missing. making : all that it depends on."""
    known = json.dumps({"making": plain(making), "code": code_digest(ROOMS)}, sort_keys=True)
    name = f"{kind}-{hashlib.sha256(known.encode()).hexdigest()[:16]}"
    place = cache.folder / LEARNT / name
    if place.is_dir():
        return place
    place.parent.mkdir(parents=True, exist_ok=True)
    lock = _waited_for(place)
    if lock is None:
        return place
    partial = new_folder_beside(place)
    try:
        if not place.is_dir():
            make(partial)
            move_into_place(partial, place)
    finally:
        discard(partial)
        lock.free()
    return place


def _waited_for(place: Path) -> ProcessLock | None:
    """The lock on a folder; None once another process has made it."""
    while True:
        lock = ProcessLock.take(place.with_name(f"{place.name}.lock"))
        if lock is not None:
            return lock
        time.sleep(WAIT_SECONDS)
        if place.is_dir():
            return None


USUAL_MEMORY, USUAL_EPSILON = 10, 0.05
POINTING = "pointing"
MODEL, NUMBERS, POSES = "model.behaviour", "learnt.json", "poses.npy"


@dataclass(frozen=True, slots=True)
class Training:
    """A training set and the settings of learning; plain values.

    sources : recipes of people's motion, or "pointing". frames : of each at 30 Hz, 0 for all. performances : of each,
    the first as recorded. smoothings : of each performance. memory, epsilon : of the automaton. clusters : further
    learning knobs. seed : of performances and clustering. tested : recipes on whose motion the entropy is measured.
    """

    sources: tuple[str, ...]
    frames: int = 0
    performances: int = 3
    smoothings: int = 5
    memory: int = USUAL_MEMORY
    epsilon: float = USUAL_EPSILON
    seed: int = 0
    body: str = "human25"
    tested: tuple[str, ...] = ()
    clusters: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def plain(self) -> dict[str, Any]:
        """As a trial's arguments."""
        return asdict(self)

    @classmethod
    def of_plain(cls, arguments: Mapping[str, Any]) -> "Training":
        """From a trial's arguments, as they come back from JSON."""
        words: dict[str, Any] = {**arguments}
        words |= {name: tuple(arguments[name]) for name in ("sources", "tested")}
        return cls(**words)

    def settings(self) -> LearningSettings:
        return LearningSettings(memory=self.memory, epsilon=self.epsilon, **self.clusters)

    def material(self) -> OversamplingSettings:
        return OversamplingSettings(smoothings=self.smoothings)


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """A model with figures of its learning. seconds : of clusters and automaton, without reading the sources."""

    model: BehaviourModel
    frames: int
    seconds: float


def recorded(
    cache: FootageCache, source: str, body: BodyModel, frames: int = 0, performance: int = 0
) -> Recording:
    """A source's motion on the body, fitted once. frames : at 30 Hz from the first, 0 for all. performance : which, 0
    for the original.

    Raises StudioError for an unknown recipe and for missing recorded motion.
    """
    if source == POINTING:
        return _performed(Recording(source, FPS, pointing_poses(body, FPS)), body, performance)
    path = find_recipe(source)
    recipe = read_recipe(path)
    own = performance > 0 and recipe.motion == JOINED
    if own:
        recipe = msgspec.structs.replace(
            recipe, options={**recipe.options, "performance": float(performance)}
        )

    def make(folder: Path) -> None:
        motion = recipe_motion(recipe, path.parent, skeleton_of_body(body))
        times = frame_times((motion.frame_count - 1) / motion.fps, FPS)
        shown = first_frames(sampled(motion, times, FPS), frames or None)
        np.save(folder / POSES, fitted_person(shown, body, source).poses)

    making = {"recipe": msgspec.to_builtins(recipe), "body": body.name, "frames": frames, "fps": FPS}
    recording = Recording(source, FPS, np.load(made_once(cache, "motion", making, make) / POSES))
    return recording if own else _performed(recording, body, performance)


def _performed(recording: Recording, body: BodyModel, performance: int) -> Recording:
    """Another performance of motion that has no recipe: tempo and angles change slowly by a little."""
    if performance == 0:
        return recording
    rng = np.random.default_rng(performance)
    poses = performed(body, recording.poses, recording.fps, OversamplingSettings(), rng)
    return dataclasses.replace(recording, poses=poses)


def learnt(cache: FootageCache, training: Training) -> Lesson:
    """The model of a training set, learnt once. Models that differ in knobs of the automaton alone have the same
    clusters.
    """
    return _read(_learnt_folder(cache, training))


def model_file(cache: FootageCache, training: Training) -> Path:
    """The file of a training set's model."""
    return _learnt_folder(cache, training) / MODEL


# Knobs of the automaton among the knobs of learning: models that differ in these alone have the same clusters.
OF_THE_AUTOMATON = ("least_probability", "smoothing", "back_off")


def _learnt_folder(cache: FootageCache, training: Training) -> Path:
    usual = {name: value for name, value in training.clusters.items() if name not in OF_THE_AUTOMATON}
    clusters = dataclasses.replace(training, memory=USUAL_MEMORY, epsilon=USUAL_EPSILON, clusters=usual)
    first = made_once(cache, "model", _making(clusters), lambda folder: _learn(cache, clusters, folder))
    if clusters == training:
        return first

    def make(folder: Path) -> None:
        began = time.perf_counter()
        base = _read(first)
        model = base.model.with_automaton(training.settings())
        _write(folder, Lesson(model, base.frames, time.perf_counter() - began))

    return made_once(cache, "model", _making(training), make)


def lesson_of(cache: FootageCache, training: Training) -> Lesson:
    """The model of a training set, learnt now: to measure how long it takes."""
    body = load_body(training.body)
    recordings = [
        recorded(cache, source, body, training.frames, _number(training, performance))
        for source in training.sources
        for performance in range(training.performances)
    ]
    tested = [recorded(cache, source, body, training.frames) for source in training.tested]
    began = time.perf_counter()
    model, figures = learn(
        recordings, body, training.settings(), training.material(), tested, seed=training.seed
    )
    return Lesson(model, figures.frames, time.perf_counter() - began)


def _number(training: Training, performance: int) -> int:
    """The number of a performance: other ones with every seed, the first always as recorded."""
    return performance + training.performances * training.seed if performance else 0


def _learn(cache: FootageCache, training: Training, folder: Path) -> None:
    _write(folder, lesson_of(cache, training))


def _making(training: Training) -> dict[str, Any]:
    named = [name for name in (*training.sources, *training.tested) if name != POINTING]
    return {
        **training.plain(),
        "recipes": [msgspec.to_builtins(read_recipe(find_recipe(name))) for name in named],
    }


def _write(folder: Path, lesson: Lesson) -> None:
    write_model(lesson.model, folder / MODEL)
    numbers = {"frames": lesson.frames, "seconds": round(lesson.seconds, 3)}
    (folder / NUMBERS).write_text(json.dumps(numbers), encoding="utf-8")


def _read(folder: Path) -> Lesson:
    numbers = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
    return Lesson(read_model(folder / MODEL), int(numbers["frames"]), float(numbers["seconds"]))


# A simple sequence to learn clusters from: a standing person points with one arm at several targets. The paper's
# clustering found 5 clusters in "a simpler arms pointing sequence" without further details (section 7.1). Ours: the
# right arm goes from hanging to one of two places and back, each way as an arm reaches (minimum jerk), with a rest at
# both ends.

TARGETS: tuple[dict[str, float], ...] = (
    {"right_shoulder_swing": 85.0, "right_shoulder_spread": 10.0, "right_elbow": 5.0},
    {"right_shoulder_swing": 20.0, "right_shoulder_spread": 85.0, "right_elbow": 5.0},
)
"""Angles of the targets, degrees."""
ROUNDS = 4
MOVE_S, REST_S = 0.8, 0.7


def pointing_poses(body: BodyModel, fps: float) -> Array:
    """(F, D) the body pointing at each target in turn, ROUNDS times over."""
    names = [entry.name for entry in body.parameters]
    resting = body.neutral
    poses = [resting[None]]
    for _ in range(ROUNDS):
        for target in TARGETS:
            pointed = resting.copy()
            for name, degrees in target.items():
                pointed[names.index(name)] = np.radians(degrees)
            poses += [_reach(resting, pointed, fps), _held(pointed, fps)]
            poses += [_reach(pointed, resting, fps), _held(resting, fps)]
    return np.concatenate(poses)


def _reach(start: Array, end: Array, fps: float) -> Array:
    """A movement of minimum jerk (Flash & Hogan 1985)."""
    share = (np.arange(round(MOVE_S * fps)) + 1.0)[:, None] / round(MOVE_S * fps)
    return start + (end - start) * (10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5)


def _held(pose: Array, fps: float) -> Array:
    return np.repeat(pose[None], round(REST_S * fps), axis=0)
