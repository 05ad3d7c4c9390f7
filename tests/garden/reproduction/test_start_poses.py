"""The experiment on start poses: a real one is measured, and classes of confidence are counted."""

from pathlib import Path

import pytest

from studio.garden.reproduction.open_questions import start_poses
from studio.results.comparison.findings import Chart, Number, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Trial

SAMPLES = Path(__file__).parents[3] / "sample_sessions"


@pytest.mark.slow
def test_a_start_pose_is_measured_against_the_truth() -> None:
    found = start_poses.measure({"footage": "walk", "frame": 0, "seed": 0}, FootageCache(SAMPLES))
    assert found["mean_mm"] <= start_poses.RIGHT_MM
    assert found["confidence"] >= start_poses.SURE
    assert found["worst_mm"] >= found["mean_mm"]


def test_poses_are_counted_by_confidence() -> None:
    def outcome(kind: str, confidence: float, mean: float) -> Outcome:
        trial = Trial(f"reporting {kind}, frame 0, seed 0", {})
        return Outcome(trial, {"confidence": confidence, "mean_mm": mean, "worst_mm": 2.0 * mean})

    assert f"{100 * start_poses.SURE:.0f} % sure" in start_poses.EXPERIMENTS[0].claim
    planted = [outcome(f"clip-{at}", 0.98, 30.0) for at in range(9)]
    planted += [outcome("leap", 0.98, 250.0), outcome("hard", 0.4, 300.0), outcome("walk", 0.4, 20.0)]
    parts = list(start_poses.shown(planted))
    numbers = {part.name: part for part in parts if isinstance(part, Number)}
    sure = numbers["right, of those called 90 % sure or more, reporting"]
    assert (sure.ours, sure.seeds, sure.paper) == (90.0, 10, 90.0)
    assert round(numbers["right, of all, reporting"].ours, 1) == 83.3
    tables = {part.title: part.rows for part in parts if isinstance(part, Table)}
    assert tables["Start poses by confidence: reporting half"] == (
        ("25 to 50 %", 2, 40.0, 50.0),
        ("97 to 100 %", 10, 98.0, 90.0),
    )
    assert [row[0].split(",")[0] for row in tables["Wrong start poses: reporting half"]] == [
        "reporting leap",
        "reporting hard",
    ]
    (chart,) = [part for part in parts if isinstance(part, Chart)]
    assert {one.name: one.y for one in chart.series}["reporting"] == (50.0, 90.0)
