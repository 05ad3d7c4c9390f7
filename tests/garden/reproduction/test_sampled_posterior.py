"""The calibration of the tempered cloud: the density of a turned-over picture, ranks, and the chains beside it."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from studio.garden.reproduction.deutscher_reid.arms import silhouette
from studio.garden.reproduction.open_questions import likelihood_scale, tempered_people
from studio.garden.reproduction.open_questions import sampled_posterior as sampled
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Outcome, Scale, Trial
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.tracker import FilterState, Hierarchy, ParticleSet, SearchSpace

SAMPLES = Path(__file__).parents[3] / "sample_sessions"


def test_the_scale_makes_the_likelihood_the_density_of_the_picture() -> None:
    arm, rng = sampled.scene("planar_arm4"), np.random.default_rng(1)
    truth, other = rng.uniform(arm.space.lower, arm.space.upper, (2, 4))
    problem = sampled.turned_over(arm, truth, np.random.default_rng(5))
    turned = np.random.default_rng(5).random((arm.camera.height, arm.camera.width)) < sampled.TURNED
    seen = (silhouette(arm.body, arm.camera, truth) > 0) ^ turned
    logs = []
    for pose in (truth, other):
        differs = (silhouette(arm.body, arm.camera, pose) > 0) ^ seen
        logs.append(np.where(differs, math.log(sampled.TURNED), math.log(1.0 - sampled.TURNED)).sum())
    weights = sampled.scale_of_density(arm) * problem.log_likelihood(np.stack([truth, other]))
    assert weights[0] - weights[1] == pytest.approx(logs[0] - logs[1])
    assert abs(weights[0] - weights[1]) > 5.0


def test_a_picture_is_measured_and_wrong_scales_are_told_from_right_ones() -> None:
    arguments = {
        "body": "planar_arm4",
        "seed": 0,
        "times": 1.0,
        "poses": 1,
        "knobs": {"layers": 12, "particles": 40},
    }
    measured = json.loads(json.dumps(plain(sampled.measure(arguments, None))))  # pyright: ignore[reportArgumentType]
    assert np.shape(measured["ranks"]) == (1, 4)
    rng = np.random.default_rng(2)
    spreads = {sampled.RIGHT: 1.0, "four times too large": 4.0}
    outcomes = [
        Outcome(
            Trial(f"{kind}, planar_arm4, seed {seed}", {}),
            {**measured, "ranks": _ranks(rng, times, 30).tolist(), "taken": [0.3] * 30},
        )
        for kind, times in spreads.items()
        for seed in range(8)
    ]
    numbers = {part.name: part for part in sampled.shown(outcomes) if hasattr(part, "verdict")}
    right = numbers[f"{sampled.RIGHT}: parameters with uniform ranks"]
    wrong = numbers["four times too large: parameters with uniform ranks"]
    assert (right.ours, wrong.ours) == (1.0, 0.0)


def _ranks(rng: np.random.Generator, times: float, count: int) -> np.ndarray:
    """Ranks (count, 4) of normal truths in normal clouds whose variance is 1 / times of what it should be."""
    truth = rng.normal(size=(count, 4, 1))
    return (rng.normal(size=(count, 4, 200)) / math.sqrt(times) < truth).mean(axis=2)


class _Bowl:
    """log w = -Σ (x - 0.3)² / 2 / 0.2²."""

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return -0.5 * np.sum(((poses - 0.3) / 0.2) ** 2, axis=1)

    fitness = log_likelihood

    def feasible(self, poses: np.ndarray, *, limbs_apart: bool = False) -> np.ndarray:
        return np.ones(len(poses), dtype=bool)


def test_the_chains_find_a_normal_posterior() -> None:
    size, whole = 3, np.arange(3)
    space = SearchSpace(
        ("a", "b", "c"),
        np.full(size, -np.inf),
        np.full(size, np.inf),
        np.full(size, 0.5),
        whole,
        Hierarchy(whole, whole == 0, whole, np.full(size, -1)),
    )
    before = FilterState(ParticleSet(np.zeros((1, size)), np.zeros(1)))
    prior = FramePrior.of_frame(before, space, scale=1.0, dynamics="none", bounded=True)
    poses = sampled.chains_of(_Bowl(), prior, 1.0, 3, 1200)
    variance = 1.0 / (1.0 / 0.25 + 1.0 / 0.04)
    assert np.allclose(poses.mean(axis=0), 0.3 * variance / 0.04, atol=0.02)
    assert np.allclose(poses.var(axis=0), variance, rtol=0.12)


@pytest.mark.slow
def test_a_person_is_measured_beside_the_chains() -> None:
    trial = sampled.people_trials(Scale((0,), quick=True))[0]
    cache = FootageCache(SAMPLES)
    arguments = {**trial.arguments, "frame": 2, "sizes": [400], "generations": 60}
    measured = json.loads(json.dumps(plain(sampled.measure_people(arguments, cache))))
    cache.close()
    cloud = measured["clouds"]["400"]
    assert 0.0 < cloud["off"] < 3.0
    assert 0.05 < cloud["spread"] < 3.0
    assert len(list(sampled.people_shown([Outcome(trial, measured)]))) >= 5


def test_the_experiments_on_people_pair_their_lines() -> None:
    scale = Scale((0, 1), quick=True)
    errors, bodies = (experiment.trials(scale) for experiment in tempered_people.EXPERIMENTS)
    assert len(errors) == 8
    larger = [trial.arguments.get("larger", 0.0) for trial in bodies]
    assert larger == [0.0, 0.0, 0.1, 0.1] * 2
    known = {"frames": [0], "per_frame_mm": [1.0], "lost": [[]], "mean_mm": 10.0, "worst_mm": 10.0}
    known |= {"lost_frames": 0, "lost_limbs": [], "evaluations": 5, "seconds": 1.0}
    outcomes = [
        Outcome(
            trial,
            {**known, "log_evidence": -9.0 if "larger" in trial.arguments else -5.0}
            | {
                "mean_mm": 8.0
                if "larger" in trial.arguments and "walk" in trial.label
                else 10.0 + trial.arguments.get("larger", 0.0)
            },
        )
        for trial in bodies
    ]
    share, agrees = [
        part for part in tempered_people.EXPERIMENTS[1].shown(outcomes) if hasattr(part, "verdict")
    ]
    assert (share.ours, agrees.ours) == (100.0, 50.0)
    tempered = [
        Outcome(trial, {**known, "mean_mm": 12.0 if trial.arguments["tracker"] == "tempered" else 10.0})
        for trial in errors
    ]
    (ratio, *_) = [
        part for part in tempered_people.EXPERIMENTS[0].shown(tempered) if hasattr(part, "verdict")
    ]
    assert ratio.ours == pytest.approx(1.2)
    assert ratio.verdict == "not reproduced"


def test_a_cloud_that_the_truth_is_drawn_like_covers_it_as_often_as_it_says() -> None:
    rng, root = np.random.default_rng(4), np.array([[3.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.5, -1.0, 1.0]])

    def shares(times: float) -> list[list[float]]:
        found = []
        for _ in range(300):
            cloud = rng.normal(size=(400, 2, 3)) @ root.T
            truth = times * rng.normal(size=(2, 3)) @ root.T
            found.append(likelihood_scale.share_nearer(cloud, np.full(400, 1 / 400), truth).tolist())
        return found

    promised = np.array(likelihood_scale.PROMISED)
    assert np.allclose(likelihood_scale.covered([{"shares": shares(1.0)}]), promised, atol=0.05)
    assert np.all(likelihood_scale.covered([{"shares": shares(3.0)}]) < promised - 0.3)


@pytest.mark.slow
def test_a_scale_is_measured_on_a_person() -> None:
    cache = FootageCache(SAMPLES)
    trials = likelihood_scale.trials(Scale((0,), quick=True))
    one = {**trials[0].arguments, "footage": "walk", "last": 7}
    one["changes"] = {**one["changes"], "layers": 4, "particles": 30}
    measured = json.loads(json.dumps(plain(likelihood_scale.measure(one, cache))))
    cache.close()
    assert np.shape(measured["shares"])[0] == 2
    parts = list(likelihood_scale.shown([Outcome(trial, measured) for trial in trials]))
    assert len(parts) == 7
