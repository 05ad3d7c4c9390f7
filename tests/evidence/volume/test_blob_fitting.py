"""K-means from predicted blobs to a hull, against known voxels, a plain twin and a likelihood worked out one by one."""

import numpy as np
import pytest
from posed_hulls import empty_hull, hull_of, learn_blobs, limb_colours, near
from scipy.stats import multivariate_normal

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.evidence.volume.blob_fitting import Fitted, Voxels, fit_blobs, nearest_blobs, self_likelihood
from studio.evidence.volume.blob_kernels import FACTORS, SUMS, assign, count_changes, gather, thicken
from studio.evidence.volume.blob_model import BlobModel, cone_blobs
from studio.evidence.volume.hull import Hull

Array = np.ndarray


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("human25")


@pytest.fixture(scope="module")
def pose(body: BodyModel) -> Array:
    return near(body, body.neutral, 5, frames=6)


@pytest.fixture(scope="module")
def hull(body: BodyModel, pose: Array) -> Hull:
    return hull_of(body, pose)


@pytest.fixture(scope="module")
def learnt(body: BodyModel) -> BlobModel:
    poses = np.stack([near(body, body.neutral, seed, frames=5) for seed in range(20, 24)])
    return learn_blobs(body, [hull_of(body, one, seed=seed) for seed, one in enumerate(poses)], poses)


def apart(fitted: Fitted, model: BlobModel, body: BodyModel, pose: Array) -> Array:
    """(B,) mm between fitted blobs and those of the true pose."""
    return np.linalg.norm(fitted.mixture.means - model.mixture(body, pose).means[0], axis=1)


