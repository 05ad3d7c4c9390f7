"""Experiments of tracked footage: their trials, and conclusions from made-up outcomes, in both directions."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from studio.foundations.package import assets_folder
from studio.garden.drawn_recipes import KINDS
from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.garden.reproduction.deutscher_reid.carried_and_crossed import in_words
from studio.garden.reproduction.experiment import group_of
from studio.garden.reproduction.fleischmann import SHARED
from studio.garden.reproduction.open_questions.generalisation import ENTRIES
from studio.garden.reproduction.plan import footage_of, frames_of, plan, scale_of
from studio.garden.reproduction.tracking import by_group, curves, spells
from studio.results.comparison.findings import VERDICTS, Findings, Number
from studio.results.comparison.tracked import Tracked, TrackingTrial, tracking_trial
from studio.results.comparison.trials import Outcome, Scale, Trial

TRACKED = (
    "fleischmann-table-2",
    "fleischmann-fig-3",
    "fleischmann-figs-4-5",
    "fleischmann-fig-6",
    "fleischmann-partitions",
    "fleischmann-constraints",
    "fleischmann-best-figure",
    "deutscher-carried",
    "deutscher-crossover-share",
    "robustness-mask-damage",
    "robustness-background-clutter",
    "robustness-calibration-error",
    "robustness-fewer-cameras",
    "robustness-fewer-frames",
    "generalisation",
    "other-people",
    "evaluations",
)
SCALE, FIVE = Scale(seeds=(0, 1, 2)), Scale(seeds=(0, 1, 2, 3, 4))


def made(trial: Trial, error: float, lost: tuple[int, ...] = ()) -> Outcome:
    """A run of forty frames (of sixty hertz; a third at twenty) with an error and some frames with a lost arm."""
    arguments = trial.arguments.get("attempt", trial.arguments)
    count = 450 if "20hz" not in arguments["footage"] else 150
    seed = arguments["seed"]
    rng = np.random.default_rng(seed)
    errors = error + 0.6 * (seed - 1) + rng.normal(0.0, 0.5, count)
    run = Tracked(
        frames=list(range(count)),
        per_frame_mm=[float(value) for value in errors],
        lost=[["left arm"] if frame in lost else [] for frame in range(count)],
        mean_mm=float(errors.mean()),
        worst_mm=float(errors.max()),
        lost_frames=len(lost),
        lost_limbs=["left arm"] if lost else [],
        evaluations=1000,
        seconds=1.0,
        # The tracker notices a frame late.
        named=[["left arm"] if frame - 1 in lost else [] for frame in range(count)],
    )
    return Outcome(trial, json.loads(json.dumps(asdict(run))))


def concluded(name: str, error_of, scale: Scale = SCALE) -> Findings:
    """The findings of an experiment whose runs have the error `error_of(trial label)`."""
    experiment = EXPERIMENTS[name]
    return experiment.conclude([made(trial, error_of(trial.label)) for trial in experiment.trials(scale)])


@pytest.mark.slow
@pytest.mark.parametrize("name", TRACKED)
def test_findings_are_plain_and_name_their_settings(name: str) -> None:
    findings = concluded(name, lambda label: 40.0)
    assert findings.verdict in VERDICTS
    assert findings.charts
    assert findings.tables
    assert findings.settings
    json.dumps(asdict(findings))


def test_effort_says_what_a_smaller_search_costs() -> None:
    words = concluded("effort", lambda label: 44.0 if label.startswith("10 × 20,") else 40.0).words
    assert words.count("10 × 20 +10.0 %") == 2
    assert words.count("10 × 50 +0.0 %") == 2


def test_table_2_is_reproduced_bettered_or_not() -> None:
    paper = {"1000": 38.0, "2000": 37.3, "4000": 35.7}

    def near(label: str) -> float:
        return paper[label.split()[0]]

    def mean_verdicts(findings: Findings) -> list[str]:
        claimed = [entry for entry in findings.numbers if entry.paper is not None]
        return [entry.verdict for entry in claimed if entry.name.startswith("mean")]

    assert mean_verdicts(concluded("fleischmann-table-2", near, FIVE)) == ["reproduced"] * 4
    assert mean_verdicts(concluded("fleischmann-table-2", near)) == ["undecided"] * 4
    assert mean_verdicts(concluded("fleischmann-table-2", lambda label: 20.0)) == ["better"] * 4
    findings = concluded("fleischmann-table-2", lambda label: 90.0)
    assert mean_verdicts(findings) == ["not reproduced"] * 4
    assert findings.verdict == "not reproduced"


def test_fig_6_requires_the_swarm_to_win_at_20_and_equal_at_60() -> None:
    def as_claimed(label: str) -> float:
        return 70.0 if "Eq. 13" in label and "20 Hz" in label else 40.0

    assert concluded("fleischmann-fig-6", as_claimed, FIVE).verdict == "reproduced"
    assert concluded("fleischmann-fig-6", lambda label: 40.0, FIVE).verdict == "not reproduced"

    def worse_at_60(label: str) -> float:
        return (
            70.0
            if ("Eq. 13" in label and "20 Hz" in label) or ("swarm" in label and "60 Hz" in label)
            else 40.0
        )

    assert concluded("fleischmann-fig-6", worse_at_60, FIVE).verdict == "not reproduced"

    def better_at_60(label: str) -> float:
        return 30.0 if "swarm" in label and "60 Hz" in label else as_claimed(label)

    assert concluded("fleischmann-fig-6", better_at_60, FIVE).verdict == "not reproduced"


def test_partitions_require_soft_to_be_better_than_all_but_three_stages() -> None:
    def as_claimed(label: str) -> float:
        return 40.0 if label.startswith("soft") else 60.0

    assert concluded("fleischmann-partitions", as_claimed, FIVE).verdict == "reproduced"

    def three_is_better(label: str) -> float:
        return 30.0 if "three" in label else as_claimed(label)

    assert concluded("fleischmann-partitions", three_is_better, FIVE).verdict == "not reproduced"


SHARED_BY = {
    "fleischmann-fig-3": "60 frames a second, seed",
    "fleischmann-fig-6": "swarm, 60 Hz, seed",
    "fleischmann-table-2": "1000 evaluations, seed",
    "fleischmann-constraints": "swarm, 60 Hz, with priors, seed",
    "fleischmann-best-figure": "swarm, paper's fitness, seed",
    "fleischmann-partitions": "soft, two stages, 60 Hz, seed",
}
"""The printed swarm at 60 Hz with 1000 evaluations, in the words of each experiment that has it."""


def test_one_setting_is_the_same_kept_trials_and_one_number() -> None:
    scale = scale_of()
    keys: dict[str, list[str]] = {}
    for name, words in SHARED_BY.items():
        jobs = [job for job in plan(EXPERIMENTS[name], scale).jobs if job.label.startswith(words)]
        keys[name] = [job.key for job in jobs[: len(scale.seeds)]]
    assert len({tuple(own) for own in keys.values()}) == 1, keys
    assert len(set(keys["fleischmann-fig-3"])) == 10

    def number(name: str) -> tuple[float, float, float]:
        def error(label: str) -> float:
            return 31.0 if label.startswith(SHARED_BY[name]) else 50.0

        found = [entry for entry in concluded(name, error, scale).numbers if entry.name == SHARED]
        assert len(found) == 1, name
        assert found[0].seeds == 10
        return found[0].ours, found[0].low, found[0].high

    assert len({number(name) for name in SHARED_BY}) == 1


def test_partitions_have_thirty_seeds_where_all_are_run() -> None:
    experiment = EXPERIMENTS["fleischmann-partitions"]

    def seeds_of(scale: Scale, words: str) -> int:
        return sum(trial.label.startswith(words) for trial in experiment.trials(scale))

    assert seeds_of(scale_of(), "global, 60 Hz, seed") == 30
    assert seeds_of(scale_of(), "global, 60 Hz, σ0 × 0.5, seed") == 10
    assert seeds_of(scale_of(40), "global, 60 Hz, seed") == 40
    assert seeds_of(scale_of(3), "global, 60 Hz, seed") == 3
    assert seeds_of(scale_of(quick=True), "global, 60 Hz, seed") == 3


def test_the_guide_has_one_number_for_the_shared_setting() -> None:
    """Kept findings of one commit, and the table of figures where these are there, say the same number."""
    folder = assets_folder() / "guide"
    kept: dict[str, tuple[tuple[str, ...], float]] = {}
    for name in SHARED_BY:
        document = json.loads((folder / "reproduction" / f"{name}.json").read_text())
        for entry in document["numbers"]:
            if entry["name"] == SHARED:
                kept[name] = tuple(document["commits"]), round(entry["ours"], 1)
    assert len({value for _, value in kept.values()}) <= 1, kept
    if kept:
        value = next(value for _, value in kept.values())
        rows = [
            row for row in (folder / "figures.md").read_text().splitlines() if "swarm, paper's fitness" in row
        ]
        assert all(f"{value:.1f} mm" in row for row in rows), (
            f"figures.md has another number than {value:.1f} mm"
        )


@pytest.mark.parametrize(
    ("error", "words"), [(30.0, "is nearer"), (60.0, "is farther off"), (40.0, "makes no")]
)
def test_what_is_carried_ends_in_a_conclusion(error: float, words: str) -> None:
    def error_of(label: str) -> float:
        return error if "the mode" in label and label.startswith("Eq. 13, the mode") else 40.0

    found = concluded("deutscher-carried", error_of, scale_of())
    assert f"Eq. 13: the mode instead of every particle {words}" in found.words
    assert "section 6: the mode instead of every particle makes no difference" in found.words
    few = concluded("deutscher-carried", error_of, FIVE)
    assert "too few to conclude" in few.words
    assert (
        len({trial.arguments["seed"] for trial in EXPERIMENTS["deutscher-carried"].trials(scale_of())}) == 10
    )


def test_a_wide_interval_is_no_conclusion() -> None:
    wide = Number("", 1.0, 0.7, 1.4, "×", None, "", 10, "answered")
    assert in_words(wide) == "shows no difference, nor that there is none"


def test_spells_are_rows_of_frames_with_a_limb_lost() -> None:
    (trial, *_) = EXPERIMENTS["fleischmann-fig-3"].trials(SCALE)
    run = Tracked(**made(trial, 40.0, lost=(3, 4, 5, 9, 448, 449)).measured)
    found = list(spells(run))
    assert [(spell.limb, spell.frames, spell.found_again) for spell in found] == [
        ("left arm", 3, True),
        ("left arm", 1, True),
        ("left arm", 2, False),
    ]


def test_damage_that_no_tracker_tolerates_is_reported() -> None:
    def hopeless(label: str) -> float:
        return 400.0 if not label.split(", ")[-2].endswith(" 0") else 30.0

    findings = concluded("robustness-mask-damage", hopeless)
    assert findings.verdict == "answered"
    (errors, losses) = findings.charts
    assert losses.heat is not None
    assert errors.heat.columns == ("0", "0.1", "0.2", "0.4", "0.8")


def test_groups_keep_the_order_of_seeds_and_curves_their_mean() -> None:
    trials = [
        tracking_trial("a, b", TrackingTrial("walk", "annealed", "edge-region", seed)) for seed in (0, 1)
    ]
    assert {group_of(trial) for trial in trials} == {"a, b"}
    groups = by_group([made(trial, error) for trial, error in zip(trials, (10.0, 20.0), strict=True)])
    chart = curves("title", groups)
    thick = [series for series in chart.series if not series.thin]
    assert len(chart.series) == 3
    assert len(thick) == 1
    assert thick[0].y[0] == pytest.approx(
        (groups["a, b"][0].per_frame_mm[0] + groups["a, b"][1].per_frame_mm[0]) / 2
    )


@pytest.mark.slow
def test_generalisation_keeps_the_halves_apart_and_counts_near_clips() -> None:
    def error(label: str) -> float:
        if "reporting" in label:
            return 50.0
        return 20.0 if label.startswith("swarm on") else 30.0

    findings = concluded("generalisation", error)
    numbers = {entry.name: entry for entry in findings.numbers}
    assert numbers["clips with a mean of at most 24 mm, swarm, choosing"].ours == pytest.approx(100.0)
    assert numbers["clips with a mean of at most 24 mm, swarm, reporting"].ours == pytest.approx(0.0)
    assert numbers["mean error, annealed, default, choosing"].ours == pytest.approx(30.0, abs=0.2)
    assert "Half to choose by: swarm is the nearest" in findings.words
    short, long = findings.tables[:2]
    assert short.columns[1:] == tuple(entry.name for entry in ENTRIES)
    (walk, *_) = short.rows
    assert str(walk[1]).startswith("30.0 / ")
    # A kind that no behaviour model fits, and one that it does.
    behaviour = short.columns.index("behaviour")
    cells = {str(row[0]).split(" (")[0]: row[behaviour] for row in short.rows}
    assert cells["leap"] == "–"
    assert cells["walk"] != "–"
    assert len(long.rows) == sum(cell != "–" for row in short.rows for cell in row[1:])


@pytest.mark.slow
def test_generalisation_counts_frames_with_a_limb_lost() -> None:
    experiment = EXPERIMENTS["generalisation"]
    outcomes = [
        made(trial, 40.0, lost=(3, 4, 5) if trial.label.startswith("condensation on choosing-leap") else ())
        for trial in experiment.trials(SCALE)
    ]
    numbers = {entry.name: entry.ours for entry in experiment.conclude(outcomes).numbers}
    clips = len(KINDS)
    assert numbers["frames with a limb lost, condensation, choosing"] == pytest.approx(
        100.0 * 3 / 450 / clips
    )
    assert numbers["frames with a limb lost, condensation, reporting"] == pytest.approx(0.0)
    assert numbers["named of frames with a limb lost, condensation, choosing"] == pytest.approx(200.0 / 3)
    assert np.isnan(numbers["named of frames with a limb lost, condensation, reporting"])
    frames = sum(450 if kind != "walk-20hz" else 150 for kind in KINDS)
    assert numbers["named of other frames, condensation, choosing"] == pytest.approx(100.0 / (frames - 3))
    assert numbers["named of other frames, swarm, choosing"] == 0.0


@pytest.mark.slow
def test_other_people_are_kept_apart_from_both_halves_and_lost_limbs_are_counted() -> None:
    experiment = EXPERIMENTS["other-people"]
    is_wood = "human34 on data:drawn-elsewhere/wood"
    outcomes = [
        made(
            trial,
            20.0 if "drawn-elsewhere" in trial.label else 50.0,
            lost=(3, 4, 5) if trial.label.startswith(is_wood) else (),
        )
        for trial in experiment.trials(SCALE)
    ]
    findings = experiment.conclude(outcomes)
    numbers = {entry.name: entry.ours for entry in findings.numbers}
    assert numbers["mean error, human34, clips of others"] == pytest.approx(20.0, abs=0.2)
    assert numbers["mean error, human34, choosing half"] == pytest.approx(50.0, abs=0.2)
    assert numbers["named of frames with a limb lost, human34, clips of others"] == pytest.approx(200.0 / 3)
    # What cannot become the default says nothing on the half that only reports.
    assert "mean error, human35, reporting half" in numbers
    assert "mean error, human34, reporting half" not in numbers
    others = next(table for table in findings.tables if table.title.startswith("clips of others"))
    row = next(row for row in others.rows if row[0] == "human34")
    # Three seeds of three frames each; the tracker notices a frame late.
    assert str(row[1]).endswith("/ 9 / 6")


def test_trials_on_real_data_need_no_recipe() -> None:
    experiment = EXPERIMENTS["other-people"]
    needed = {trial.label: footage_of(experiment, trial) for trial in experiment.trials(Scale((0,)))}
    assert needed["human34 on data:drawn-elsewhere/tiles, seed 0"] == ()
    assert needed["human34 on choosing-kick, seed 0"] == ("choosing-kick",)


def test_generalisation_is_measured_with_a_model_where_one_is_needed() -> None:
    guided = [trial for trial in EXPERIMENTS["generalisation"].trials(SCALE) if "training" in trial.arguments]
    assert {trial.arguments["attempt"]["tracker"] for trial in guided} == {"behaviour"}
    assert all(frames_of(trial.arguments) == trial.arguments["attempt"]["last"] for trial in guided)
    alone = [trial for trial in EXPERIMENTS["generalisation"].trials(SCALE) if "height alone" in trial.label]
    assert {trial.arguments["attempt"]["subject"] for trial in alone} == {"subject_height.toml"}
