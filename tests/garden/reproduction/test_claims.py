"""Claims that two things are equal are refuted on both sides, and not by a handful of seeds."""

import ast
from pathlib import Path

import numpy as np
import pytest

import studio.garden.reproduction
from studio.garden.reproduction.claims import EQUAL, FEWEST_SEEDS, LOWER, NO_WORSE, percent, ratio

THEIRS = np.random.default_rng(7).normal(30.0, 0.5, 10)


def verdict(factor: float, claim: str, seeds: int = 10) -> str:
    return ratio("error", factor * THEIRS[:seeds], THEIRS[:seeds][::-1], claim).verdict


@pytest.mark.parametrize(
    ("factor", "equal", "no_worse", "lower"),
    [
        (0.76, "not reproduced", "better", "reproduced"),
        (1.0, "reproduced", "reproduced", "not reproduced"),
        (1.3, "not reproduced", "not reproduced", "not reproduced"),
    ],
)
def test_equal_is_refuted_by_better_as_by_worse(factor: float, equal: str, no_worse: str, lower: str) -> None:
    assert verdict(factor, EQUAL) == equal
    assert verdict(factor, NO_WORSE) == no_worse
    assert verdict(factor, LOWER) == lower


@pytest.mark.parametrize("claim", [EQUAL, NO_WORSE])
def test_few_seeds_show_no_equality(claim: str) -> None:
    assert verdict(1.0, claim, FEWEST_SEEDS) == "reproduced"
    assert verdict(1.0, claim, FEWEST_SEEDS - 1) == "undecided"
    assert verdict(1.3, claim, FEWEST_SEEDS - 1) == "not reproduced"


def test_all_of_a_few_cases_leave_an_interval() -> None:
    found = percent("right", [True] * 68, 90.0)
    assert (found.ours, found.high, found.seeds, found.verdict) == (100.0, 100.0, 68, "better")
    assert found.low == pytest.approx(100.0 * 0.025 ** (1 / 68))
    assert percent("right", [True] * 20, 90.0).verdict == "reproduced"
    assert percent("right", [True] * 5, 90.0).verdict == "undecided"
    assert percent("right", [False] * 20, 90.0).verdict == "not reproduced"
    assert percent("right", [True, False]).verdict == "answered"


def test_every_ratio_of_an_experiment_is_judged_there() -> None:
    """No module compares two settings by a rule of its own, one-sided or of few seeds."""
    folder = Path(studio.garden.reproduction.__file__).parent
    for path in folder.rglob("*.py"):
        called = {
            getattr(node.func, "attr", getattr(node.func, "id", ""))
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Call)
        }
        if path.name != "claims.py":
            assert not called & {"ratio_number", "verdict_of"}, path