def test_the_kernel_finds_the_nearest_blob_and_sums_its_voxels() -> None:
    rng = np.random.default_rng(0)
    voxels = rng.normal(size=(6, 1500)).astype(np.float32)
    factors = rng.normal(size=(7, FACTORS)).astype(np.float32)
    labels, distances = np.empty(1500, np.int32), np.empty(1500, np.float32)
    assign(voxels, factors, labels, distances)
    root = np.zeros((7, 3, 3))
    root[:, 0], root[:, 1, 1:], root[:, 2, 2] = factors[:, 3:6], factors[:, 6:8], factors[:, 8]
    space = np.einsum("bij,kbj->kbi", root, voxels[:3].T[:, None] - factors[:, :3])
    colour = (voxels[3:].T[:, None] - factors[:, 9:12]) * factors[:, 12:]
    squared = (space**2).sum(axis=2) + (colour**2).sum(axis=2)
    np.testing.assert_array_equal(labels, squared.argmin(axis=1))
    np.testing.assert_allclose(distances, squared.min(axis=1), rtol=1e-4)
    shares, extents, sums = rng.random(1500), rng.random(1500), np.empty((7, SUMS))
    gather(voxels, shares, extents, labels, sums)
    for blob in range(7):
        own, w = voxels[:, labels == blob].astype(float), shares[labels == blob]
        products = [own[i] * own[j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]
        rows = [np.ones_like(w), *own[:3], *products, *own[3:], *own[3:] ** 2, extents[labels == blob]]
        np.testing.assert_allclose(sums[blob], [row @ w for row in rows], rtol=1e-9, atol=1e-12)
    before = labels.copy()
    before[::3] += 1
    assert count_changes(labels, before) == 500
    np.testing.assert_array_equal(before, labels)


def test_blobs_come_to_lie_on_their_limbs(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    start = near(body, pose, 1, frames=1.5)
    moved_by = np.linalg.norm(
        learnt.mixture(body, start).means[0] - learnt.mixture(body, pose).means[0], axis=1
    )
    fitted = fit_blobs(hull, learnt, body, start[None])
    found = apart(fitted, learnt, body, pose)
    assert moved_by.mean() > 60.0
    assert found.mean() < 12.0
    assert found.max() < 35.0
    assert fitted.mixture.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(fitted.mixture.weights, learnt.weight, atol=0.03)


def test_the_likelihood_is_that_of_every_voxel_from_its_own_blob(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    fitted = fit_blobs(hull, learnt, body, pose[None], iterations=4, moved=False)
    logs = np.empty(len(hull.centres))
    for blob in range(len(learnt.limb)):
        own = fitted.labels == blob
        space = multivariate_normal(fitted.mixture.means[blob], fitted.mixture.covariances[blob])
        colour = multivariate_normal(learnt.colour[blob], np.diag(learnt.colour_variance[blob]))
        logs[own] = space.logpdf(hull.centres[own]) + colour.logpdf(hull.colours[own])
        logs[own] += np.log(fitted.mixture.weights[blob])
    assert fitted.log_likelihood == pytest.approx(hull.weights() @ logs, rel=1e-5)
    assert fitted.margin == pytest.approx(fitted.log_likelihood - self_likelihood(learnt))
    np.testing.assert_array_equal(nearest_blobs(Voxels.of(hull), fitted.mixture), fitted.labels)


def test_a_body_like_the_model_has_the_expected_likelihood(body: BodyModel, learnt: BlobModel) -> None:
    rng = np.random.default_rng(3)
    mixture = learnt.mixture(body, body.neutral).at(0)
    rows = rng.choice(len(mixture.weights), 200_000, p=mixture.weights)
    draws = []
    for blob in range(len(mixture.weights)):
        count = int((rows == blob).sum())
        space = multivariate_normal(mixture.means[blob], mixture.covariances[blob])
        colour = multivariate_normal(mixture.colours[blob], np.diag(mixture.colour_variances[blob]))
        own = np.log(mixture.weights[blob]) + space.logpdf(space.rvs(count, random_state=rng))
        draws.append(own + colour.logpdf(colour.rvs(count, random_state=rng)))
    assert self_likelihood(learnt) == pytest.approx(np.concatenate(draws).mean(), abs=0.05)


def test_the_likeliest_start_is_kept(body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel) -> None:
    starts = np.stack([near(body, pose, seed, frames=6) for seed in (31, 32)] + [near(body, pose, 2)])
    fitted = fit_blobs(hull, learnt, body, starts)
    assert fitted.start == 2
    # Each unchanged, and translated to the hull.
    assert len(fitted.log_likelihoods) == 6
    assert fitted.log_likelihood == fitted.log_likelihoods.max()
    alone = fit_blobs(hull, learnt, body, starts[2:])
    np.testing.assert_array_equal(alone.mixture.means, fitted.mixture.means)


def test_a_body_that_jumped_is_found_by_moving_the_prediction(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    away = pose.copy()
    away[:2] += [380.0, -240.0]
    stuck = fit_blobs(hull, learnt, body, away[None], moved=False)
    found = fit_blobs(hull, learnt, body, away[None])
    assert apart(found, learnt, body, pose).mean() < 10.0
    assert apart(stuck, learnt, body, pose).mean() > 40.0
    assert found.margin > stuck.margin


def test_colour_tells_limbs_apart(body: BodyModel) -> None:
    """The body is predicted a leg's distance to the side: without colours one leg's voxels go to the other."""
    hull = hull_of(body, body.neutral)
    cones = cone_blobs(body)
    colours = limb_colours(body)
    variance = np.full_like(colours, 36.0)
    coloured = BlobModel(cones.limb, cones.offset, cones.eigenvalues, colours, variance, cones.weight)
    start = body.neutral.copy()
    start[1] += 180.0
    legs = [index for index, limb in enumerate(body.drawn) if "shin" in limb.name or "thigh" in limb.name]
    off = [
        apart(fit_blobs(hull, model, body, start[None], moved=False), model, body, body.neutral)[legs].max()
        for model in (coloured, cones)
    ]
    assert off[0] < 25.0
    assert off[1] > 90.0


def test_something_else_than_the_body_is_unlikely(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    good = fit_blobs(hull, learnt, body, pose[None])
    rng = np.random.default_rng(0)
    corners = rng.uniform([-1500, -1500, 0], [1500, 1500, 2200], (6000, 3))
    grey = np.full((6000, 3), 20.0, dtype=np.float32)
    dark = Hull(corners, np.full(6000, 20.0), grey, grey[:, None], 7, hull.box)
    assert -1.5 < good.margin < 1.5
    assert fit_blobs(dark, learnt, body, pose[None]).margin < -8.0
    shuffled = Hull(
        hull.centres, hull.edges, hull.colours[::-1].copy(), hull.view_colours, hull.depth, hull.box
    )
    assert fit_blobs(shuffled, learnt, body, pose[None]).margin < good.margin - 3.0


def test_a_blob_without_voxels_stays_where_it_was_predicted(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    hand = next(index for index, limb in enumerate(body.drawn) if limb.name == "left hand")
    blobs = np.flatnonzero(learnt.limb == hand)
    predicted = learnt.mixture(body, pose)
    labels = nearest_blobs(Voxels.of(hull), predicted.at(0))
    kept = ~np.isin(labels, blobs)
    handless = Hull(
        hull.centres[kept], hull.edges[kept], hull.colours[kept], hull.view_colours[kept], 7, hull.box
    )
    fitted = fit_blobs(handless, learnt, body, pose[None], iterations=1, moved=False)
    np.testing.assert_allclose(fitted.mixture.means[blobs], predicted.means[0, blobs], atol=1e-6)
    assert np.isfinite(fitted.mixture.covariances).all()
    assert (fitted.mixture.weights > 0.0).all()


def test_the_same_voxels_give_the_same_bits(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    one, other = (fit_blobs(hull, learnt, body, pose[None]) for _ in range(2))
    np.testing.assert_array_equal(one.mixture.means, other.mixture.means)
    np.testing.assert_array_equal(one.mixture.covariances, other.mixture.covariances)
    assert one.log_likelihood == other.log_likelihood


def test_large_voxels_count_by_their_volume(body: BodyModel, pose: Array, learnt: BlobModel) -> None:
    fine = hull_of(body, pose, spacing=12.0, noise=0.0)
    coarse = hull_of(body, pose, spacing=30.0, noise=0.0)
    lower = fine.centres[:, 2] < pose[2] - 500.0
    above = coarse.centres[:, 2] >= pose[2] - 500.0
    mixed = Hull(
        np.concatenate([fine.centres[lower], coarse.centres[above]]),
        np.concatenate([fine.edges[lower], coarse.edges[above]]),
        np.concatenate([fine.colours[lower], coarse.colours[above]]),
        np.concatenate([fine.view_colours[lower], coarse.view_colours[above]]),
        7,
        fine.box,
    )
    one, other = (fit_blobs(hull, learnt, body, pose[None]) for hull in (fine, mixed))
    np.testing.assert_allclose(other.mixture.weights, one.mixture.weights, atol=0.01)
    assert np.linalg.norm(other.mixture.means - one.mixture.means, axis=1).max() < 12.0


def test_blobs_are_at_least_as_thick_in_every_direction() -> None:
    """One that is, two that are thin in a direction, one that is in two."""
    upper = (
        [100, 30, 0, 90, 0, 60],
        [100, 90, 0, 100, 0, 100],
        [10, 0, 5, 90, 0, 60],
        [100, 90, 0, 100, 0, 10],
        [60, 25, -20, 50, 30, 80],
        [45, -18, 12, 50, 9, 40],
        [40, 9, 15, 38, 12, 42],
    )
    state = np.zeros((len(upper), 16))
    state[:, 3:9] = upper
    before = state.copy()
    thicken(state, 20.0)
    places = np.array([[3, 4, 5], [4, 6, 7], [5, 7, 8]])
    for old, new in zip(before, state, strict=True):
        values, axes = np.linalg.eigh(old[places])
        np.testing.assert_allclose(new[places], axes * np.maximum(values, 20.0) @ axes.T, atol=1e-9)
    np.testing.assert_array_equal(state[0], before[0])


def test_voxels_no_view_coloured_and_no_voxels_at_all(
    body: BodyModel, pose: Array, hull: Hull, learnt: BlobModel
) -> None:
    unseen = hull.colours.copy()
    unseen[::2] = np.nan
    half = Hull(hull.centres, hull.edges, unseen, hull.view_colours, 7, hull.box)
    assert np.isfinite(fit_blobs(half, learnt, body, pose[None]).log_likelihood)
    voxels, known = Voxels.of(half), unseen[1::2].astype(float)
    shares = hull.weights()[1::2] / hull.weights()[1::2].sum()
    np.testing.assert_allclose(voxels.colour, shares @ known, rtol=1e-6)
    np.testing.assert_allclose(
        voxels.rows[3:, ::2], np.tile(voxels.colour[:, None], (1, len(unseen[::2]))), rtol=1e-6
    )
    np.testing.assert_allclose(voxels.colour_variance, shares @ (known - voxels.colour) ** 2, rtol=1e-6)
    nothing = Hull(hull.centres, hull.edges, np.full_like(unseen, np.nan), hull.view_colours, 7, hull.box)
    assert np.isfinite(fit_blobs(nothing, learnt, body, pose[None]).log_likelihood)
    with pytest.raises(ValueError, match="empty hull"):
        fit_blobs(empty_hull(), learnt, body, pose[None])
