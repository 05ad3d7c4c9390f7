"""A racer on a problem as a trial: kept as other trials are, run in any process, not measured twice."""

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_file
from studio.results.arena.problem import ArenaError, BudgetSpentError, DeafError, Definition, Problem
from studio.results.arena.problem_files import BUNDLED, read_problems
from studio.results.arena.profiles import Trial
from studio.results.arena.racers import OWN_RACERS, RACERS, SUFFIX, Racer, racer_named
from studio.results.arena.turns import Weigh, race_in_turns
from studio.results.comparison import trials
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.kept_trials import code_digest
from studio.results.comparison.trials import Outcome, kept_as
from studio.search.likelihood.devices import CPU, DEVICE_KNOB, is_processor

DIGEST_LENGTH = 16
CODE = ("results/arena",)
SHOWN_AFTER = (10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000)
"""Evaluations after which the pose of the first seed is kept, to be drawn."""


def defined_in(place: str) -> tuple[Definition, ...]:
    """The problems of a file, "" for the bundled ones. Raises ArenaError."""
    path = Path(place) if place else BUNDLED
    try:
        return _read(path, path.stat().st_mtime_ns)
    except FileNotFoundError:
        raise ArenaError(
            f"There is no set of problems '{path}'.", "Make one with `studio arena export`."
        ) from None


@lru_cache(maxsize=4)
def _read(path: Path, stamp: int) -> tuple[Definition, ...]:
    return read_problems(path)


def chosen(definitions: Sequence[Definition], names: Sequence[str]) -> tuple[Definition, ...]:
    """Problems by name, or by "easy" and "hard"; all for no name. Raises ArenaError for an unknown name."""
    for name in names:
        if not any(name in (one.name, one.kind) for one in definitions):
            raise ArenaError(
                f"There is no problem '{name[:64]}'.",
                f"There are {', '.join(one.name for one in definitions)}; or say easy or hard.",
            )
    return tuple(one for one in definitions if not names or one.name in names or one.kind in names)


def planned(
    definitions: Sequence[Definition],
    racers: Sequence[str],
    evaluations: int,
    seeds: Sequence[int],
    place: str,
    device: str = CPU,
) -> tuple[trials.Trial, ...]:
    """A trial for each problem, racer and seed, problem by problem.

    place : of the problems' file, "" for the bundled ones. device : what weighs poses. Raises ArenaError,
    UnknownMemberError for a racer.
    """
    known = {name: (racer_named(name).name, _code_of(name)) for name in racers}
    names = [known[name][0] for name in racers]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ArenaError(
            f"Two racers have the same name, '{twice}'.", "Give each its own, and name each once."
        )
    return tuple(
        trials.Trial(
            f"{known[name][0]} on {one.name}, seed {seed}",
            {
                "set": place,
                "problem": one.name,
                "hash": "" if one.best is None else one.best.hash,
                "racer": name,
                "name": known[name][0],
                "code": known[name][1],
                "evaluations": evaluations,
                "seed": seed,
                **({} if device == CPU else {DEVICE_KNOB: device}),
            },
        )
        for one in definitions
        for name in racers
        for seed in seeds
    )


@lru_cache(maxsize=16)
def weighed_by(definition: Definition, device: str) -> Definition:
    """The problem with a device that weighs its poses, where its likelihood lets that be chosen."""
    maps = definition.maps
    if DEVICE_KNOB not in maps.knobs:
        return definition
    return replace(definition, maps=replace(maps, knobs={**maps.knobs, DEVICE_KNOB: device}))


def _code_of(name: str) -> str:
    """What changes when a racer does: a digest of the arena's code, or a package's version, or the file's own."""
    if name.endswith(SUFFIX):
        return hashlib.sha256(read_file(Path(name))).hexdigest()[:DIGEST_LENGTH]
    return " ".join((code_digest(CODE), *RACERS.packages))


