"""Whether half widths hold on drawn clips: what is concluded from measured trials, and one measured trial."""

import json
from pathlib import Path

import pytest
from drawn_people import ring_of_cameras
from planted_runs import drawn_session, person_poses

from studio.garden.drawn_recipes import KINDS
from studio.garden.reproduction.open_questions import half_widths
from studio.results.comparison.findings import Chart, Number, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Scale, Trial


def outcome(clip: str, **measured: object) -> Outcome:
    return Outcome(Trial(f"{clip}, seed 0", {"footage": clip, "seed": 0, "last": None}), dict(measured))


def measured(share: float, most: float | None = None) -> dict[str, object]:
    return {
        "joints": ["Hip", "Neck"],
        "half_widths": [[10.0, 20.0, None], [12.0, 24.0, None]],
        "within": [[share, 0.8, most], [share + 0.2, 1.0, most]],
        "frames": 75,
        "blocks": 12,
        "times": 2.5,
    }


def test_every_clip_of_both_halves_is_tracked_once_a_seed() -> None:
    made = half_widths.trials(Scale((0, 1)))
    assert len(made) == 2 * 2 * len(KINDS)
    assert {trial.arguments["last"] for trial in made} == {None}


def test_only_the_reporting_half_counts_and_levels_without_half_width_are_left_out() -> None:
    outcomes = [
        outcome("choosing-walk", **measured(0.0)),
        outcome("reporting-walk", **measured(0.4)),
        outcome("reporting-kick", **measured(0.6)),
        outcome("reporting-hard", refused="It cannot be promised."),
    ]
    parts = list(half_widths.shown(outcomes))
    numbers = {part.name: part for part in parts if isinstance(part, Number)}
    half, eighty, most, times = numbers.values()
    assert half.ours == pytest.approx(60.0)
    assert (eighty.ours, eighty.seeds, times.ours) == (pytest.approx(90.0), 2, 2.5)
    assert most.seeds == 0
    (table,) = [part for part in parts if isinstance(part, Table)]
    assert [row[0] for row in table.rows] == ["choosing-walk", "reporting-walk", "reporting-kick"]
    assert table.rows[1][3:] == (50.0, 90.0, None, 11.0, 22.0, None)
    (chart,) = [part for part in parts if isinstance(part, Chart)]
    assert [one.name for one in chart.series] == ["50 % promised", "80 % promised"]
    assert chart.series[0].y == (pytest.approx(50.0), pytest.approx(70.0))
    assert "reporting-hard: It cannot be promised." in parts


@pytest.mark.slow
def test_a_clip_is_tracked_drawn_again_and_measured(tmp_path: Path) -> None:
    drawn_session(tmp_path / "person", person_poses("walk", 20, 10, 2), ring_of_cameras(4))
    cache = FootageCache(tmp_path)
    told = half_widths.measure({"footage": str(tmp_path / "person"), "seed": 1, "last": 10}, cache)
    told = json.loads(json.dumps(told))
    assert len(told["joints"]) == len(told["half_widths"]) == len(told["within"]) == 15
    assert told["frames"] == 10
    assert told["times"] > 0.0
    assert all(0.0 <= row[0] <= 1.0 for row in told["within"])
    assert not (tmp_path / "person" / "runs").exists()
