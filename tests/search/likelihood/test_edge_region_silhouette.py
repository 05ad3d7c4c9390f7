"""Three terms together: each equals that of the other weightings."""

import numba
import numpy as np
import pytest
from pixel_centres import union
from weighting_scene import looking_at, plain_evidence, scattered

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.errors import BodyError, FootageError
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.edge_silhouette import EdgeSilhouetteLikelihood, EdgeSilhouetteSettings
from studio.search.likelihood.problem import TRUNK_FIRST


def problem_of(body, cameras, evidence, **knobs):
    settings = EdgeRegionSilhouetteSettings(**knobs)
    return EdgeRegionSilhouetteLikelihood(body, cameras, settings).problem(evidence)


@pytest.mark.parametrize("aware", [False, True])
@pytest.mark.parametrize("resolution", ["half", "full"])
def test_the_terms_are_those_of_the_other_weightings(human, ring, smooth, resolution, aware):
    poses = scattered(human, 21)
    knobs = {"occlusion_aware": aware, "edge_samples": 64}
    problem = problem_of(human, ring, smooth, silhouette_resolution=resolution, **knobs)
    edge, region = EdgeRegionLikelihood(human, ring, EdgeRegionSettings(**knobs)).problem(smooth).terms(poses)
    other = EdgeSilhouetteLikelihood(human, ring, EdgeSilhouetteSettings(silhouette_resolution=resolution))
    silhouette, _ = other.problem(smooth).terms(poses)
    found = problem.terms(poses)
    np.testing.assert_array_equal(found[0], 1.0 - edge)
    np.testing.assert_array_equal(found[1], 1.0 - region)
    np.testing.assert_array_equal(found[2], silhouette)
    np.testing.assert_allclose(problem.fitness(poses), (2.0 - edge - region + silhouette).mean(axis=1))
    np.testing.assert_allclose(problem.log_likelihood(poses), -(edge + region + 1.0 - silhouette).sum(axis=1))


def test_weights_of_the_terms(human, ring, smooth):
    poses = scattered(human, 6)
    edge, region, silhouette = problem_of(human, ring, smooth).terms(poses)
    weighed = problem_of(human, ring, smooth, edge_weight=0.25, region_weight=2.0, silhouette_weight=3.0)
    expected = (0.25 * edge + 2.0 * region + 3.0 * silhouette).mean(axis=1)
    np.testing.assert_allclose(weighed.fitness(poses), expected)
    np.testing.assert_allclose(weighed.log_likelihood(poses), 4 * (expected - 5.25))
    without = problem_of(human, ring, smooth, silhouette_weight=0.0).log_likelihood(poses)
    np.testing.assert_allclose(
        without, EdgeRegionLikelihood(human, ring, EdgeRegionSettings()).problem(smooth).log_likelihood(poses)
    )


@pytest.mark.parametrize("views", [1, 4, 9, 17])
@pytest.mark.parametrize("count", [1, 7, 16, 17, 40])
def test_the_terms_are_summed_as_numpy_does(human, views, count):
    """Bit for bit: a run's poses depend on the last bit of a weight."""
    rng, middle = (
        np.random.default_rng(views),
        limb_ends(human, human.neutral[None]).reshape(-1, 3).mean(axis=0),
    )
    around = 2.0 * np.pi * np.arange(views) / views
    places = middle + 3000.0 * np.stack([np.cos(around), np.sin(around), np.full(views, 0.2)], axis=1)
    cameras = tuple(looking_at(f"c{k}", place, middle) for k, place in enumerate(places))
    nothing = np.zeros((0, 0, 3), np.uint8)
    maps = rng.integers(0, 256, (views, 2, 240, 320)).astype(np.uint8)
    evidence = FrameEvidence(0, tuple(ViewEvidence(f"c{k}", nothing, *maps[k]) for k in range(views)))
    poses = scattered(human, count)
    weights = {"edge_weight": 1.1, "region_weight": 0.7, "silhouette_weight": 1.3}
    problem = problem_of(human, cameras, evidence, **weights)
    edge, region, silhouette = (term.mean(axis=1) for term in problem.terms(poses))
    np.testing.assert_array_equal(problem.fitness(poses), 1.1 * edge + 0.7 * region + 1.3 * silhouette)
    other = EdgeSilhouetteLikelihood(human, cameras, EdgeSilhouetteSettings()).problem(evidence)
    silhouette, edge = (term.mean(axis=1) for term in other.terms(poses))
    np.testing.assert_array_equal(other.fitness(poses), silhouette + edge)


