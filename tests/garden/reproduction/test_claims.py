"""Claims that two things are equal are refuted on both sides, and not by a handful of seeds."""

import ast
from pathlib import Path

import numpy as np
import pytest

import studio.garden.reproduction
from studio.garden.reproduction.claims import (
    EQUAL,
    FEWEST_SEEDS,
    LOWER,
    NO_WORSE,
    beside,
    percent,
    ratio,
    saved,
    share,
)
from studio.garden.reproduction.experiment import TABLE, Experiment
from studio.results.comparison.statistics import ONE_SIDED, bootstrap_interval, number
from studio.results.comparison.trials import Scale

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


def test_no_saving_is_refuted_by_a_saving_as_by_a_loss() -> None:
    about_one = [0.98, 1.0, 1.02, 1.01, 0.99]
    assert saved("saved", about_one, 1.0).verdict == "reproduced"
    for factor in (0.7, 1.4):
        assert saved("saved", [factor * one for one in about_one], 1.0).verdict == "not reproduced"
    assert saved("saved", [2.0 * one for one in about_one], 2.0).verdict == "reproduced"
    assert saved("saved", [3.0 * one for one in about_one], 2.0).verdict == "better"
    assert saved("saved", about_one[1:], 1.0).verdict == "undecided"
    assert saved("saved", about_one, None).verdict == "answered"


@pytest.mark.parametrize("better", ["", "lower"])
def test_no_experiment_finds_a_printed_value_again_by_a_few_seeds(better: str) -> None:
    def verdict(seeds: int) -> str:
        experiment = Experiment(
            **TABLE["fleischmann-table-2"],
            name="few",
            trials=lambda scale: (),
            measure=lambda arguments, cache: {},
            shown=lambda outcomes: [
                number("error", [38.0 + seed / 10 for seed in range(seeds)], "mm", 38.0, better)
            ],
        )
        assert experiment.trials(Scale((0,))) == ()
        return experiment.conclude(()).verdict

    assert verdict(FEWEST_SEEDS) == "reproduced"
    assert verdict(FEWEST_SEEDS - 1) == "undecided"


def test_all_of_a_few_cases_leave_an_interval() -> None:
    found = percent("right", [True] * 68, 90.0)
    assert (found.ours, found.high, found.seeds, found.verdict) == (100.0, 100.0, 68, "better")
    assert found.low == pytest.approx(100.0 * 0.025 ** (1 / 68))
    assert percent("right", [True] * 20, 90.0).verdict == "reproduced"
    assert percent("right", [True] * 5, 90.0).verdict == "undecided"
    assert percent("right", [False] * 20, 90.0).verdict == "not reproduced"
    assert percent("right", [True, False]).verdict == "answered"


MILLIMETRES = "tracking.py"
"""Its means and worst frames are printed in mm, of which fewer are better."""


def test_every_ratio_of_an_experiment_is_judged_there() -> None:
    """No module compares two settings by a rule of its own, one-sided or of few seeds."""
    folder = Path(studio.garden.reproduction.__file__).parent
    seen: set[str] = set()
    for path in folder.rglob("*.py"):
        if path.name == "claims.py":
            continue
        calls = [
            node
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Call)
        ]
        assert not {called(node) for node in calls} & {"ratio_number", "verdict_of"}, path
        beside = {id(entry) for node in calls if called(node) == "beside" for entry in node.args}
        one_sided = [
            node
            for node in calls
            if called(node) == "number" and id(node) not in beside and is_one_sided(node)
        ]
        seen |= {path.name for _ in one_sided}
    assert seen == {MILLIMETRES}


def called(call: ast.Call) -> str:
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def is_one_sided(call: ast.Call) -> bool:
    """Whether a call of `number` gives it a paper's value and a better side."""
    given = {keyword.arg for keyword in call.keywords}
    names = ("name", "values", "unit", "paper", "better", "statistic")
    given |= set(names[: len(call.args)])
    return {"paper", "better"} <= given


def test_each_claim_says_what_would_refute_it() -> None:
    said = {
        "holds": share("holds", [True] * 6),
        "does not": share("does not", [False] * 6, 0.0),
        "equal": ratio("equal", [1.0, 1.1], [1.0, 1.0], EQUAL),
        "no worse": ratio("no worse", [1.0, 1.1], [1.0, 1.0], NO_WORSE),
        "lower": ratio("lower", [1.0, 1.1], [2.0, 2.0], LOWER),
        "least": percent("least", [True, True], 80.0),
    }
    assert {name: number.refuted for name, number in said.items()} == {
        "holds": "so in significantly fewer than half of the seeds",
        "does not": "so in significantly more than half of the seeds",
        "equal": "the interval leaves 1 out and reaches beyond 0.909 or 1.1",
        "no worse": "the interval lies above 1 and reaches beyond 1.1",
        "lower": "the whole interval lies above 0.909",
        "least": "the interval lies below 80 and reaches below 72.7",
    }
    assert beside(said["lower"]).refuted == ""
    assert ratio("without a claim", [1.0], [1.0]).refuted == ""


@pytest.mark.parametrize("values", [(1.3, 1.4, 1.35), (0.8, 1.3, 1.0), (0.5, 0.6, 0.55), (1.0, 1.01, 0.99)])
@pytest.mark.parametrize("better", ["", "lower", "higher"])
def test_what_is_said_to_refute_does(values: tuple[float, ...], better: str) -> None:
    found = number("size", values * 4, "mm", 1.0, better)
    least, most = bootstrap_interval(values * 4, level=ONE_SIDED)
    beyond_margin = {"lower": most > 1.1, "higher": least < 1 / 1.1}.get(
        better, most > 1.1 or least < 1 / 1.1
    )
    left_out = {"lower": found.low > 1.0, "higher": found.high < 1.0}.get(
        better, not found.low <= 1.0 <= found.high
    )
    assert (found.verdict == "not reproduced") == (beyond_margin and left_out)
