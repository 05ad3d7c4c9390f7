"""Trackers compared on one session: trials, conclusions, and the bundled walk as the long run."""

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from studio.cli.reading import read_assignments
from studio.foundations.errors import RunError, SessionError, StudioError, TruthError
from studio.results.comparison.candidates import Lineup
from studio.results.comparison.comparison_findings import document, findings, frames_csv, table_text
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.plan import Comparison, Plan, conclude, plan_comparison, trials
from studio.results.comparison.tracked import measure_tracking
from studio.results.comparison.trials import Outcome
from studio.search.settings import DEFAULT_WEIGHTING
from studio.sessions.session import Session

ROOT = Path(__file__).resolve().parents[3]
WALK = ROOT / "sample_sessions" / "walk"


def plan(*names: str, evaluations: int = 200, seeds: tuple[int, ...] = (0, 1, 2), frames: int = 4) -> Plan:
    """A plan on the first frames of the bundled walk."""
    lineup = Lineup(names, "", evaluations, 5, read_assignments(()))
    return plan_comparison(Session(WALK), lineup, seeds, last=frames)


def made_up(drawn: Plan) -> list[Outcome]:
    """Outcomes with distinct errors: tracker t, seed s, frame f gives 10 (t + 1) + s + f / 10."""
    outcomes = []
    for trial in trials(drawn):
        seed = trial.arguments["seed"]
        tracker = next(
            at for at, one in enumerate(drawn.candidates) if one.name == trial.label.rpartition(", seed ")[0]
        )
        errors = [10.0 * (tracker + 1) + seed + frame / 10 for frame in range(drawn.frame_count)]
        lost = [["left leg"] if tracker == 1 and frame == 2 else [] for frame in range(drawn.frame_count)]
        measured = {
            "frames": list(range(drawn.frame_count)), "per_frame_mm": errors, "lost": lost,
            "mean_mm": float(np.mean(errors)), "worst_mm": max(errors), "lost_frames": int(tracker == 1),
            "lost_limbs": [], "evaluations": 200, "seconds": 2.0,
        }  # fmt: skip
        outcomes.append(Outcome(trial, measured))
    return outcomes


@pytest.fixture
def concluded() -> Comparison:
    """A comparison of three trackers that were not run."""
    drawn = plan("annealed", "annealed:eq13", "condensation")
    return conclude(drawn, made_up(drawn))


def test_a_trial_tracks_the_session_with_its_own_seed() -> None:
    drawn = plan("annealed", seeds=(1,))
    cache = FootageCache(Path("nowhere"))
    try:
        (trial,) = trials(drawn)
        found = measure_tracking(json.loads(json.dumps(dict(trial.arguments))), cache)
        again = measure_tracking(trial.arguments, cache)
    finally:
        cache.close()
    assert found["evaluations"] == 200
    assert found["mean_mm"] < 35.0
    assert found["lost_frames"] == 0
    assert {**found, "seconds": 0} == {**again, "seconds": 0}


def test_all_seeds_are_taken_together(concluded: Comparison) -> None:
    first, second, third = concluded.trackers
    assert [result.tracker for result in concluded.trackers] == ["annealed", "annealed:eq13", "condensation"]
    assert first.mean_mm == pytest.approx(10 + 1 + 0.15)
    assert first.worst_mm == pytest.approx(10 + 2 + 0.3)
    assert (first.lost_frames, second.lost_frames, third.seconds) == (0, 3, 6.0)
    assert first.curve == pytest.approx([11.0, 11.1, 11.2, 11.3])
    assert third.means == pytest.approx([30.15, 31.15, 32.15])


def test_every_pair_is_tested_over_frames_and_seeds(concluded: Comparison) -> None:
    assert [(pair.first, pair.second) for pair in concluded.pairs] == [
        ("annealed", "annealed:eq13"), ("annealed", "condensation"), ("annealed:eq13", "condensation"),
    ]  # fmt: skip
    pair = concluded.pairs[0]
    assert (pair.frames.better, pair.frames.worse, pair.seeds.better) == (4, 0, 3)
    assert pair.frames.p == pytest.approx(stats.binomtest(4, 4).pvalue)
    assert pair.seeds.p == pytest.approx(0.25)


def test_findings_show_each_seed_thin_and_the_mean_thick(concluded: Comparison) -> None:
    found = findings(concluded)
    chart = found.charts[0]
    thick = [series for series in chart.series if not series.thin]
    assert [series.name for series in thick] == ["annealed", "annealed:eq13", "condensation"]
    assert sum(series.thin for series in chart.series) == 9
    assert {series.group for series in chart.series if series.thin} == {series.group for series in thick}
    assert [number.ours for number in found.numbers] == pytest.approx([11.15, 21.15, 31.15])
    assert all(number.low <= number.ours <= number.high for number in found.numbers)
    assert "annealed is nearer than condensation in 4 of 4 frames" in found.words
    assert "not prove" in found.words
    assert "cannot fall below 0.25" in found.words


def test_the_document_has_the_agreed_fields(concluded: Comparison) -> None:
    report = json.loads(json.dumps(document(concluded)))
    fields = {"tracker", "evaluations", "mean_mm", "worst_mm", "lost_frames", "seconds"}
    for entry in report["trackers"]:
        assert entry.keys() == fields | {"seeds"}
        assert [seed.keys() == fields | {"seed"} for seed in entry["seeds"]] == [True] * 3
    assert report["frames"] == [0, 4]
    assert report["settings"]["annealed:eq13"]["adaptive_diffusion"] is False


