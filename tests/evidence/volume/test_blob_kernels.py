"""The kernels of blob fitting against matrices and plain loops."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from studio.evidence.volume.blob_kernels import (
    FACTORS,
    STATE,
    SUMS,
    fill_factors,
    fit,
    gather,
    likelihood_of,
    precision_of,
    update,
)

Array = np.ndarray
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
ENTRIES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


def blobs(seed: int, count: int = 4) -> Array:
    """(B, STATE) random blobs, far apart beside their size."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 12.0, (count, 3, 3))
    covariances = root @ root.transpose(0, 2, 1) + 40.0 * np.eye(3)
    upper = np.array([[one[place] for place in UPPER] for one in covariances])
    state = np.column_stack(
        [
            rng.uniform(-60.0, 60.0, (count, 3)),
            upper,
            rng.uniform(60.0, 190.0, (count, 3)),
            rng.uniform(40.0, 90.0, (count, 3)),
            rng.dirichlet(np.full(count, 4.0)),
        ]
    )
    assert state.shape == (count, STATE)
    return state


def covariance(blob: Array) -> Array:
    return blob[3:9][ENTRIES]


def voxels_of(state: Array, seed: int, each: int = 60) -> tuple[Array, Array, Array]:
    """(6, K) float32 voxels about blobs, their shares and extents."""
    rng = np.random.default_rng(seed)
    rows = [
        np.concatenate(
            [
                rng.multivariate_normal(blob[:3], covariance(blob), each),
                rng.normal(blob[9:12], np.sqrt(blob[12:15]), (each, 3)),
            ],
            axis=1,
        )
        for blob in state
    ]
    voxels = np.ascontiguousarray(np.concatenate(rows).T, np.float32)
    shares = rng.random(voxels.shape[1]) + 0.2
    return voxels, shares / shares.sum(), rng.uniform(5.0, 40.0, voxels.shape[1])


def test_precision_is_the_inverse_of_the_covariance() -> None:
    for blob in blobs(1):
        inverse = np.empty(6)
        assert precision_of(blob, inverse) == pytest.approx(np.linalg.det(covariance(blob)))
        np.testing.assert_allclose(inverse[ENTRIES], np.linalg.inv(covariance(blob)), rtol=1e-9, atol=1e-12)


