"""Component-wise EM finds the number of Gaussians, and fits them as well as plain EM that is given it."""

import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from studio.foundations.errors import BehaviourError
from studio.search.behaviour.figueiredo_jain import Search, fit_mixture, parameters_of
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.mixture_kernels import (
    losses_without,
    replace_component,
    shares_of,
    sum_of_others,
)


@dataclass(frozen=True)
class Truth:
    """A mixture with known components."""

    weights: np.ndarray
    means: np.ndarray
    covariances: np.ndarray

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        numbers = rng.choice(len(self.weights), count, p=self.weights)
        factors = np.linalg.cholesky(self.covariances)
        noise = rng.standard_normal((count, self.means.shape[1]))
        return self.means[numbers] + np.einsum("nij,nj->ni", factors[numbers], noise)


def separated() -> Truth:
    """Five clusters far from each other in three dimensions."""
    rng = np.random.default_rng(11)
    means = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9], [9, 9, 9]], dtype=float)
    factors = rng.standard_normal((5, 3, 3))
    return Truth(np.full(5, 0.2), means, factors @ factors.transpose(0, 2, 1) + 0.3 * np.eye(3))


def overlapping() -> Truth:
    """Four clusters, two of which share their mean (the second example of Figueiredo & Jain, section 6.1)."""
    means = np.array([[-4.0, -4.0], [-4.0, -4.0], [2.0, 2.0], [-1.0, -6.0]])
    covariances = np.array(
        [[[1, 0.5], [0.5, 1]], [[6, -2], [-2, 6]], [[2, -1], [-1, 2]], [[0.125, 0], [0, 0.125]]], dtype=float
    )
    return Truth(np.array([0.3, 0.3, 0.3, 0.1]), means, covariances)


def unequal() -> Truth:
    """Three elongated clusters of 70, 25 and 5 %."""
    means = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 6.0]])
    covariances = np.array([[[2, 0], [0, 0.2]], [[0.3, 0.2], [0.2, 1.5]], [[0.2, 0], [0, 0.1]]])
    return Truth(np.array([0.7, 0.25, 0.05]), means, covariances)


def plain_em(points: np.ndarray, truth: Truth, steps: int = 100) -> float:
    """The log-likelihood that textbook EM reaches from the truth, with the right number of components."""
    weights, means, covariances = truth.weights, truth.means, truth.covariances
    for _ in range(steps):
        parts = zip(weights, means, covariances, strict=True)
        joint = np.stack([w * multivariate_normal(m, c).pdf(points) for w, m, c in parts], axis=1)
        shares = joint / joint.sum(axis=1, keepdims=True)
        counts = shares.sum(axis=0)
        weights, means = counts / len(points), shares.T @ points / counts[:, None]
        away = points[:, None] - means
        covariances = np.einsum("nk,nki,nkj->kij", shares, away, away) / counts[:, None, None]
    return float(np.log(joint.sum(axis=1)).sum())


def test_what_is_lost_without_a_component_is_exact_where_points_are_all_its_own() -> None:
    densities = np.random.default_rng(2).normal(size=(3, 6))
    densities[0, :3] += [8.0, 40.0, 400.0]
    logs = np.log([0.5, 0.3, 0.2])
    joint = densities + logs[:, None]
    wanted = [
        (logsumexp(joint, axis=0) - logsumexp(np.delete(joint, number, axis=0), axis=0)).sum()
        + 6 * np.log1p(-np.exp(logs[number]))
        for number in range(3)
    ]
    np.testing.assert_allclose(losses_without(densities, logs, logsumexp(joint, axis=0)), wanted, rtol=1e-9)


