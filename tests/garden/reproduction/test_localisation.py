"""Figures 12 to 14 and 17: the counting by hand, the finding on the arms of Figs. 11 and 15."""

import json

import numpy as np
import pytest

from studio.garden.reproduction.deutscher_reid import localisation
from studio.garden.reproduction.deutscher_reid.localisation import (
    SETTINGS,
    crossing_layers,
    measure,
    reduction,
    reductions,
)
from studio.garden.reproduction.deutscher_reid.setting import ARM_CONSTANT
from studio.garden.reproduction.experiment import Experiment
from studio.results.comparison.findings import Findings
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Outcome, Scale

SEEDS = Scale(tuple(range(6)))
FIGURES = {one.name: one for one in localisation.EXPERIMENTS if one.name != "deutscher-fig-16"}
FIGS_12_TO_14 = ("deutscher-fig-12", "deutscher-fig-13", "deutscher-fig-14")


def falling(shares: list[list[float]], noisy: float = 1.0) -> dict:
    """A measured search: shares (M, D), and the factor on each variance by noise in the first layer."""
    drawn = shares[1] if len(shares) > 1 else shares[0]
    return {
        "shares": shares,
        "drawn": drawn,
        "noisy": [min(1.0, noisy * value) for value in drawn],
        "errors": [0.5] * len(shares[0]),
    }


RISING = [
    [1, 1, 1, 1],
    [0.05, 0.9, 1, 1],
    [0.05, 0.05, 1, 1],
    [0.01, 0.01, 0.01, 0.8],
    [0.01, 0.01, 0.01, 0.01],
]
EVEN = [[1, 1, 1, 1], [0.9, 0.95, 1, 1], [0.05, 0.05, 0.5, 0.5], [0.01, 0.01, 0.01, 0.01]]


def test_crossings_are_counted_from_the_first_cloud() -> None:
    shares = np.array([[[1.0, 1.0, 1.0], [0.09, 0.5, 0.5], [0.2, 0.1, 0.5], [0.01, 0.05, 0.11]]])
    assert crossing_layers(shares).tolist() == [[1, 3, 4]]


def test_seeds_are_counted_as_in_the_claim() -> None:
    rising = falling([[1, 1, 1], [0.05, 1, 1], [0.05, 0.05, 1], [0.01, 0.01, 0.01]])
    even = falling([[1, 1, 1], [1, 1, 1], [0.05, 0.05, 0.5], [0.01, 0.01, 0.01]])
    unfinished = falling([[1, 1, 1], [0.05, 1, 1], [0.05, 0.05, 1], [0.01, 0.01, 0.5]])
    backwards = falling([[1, 1, 1], [1, 1, 0.05], [1, 0.05, 0.05], [0.05, 0.01, 0.01]])
    found = reduction([rising, even, unfinished, backwards])
    assert found.crossings.tolist() == [[1, 2, 3], [2, 2, 3], [1, 2, 4], [3, 2, 1]]
    assert found.strictly_rising.tolist() == [True, False, False, False]
    assert found.even.tolist() == [False, True, False, False]


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    """Every trial of these figures, once each."""
    cache = FootageCache(tmp_path_factory.mktemp("empty"))
    found: dict[str, Outcome] = {}
    for experiment in FIGURES.values():
        for trial in experiment.trials(SEEDS):
            key = f"{experiment.measure.__name__} {json.dumps(trial.arguments, sort_keys=True)}"
            if key not in found:
                found[key] = Outcome(
                    trial, json.loads(json.dumps(experiment.measure(trial.arguments, cache)))
                )
    return found


def concluded(experiment: Experiment, measured: dict[str, Outcome]) -> Findings:
    """The findings of a figure from the measurements."""
    keys = [
        f"{experiment.measure.__name__} {json.dumps(trial.arguments, sort_keys=True)}"
        for trial in experiment.trials(SEEDS)
    ]
    return experiment.conclude([measured[key] for key in keys])


def test_joints_are_localised_from_the_root_outwards(measured: dict[str, Outcome]) -> None:
    found = concluded(FIGURES["deutscher-fig-13"], measured)
    shares = {entry.name: entry.ours for entry in found.numbers}
    # Of thirty seeds strictly in 24 with our kernel, in 23 with Eq. 18 as printed; of these six in three and in five.
    assert shares["joints fall strictly one after the other, shrunk (ours)"] >= 1 / 2
    assert shares["joints fall strictly one after the other"] >= 1 / 2
    layers = [entry.ours for entry in found.numbers if entry.name.startswith("layer in which")]
    assert np.all(np.diff(layers) > 0.3)
    assert layers[-1] <= SETTINGS["layers"] + 0.5
    assert len(found.charts[0].series) == 4 * (1 + len(SEEDS.seeds))


def test_noise_undoes_the_gain_only_without_adaptive_diffusion(measured: dict[str, Outcome]) -> None:
    found = concluded(FIGURES["deutscher-fig-12"], measured)
    numbers = {entry.name: entry.ours for entry in found.numbers}
    assert numbers["variance of x1 after drawing"] < 0.5 * numbers["variance of x2 after drawing"]
    assert numbers["variance of x1 after planned noise"] > 1.5 * numbers["variance of x1 after drawing"]
    grown = numbers["x1's variance after adaptive noise over that before"]
    assert grown == pytest.approx(1.0 + ARM_CONSTANT, abs=0.03)


