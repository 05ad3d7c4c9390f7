"""Optimisers on the arena's bundled problems: who comes how near the heaviest known pose with how many evaluations."""

from collections.abc import Iterator, Sequence

import numpy as np

from studio.garden.reproduction.experiment import Part, listed
from studio.results.arena.problem import Definition
from studio.results.arena.profiles import SHARES, Trial
from studio.results.arena.racers import RACERS
from studio.results.arena.racing import as_trial, defined_in, measure_race, planned
from studio.results.arena.reports import charts_of, tables_of, words_of
from studio.results.comparison import trials as kinds
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale

BUDGET, QUICK_BUDGET = 5000, 1000


def trials(scale: Scale) -> tuple[kinds.Trial, ...]:
    """Every racer on every problem."""
    budget = QUICK_BUDGET if scale.quick else BUDGET
    return planned(defined_in(""), tuple(RACERS), budget, scale.seeds, "")


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Targets reached by each racer, with its intervals over seeds; the profiles; expected running times."""
    budget = int(outcomes[0].trial.arguments["evaluations"])
    yield from shown_of([as_trial(outcome) for outcome in outcomes], defined_in(""), budget)


def shown_of(raced: Sequence[Trial], definitions: Sequence[Definition], budget: int) -> Iterator[Part]:
    """The same of races on some problems."""
    for name in dict.fromkeys(one.racer for one in raced):
        yield number(f"targets reached within {budget} evaluations, {name}", _reached(raced, name), "%")
    yield from charts_of(raced, definitions, budget)
    yield from tables_of(raced, definitions)
    yield words_of(raced, budget)
    yield {
        "evaluations": budget,
        "problems": len(definitions),
        "targets": f"{len(SHARES)} a problem, from {SHARES[0]:.2g} to {SHARES[-1]:g} of the way from the start pose",
    }


def _reached(raced: Sequence[Trial], racer: str) -> list[float]:
    """Of each seed the share of all targets, per cent."""
    seeds = sorted({one.seed for one in raced})
    return [
        100.0
        * float(
            np.mean(
                [
                    np.isfinite(one.runtime(share))
                    for one in raced
                    if (one.racer, one.seed) == (racer, seed)
                    for share in SHARES
                ]
            )
        )
        for seed in seeds
    ]


EXPERIMENTS = (listed("arena", trials, measure_race, shown),)
