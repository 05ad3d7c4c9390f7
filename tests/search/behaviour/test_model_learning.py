"""Learning a whole model, other frame rates, another memory."""

import dataclasses

import numpy as np
import pytest
from toy_behaviour import FPS, SETTINGS, recordings, toy_model, waves

from studio.body.catalogue import load_body
from studio.foundations.errors import BehaviourError
from studio.foundations.knobs import changed
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_learning import learn_model


@pytest.fixture(scope="module")
def model() -> BehaviourModel:
    return toy_model()


def test_parts_fit_together(model: BehaviourModel) -> None:
    assert 4 <= model.clusters <= 12
    assert model.states > model.clusters
    assert model.making.frames == 1200
    assert model.mixture.means.shape == (model.clusters, 4)
    assert model.dynamics.means.shape == (model.clusters, 8)
    assert model.automaton.symbols == model.clusters
    assert {int(label) for labels in model.making.labels for label in labels} == set(range(model.clusters))
    for poses, labels in zip(recordings(), model.making.labels, strict=True):
        np.testing.assert_array_equal(model.labels(poses), labels)


def test_the_two_waves_do_not_mix(model: BehaviourModel) -> None:
    slow, fast = (set(model.labels(waves(30 + kind, kind=kind)).tolist()) for kind in range(2))
    # They may share a cluster, but not many.
    assert len(slow & fast) <= 2
    assert model.entropy([waves(40, kind=0), waves(41, kind=1)]) < np.log(model.clusters) / 2


def test_entropies(model: BehaviourModel) -> None:
    assert model.making.entropy_train == pytest.approx(model.entropy(recordings()))
    scrambled = waves(3)[np.random.default_rng(0).permutation(200)]
    assert model.entropy([scrambled]) > 3.0 * model.making.entropy_train


def test_clusters_are_those_of_the_frames(model: BehaviourModel) -> None:
    features = np.concatenate([model.space.features(poses) for poses in recordings()])
    shares = model.mixture.responsibilities(model.reduction.reduced(features))
    np.testing.assert_allclose(
        model.dynamics.means, shares.T @ features / shares.sum(axis=0)[:, None], atol=1e-10
    )


def test_prototypes_are_real_frames_of_their_clusters(model: BehaviourModel) -> None:
    found = model.prototypes
    for cluster in range(model.clusters):
        recording, frame = found.recordings[cluster], found.frames[cluster]
        np.testing.assert_array_equal(found.poses[cluster], recordings()[recording][frame])
        assert model.making.labels[recording][frame] == cluster
    np.testing.assert_array_equal(found.derivatives, model.dynamics.means[:, 4:])
    spread = np.linalg.norm(found.poses - model.dynamics.means[:, :4], axis=1)
    assert spread.max() < 0.3


def test_same_seed_same_model_another_seed_another(model: BehaviourModel) -> None:
    again, other = toy_model(), toy_model(seed=5)
    np.testing.assert_array_equal(again.mixture.means, model.mixture.means)
    assert again.automaton.contexts == model.automaton.contexts
    assert other.mixture.means.shape != model.mixture.means.shape or not np.allclose(
        other.mixture.means, model.mixture.means
    )


def test_another_rate_scales_the_derivatives(model: BehaviourModel) -> None:
    double = model.at_rate(2.0 * FPS)
    assert (double.fps, double.steps_per_frame) == (2.0 * FPS, 0.5)
    np.testing.assert_allclose(double.dynamics.means[:, 4:], model.dynamics.means[:, 4:] / 2.0)
    np.testing.assert_allclose(
        double.dynamics.covariances[:, :4, 4:], model.dynamics.covariances[:, :4, 4:] / 2.0
    )
    assert model.at_rate(0.5).steps_per_frame == pytest.approx(FPS / 0.5)
    for none in (0.0, -25.0, np.inf):
        with pytest.raises(BehaviourError, match="no frame rate"):
            model.at_rate(none)
    # A motion seen twice as often has the labels of the motion.
    poses = waves(3, frames=100)
    times = np.arange(199) / 2.0
    often = np.stack([np.interp(times, np.arange(100), column) for column in poses.T], axis=1)
    agreement = np.mean(double.labels(often)[2::2] == model.labels(poses)[1:])
    assert agreement > 0.9
    back = double.at_rate(FPS)
    np.testing.assert_allclose(back.dynamics.covariances, model.dynamics.covariances, rtol=1e-10)
    assert model.at_rate(FPS) is model
    with pytest.raises(BehaviourError, match="-1 frames"):
        model.at_rate(-1.0)


def test_the_automaton_can_be_learnt_again(model: BehaviourModel) -> None:
    longer = model.with_automaton(changed(SETTINGS, {"memory": 8}))
    first = model.with_automaton(changed(SETTINGS, {"memory": 1}))
    assert first.states < model.states < longer.states
    assert longer.making.entropy_train < model.making.entropy_train < first.making.entropy_train
    assert longer.making.settings.memory == 8
    np.testing.assert_array_equal(longer.mixture.means, model.mixture.means)


def test_the_whole_space_and_diagonal_clusters_work_too() -> None:
    whole = toy_model(reduced_dimensions=0)
    assert whole.mixture.means.shape[1] == 8
    diagonal = toy_model(reduced_dimensions=0, covariance="diagonal")
    assert diagonal.clusters >= 4
    # Noise is still that of the frames, with all its correlations.
    assert np.abs(diagonal.dynamics.covariances[:, 0, 1]).max() > 0.0


def test_a_larger_body_and_progress() -> None:
    body = load_body("human25")
    rng = np.random.default_rng(0)
    poses = np.repeat(body.neutral[None], 400, axis=0)
    poses[:, 6:] += np.sin(np.arange(400)[:, None] / 12.0 + np.arange(19)) * 0.4
    poses += 0.002 * rng.standard_normal(poses.shape)
    steps: list[tuple[str, int, int]] = []
    settings = changed(SETTINGS, {"reduced_dimensions": 3})
    model = learn_model([poses], body, 30.0, settings, rng, lambda *step: steps.append(step), ["wave"])
    assert model.dynamics.covariances.shape[1:] == (38, 38)
    assert (np.linalg.eigvalsh(model.dynamics.covariances) > 0.0).all()
    assert model.making.sources == ("wave",)
    assert steps


def test_bad_recordings_are_refused() -> None:
    body, rng = load_body("planar_arm4"), np.random.default_rng(0)
    with pytest.raises(BehaviourError, match="no recording"):
        learn_model([], body, FPS, SETTINGS, rng)
    with pytest.raises(BehaviourError, match="Recording 2: A recording of 1 frame"):
        learn_model([waves(0), waves(1)[:1]], body, FPS, SETTINGS, rng)
    with pytest.raises(BehaviourError, match="too few for one cluster"):
        learn_model([waves(0)[:5]], body, FPS, SETTINGS, rng)
    assert dataclasses.is_dataclass(SETTINGS)
