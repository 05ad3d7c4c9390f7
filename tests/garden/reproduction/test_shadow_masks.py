"""The shadow test is measured against exact masks."""

from pathlib import Path

import pytest

from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.garden.reproduction.open_questions.shadow_masks import CHOICES, measure
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Scale, Trial

EXPERIMENT = EXPERIMENTS["shadow-test"]


def test_shares_are_of_the_body_and_the_worst_clip_is_named() -> None:
    counted = {"one": [10, 20, 1000], "other": [50, 0, 1000]}
    outcomes = [
        Outcome(Trial(clip, {"clip": clip}), dict.fromkeys(CHOICES, counts))
        for clip, counts in counted.items()
    ]
    findings = EXPERIMENT.conclude(outcomes)
    numbers = {one.name: one.ours for one in findings.numbers}
    assert numbers["body called background, 5 pixels, 0.025"] == pytest.approx(3.0)
    assert numbers["body called background, worst clip, 5 pixels, 0.025"] == pytest.approx(5.0)
    assert numbers["beside it called body, 5 pixels, 0.025"] == pytest.approx(1.0)
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
        return {name: counts[row] / counts[2] for name, counts in measure({"clip": clip}, cache).items()}

    missed, added = shares("data:drawn-elsewhere/wood", 0), shares("choosing-hard", 1)
    together = "5 pixels, 0.025"
    assert missed[together] < 0.03 < missed["each pixel alone, 0.04"]
    assert added[together] < 0.03 < added["each pixel alone, 0.015"]


def test_a_trial_is_a_clip() -> None:
    clips = [trial.arguments["clip"] for trial in EXPERIMENT.trials(Scale((0, 1, 2)))]
    assert len(clips) == len(set(clips))
    assert {clip for clip in clips if not clip.startswith("data:")} >= {"choosing-hard", "choosing-walk"}
