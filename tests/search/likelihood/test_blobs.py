"""The blob weighting on a body whose masks and colours are known."""

import dataclasses

import numpy as np
import pytest
from divergences import kept_divergence

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.errors import BodyError, FootageError
from studio.garden.benchmarks.kernels import made_evidence, ring_of_cameras
from studio.search.likelihood.blob_settings import BlobSettings
from studio.search.likelihood.blobs import NOTHING_SEEN, BlobLikelihood, ExpectedBlobs, blob_mixture
from studio.search.likelihood.problem import TRUNK_FIRST, FittedToPoses, QualityMeasured

Array = np.ndarray
SETTINGS = BlobSettings(hull_depth=6)


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("human25")


@pytest.fixture(scope="module")
def evidence(body: BodyModel) -> FrameEvidence:
    """The neutral pose in four pictures."""
    return made_evidence(body, ring_of_cameras(body), np.random.default_rng(0))["proximity"]


@pytest.fixture(scope="module")
def likelihood(body: BodyModel) -> BlobLikelihood:
    return BlobLikelihood(body, ring_of_cameras(body), SETTINGS)


def scattered(body: BodyModel, count: int, seed: int = 1, frames: float = 3.0) -> Array:
    step = np.array([entry.max_step for entry in body.parameters]) / 30.0
    return body.neutral + frames * step * np.random.default_rng(seed).uniform(-1, 1, (count, len(step)))


def blank(evidence: FrameEvidence) -> FrameEvidence:
    """The same views without a person."""
    views = [dataclasses.replace(view, mask=np.zeros_like(view.mask)) for view in evidence.views]
    return dataclasses.replace(evidence, views=tuple(views))