@dataclass
class PlainSearch:
    """Component-wise EM as it is defined: after each update all shares are taken afresh."""

    points: np.ndarray
    diagonal: bool
    weights: np.ndarray
    means: list[np.ndarray]
    covariances: list[np.ndarray]
    floor: np.ndarray

    @classmethod
    def begun(
        cls, points: np.ndarray, rng: np.random.Generator, most: int, diagonal: bool, floor: tuple[float, ...]
    ) -> "PlainSearch":
        variance, width = points.var(axis=0).mean(), points.shape[1]
        means = list(points[rng.choice(len(points), most, replace=False)])
        least = 1e-6 * variance * np.eye(width) + np.diag(floor or np.zeros(width))
        starts = [0.1 * variance * np.eye(width)] * most
        return cls(points, diagonal, np.full(most, 1.0 / most), means, starts, least)

    @property
    def parameters(self) -> float:
        width = self.points.shape[1]
        return 2.0 * width if self.diagonal else width + width * (width + 1) / 2

    def joint(self) -> np.ndarray:
        parts = zip(self.weights, self.means, self.covariances, strict=True)
        return np.stack([np.log(w) + multivariate_normal(m, c).logpdf(self.points) for w, m, c in parts])

    def reached(self) -> tuple[int, float, float]:
        """Components, message length and log-likelihood."""
        joint = self.joint()
        totals, size = logsumexp(joint, axis=0), len(joint)
        support = np.exp(joint - totals).sum(axis=1)
        shape = self.parameters / 2 * np.log(support).sum() + size / 2 * np.log(len(self.points))
        return size, shape - totals.sum(), totals.sum()

    def remove(self, number: int) -> None:
        self.weights = np.delete(self.weights, number)
        self.weights = self.weights / self.weights.sum()
        del self.means[number], self.covariances[number]

    def sweep(self) -> None:
        number = 0
        while number < len(self.weights):
            joint = self.joint()
            share = np.exp(joint[number] - logsumexp(joint, axis=0))
            strength = max(0.0, share.sum() - self.parameters / 2) / len(self.points)
            if strength == 0.0 and len(self.weights) > 1:
                self.remove(number)
                continue
            self.means[number] = share @ self.points / share.sum()
            away = self.points - self.means[number]
            spread = (away * share[:, None]).T @ away / share.sum()
            self.covariances[number] = (np.diag(np.diag(spread)) if self.diagonal else spread) + self.floor
            self.weights[number] = max(strength, 1.0 / len(self.points))
            self.weights = self.weights / self.weights.sum()
            number += 1

    def converge(self) -> int:
        before = np.inf
        for sweep in itertools.count(1):
            self.sweep()
            after = self.reached()[1]
            if abs(after - before) < 1e-3 * len(self.points):
                return sweep
            before = after
        raise AssertionError

    def likelihood_without(self, number: int) -> float:
        joint = np.delete(self.joint(), number, axis=0)
        return float((logsumexp(joint, axis=0) - np.log1p(-self.weights[number])).sum())


@pytest.mark.parametrize(("covariance", "floor"), [("full", ()), ("diagonal", (0.05, 0.02))])
def test_the_search_takes_the_course_of_its_definition(covariance: str, floor: tuple[float, ...]) -> None:
    points = unequal().sample(150, np.random.default_rng(2))
    plain = PlainSearch.begun(points, np.random.default_rng(3), 7, covariance == "diagonal", floor)
    course, best = [], None
    while True:
        sweeps = plain.converge()
        course.append((*plain.reached(), sweeps))
        if best is None or course[-1][1] < min(length for _, length, *_ in course[:-1]):
            best = plain.weights, np.array(plain.means), np.array(plain.covariances)
        if len(plain.weights) == 1:
            break
        plain.remove(int(np.argmax([plain.likelihood_without(one) for one in range(len(plain.weights))])))
    mixture, history = fit_mixture(
        points, np.random.default_rng(3), Search(most=7, covariance=covariance, floor=floor)
    )
    found = [(one.components, one.length, one.log_likelihood, one.sweeps) for one in history]
    np.testing.assert_allclose(found, course, rtol=1e-7)
    for one, other in zip((mixture.weights, mixture.means, mixture.covariances), best, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)


