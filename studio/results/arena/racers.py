"""Racers: searches of one problem, each a function that is asked for poses until its evaluations are spent.

A racer is one file (`Racer`), named by its path, or a member of the entry-point group `studio.racers`. The studio's
own: every tracker that needs no behaviour model, CMA-ES (package `cmaes`, extra `arena`), SciPy's differential
evolution and dual annealing, and random search. All begin at the prior: at its start pose, with σ0 as the scale of each
parameter.
"""

import importlib.util
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # optimize, half a second, is loaded once it is used

from studio.foundations.arrays import Array, Mask
from studio.foundations.errors import StudioError
from studio.foundations.extras import load_extra
from studio.foundations.knobs import changed
from studio.foundations.registry import Registry
from studio.results.arena.problem import ArenaError, Problem
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.frame_loop import search_frame

EXTRA = "arena"
SEARCH, LAYERS = 1000, 10
"""Evaluations of one of a tracker's searches, and layers of those whose layers can be chosen."""
BATCH = 100
FIRST_STEP = 0.5
"""Of CMA-ES, in σ0."""
POPULATION, MOST_MEMBERS = 4, 120
"""Members of differential evolution a parameter, and at most."""
ENDLESS = 1_000_000_000
SUFFIX = ".py"
MEMBER = "RACER"


@dataclass(frozen=True, slots=True)
class Racer:
    """A search.

    name : its key. label : on screen. search : of a problem with a budget and a seed; it calls
    `problem.log_likelihood` until that ends it, or returns earlier.
    """

    name: str
    label: str
    search: Callable[[Problem, int], object]


def _check(racer: Racer) -> None:
    """Raise StudioError for what is no search."""
    if not callable(racer.search):
        raise StudioError("its search is no function of a problem and a seed")


class _AsTracked:
    """A problem as a tracker's likelihood: poses set within the bounds, every pose possible."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        return self._problem.log_likelihood(np.clip(poses, self._problem.lower, self._problem.upper))

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        return self.log_likelihood(poses)

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> Mask:
        return np.all((poses >= self._problem.lower) & (poses <= self._problem.upper), axis=1)


def _racer_of_tracker(name: str) -> Racer:
    """A tracker's single-frame search of SEARCH evaluations from the prior; the next begins where it ended, as in the
    first frame of a run (`start_repeats`).
    """
    tracker = TRACKERS[name]

    def search(problem: Problem, seed: int) -> None:
        budget = ENDLESS if problem.budget is None else problem.budget
        wanted = max(min(budget, SEARCH), tracker.least_evaluations(LAYERS))
        settings = changed(tracker.settings_type(), knobs_for_evaluations(name, wanted, LAYERS))
        search_frame(
            tracker,
            _AsTracked(problem),
            problem.prior.state,
            problem.space,
            seed=seed,
            frame=0,
            settings_source=lambda: (0, settings),
            # More than there can be: the budget ends it.
            repeats=1 + budget,
        )

    return Racer(name, tracker.label, search)


def _search_by_cmaes(problem: Problem, seed: int) -> None:
    """CMA-ES about the start pose, in units of σ0; stopped, it begins again with twice as many members (IPOP)."""
    cmaes = load_extra("cmaes", EXTRA)
    start, sigma = problem.prior.start, problem.prior.sigma
    bounds = np.stack([(problem.lower - start) / sigma, (problem.upper - start) / sigma], axis=1)
    size = 4 + int(3 * np.log(max(problem.dimensions, 2)))
    for attempt in itertools.count():
        climber = cmaes.CMA(
            mean=np.clip(np.zeros(problem.dimensions), bounds[:, 0], bounds[:, 1]),
            sigma=FIRST_STEP,
            bounds=bounds,
            seed=seed + 1000 * attempt,
            population_size=size << min(attempt, 5),
        )
        while not climber.should_stop():
            steps = np.stack([climber.ask() for _ in range(climber.population_size)])
            poses = np.clip(start + sigma * steps, problem.lower, problem.upper)
            climber.tell([*zip(steps, (-problem.log_likelihood(poses)).tolist(), strict=True)])


def _search_by_differential_evolution(problem: Problem, seed: int) -> None:
    """SciPy's, its members drawn about the start pose with σ0, a generation at a time."""
    rng = np.random.default_rng(seed)
    members = min(max(POPULATION * problem.dimensions, 8), MOST_MEMBERS)
    while True:
        drawn = rng.normal(problem.prior.start, problem.prior.sigma, (members, problem.dimensions))
        drawn[0] = problem.prior.start
        scipy.optimize.differential_evolution(
            lambda poses: -_finite(problem.log_likelihood(np.atleast_2d(poses.T))),  # pyright: ignore[reportArgumentType] - vectorized
            scipy.optimize.Bounds(problem.lower, problem.upper),
            init=np.clip(drawn, problem.lower, problem.upper),
            maxiter=ENDLESS,
            tol=0.0,
            updating="deferred",
            vectorized=True,
            polish=False,
            seed=rng,
        )


