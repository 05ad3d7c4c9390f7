"""Whose fault errors are, over evaluations: what is concluded from tracked runs."""

import pytest

from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.results.comparison.findings import Chart, Number, Table
from studio.results.comparison.tracked import Tracked
from studio.results.comparison.trials import Outcome, Scale

SPLIT = EXPERIMENTS["error-split"]


def tracked(search: float) -> dict[str, object]:
    parts = {"search": search, "likelihood": 8.0, "body": 2.0}
    run = Tracked([0], [10.0 + search], [[]], 10.0 + search, 20.0, 0, [], 1000, 1.0, parts_mm=parts)
    return {name: getattr(run, name) for name in Tracked.__dataclass_fields__}


def test_each_clip_has_its_bars_and_each_tracker_what_evaluations_take_from_its_searchs_part() -> None:
    trials = SPLIT.trials(Scale((0, 1), quick=True))
    assert {trial.arguments["split_frames"] for trial in trials} == {3}
    outcomes = [
        Outcome(
            trial, tracked(4000.0 / (1000 if ", 1000 on" in trial.label else 4000) + trial.arguments["seed"])
        )
        for trial in trials
    ]
    parts = list(SPLIT.shown(outcomes))
    (chart,) = [part for part in parts if isinstance(part, Chart)]
    assert chart.stacked
    assert [series.name for series in chart.series] == ["body", "likelihood", "search"]
    assert chart.series[2].y == pytest.approx((4.5, 1.5) * 4)
    gone = [part for part in parts if isinstance(part, Number)]
    assert [one.ours for one in gone] == pytest.approx([-3.0] * 4)
    (table,) = [part for part in parts if isinstance(part, Table)]
    assert table.rows[0] == ("walk", "annealed, 1000", 14.5, 2.0, 8.0, 4.5)