def test_csv_and_text_agree(concluded: Comparison) -> None:
    lines = frames_csv(concluded).splitlines()
    assert lines[0] == "tracker,seed,frame,error_mm,limbs_lost"
    assert len(lines) == 1 + 3 * 3 * 4
    assert "annealed:eq13,1,2,21.200,left leg" in lines
    text = table_text(concluded)
    assert "annealed:eq13" in text
    assert "21.1" in text or "21.2" in text


def test_a_session_that_is_not_there_is_no_recipe_to_be_rendered(tmp_path: Path) -> None:
    cache = FootageCache(tmp_path)
    with pytest.raises(SessionError, match="There is no session at") as refusal:
        cache.session(str(tmp_path / "toy"))
    assert "renamed" in refusal.value.hint
    with pytest.raises(SessionError, match="'walk' is not in") as refusal:
        cache.session("walk")
    assert "synthesize walk" in refusal.value.hint


def test_a_session_without_truth_is_refused(session_on_disk: Session) -> None:
    with pytest.raises(TruthError, match="no truth") as refused:
        plan_comparison(session_on_disk, Lineup(("annealed",), "", 200), (0,))
    assert "truth" in refused.value.hint


@pytest.mark.parametrize("wrong", [{"seeds": ()}, {"seeds": (1, 1)}, {"seeds": (-1,)}, {"frames": 151}])
def test_wrong_seeds_and_frames_are_refused(wrong: dict) -> None:
    with pytest.raises(RunError):
        plan("annealed", **wrong)


def test_one_weighting_for_all_by_default_the_sessions() -> None:
    assert {candidate.weighting for candidate in plan("annealed", "condensation").candidates} == {
        DEFAULT_WEIGHTING
    }
    with pytest.raises(StudioError, match="no weighting 'x'"):
        plan_comparison(Session(WALK), Lineup(("annealed",), "x", 200), (0,))


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_improved_filter_keeps_every_limb_on_the_bundled_walk() -> None:
    drawn = plan_comparison(Session(WALK), Lineup(("improvements",), "", 2000), tuple(range(10)))
    cache = FootageCache(Path("nowhere"))
    try:
        outcomes = [Outcome(trial, measure_tracking(trial.arguments, cache)) for trial in trials(drawn)]
    finally:
        cache.close()
    comparison = conclude(drawn, outcomes)
    folder = Path(os.environ.get("STUDIO_ARTEFACTS", ROOT / "artefacts"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "walk_accuracy.json").write_text(json.dumps(document(comparison), indent=1))
    print("\n" + table_text(comparison))
    improved, planned, baseline = comparison.trackers
    assert {result.evaluations for result in comparison.trackers} == {2000}
    assert improved.mean_mm <= 35.0
    assert sum(seed.lost_frames == 0 for seed in improved.seeds) >= 8
    assert improved.mean_mm < min(planned.mean_mm, baseline.mean_mm)
    assert all(math.isfinite(pair.seeds.p) for pair in comparison.pairs)


def test_whose_fault_errors_are_is_a_bar_a_tracker_a_sentence_and_in_the_json() -> None:
    drawn = replace(plan("annealed", "condensation"), split_frames=2)
    assert {trial.arguments["split_frames"] for trial in trials(drawn)} == {2}
    outcomes = [
        replace(
            one, measured={**one.measured, "parts_mm": {"search": -1.0 - at, "likelihood": 9.0, "body": 3.0}}
        )
        for at, one in enumerate(made_up(drawn))
    ]
    comparison = conclude(drawn, outcomes)
    chart = findings(comparison).charts[2]
    assert chart.stacked
    assert chart.categories == ("annealed", "condensation")
    assert [(one.name, one.y) for one in chart.series] == [
        ("body", (3.0, 3.0)), ("likelihood", (9.0, 9.0)), ("search", (-3.0, -4.0)),
    ]  # fmt: skip
    assert "in 2 frames of each trial: annealed search −3.0, likelihood 9.0, body 3.0; condens" in table_text(
        comparison
    )
    first = document(comparison)["trackers"][0]
    assert first["parts_mm"] == {"search": -3.0, "likelihood": 9.0, "body": 3.0}


def test_a_comparison_that_splits_nothing_has_no_bars_of_it(concluded: Comparison) -> None:
    assert len(findings(concluded).charts) == 2
    assert "Whose part" not in table_text(concluded)
    assert "parts_mm" not in document(concluded)["trackers"][0]


def test_one_candidate_has_another_body_than_the_comparison() -> None:
    lineup = Lineup(("tempered", "tempered:new"), "", 200, 5, {"tempered:new": {"body": "human34"}})
    drawn = plan_comparison(Session(WALK), lineup, (0,), last=2)
    assert [trial.arguments["body"] for trial in trials(drawn)] == ["", "human34"]
    comparison = conclude(drawn, made_up(drawn))
    assert document(comparison)["settings"]["tempered:new"]["body"] == "human34"
    assert "body human34" in findings(comparison).settings["tempered:new"]
    assert "body" not in document(comparison)["settings"]["tempered"]


@pytest.mark.parametrize("body", ["", "tempered:new"])
def test_a_body_that_does_not_exist_and_one_for_all_are_refused(body: str) -> None:
    lineup = Lineup(("tempered", "tempered:new"), "", 200, 5, {body: {"body": "no-such"}})
    with pytest.raises(StudioError, match=r"no-such|The body of all trackers is not a knob"):
        plan_comparison(Session(WALK), lineup, (0,), last=2)