def _search_by_dual_annealing(problem: Problem, seed: int) -> None:
    """SciPy's, from the start pose on, a pose at a time, with its own local search."""
    rng = np.random.default_rng(seed)
    while True:
        scipy.optimize.dual_annealing(
            lambda pose: -float(_finite(problem.log_likelihood(pose[None]))[0]),
            _bounds(problem),
            x0=problem.prior.start,
            maxiter=ENDLESS,
            maxfun=ENDLESS,
            seed=rng,
        )


def _search_at_random(problem: Problem, seed: int) -> None:
    """Poses drawn about the start pose with σ0."""
    rng = np.random.default_rng(seed)
    while True:
        drawn = rng.normal(problem.prior.start, problem.prior.sigma, (BATCH, problem.dimensions))
        problem.log_likelihood(np.clip(drawn, problem.lower, problem.upper))


def _bounds(problem: Problem) -> list[tuple[float, float]]:
    return [*zip(problem.lower.tolist(), problem.upper.tolist(), strict=True)]


def _finite(weights: Array) -> Array:
    """SciPy's local searches go beyond bounds by a step of their differences, and cannot use an infinite value."""
    return np.maximum(weights, -1e12)


_OTHERS = (
    Racer("cma-es", "CMA-ES", _search_by_cmaes),
    Racer("differential-evolution", "Differential evolution", _search_by_differential_evolution),
    Racer("dual-annealing", "Dual annealing", _search_by_dual_annealing),
    Racer("random-search", "Random search", _search_at_random),
)
_OWN = (*(_racer_of_tracker(name) for name in TRACKERS if not TRACKERS[name].needs_behaviour), *_OTHERS)
OWN_RACERS = frozenset(racer.name for racer in _OWN)
"""Names of those that ask for poses in one thread."""
RACERS: Registry[Racer] = Registry("racer", "studio.racers", Racer, _OWN, _check)


def racer_named(name: str) -> Racer:
    """The racer of a name, or of a Python file, whose RACER it is. Raises UnknownMemberError, ArenaError."""
    return _racer_in(Path(name)) if name.endswith(SUFFIX) else RACERS[name]


def _racer_in(path: Path) -> Racer:
    """The RACER of a Python file, which is run."""
    hint = f"Let the file say {MEMBER} = Racer(name, label, search); the guide has an example."
    if not path.is_file():
        raise ArenaError(f"There is no racer's file '{path}'.", "Check the path.")
    spec = importlib.util.spec_from_file_location(f"racer_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ArenaError(
            f"The racer's file '{path.name}' cannot be run: {type(error).__name__}: {error}.", hint
        ) from error
    racer = getattr(module, MEMBER, None)
    if not isinstance(racer, Racer):
        raise ArenaError(f"The file '{path.name}' has no {MEMBER}.", hint)
    _check(racer)
    return racer