@pytest.mark.parametrize("aware", [False, True])
def test_the_first_stage_uses_the_trunks_edges_only(human, ring, smooth, aware):
    """A pose that differs in the limbs alone has the trunk's edges of the other, unless a limb comes before it."""
    problem = problem_of(human, ring, smooth, occlusion_aware=aware)
    poses = np.stack([human.neutral, human.neutral])
    names = [entry.name for entry in human.parameters]
    poses[1, [names.index("left_knee_ry"), names.index("left_hip_ry")]] += (-0.8, 0.4)
    whole, first = problem.terms(poses), problem.terms(poses, TRUNK_FIRST)
    assert (whole[0][0] != whole[0][1]).any()
    np.testing.assert_array_equal(first[0][0], first[0][1])
    assert (first[0] != whole[0]).all()
    np.testing.assert_array_equal(first[1], whole[1])
    np.testing.assert_array_equal(first[2], whole[2])


def test_a_body_without_a_trunk_is_the_same_in_both_stages():
    body = load_body("planar_arm4")
    middle = limb_ends(body, body.neutral[None]).reshape(-1, 3).mean(axis=0)
    camera = looking_at("c", middle + np.array([1500.0, 900.0, 500.0]), middle)
    rng = np.random.default_rng(0)
    maps = rng.integers(0, 256, (2, 240, 320)).astype(np.uint8)
    evidence = FrameEvidence(0, (ViewEvidence("c", np.zeros((0, 0, 3), np.uint8), *maps),))
    problem = problem_of(body, (camera,), evidence)
    poses = scattered(body, 9)
    np.testing.assert_array_equal(problem.fitness(poses), problem.fitness(poses, TRUNK_FIRST))


def test_the_pose_that_made_the_silhouettes_fits_best(human, ring):
    corners, _ = EdgeRegionLikelihood(human, ring, EdgeRegionSettings()).projector.corners(
        human.neutral[None]
    )
    views = []
    for camera, outlines in zip(ring, corners[0], strict=True):
        mask = np.where(union(outlines, camera.width, camera.height)[0], 255, 0).astype(np.uint8)
        views.append(ViewEvidence(camera.name, np.zeros((0, 0, 3), np.uint8), mask, mask))
    problem = problem_of(human, ring, FrameEvidence(0, tuple(views)), silhouette_resolution="full")
    fitness = problem.fitness(np.concatenate([human.neutral[None], scattered(human, 60, spread=3.0)]))
    assert fitness[0] > fitness[1:].max()
    assert fitness[0] > 2.5


def test_nothing_is_gained_by_leaving(human, ring):
    problem = problem_of(human, ring, plain_evidence(ring, 255, 255))
    poses = np.repeat(human.neutral[None], 2, axis=0)
    poses[1, 5] += 20000.0
    edge, region, silhouette = problem.terms(poses)
    assert (edge[1] == 0).all()
    assert (region[1] == 0).all()
    assert (silhouette[1] == 0).all()
    np.testing.assert_allclose(problem.log_likelihood(poses)[1], -12.0)


def test_any_finite_pose_is_a_number_on_any_number_of_threads(human, ring, smooth):
    poses = scattered(human, 700, spread=20.0)
    poses[:12, :12] *= 10.0 ** np.arange(0, 300, 25)[:, None]
    for evidence in (smooth, plain_evidence(ring, 0, 0)):
        problem = problem_of(human, ring, evidence)
        numba.set_num_threads(1)
        weights = problem.log_likelihood(poses)
        assert ((weights >= -12.0) & (weights <= 0.0)).all()
        np.testing.assert_array_equal(problem.log_likelihood(poses[40:41]), weights[40:41])
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        np.testing.assert_array_equal(problem.log_likelihood(poses), weights)


def test_wrong_evidence_is_refused(human, ring, smooth):
    with pytest.raises(BodyError):
        problem_of(human, ring, smooth).log_likelihood(np.full((1, 31), np.nan))
    with pytest.raises(FootageError, match="has views c0, c1, c2"):
        problem_of(human, ring, FrameEvidence(0, smooth.views[:3]))