def test_the_plain_filter_is_even_or_the_text_gives_the_reason(measured: dict[str, Outcome]) -> None:
    found = concluded(FIGURES["deutscher-fig-14"], measured)
    numbers = {entry.name: entry.ours for entry in found.numbers}
    assert (
        numbers["layers between the first and the last joint, planned noise"]
        < numbers["layers between the first and the last joint, adaptive noise"]
    )
    assert numbers["mean error with adaptive noise"] < 0.5 * numbers["mean error with planned noise"]
    if found.verdict == "not reproduced":
        assert "The reason:" in found.words
        # The reason given, measured: noise delays the first joint more than the last one, and noise that hides
        # selection loses the arm.
        groups = reductions([measured[key] for key in measured if "planar_arm4" in key])
        planned, adaptive = groups[localisation.WITHOUT], groups[localisation.WITH]
        delay = (planned.crossings - adaptive.crossings).mean(axis=0)
        assert delay[0] > delay[-1] + 0.5
        assert groups[localisation.WITH_LOUD].errors.mean() > 0.5


def test_both_branched_arms_are_localised_from_the_hinge(measured: dict[str, Outcome]) -> None:
    found = concluded(FIGURES["deutscher-fig-17"], measured)
    assert found.numbers[0].ours >= 5 / 6
    ends = concluded(FIGURES["deutscher-fig-18"], measured)
    assert ends.numbers[0].ours >= 5 / 6
    clouds = [chart for chart in ends.charts if chart.kind == "points"]
    assert [chart.title.split(",")[1].strip() for chart in clouds] == [
        "layer 1 of 8",
        "layer 3 of 8",
        "layer 5 of 8",
        "layer 7 of 8",
        "layer 8 of 8",
    ]
    spread = [np.ptp(clouds[index].series[0].x) for index in (0, -1)]
    assert spread[1] < 0.1 * spread[0]


@pytest.mark.parametrize(("outer", "verdict"), [(1.0, "not reproduced"), (1.2, "reproduced")])
def test_ends_that_draw_together_evenly_are_not_localised_in_order(outer: float, verdict: str) -> None:
    """Each end begins with a wider scatter than the one before. outer : how much slower an end's scatter falls."""
    experiment = FIGURES["deutscher-fig-18"]
    first = np.array([140.0, 290.0, 460.0] * 2)
    falls = np.array([1.0, outer, outer**2] * 2)
    spreads = [(first * np.minimum(1.0, falls * 0.6**layer)).tolist() for layer in range(8)]
    outcome = {"spreads": spreads, "clouds": [], "truth": []}
    found = experiment.conclude([Outcome(trial, outcome) for trial in experiment.trials(SEEDS)])
    assert found.verdict == verdict
    gathered = next(entry for entry in found.numbers if "less than 50 mm" in entry.name)
    assert (gathered.ours, gathered.verdict) == (1.0, "answered")


def made(name: str, shares: list[list[float]], noisy: float = 1.0) -> Findings:
    """The findings of a figure with searches of these shares."""
    experiment = FIGURES[name]
    return experiment.conclude([Outcome(trial, falling(shares, noisy)) for trial in experiment.trials(SEEDS)])


def test_verdicts_follow_the_measurements() -> None:
    assert made("deutscher-fig-13", RISING).verdict == "reproduced"
    assert made("deutscher-fig-13", EVEN).verdict == "not reproduced"
    assert made("deutscher-fig-14", EVEN).verdict == "reproduced"
    assert "The reason:" not in made("deutscher-fig-14", EVEN).words
    assert made("deutscher-fig-14", RISING).verdict == "not reproduced"
    assert "The reason:" in made("deutscher-fig-14", RISING).words
    # Noise that changes nothing undoes nothing: Fig. 12c is not seen.
    assert made("deutscher-fig-12", RISING, noisy=1.0).verdict == "not reproduced"
    six = [[*row[:3], *row[:3]] for row in RISING]
    assert made("deutscher-fig-17", six).verdict == "reproduced"
    assert made("deutscher-fig-17", [[*row[:3], *row[2::-1]] for row in RISING]).verdict == "not reproduced"


def test_trials_of_figures_12_to_14_are_shared() -> None:
    searches = [
        json.dumps(trial.arguments, sort_keys=True)
        for figure in FIGS_12_TO_14
        for trial in FIGURES[figure].trials(SEEDS)
    ]
    assert len(set(searches)) == (4 + 2 * len(localisation.MILDER)) * len(SEEDS.seeds)
    assert {FIGURES[figure].measure for figure in FIGS_12_TO_14} == {measure}


def test_slopes_tell_even_falls_from_uneven_ones() -> None:
    layers = np.arange(6)[None, :, None]
    even, uneven = 10.0 ** (-0.5 * layers * np.ones(4)), 10.0 ** (-layers * np.array([0.8, 0.4, 0.2, 0.1]))
    assert localisation.slopes(even) == pytest.approx(np.full((1, 4), -0.5))
    assert localisation.slopes(uneven)[0] == pytest.approx([-0.8, -0.4, -0.2, -0.1])