def test_shares_and_totals_are_those_of_all_components_summed_afresh() -> None:
    rng = np.random.default_rng(4)
    # The second component is nearly all, some, next to nothing of what a point has; before and after.
    levels = np.array([900.0, 45.0, 9.0, 5.0, 0.0, -9.0, -39.0, -45.0, -900.0])
    before, after = (part.ravel() for part in np.meshgrid(levels, levels))
    densities = rng.normal(size=(3, len(before)))
    densities[1] += before
    logs, weight = np.log([0.5, 0.2, 0.3]), np.log(0.35)
    totals = logsumexp(densities + logs[:, None], axis=0)
    share = np.exp(logs[1] + densities[1] - totals)
    found = shares_of(densities[1], logs[1], totals)
    np.testing.assert_allclose(found, np.where(share > np.exp(-40.0), share, 0.0), rtol=1e-12)
    assert shares_of(np.array([1e-9]), 0.0, np.zeros(1))[0] == 1.0
    others = [sum_of_others(densities, logs, 1, point) for point in range(len(before))]
    np.testing.assert_allclose(others, logsumexp(np.delete(densities + logs[:, None], 1, axis=0), axis=0))
    assert sum_of_others(densities[:1], logs[:1], 0, 0) == -np.inf
    new = rng.normal(size=len(after)) + after
    changed = densities.copy()
    replace_component(changed, logs, 1, new, weight, totals)
    np.testing.assert_array_equal(changed, [densities[0], new, densities[2]])
    logs[1] = weight
    np.testing.assert_allclose(totals, logsumexp(changed + logs[:, None], axis=0), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("make", [separated, overlapping, unequal])
@pytest.mark.parametrize("seed", range(6))
def test_the_number_of_components_is_found_and_the_fit_is_that_of_plain_em(make, seed: int) -> None:
    truth = make()
    rng = np.random.default_rng(seed)
    points = truth.sample(1000, rng)
    mixture, history = fit_mixture(points, rng, Search(most=20))
    assert mixture.size == len(truth.weights)
    reached, wanted = mixture.log_likelihood(points), plain_em(points, truth)
    # Its weights are those of a penalised likelihood, so that it stays a little below.
    assert wanted - 0.005 * len(points) < reached < wanted + 0.001 * len(points)
    assert [entry.components for entry in history][-1] == 1


def test_found_components_are_the_true_ones() -> None:
    truth = separated()
    points = truth.sample(3000, np.random.default_rng(5))
    mixture, _ = fit_mixture(points, np.random.default_rng(6), Search(most=20))
    distances = np.linalg.norm(mixture.means[:, None] - truth.means, axis=2)
    match = distances.argmin(axis=0)
    assert sorted(match) == list(range(5))
    np.testing.assert_allclose(mixture.weights[match], truth.weights, atol=0.03)
    np.testing.assert_allclose(mixture.means[match], truth.means, atol=0.3)
    np.testing.assert_allclose(mixture.covariances[match], truth.covariances, atol=0.8)


def test_the_answer_has_the_shortest_message() -> None:
    points = overlapping().sample(800, np.random.default_rng(1))
    mixture, history = fit_mixture(points, np.random.default_rng(2), Search(most=15))
    n, k, size = 800, mixture.size, 2 + 3
    support = mixture.responsibilities(points).sum(axis=0)
    length = size / 2 * np.log(support).sum() + k / 2 * np.log(n) - mixture.log_likelihood(points)
    shortest = min(history, key=lambda entry: entry.length)
    assert length == pytest.approx(shortest.length, rel=1e-10)
    assert shortest.components == k
    assert shortest.log_likelihood == pytest.approx(mixture.log_likelihood(points), rel=1e-10)


def test_every_component_has_points_for_its_parameters() -> None:
    points = np.random.default_rng(0).standard_normal((400, 6))
    mixture, history = fit_mixture(points, np.random.default_rng(1), Search(most=60))
    assert mixture.size == 1
    assert max(entry.components for entry in history) <= 400 / (parameters_of(6, "full") / 2)


def test_repeated_and_constant_values_make_no_singularity() -> None:
    rng = np.random.default_rng(0)
    points = np.concatenate(
        [np.zeros((100, 3)), np.ones((100, 3)), 0.1 * rng.standard_normal((100, 3)) + 5.0]
    )
    points[:, 2] = 7.0
    mixture, _ = fit_mixture(points, rng, Search(most=10))
    assert mixture.size >= 3
    assert (np.linalg.eigvalsh(mixture.covariances) > 0.0).all()
    assert np.isfinite(mixture.log_likelihood(points))


def test_diagonal_covariances() -> None:
    rng = np.random.default_rng(4)
    points = np.concatenate([rng.standard_normal((300, 8)) * 0.3, rng.standard_normal((300, 8)) + 4.0])
    mixture, _ = fit_mixture(points, rng, Search(most=15, covariance="diagonal"))
    assert mixture.size == 2
    off = mixture.covariances * (1.0 - np.eye(8))
    assert not off.any()
    assert parameters_of(8, "diagonal") == 16


def test_patience_ends_the_search_and_keeps_the_best() -> None:
    points = separated().sample(1000, np.random.default_rng(9))
    whole, long = fit_mixture(points, np.random.default_rng(1), Search(most=20))
    short, history = fit_mixture(points, np.random.default_rng(1), Search(most=20, patience=2))
    assert len(history) < len(long)
    np.testing.assert_array_equal(short.means, whole.means)


@pytest.mark.parametrize("patience", [1, 2, 4])
def test_patience_is_the_number_of_removals_in_a_row_without_a_shorter_message(patience: int) -> None:
    points = overlapping().sample(300, np.random.default_rng(9))
    _, whole = fit_mixture(points, np.random.default_rng(1), Search(most=12))
    shortest = np.minimum.accumulate([entry.length for entry in whole])
    since, wanted = 0, len(whole)
    for place in range(1, len(whole)):
        since = since + 1 if shortest[place] == shortest[place - 1] else 0
        if since == patience:
            wanted = place + 1
            break
    _, history = fit_mixture(points, np.random.default_rng(1), Search(most=12, patience=patience))
    assert history == whole[:wanted]


def test_the_search_goes_down_to_the_fewest_asked_for() -> None:
    points = separated().sample(200, np.random.default_rng(9))
    for least in (1, 2, 3):
        mixture, history = fit_mixture(points, np.random.default_rng(1), Search(most=6, least=least))
        assert min(entry.components for entry in history) == least
        assert mixture.size >= least


def test_as_few_points_as_a_component_needs_are_enough() -> None:
    points = np.random.default_rng(0).standard_normal((4, 2))
    # Five parameters: two points and a half.
    mixture, _ = fit_mixture(points[:3], np.random.default_rng(0), Search(most=9))
    np.testing.assert_allclose(mixture.means[0], points[:3].mean(axis=0))
    with pytest.raises(BehaviourError, match="2 frames are too few") as refusal:
        fit_mixture(points[:2], np.random.default_rng(0), Search(most=9))
    assert "3 or more" in refusal.value.hint
    with pytest.raises(BehaviourError, match="1 frames are too few") as refusal:
        fit_mixture(points[:1, :1], np.random.default_rng(0), Search(most=1, covariance="diagonal"))
    assert "2 or more" in refusal.value.hint


def test_same_seed_same_mixture() -> None:
    points = unequal().sample(600, np.random.default_rng(0))
    one, _ = fit_mixture(points, np.random.default_rng(7), Search(most=12))
    other, _ = fit_mixture(points, np.random.default_rng(7), Search(most=12))
    np.testing.assert_array_equal(one.covariances, other.covariances)


def test_progress_is_reported() -> None:
    steps: list[tuple[str, int, int]] = []
    points = unequal().sample(300, np.random.default_rng(0))
    fit_mixture(points, np.random.default_rng(0), Search(most=8), lambda *step: steps.append(step))
    assert steps[-1][1:] == (7, 8)
    assert all(before[1] < after[1] for before, after in itertools.pairwise(steps))


@pytest.mark.parametrize(
    ("points", "search", "words"),
    [
        (np.zeros((100, 38)), Search(most=5), "100 frames are too few"),
        (np.full((100, 2), np.nan), Search(most=5), "not finite"),
        (np.zeros(100), Search(most=5), "not finite"),
        (np.zeros((100, 2)), Search(most=5, least=0), "from 5 down to 0"),
        (np.zeros((100, 2)), Search(most=5, least=6), "from 5 down to 6"),
        (np.zeros((100, 2)), Search(most=5, covariance="round"), "'round'"),
    ],
)
def test_bad_input_is_refused(points: np.ndarray, search: Search, words: str) -> None:
    with pytest.raises(BehaviourError, match=words) as refusal:
        fit_mixture(points, np.random.default_rng(0), search)
    assert refusal.value.hint


def test_mixture_is_a_density() -> None:
    mixture, _ = fit_mixture(
        unequal().sample(500, np.random.default_rng(3)), np.random.default_rng(3), Search(most=10)
    )
    assert isinstance(mixture, GaussianMixture)
    assert mixture.weights.sum() == pytest.approx(1.0)
