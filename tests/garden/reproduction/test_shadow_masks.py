"""The shadow test is measured against exact masks."""

from pathlib import Path

import pytest

from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.garden.reproduction.open_questions.shadow_masks import CHOICES, PLAIN, POOR, measure
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Scale, Trial

EXPERIMENT = EXPERIMENTS["shadow-test"]


def test_shares_are_of_the_body_or_of_its_shadow_by_set() -> None:
    counted = {"one": [10, 20, 1000, 5, 500, 30, 10], "other": [50, 0, 1000, 0, 250, 10, 0]}
    outcomes = [
        Outcome(Trial(f"{clip}, {kind}", {"clip": clip, "set": kind}), dict.fromkeys(CHOICES, counts))
        for kind, clips in ((PLAIN, ("one", "other")), (POOR, ("other",)))
        for clip, counts in counted.items()
        if clip in clips
    ]
    findings = EXPERIMENT.conclude(outcomes)
    numbers = {one.name: one.ours for one in findings.numbers}
    choice = "5 pixels, 0.025"
    assert numbers[f"body called background, {PLAIN}, {choice}"] == pytest.approx(3.0)
    assert numbers[f"body called background, worst clip, {PLAIN}, {choice}"] == pytest.approx(5.0)
    assert numbers[f"beside it called body, {PLAIN}, {choice}"] == pytest.approx(1.0)
    assert numbers[f"its shadow called body, {PLAIN}, {choice}"] == pytest.approx(0.5)
    assert numbers[f"body called neither, {PLAIN}, {choice}"] == pytest.approx(2.0)
    assert numbers[f"its shadow called neither, {PLAIN}, {choice}"] == pytest.approx(1.0)
    assert numbers[f"body called background, {POOR}, {choice}"] == pytest.approx(5.0)
    assert findings.tables[0].rows[0][1:] == ("1.0 / 2.0", "5.0 / 0.0")


@pytest.mark.slow
@pytest.mark.real_data
def test_neighbouring_pixels_together_keep_skin_and_drop_tinted_shadows(
    real_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The default against each pixel alone: skin on wood with its tolerance, tinted shadows with a narrow one."""
    monkeypatch.setenv("STUDIO_REAL_DATA", str(real_data))
    cache = FootageCache(tmp_path)

    def shares(clip: str, row: int) -> dict[str, float]:
        arguments = {"clip": clip, "set": PLAIN}
        return {name: counts[row] / counts[2] for name, counts in measure(arguments, cache).items()}

    missed, added = shares("data:drawn-elsewhere/wood", 0), shares("choosing-hard", 1)
    together = "5 pixels, 0.025"
    assert missed[together] < 0.03 < missed["each pixel alone, 0.04"]
    assert added[together] < 0.03 < added["each pixel alone, 0.015"]


def test_a_trial_is_a_clip_as_drawn_or_poorly_seen() -> None:
    planned = [trial.arguments for trial in EXPERIMENT.trials(Scale((0, 1, 2)))]
    drawn, poor = ([one["clip"] for one in planned if one["set"] == kind] for kind in (PLAIN, POOR))
    assert drawn == poor
    assert len(set(drawn)) == len(drawn) == 12
    assert {"choosing-hard", "choosing-walk"} <= set(drawn)