def test_factors_are_the_mean_the_root_of_the_precision_and_the_colour() -> None:
    state, factors = blobs(2), np.empty((4, FACTORS))
    fill_factors(state, factors)
    for blob, row in zip(state, factors, strict=True):
        np.testing.assert_array_equal(row[:3], blob[:3])
        root = np.array([[row[3], row[4], row[5]], [0.0, row[6], row[7]], [0.0, 0.0, row[8]]])
        np.testing.assert_allclose(root.T @ root, np.linalg.inv(covariance(blob)), rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(row[9:12], blob[9:12])
        np.testing.assert_allclose(row[12:], 1.0 / np.sqrt(blob[12:15]))


def test_likelihood_is_the_mean_of_every_voxels_from_its_own_blob() -> None:
    state = blobs(3, 5)
    voxels, shares, _ = voxels_of(state[[0, 1, 3, 4]], 3)
    labels, sums = np.repeat([0, 1, 3, 4], 60).astype(np.int32), np.empty((5, SUMS))
    gather(voxels, shares, np.zeros_like(shares), labels, sums)
    moved = state.copy()
    moved[:, :3] += np.random.default_rng(3).normal(0.0, 9.0, (5, 3))
    colours = np.column_stack([state[:, 9:12] + 5.0, state[:, 12:15] * 1.3])
    total = 0.0
    for voxel, share, label in zip(voxels.T.astype(float), shares, labels, strict=True):
        blob = moved[label]
        total += share * (
            np.log(blob[15])
            + multivariate_normal(blob[:3], covariance(blob)).logpdf(voxel[:3])
            + multivariate_normal(colours[label, :3], np.diag(colours[label, 3:])).logpdf(voxel[3:])
        )
    assert likelihood_of(moved, sums, colours) == pytest.approx(total, rel=1e-9)


def plain_update(
    predicted: Array, voxels: Array, shares: Array, extents: Array, labels: Array, prior: float, least: float
) -> Array:
    """Each blob's moments over its voxels and, as one voxel more, what was predicted."""
    state = np.empty_like(predicted)
    for b, before in enumerate(predicted):
        own = labels == b
        weights = np.append(shares[own], prior * before[15])
        total = weights.sum()
        places = np.vstack([voxels[:3, own].T.astype(float), before[:3]])
        mean = weights @ places / total
        spread = (places - mean).T @ (weights[:, None] * (places - mean)) / total
        spread += weights[-1] / total * covariance(before)
        spread += shares[own] @ extents[own] / total * np.eye(3)
        colours = np.vstack([voxels[3:, own].T.astype(float), before[9:12]])
        colour = weights @ colours / total
        variance = weights @ (colours - colour) ** 2 / total + weights[-1] / total * before[12:15]
        state[b] = [*mean, *(spread[i] for i in UPPER), *colour, *np.maximum(variance, least), total]
    state[:, 15] /= state[:, 15].sum()
    return state


def test_update_is_the_moments_of_voxels_and_prediction() -> None:
    predicted = blobs(4)
    voxels, shares, extents = voxels_of(predicted, 4)
    labels, sums = np.random.default_rng(4).integers(0, 3, len(shares)).astype(np.int32), np.empty((4, SUMS))
    voxels[3, labels == 1] = 100.0
    predicted[1, 9], predicted[1, 12] = 100.0, 20.0
    gather(voxels, shares, extents, labels, sums)
    state = np.empty_like(predicted)
    update(predicted, sums, 0.3, 36.0, state)
    expected = plain_update(predicted, voxels, shares, extents, labels, 0.3, 36.0)
    assert (expected[:, 12:15] == 36.0).sum() == 1
    np.testing.assert_allclose(state, expected, rtol=1e-8, atol=1e-8)


def plain_fit(
    predicted: Array,
    given: tuple[Array, Array, Array],
    colours: Array,
    rounds: int,
    still: float,
    least: float,
) -> tuple[float, Array, Array, int]:
    """Of the best round: the likelihood, the state and the labels; and the number of rounds that were looked at."""
    voxels, shares, extents = given
    state, likelihood, before, looked = predicted.copy(), -np.inf, np.full(len(shares), -1), 0
    best, best_labels = predicted, before
    for step in range(rounds + 1):
        looked += 1
        squared = []
        for blob in state:
            away = voxels[:3].T.astype(float) - blob[:3]
            off = (voxels[3:].T.astype(float) - blob[9:12]) ** 2 / blob[12:15]
            squared.append(
                np.einsum("ki,ij,kj->k", away, np.linalg.inv(covariance(blob)), away) + off.sum(axis=1)
            )
        labels = np.argmin(squared, axis=0)
        changed, before = int((labels != before).sum()), labels
        sums = np.empty((len(state), SUMS))
        gather(voxels, shares, extents, labels.astype(np.int32), sums)
        improved = likelihood_of(state, sums, colours)
        if step > 0 and improved <= likelihood:
            break
        best, best_labels, likelihood = state, labels, improved
        if changed <= still * len(labels):
            break
        state = plain_update(predicted, voxels, shares, extents, labels, 0.05, 36.0)
        for blob in state:
            values, axes = np.linalg.eigh(covariance(blob))
            thick = axes * np.maximum(values, least) @ axes.T
            blob[3:9] = [thick[place] for place in UPPER]
    return likelihood, best, best_labels, looked


@pytest.mark.parametrize(
    ("rounds", "still", "least"),
    [(0, 0.0, 25.0), (1, 0.0, 25.0), (9, 0.0, 25.0), (9, 0.05, 150.0), (9, 0.2, 25.0)],
)
def test_a_fit_goes_on_until_hardly_a_voxel_changes_or_it_grows_worse(
    rounds: int, still: float, least: float
) -> None:
    looks = set()
    for seed in range(6):
        truth = blobs(seed, 5)
        given = voxels_of(truth, seed)
        predicted = truth.copy()
        predicted[:, :3] += np.random.default_rng(seed).normal(0.0, 25.0, (5, 3))
        colours = np.column_stack([truth[:, 9:12], truth[:, 12:15]])
        if seed % 2:
            predicted[:, 12:15] *= 400.0
        best, labels = np.empty_like(predicted), np.empty(300, np.int32)
        rules = np.array([rounds, still, 0.05, 36.0, least])
        likelihood = fit(*given, predicted, colours, rules, best, labels)
        expected = plain_fit(predicted, given, colours, rounds, still, least)
        assert likelihood == pytest.approx(expected[0], rel=1e-6)
        np.testing.assert_allclose(best, expected[1], rtol=1e-5, atol=1e-5)
        np.testing.assert_array_equal(labels, expected[2])
        looks.add(expected[3])
    assert rounds < 2 or still > 0.1 or len(looks) > 1


def test_a_share_of_the_voxels_that_still_change_ends_a_fit() -> None:
    """All of them change in the first round: it is the last where all may."""
    state = blobs(1)
    given = voxels_of(state, 1)
    predicted = state + np.pad(np.full((4, 1), 15.0), ((0, 0), (0, STATE - 1)))
    colours = np.column_stack([state[:, 9:12], state[:, 12:15]])
    best, labels = np.empty_like(state), np.empty(240, np.int32)
    fit(*given, predicted, colours, np.array([9, 1.0, 0.05, 36.0, 25.0]), best, labels)
    np.testing.assert_array_equal(best, predicted)
    fit(*given, predicted, colours, np.array([9, 0.999, 0.05, 36.0, 25.0]), best, labels)
    assert np.abs(best - predicted).max() > 5.0
