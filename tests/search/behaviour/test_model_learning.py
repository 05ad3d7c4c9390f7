"""Learning a whole model, other frame rates, another memory."""

import dataclasses

import numpy as np
import pytest
from toy_behaviour import FPS, SETTINGS, recordings, toy_model, waves

from studio.body.catalogue import load_body
from studio.foundations.errors import BehaviourError
from studio.foundations.knobs import changed
from studio.search.behaviour.automaton_learning import ContextTest, learn_automaton
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_learning import cluster_floor, learn_model


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
    np.testing.assert_allclose(double.prototypes.derivatives, model.prototypes.derivatives / 2.0)
    np.testing.assert_array_equal(double.prototypes.poses, model.prototypes.poses)
    # The same motion has the same place in the reduced space.
    factor = np.repeat([1.0, 0.5], 4)
    features = model.dynamics.means
    np.testing.assert_allclose(
        double.reduction.reduced(features * factor), model.reduction.reduced(features), atol=1e-12
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


def test_what_never_moves_has_a_least_variance() -> None:
    still = [poses * [1.0, 1.0, 0.0, 1.0] + [0.0, 0.0, 0.3, 0.0] for poses in recordings()]
    model = learn_model(still, load_body("planar_arm4"), FPS, SETTINGS, np.random.default_rng(0))
    features = np.concatenate([model.space.features(poses) for poses in still])
    # A millionth of the mean variance of all angles, and of that of their derivatives.
    least = 1e-6 * features.var(axis=0).reshape(2, 4).mean(axis=1)
    for place, wanted in zip((2, 6), least, strict=True):
        np.testing.assert_allclose(model.dynamics.covariances[:, place, place], wanted, rtol=1e-6)
    none = [np.repeat(poses[:1], 50, axis=0) for poses in still[:1]]
    frozen = learn_model(none, load_body("planar_arm4"), FPS, SETTINGS, np.random.default_rng(0))
    np.testing.assert_allclose(frozen.dynamics.covariances[0], 1e-12 * np.eye(8), atol=1e-20)


def test_the_floor_of_clusters_is_a_share_of_all_variances() -> None:
    variances = np.array([4.0, 0.5])
    np.testing.assert_allclose(
        cluster_floor(changed(SETTINGS, {"cluster_floor": 0.01}), variances), [0.04, 0.005]
    )
    assert cluster_floor(changed(SETTINGS, {"cluster_floor": 0.0}), variances) == ()
    wide = toy_model(cluster_floor=0.4, covariance="diagonal")
    points = np.concatenate([wide.reduction.reduced(wide.space.features(poses)) for poses in recordings()])
    least = np.diagonal(wide.mixture.covariances, axis1=1, axis2=2)
    assert (least >= 0.4 * points.var(axis=0)).all()


def test_clusters_as_poses_alone_are_the_margins(model: BehaviourModel) -> None:
    alone = model.poses_only
    np.testing.assert_array_equal(alone.weights, model.dynamics.weights)
    np.testing.assert_array_equal(alone.means, model.dynamics.means[:, :4])
    np.testing.assert_array_equal(alone.covariances, model.dynamics.covariances[:, :4, :4])


def test_the_automatons_settings_are_the_learnings(model: BehaviourModel) -> None:
    other = changed(
        SETTINGS,
        {"memory": 2, "epsilon": 0.7, "least_probability": 0.01, "smoothing": 0.02, "back_off": 0.3},
    )
    wanted = learn_automaton(model.making.labels, model.clusters, ContextTest(2, 0.7, 0.01))
    found = model.with_automaton(other)
    assert found.automaton.contexts == wanted.contexts
    assert (found.automaton.smoothing, found.automaton.back_off) == (0.02, 0.3)
    assert found.making.entropy_train == found.automaton.entropy(model.making.labels)
    assert np.isnan(found.making.entropy_test)


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
