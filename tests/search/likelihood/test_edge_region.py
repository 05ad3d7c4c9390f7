"""Edge and region weighting against a plain NumPy twin that shares no code with it."""

import numba
import numpy as np
import pytest
from weighting_scene import (
    four_cameras,
    inside_outline,
    looking_at,
    on_grid,
    plain_evidence,
    read,
    scattered,
    smooth_evidence,
    true_corners,
)

from studio.body.catalogue import load_body
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.errors import BodyError, FootageError
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.edge_region import BLOCKS_A_THREAD, EdgeRegionLikelihood, EdgeRegionSettings

STRIPS = np.array([1, 3, 5]) / 6.0
# The maps hold whole numbers of 255ths (1 - p)², each off by half at most; averages are off by less.
QUANTISED = 0.5 / 255
# Positions differ by 0.01 px, so that a few samples in a hundred read the next pixel, whose value differs by 3 %.
ROUNDED = 0.002

NUDGES = 0.02 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])


def twin(body, cameras, evidence, poses, edge_samples=32, region_samples=48, hidden=None):
    """Σe and Σr (N, V): every sample projected and read on its own."""
    along_edge = (np.arange(edge_samples // 2) + 0.5) / (edge_samples // 2)
    along_region = (np.arange(region_samples // 3) + 0.5) / (region_samples // 3)
    edge, region = np.zeros((2, len(poses), len(cameras)))
    for v, (camera, view) in enumerate(zip(cameras, evidence.views, strict=True)):
        corners, depth = true_corners(body, camera, poses)
        for n in range(len(poses)):
            e, r = [], []
            for limb, outline in enumerate(corners[n]):
                seen = bool((depth[n, limb] > 10).all())
                points = on_grid(outline, along_edge, np.array([0.0, 1.0]))
                costs = (1 - read(view.edges, points, 0.0) / 255) ** 2 if seen else np.ones(len(points))
                if hidden is not None:
                    costs = costs[~hidden(points, limb, corners[n], depth[n])]
                e.append(costs)
                points = on_grid(outline, along_region, STRIPS)
                r.append((1 - read(view.mask, points, 0.0) / 255) ** 2 if seen else np.ones(len(points)))
            edge[n, v], region[n, v] = np.concatenate(e).mean(), np.concatenate(r).mean()
    return edge, region


def problem_of(body, cameras, evidence, **settings):
    return EdgeRegionLikelihood(body, cameras, EdgeRegionSettings(**settings)).problem(evidence)


@pytest.mark.parametrize(("edge_samples", "region_samples"), [(32, 48), (96, 48), (32, 144), (128, 192)])
def test_terms_equal_the_twins(human, ring, smooth, edge_samples, region_samples):
    poses = scattered(human, 19)
    problem = problem_of(human, ring, smooth, edge_samples=edge_samples, region_samples=region_samples)
    edge, region = problem.terms(poses)
    expected_edge, expected_region = twin(human, ring, smooth, poses, edge_samples, region_samples)
    np.testing.assert_allclose(edge, expected_edge, atol=QUANTISED + ROUNDED)
    np.testing.assert_allclose(region, expected_region, atol=QUANTISED + ROUNDED)
    np.testing.assert_allclose(problem.log_likelihood(poses), -(edge + region).sum(axis=1), rtol=1e-12)


@pytest.mark.parametrize("name", ["human29", "dog", "planar_arm4"])
def test_other_bodies_equal_the_twin(name):
    body = load_body(name)
    cameras = four_cameras()
    evidence = smooth_evidence(cameras, seed=3)
    poses = scattered(body, 5)
    edge, region = problem_of(body, cameras, evidence).terms(poses)
    expected_edge, expected_region = twin(body, cameras, evidence, poses)
    np.testing.assert_allclose(edge, expected_edge, atol=QUANTISED + ROUNDED)
    np.testing.assert_allclose(region, expected_region, atol=QUANTISED + ROUNDED)


def test_weights_of_the_terms(human, ring, smooth):
    poses = scattered(human, 4)
    edge, region = problem_of(human, ring, smooth).terms(poses)
    weighed = problem_of(human, ring, smooth, edge_weight=0.25, region_weight=3.0).log_likelihood(poses)
    np.testing.assert_allclose(weighed, -(0.25 * edge + 3.0 * region).sum(axis=1), rtol=1e-12)


def test_the_pose_that_made_the_silhouette_weighs_most(human, ring):
    """The sign of Eq. 17: as printed, the worst pose would weigh most."""
    views = []
    corners = [true_corners(human, camera, human.neutral[None])[0][0] for camera in ring]
    for camera, outlines in zip(ring, corners, strict=True):
        pixels = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1)
        mask = np.any([inside_outline(pixels, outline) for outline in outlines], axis=0)
        grown = mask.copy()
        grown[1:] |= mask[:-1]
        grown[:, 1:] |= grown[:, :-1]
        edges = np.where(grown ^ np.roll(mask, (-1, -1), (0, 1)), 255, 0).astype(np.uint8)
        whole = np.where(mask, 255, 0).astype(np.uint8)
        views.append(ViewEvidence(camera.name, np.repeat(whole[:, :, None], 3, axis=2), whole, edges))
    problem = problem_of(human, ring, FrameEvidence(0, tuple(views)))
    others = scattered(human, 60, spread=4.0)
    weights = problem.log_likelihood(np.concatenate([human.neutral[None], others]))
    assert weights[0] > weights[1:].max()


def test_leaving_the_pictures_is_never_rewarded(human, ring):
    """Where the pictures match everywhere, only the visible part of a pose gains weight."""
    problem = problem_of(human, ring, plain_evidence(ring, 255, 255))
    assert problem.log_likelihood(human.neutral[None])[0] == 0.0
    rising = np.repeat(human.neutral[None], 40, axis=0)
    rising[:, 5] += np.linspace(0, 20000, 40)
    weights = problem.log_likelihood(rising)
    edge, region = problem.terms(rising)
    assert (np.diff(edge, axis=0)[:, 0] >= 0).all(), "the further out, the worse, in the first camera"
    assert (np.diff(region, axis=0)[:, 0] >= 0).all()
    assert weights[-1] == -8.0, "seen by none: the worst, once for each term and camera"
    assert ((weights >= -8.0) & (weights <= 0.0)).all()


def test_partly_outside_equals_the_twin(human, ring, smooth):
    poses = scattered(human, 30)
    poses[:, 3:6] += np.random.default_rng(4).uniform(-1500, 1500, (30, 3))
    problem = problem_of(human, ring, smooth)
    seen = problem.likelihood.projector.corners(poses)[1]
    assert (seen == 0).sum() > 100, "many limbs are partly outside"
    edge, region = problem.terms(poses)
    expected_edge, expected_region = twin(human, ring, smooth, poses)
    # A sample at the border may fall on either side of it: one of 320 and of 480 now and then.
    np.testing.assert_allclose(edge, expected_edge, atol=QUANTISED + ROUNDED + 2 / 320)
    np.testing.assert_allclose(region, expected_region, atol=QUANTISED + ROUNDED + 2 / 480)


def test_behind_a_camera_costs_the_most_in_that_view_alone(human, ring):
    target = 2 * ring[1].centre - np.array([0, 0, 900.0])
    away = looking_at(ring[1].name, ring[1].centre, target, (301, 257))
    cameras = (ring[0], away, *ring[2:])
    edge, region = problem_of(human, cameras, plain_evidence(cameras, 255, 255)).terms(human.neutral[None])
    np.testing.assert_array_equal(edge[0], [0, 1, 0, 0])
    np.testing.assert_array_equal(region[0], [0, 1, 0, 0])


def test_any_finite_pose_has_a_finite_weight(human, ring, smooth):
    poses = np.repeat(human.neutral[None], 12, axis=0)
    poses[np.arange(12), np.arange(12)] = 10.0 ** np.arange(0, 300, 25)
    poses[:, 5] *= -(10.0 ** np.arange(12))
    for occlusion_aware in (False, True):
        weights = problem_of(human, ring, smooth, occlusion_aware=occlusion_aware).log_likelihood(poses)
        assert ((weights >= -8.0) & (weights <= 0.0)).all()
    with pytest.raises(BodyError):
        problem_of(human, ring, smooth).log_likelihood(np.full((1, 31), np.nan))


def test_a_weight_depends_neither_on_other_poses_nor_on_threads(human, ring, smooth):
    poses = scattered(human, 2 * 16 * BLOCKS_A_THREAD + 3)
    for occlusion_aware in (False, True):
        problem = problem_of(human, ring, smooth, occlusion_aware=occlusion_aware)
        numba.set_num_threads(1)
        together = problem.log_likelihood(poses)
        np.testing.assert_array_equal(problem.log_likelihood(poses[40:41]), together[40:41])
        np.testing.assert_array_equal(problem.log_likelihood(poses[::-1]), together[::-1])
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        np.testing.assert_array_equal(problem.log_likelihood(poses), together)
    assert problem.log_likelihood(poses[:0]).shape == (0,)


def hidden_by_nearer(points, limb, corners, depth):
    """Whether samples of a limb lie in the outline of a limb whose middle is nearer."""
    middles = depth.mean(axis=1)
    found = np.zeros(len(points), dtype=bool)
    for other in range(len(corners)):
        if other != limb and middles[other] < middles[limb]:
            found |= inside_outline(points, corners[other])
    return found


@pytest.mark.parametrize("edge_samples", [32, 128])
def test_hidden_edges_are_left_out(human, ring, smooth, edge_samples):
    poses = scattered(human, 12)
    problem = problem_of(human, ring, smooth, occlusion_aware=True, edge_samples=edge_samples)
    edge, region = problem.terms(poses)
    expected_edge, expected_region = twin(human, ring, smooth, poses, edge_samples, hidden=hidden_by_nearer)
    blind, _ = problem_of(human, ring, smooth, edge_samples=edge_samples).terms(poses)
    assert np.abs(blind - expected_edge).max() > 0.02, "occlusion matters here"
    # A sample within 0.01 px of a nearer limb's outline may count on one side only: one of 250 or more.
    np.testing.assert_allclose(edge, expected_edge, atol=QUANTISED + ROUNDED + 1 / 250)
    np.testing.assert_allclose(region, expected_region, atol=QUANTISED + ROUNDED)


def test_which_samples_are_hidden(human, ring, smooth):
    """Sample by sample; those within 0.02 px of an outline are left to rounding."""
    poses = scattered(human, 6)
    problem = problem_of(human, ring, smooth, occlusion_aware=True, edge_samples=64)
    bits = problem.hidden(problem.likelihood.projector.blocks(poses))
    assert bits.shape == (1, 4, 10, 2, 16)
    along = (np.arange(32) + 0.5) / 32
    compared = hidden = 0
    for v, camera in enumerate(ring):
        corners, depth = true_corners(human, camera, poses)
        for n in range(len(poses)):
            for limb, outline in enumerate(corners[n]):
                for side in (0, 1):
                    points = on_grid(outline, along, np.array([float(side)]))
                    expected = hidden_by_nearer(points, limb, corners[n], depth[n])
                    nudges = [hidden_by_nearer(points + d, limb, corners[n], depth[n]) for d in NUDGES]
                    sure = np.all(nudges == expected, axis=0)
                    found = (int(bits[0, v, limb, side, n]) >> np.arange(32)) & 1
                    np.testing.assert_array_equal(found[sure], expected[sure])
                    compared += sure.sum()
                    hidden += expected.sum()
    assert compared > 0.98 * 6 * 4 * 10 * 64
    assert hidden > 1000


def test_evidence_of_other_cameras_is_refused(human, ring, smooth):
    likelihood = EdgeRegionLikelihood(human, ring, EdgeRegionSettings())
    with pytest.raises(FootageError, match="has views c0, c1, c2"):
        likelihood.problem(FrameEvidence(0, smooth.views[:3]))
    swapped = (smooth.views[1], smooth.views[0], *smooth.views[2:])
    with pytest.raises(FootageError, match="has views c1, c0"):
        likelihood.problem(FrameEvidence(0, swapped))
    first = smooth.views[0]
    small = ViewEvidence(first.camera, first.picture, first.mask, first.edges[:100])
    with pytest.raises(FootageError, match="edge map of camera 'c0' in frame 0 is 320 × 100"):
        likelihood.problem(FrameEvidence(0, (small, *smooth.views[1:])))


def test_pictures_that_are_too_large_are_refused(human, ring):
    one = ring[0]
    huge = Camera("huge", 5000, 4000, one.matrix, one.distortion, one.rotation, one.translation)
    with pytest.raises(FootageError, match="5000 × 4000"):
        EdgeRegionLikelihood(human, (huge,), EdgeRegionSettings())


def test_feasible_is_within_the_limits(human, ring, smooth):
    problem = problem_of(human, ring, smooth)
    lower = np.array([entry.lower for entry in human.parameters])
    limited = int(np.flatnonzero(np.isfinite(lower))[0])
    poses = np.repeat(human.neutral[None], 3, axis=0)
    poses[1, limited] = lower[limited]
    poses[2, limited] = lower[limited] - 0.001
    np.testing.assert_array_equal(problem.feasible(poses), [True, True, False])


def test_samples_an_evaluation(human, ring):
    assert EdgeRegionLikelihood(human, ring, EdgeRegionSettings()).samples_per_evaluation == 3200
    settings = EdgeRegionSettings(edge_samples=70, region_samples=150)
    assert EdgeRegionLikelihood(human, ring, settings).samples_per_evaluation == 40 * (64 + 144)
