"""The arena's experiment: its trials are the race's own, and what it shows is counted from them."""

from pathlib import Path

import numpy as np
import pytest

from studio.garden.reproduction.open_questions import arena
from studio.results.arena.profiles import SHARES
from studio.results.arena.racers import RACERS
from studio.results.arena.racing import as_trial, defined_in, measure_race
from studio.results.comparison.findings import Chart, Number, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Outcome, Scale


def test_every_racer_on_every_problem_with_every_seed() -> None:
    planned = arena.trials(Scale((0, 1)))
    assert len(planned) == 2 * len(RACERS) * len(defined_in(""))
    assert len({str(trial.arguments) for trial in planned}) == len(planned)
    assert {trial.arguments["evaluations"] for trial in planned} == {5000}


def test_what_is_shown_is_counted_from_the_trials(tmp_path: Path) -> None:
    names = ("cma-es", "random-search")
    planned = [
        trial
        for trial in arena.trials(Scale((0, 1), quick=True))
        if trial.arguments["problem"] == "planar-arm" and trial.arguments["racer"] in names
    ]
    cache = FootageCache(tmp_path)
    outcomes = [Outcome(trial, plain(measure_race(trial.arguments, cache))) for trial in planned]
    raced = [as_trial(outcome) for outcome in outcomes]
    definitions = [one for one in defined_in("") if one.name == "planar-arm"]
    parts = [*arena.shown_of(raced, definitions, 1000)]
    numbers = {part.name: part for part in parts if isinstance(part, Number)}
    own = [one for one in raced if one.racer == "cma-es"]
    reached = [np.mean([np.isfinite(one.runtime(share)) for share in SHARES]) for one in own]
    ours = numbers["targets reached within 1000 evaluations, cma-es"].ours
    assert ours == pytest.approx(100.0 * np.mean(reached))
    (chart,) = [part for part in parts if isinstance(part, Chart)]
    assert 100.0 * chart.series[0].y[-1] == pytest.approx(ours)
    assert {len(part.rows) for part in parts if isinstance(part, Table)} == {1}
