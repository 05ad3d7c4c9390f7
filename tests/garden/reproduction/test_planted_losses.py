"""Planted losses: counted by cause, and really planted in a drawn clip."""

from pathlib import Path

import pytest

from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.garden.reproduction.open_questions.planted_losses import CAUSES, ERASED, MOVED, SOUND, measure
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Scale, Trial
from studio.results.drawing_footage.recipes import synthesize

EXPERIMENT = EXPERIMENTS["planted-losses"]


def test_shares_are_of_all_clips_frames() -> None:
    none = {cause: [0] * 5 for cause in (*CAUSES, SOUND)}
    outcomes = [
        Outcome(Trial("one", {"clip": "one"}), {**none, MOVED: [10, 9, 8, 10, 9], SOUND: [50, 1, 0, 2, 0]}),
        Outcome(Trial("other", {"clip": "other"}), {**none, ERASED: [10, 0, 0, 9, 9]}),
    ]
    findings = EXPERIMENT.conclude(outcomes)
    numbers = {one.name: one.ours for one in findings.numbers}
    assert numbers["named by a run, moved"] == pytest.approx(90.0)
    assert numbers["named by a run, all causes"] == pytest.approx(45.0)
    assert numbers["named by a check, all causes"] == pytest.approx(95.0)
    assert numbers["named by a check, no limb lost"] == pytest.approx(4.0)
    assert findings.tables[1].rows[-1][1] == "10 / 9 / 10"


def test_a_clip_has_a_trial_of_planted_losses_and_one_of_a_poor_run() -> None:
    labels = [trial.label for trial in EXPERIMENT.trials(Scale((0,)))]
    assert len(labels) == len(set(labels))
    assert sum(label.startswith("planted") for label in labels) * 2 == len(labels)


@pytest.mark.slow
def test_a_limb_that_all_masks_lack_is_named_by_a_check(tmp_path: Path) -> None:
    synthesize("choosing-walk", tmp_path / "choosing-walk", frames=30)
    arguments = {"clip": "choosing-walk", "frames": 2, "seed": 0, "attempt": {}}
    counts = measure(arguments, FootageCache(tmp_path))
    frames, _, _, named, _ = counts[ERASED]
    assert frames >= 6
    assert named >= 0.8 * frames
    assert counts[SOUND][0] == 2
    assert counts[SOUND][3] == 0