@kept_as("arena.measure_race")
def measure_race(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Run a racer on a problem: evaluations, seconds and those of the likelihood alone, the way from the start pose, at
    which counts heavier poses were met and how far they are from the known best, and poses of the first seed.

    Raises ArenaError for a problem that is another by now, and for what the racer raises.
    """
    problem = Problem(_definition_of(arguments), arguments["evaluations"])
    began = time.perf_counter()
    run_racer(racer_named(arguments["racer"]), problem, arguments["seed"])
    return _measured(problem, arguments["seed"], time.perf_counter() - began)


@kept_as("arena.measure_races")
def measure_races(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Run a racer on a problem with several seeds, whose poses are weighed together: `measured`, what `measure_race`
    gives of each, seconds as shares of all.

    arguments : `trials`, those of each.
    """
    trials = arguments["trials"]
    definition, racer = _definition_of(trials[0]), racer_named(trials[0]["racer"])
    problems = [Problem(definition, one["evaluations"]) for one in trials]

    def race_of(problem: Problem, seed: int) -> Callable[[Weigh], None]:
        def race(weigh: Weigh) -> None:
            problem.weigh_whole = weigh
            run_racer(racer, problem, seed)

        return race

    weighing, began = 0.0, time.perf_counter()

    def weigh(poses: Array) -> Array:
        nonlocal weighing
        asked = time.perf_counter()
        weights = problems[0].weigh_alone(poses)
        weighing += time.perf_counter() - asked
        return weights

    race_in_turns([race_of(one, trial["seed"]) for one, trial in zip(problems, trials, strict=True)], weigh)
    share = (time.perf_counter() - began) / len(trials)
    for problem in problems:
        problem.weigh_whole, problem.seconds = None, weighing / len(trials)
    return {
        "measured": [
            _measured(problem, one["seed"], share) for problem, one in zip(problems, trials, strict=True)
        ]
    }


def races_in_common(arguments: Mapping[str, Any]) -> str:
    """The same for trials that differ by seed alone and whose poses a card may weigh together; "" for others."""
    (definition,) = chosen(defined_in(arguments["set"]), [arguments["problem"]])
    on_card = DEVICE_KNOB in definition.maps.knobs and not is_processor(arguments.get(DEVICE_KNOB, CPU))
    if not on_card or arguments["racer"] not in OWN_RACERS:
        return ""
    return json.dumps({**arguments, "seed": None}, sort_keys=True)


def _definition_of(arguments: Mapping[str, Any]) -> Definition:
    (definition,) = chosen(defined_in(arguments["set"]), [arguments["problem"]])
    best = definition.best
    if best is None or best.hash != arguments["hash"]:
        raise ArenaError(f"Problem '{definition.name}' has changed meanwhile.", "Begin the race again.")
    device = arguments.get(DEVICE_KNOB, CPU)
    return definition if device == CPU else weighed_by(definition, device)


def _measured(problem: Problem, seed: int, seconds: float) -> dict[str, Any]:
    best = problem.best
    assert best is not None
    drawn = poses_after(problem, SHOWN_AFTER) if seed == 0 else {}
    return {
        "evaluations": problem.evaluations,
        "seconds": round(seconds, 4),
        "seconds_weighing": round(problem.seconds, 4),
        "way": best.log_weight - problem.start_log_weight,
        "reached": [one.evaluations for one in problem.improvements],
        "gaps": [best.log_weight - one.log_weight for one in problem.improvements],
        "poses": {str(count): pose for count, pose in drawn.items()},
    }


def run_racer(racer: Racer, problem: Problem, seed: int) -> None:
    """Let a racer search a problem until it ends or the budget is spent.

    Raises ArenaError for what it raises, and where it weighs no pose.
    """
    where = f"Racer '{racer.name}' on problem '{problem.name}' with seed {seed}"
    try:
        racer.search(problem, seed)
    except BudgetSpentError:
        return
    except DeafError:
        raise ArenaError(
            f"{where} goes on asking though its evaluations are spent.",
            "Let BudgetSpentError end it: an `except Exception` around problem.log_likelihood keeps it from that.",
        ) from None
    except StudioError as error:
        raise ArenaError(f"{where}: {error.message}", error.hint) from error
    except Exception as error:
        raise ArenaError(
            f"{where} failed with {trials.failure_in_words(error)}.", "Correct the racer and race again."
        ) from error
    if not problem.evaluations:
        raise ArenaError(
            f"{where} weighed no pose.", "Let it call problem.log_likelihood(poses) until that ends it."
        )


def poses_after(problem: Problem, counts: Sequence[int]) -> dict[int, list[float]]:
    """The heaviest pose (D,) after so many evaluations, of those counts that were reached and found one."""
    shown = dict[int, list[float]]()
    for count in counts:
        until = [one for one in problem.improvements if one.evaluations <= count]
        if until and count <= problem.evaluations:
            shown[count] = until[-1].pose.tolist()
    return shown


def as_trial(outcome: Outcome) -> Trial:
    """A measured outcome as profiles take it."""
    arguments, measured = outcome.trial.arguments, outcome.measured
    return Trial(
        arguments["problem"],
        arguments["name"],
        arguments["seed"],
        measured["evaluations"],
        tuple(measured["reached"]),
        tuple(measured["gaps"]),
        measured["way"],
    )
