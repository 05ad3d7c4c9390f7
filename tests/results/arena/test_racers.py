"""Racers: each spends its budget within the bounds and is repeated by its seed; files and packages add their own."""

import sys
from pathlib import Path

import numpy as np
import pytest
from guide_package import FILES, lay_out
from toy_arena import ToyArena

from studio.foundations.errors import StudioError
from studio.foundations.registry import Registry
from studio.results.arena.problem import ArenaError, Problem
from studio.results.arena.racers import RACERS, Racer, racer_named
from studio.results.arena.racing import poses_after, run_racer
from studio.search.trackers.catalogue import TRACKERS

BUDGET = 1500
LEAST_OF_THE_WAY = 0.3


def raced(arena: ToyArena, racer: Racer, seed: int = 1, *, part: bool = False) -> Problem:
    problem = Problem(arena.part if part else arena.whole, BUDGET)
    run_racer(racer, problem, seed)
    return problem


@pytest.mark.parametrize("name", sorted(RACERS))
@pytest.mark.parametrize("part", [False, True])
def test_a_racer_spends_its_budget_comes_nearer_and_is_repeated_by_its_seed(
    arena: ToyArena, name: str, part: bool
) -> None:
    problem, again, other = (raced(arena, RACERS[name], seed, part=part) for seed in (1, 1, 2))
    assert problem.evaluations == BUDGET
    assert problem.heaviest is not None
    assert problem.best is not None
    way = problem.best.log_weight - problem.start_log_weight
    assert problem.heaviest.log_weight > problem.start_log_weight + LEAST_OF_THE_WAY * way
    assert [one.evaluations for one in again.improvements] == [
        one.evaluations for one in problem.improvements
    ]
    assert np.array_equal(again.improvements[-1].pose, problem.improvements[-1].pose)
    assert [one.evaluations for one in other.improvements] != [
        one.evaluations for one in problem.improvements
    ]
    for one in problem.improvements:
        assert np.isfinite(one.log_weight)
        assert np.all((one.pose >= problem.lower) & (one.pose <= problem.upper))


def test_every_tracker_without_a_behaviour_model_races() -> None:
    assert {name for name in TRACKERS if not TRACKERS[name].needs_behaviour} < set(RACERS)
    assert "behaviour" not in RACERS


def test_poses_are_kept_of_counts_that_were_reached(arena: ToyArena) -> None:
    problem = raced(arena, RACERS["random-search"])
    shown = poses_after(problem, (10, 1000, 10_000))
    assert list(shown) == [10, 1000]
    until = [one for one in problem.improvements if one.evaluations <= 10]
    assert shown[10] == until[-1].pose.tolist()


def test_cma_es_names_the_extra_where_its_package_is_missing(
    arena: ToyArena, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "cmaes", None)
    with pytest.raises(ArenaError, match="cmaes is not installed") as refusal:
        raced(arena, RACERS["cma-es"])
    assert "capture-studio[arena]" in refusal.value.hint


def test_the_guide_s_racer_is_raced_from_its_file(arena: ToyArena, tmp_path: Path) -> None:
    file = tmp_path / "my_racer.py"
    file.write_text(FILES["my_racer.py"], encoding="utf-8")
    racer = racer_named(str(file))
    problem = raced(arena, racer)
    assert problem.evaluations == BUDGET
    assert problem.best is not None
    assert problem.heaviest is not None
    way = problem.best.log_weight - problem.start_log_weight
    assert problem.best.log_weight - problem.heaviest.log_weight < 0.1 * way


HEAD = "from studio.arena import Racer\nimport numpy as np\n"
DEAF = """while True:
        try:
            problem.log_likelihood(problem.prior.start[None])
        except Exception:
            continue"""


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("raise ZeroDivisionError('by nothing')", "failed with ZeroDivisionError: by nothing"),
        ("problem.log_likelihood(np.full((3, problem.dimensions), np.nan))", "was given nan for 'x1'"),
        ("problem.log_likelihood([1.0])", "array of shape"),
        ("pass", "weighed no pose"),
        (DEAF, "goes on asking though its evaluations are spent"),
    ],
)
def test_a_racer_that_goes_wrong_is_named_with_problem_seed_and_cause(
    arena: ToyArena, tmp_path: Path, body: str, why: str
) -> None:
    file = tmp_path / "wrong.py"
    file.write_text(
        f"{HEAD}def search(problem, seed):\n    {body}\n\nRACER = Racer('wrong', 'Wrong', search)\n"
    )
    with pytest.raises(ArenaError, match=why) as refusal:
        raced(arena, racer_named(str(file)), seed=7)
    assert f"Racer 'wrong' on problem '{arena.whole.name}' with seed 7" in refusal.value.message


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("RACER = 3\n", "has no RACER"),
        ("def search(:\n", "cannot be run: SyntaxError"),
        ("import nothing_of_that_name\n", "cannot be run: ModuleNotFoundError"),
        (f"{HEAD}RACER = Racer('mine', 'Mine', 3)\n", "no function of a problem and a seed"),
    ],
)
def test_a_file_without_a_racer_says_why(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(StudioError, match=why):
        racer_named(str(tmp_path / "mine.py"))
    with pytest.raises(ArenaError, match="no racer's file"):
        racer_named(str(tmp_path / "gone.py"))


def test_a_package_adds_a_racer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = FILES["my_racer.py"].replace('"my-search"', '"packed"')
    lay_out(
        tmp_path, {"packed_racer.py": text}, "packed", {"studio.racers": {"packed": "packed_racer:RACER"}}
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    registry = Registry("racer", "studio.racers", Racer, (), lambda racer: None)
    assert list(registry) == ["packed"]
    assert registry["packed"].label == "My search"


def test_a_problem_shows_itself_in_a_line(arena: ToyArena) -> None:
    problem = raced(arena, RACERS["random-search"])
    assert (
        repr(problem)
        == f"<Problem '{problem.name}', 4 parameters, {problem.kind}: {BUDGET} of {BUDGET} spent>"
    )