def test_the_weight_is_one_over_the_divergence_of_the_mixtures(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    informed = likelihood.problem(evidence).expecting(body.neutral[None], {})
    poses = scattered(body, 12)
    image = blob_mixture(informed)
    assert image is not None
    mixtures = informed.model.mixture(body, poses)
    wanted = np.array([kept_divergence(mixtures.at(n), image) for n in range(12)])
    np.testing.assert_allclose(np.exp(-informed.log_likelihood(poses)), wanted, rtol=1e-9)
    np.testing.assert_array_equal(informed.fitness(poses), informed.log_likelihood(poses))
    sharper = BlobLikelihood(body, likelihood.cameras, dataclasses.replace(SETTINGS, blob_sharpness=3.0))
    again = sharper.problem(evidence).expecting(body.neutral[None], {})
    np.testing.assert_allclose(again.log_likelihood(poses), 3.0 * informed.log_likelihood(poses))


def test_the_true_pose_weighs_most_though_another_was_expected(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    problem = likelihood.problem(evidence)
    for seed in range(3):
        informed = problem.expecting(scattered(body, 1, seed, frames=1.0), {})
        poses = np.concatenate([body.neutral[None], scattered(body, 300, seed + 10)])
        weights = informed.log_likelihood(poses)
        assert weights[0] > np.quantile(weights, 0.99)


def test_without_expectations_the_mean_of_the_weighed_poses_is_expected(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    problem = likelihood.problem(evidence)
    assert isinstance(problem, FittedToPoses)
    assert not isinstance(problem, QualityMeasured)
    poses = scattered(body, 9)
    informed = problem.expecting(poses.mean(axis=0)[None], {})
    assert isinstance(informed, QualityMeasured)
    np.testing.assert_array_equal(problem.log_likelihood(poses), informed.log_likelihood(poses))
    assert problem.log_likelihood(np.zeros((0, 25))).shape == (0,)
    assert blob_mixture(problem) is None


def test_the_first_stage_uses_the_trunk_alone(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    informed = likelihood.problem(evidence).expecting(body.neutral[None], {})
    knee = [entry.name for entry in body.parameters].index("left_knee")
    bent = body.neutral.copy()
    bent[knee] += 1.2
    pair = np.stack([body.neutral, bent])
    trunk, whole = informed.log_likelihood(pair, TRUNK_FIRST), informed.log_likelihood(pair)
    assert trunk[0] == trunk[1]
    assert whole[0] > whole[1]


def test_blobs_are_learnt_for_so_many_frames_then_kept(body: BodyModel, evidence: FrameEvidence) -> None:
    likelihood = BlobLikelihood(body, ring_of_cameras(body), dataclasses.replace(SETTINGS, blob_learning=3))
    memory: dict[str, Array] = {}
    frames = []
    for _ in range(5):
        informed = likelihood.problem(evidence).expecting(body.neutral[None], memory)
        memory = dict(informed.remembered(body.neutral))
        frames.append(sorted(memory))
    assert frames == [["blob_frames", "blob_profiles"]] * 2 + [["blobs"]] * 3
    informed = likelihood.problem(evidence).expecting(body.neutral[None], memory)
    assert informed.remembered(body.neutral) is informed.memory
    assert np.isfinite(informed.model.colour).all()
    cones = likelihood.problem(evidence).expecting(body.neutral[None], {})
    assert np.isnan(cones.model.colour).all()
    assert informed.quality > cones.quality
    # The hull is fatter than the body, and the learnt blobs are too.
    assert informed.divergences(body.neutral[None])[0] < 0.5 * cones.divergences(body.neutral[None])[0]


def test_kept_blobs_are_those_of_all_frames_that_were_learnt_from(
    body: BodyModel, evidence: FrameEvidence
) -> None:
    poses, made = scattered(body, 3, frames=0.5), []
    for frames in (3, 4):
        settings = dataclasses.replace(SETTINGS, blob_learning=frames)
        likelihood = BlobLikelihood(body, ring_of_cameras(body), settings)
        memory: dict[str, Array] = {}
        for pose in poses:
            memory = dict(likelihood.problem(evidence).expecting(pose[None], memory).remembered(pose))
        made.append((memory, likelihood.model(memory)))
    assert set(made[0][0]) == {"blobs"}
    assert made[1][0]["blob_frames"].tolist() == [3.0]
    for field in dataclasses.fields(made[0][1]):
        one, other = (getattr(model, field.name) for _, model in made)
        np.testing.assert_array_equal(one, other)


def test_without_frames_to_learn_from_the_cones_are_kept(body: BodyModel, evidence: FrameEvidence) -> None:
    likelihood = BlobLikelihood(body, ring_of_cameras(body), dataclasses.replace(SETTINGS, blob_learning=0))
    informed = likelihood.problem(evidence).expecting(body.neutral[None], {})
    assert dict(informed.remembered(body.neutral)) == {}
    assert informed.model is likelihood.cones


def test_a_fit_is_lost_below_the_setting(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    memory = likelihood.problem(evidence).expecting(body.neutral[None], {}).remembered(body.neutral)
    black = [dataclasses.replace(view, mask=np.full_like(view.mask, 255)) for view in evidence.views]
    full = dataclasses.replace(evidence, views=tuple(black))
    quality = likelihood.problem(full).expecting(body.neutral[None], memory).quality
    assert quality < 0.0
    for share, lost in ((0.99, True), (1.01, False)):
        settings = dataclasses.replace(SETTINGS, blob_lost=-share * quality)
        other = BlobLikelihood(body, likelihood.cameras, settings).problem(full)
        assert other.expecting(body.neutral[None], memory).lost_evidence == lost
        # Before anything is learnt only an empty hull is lost.
        assert not other.expecting(body.neutral[None], {}).lost_evidence


def test_learnt_blobs_are_the_same_in_another_process(body: BodyModel, evidence: FrameEvidence) -> None:
    poses, memories = scattered(body, 5), []
    for _ in range(2):
        memory: dict[str, Array] = {}
        for frame in range(3):
            # A separate likelihood for every frame: only the memory is passed on.
            likelihood = BlobLikelihood(body, ring_of_cameras(body), SETTINGS)
            informed = likelihood.problem(evidence).expecting(poses[frame][None], memory)
            memory = {name: values.copy() for name, values in informed.remembered(poses[frame]).items()}
        memories.append((memory, informed.log_likelihood(poses)))
    for name, values in memories[0][0].items():
        np.testing.assert_array_equal(values, memories[1][0][name])
    np.testing.assert_array_equal(memories[0][1], memories[1][1])


def test_an_empty_scene_is_lost_and_adds_nothing(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    problem = likelihood.problem(blank(evidence))
    informed = problem.expecting(body.neutral[None], {})
    assert informed.lost_evidence
    assert informed.quality == -np.inf
    assert dict(informed.remembered(body.neutral)) == {}
    weights = informed.log_likelihood(scattered(body, 4))
    np.testing.assert_allclose(weights, -np.log(NOTHING_SEEN))
    np.testing.assert_allclose(problem.log_likelihood(scattered(body, 4)), -np.log(NOTHING_SEEN))
    assert blob_mixture(informed) is None
    seen = likelihood.problem(evidence).expecting(body.neutral[None], {})
    assert not seen.lost_evidence
    assert weights[0] < seen.log_likelihood(scattered(body, 50)).min()


def test_a_picture_full_of_foreground_is_lost(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    memory = likelihood.problem(evidence).expecting(body.neutral[None], {}).remembered(body.neutral)
    black = [
        dataclasses.replace(view, mask=np.full_like(view.mask, 255), picture=np.zeros_like(view.picture))
        for view in evidence.views
    ]
    informed = likelihood.problem(dataclasses.replace(evidence, views=tuple(black))).expecting(
        body.neutral[None], memory
    )
    assert informed.lost_evidence
    assert np.isfinite(informed.log_likelihood(scattered(body, 4))).all()
    assert informed.remembered(body.neutral) is memory


def test_only_so_many_expectations_are_fitted(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    informed = likelihood.problem(evidence).expecting(scattered(body, 7), {})
    assert isinstance(informed, ExpectedBlobs)
    assert len(informed.starts) == SETTINGS.blob_starts
    assert SETTINGS.blob_starts <= len(informed.fitted.log_likelihoods) <= 2 * SETTINGS.blob_starts


@pytest.mark.parametrize("name", ["dog", "human34"])
def test_every_body_can_be_weighed(name: str) -> None:
    body = load_body(name)
    cameras = ring_of_cameras(body)
    evidence = made_evidence(body, cameras, np.random.default_rng(0))["proximity"]
    informed = BlobLikelihood(body, cameras, SETTINGS).problem(evidence).expecting(body.neutral[None], {})
    assert informed.fitted is not None
    poses = np.concatenate([body.neutral[None], scattered(body, 200)])
    weights = informed.log_likelihood(poses)
    assert weights[0] > np.quantile(weights, 0.98)
    assert len(informed.model.limb) == len(kinematic_tables(body).limb_joint)
    assert limb_frames(body, poses[:1]).shape[1] == len(informed.model.limb)


def test_what_does_not_fit_is_refused(
    body: BodyModel, evidence: FrameEvidence, likelihood: BlobLikelihood
) -> None:
    wrong = body.neutral.copy()
    wrong[3] = np.nan
    problem = likelihood.problem(evidence)
    with pytest.raises(BodyError, match="not finite"):
        problem.log_likelihood(wrong[None])
    with pytest.raises(BodyError, match="do not fit"):
        problem.expecting(np.zeros((1, 31)), {})
    with pytest.raises(FootageError):
        likelihood.problem(dataclasses.replace(evidence, views=evidence.views[:2]))
