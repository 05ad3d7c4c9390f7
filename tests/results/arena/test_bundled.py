"""The bundled problems: of all sizes, and each known best weighs here what it weighed where it was searched for."""

import numpy as np
import pytest

from studio.results.arena.problem import EASY, HARD, Definition, Problem
from studio.results.arena.problem_files import BUNDLED, LARGEST_SET, read_problems

PROBLEMS = read_problems(BUNDLED)
ROUNDING = 1e-4
"""Share of the way that kernels may round otherwise on another processor."""


def test_they_are_few_bytes_of_all_sizes_easy_and_hard() -> None:
    assert BUNDLED.stat().st_size < LARGEST_SET / 2
    sizes = sorted(len(one.free) for one in PROBLEMS)
    assert sizes[0] == 4
    assert sizes[-1] >= 29
    assert {one.kind for one in PROBLEMS} == {EASY, HARD}
    assert len({one.maps.body_name for one in PROBLEMS}) >= 4
    assert any(len(one.free) < len(one.held) for one in PROBLEMS)


@pytest.mark.parametrize("definition", PROBLEMS, ids=lambda one: one.name)
def test_the_known_best_is_reproduced(definition: Definition) -> None:
    best, problem = definition.best, Problem(definition)
    assert best is not None
    assert best.evaluations >= 900_000
    weight = problem.weigh(best.pose[None])[0]
    way = best.log_weight - problem.start_log_weight
    assert way > 0.0
    assert weight == pytest.approx(best.log_weight, abs=ROUNDING * way)
    drawn = np.random.default_rng(2).normal(
        problem.prior.start, problem.prior.sigma, (2000, problem.dimensions)
    )
    assert problem.weigh(np.clip(drawn, problem.lower, problem.upper)).max() <= best.log_weight
