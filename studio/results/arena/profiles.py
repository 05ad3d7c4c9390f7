"""How fast racers come how near: empirical distributions of runtimes, and expected running times.

A target is a log-weight: that of the heaviest known pose less a share of the way to it from the start pose (SHARES),
so that problems and likelihoods of any scale count alike. A trial's runtime for a target is the number of evaluations
after which it was first reached; there is none where the budget was spent before.

The profile (ECDF) at n evaluations is the share of all pairs of problem, target and seed that were reached within n
(Hansen et al. 2016, arXiv:1605.03560; Moré & Wild 2009). The expected running time of a target (ERT) is the evaluations
of all trials until they reached it or ended, over the number that reached it: infinite where none did. Bands are
percentiles of both over seeds drawn again within each problem.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from studio.foundations.arrays import Array

SHARES = tuple(float(share) for share in np.logspace(-0.1, -3.0, 30))
"""From 0.79 of the way left to 0.001."""
K = TypeVar("K", bound=Hashable)
DRAWS, LEVEL = 1000, 0.95
SEED = 20160601


@dataclass(frozen=True, slots=True)
class Trial:
    """A racer's run on a problem.

    evaluations : spent.
    reached : (K,) ascending counts at which a heavier pose was met.
    gaps : (K,) by how many nats each is lighter than the heaviest known one; below zero where it is heavier.
    way : the start pose's gap.
    """

    problem: str
    racer: str
    seed: int
    evaluations: int
    reached: tuple[int, ...]
    gaps: tuple[float, ...]
    way: float

    def runtime(self, share: float) -> float:
        """Evaluations until so little of the way is left; infinite where that was not reached."""
        for count, gap in zip(self.reached, self.gaps, strict=True):
            if gap <= share * self.way:
                return float(count)
        return np.inf

    @property
    def share_left(self) -> float:
        """Of the way from the start pose, at the end; below zero where a heavier pose than the known one was met."""
        return self.gaps[-1] / self.way if self.gaps and self.way > 0.0 else np.inf


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A racer's ECDF. evaluations : (N,). share, low, high : (N,) of pairs reached, and its band over seeds."""

    racer: str
    evaluations: Array
    share: Array
    low: Array
    high: Array


@dataclass(frozen=True, slots=True)
class RunningTime:
    """Expected evaluations until a share of the way is left, with its band; infinite where no trial came so near.

    reached, trials : how many came so near, of how many.
    """

    problem: str
    racer: str
    share: float
    expected: float
    low: float
    high: float
    reached: int
    trials: int


def profile(racer: str, trials: Sequence[Trial], counts: Array, shares: Sequence[float] = SHARES) -> Profile:
    """The ECDF of a racer's trials at numbers of evaluations (N,)."""
    by_problem = [
        np.stack([_reached(trial, counts, shares) for trial in own])
        for own in _grouped(trials, lambda trial: trial.problem).values()
    ]
    share = np.mean([rows.mean(axis=0) for rows in by_problem], axis=0)
    rng = np.random.default_rng(SEED)
    drawn = np.mean(
        [rows[rng.integers(len(rows), size=(DRAWS, len(rows)))].mean(axis=1) for rows in by_problem], axis=0
    )
    low, high = _band(drawn)
    return Profile(racer, counts, share, low, high)


def running_time(trials: Sequence[Trial], share: float) -> RunningTime:
    """The expected running time of one racer's trials on one problem."""
    runtimes = np.array([trial.runtime(share) for trial in trials])
    spent = np.where(np.isfinite(runtimes), runtimes, [trial.evaluations for trial in trials])
    successes = np.isfinite(runtimes)
    rows = np.random.default_rng(SEED).integers(len(trials), size=(DRAWS, len(trials)))
    drawn = _over(spent[rows].sum(axis=1), successes[rows].sum(axis=1))
    low, high = _band(drawn)
    expected = float(_over(np.array([spent.sum()]), np.array([successes.sum()]))[0])
    first = trials[0]
    return RunningTime(
        first.problem,
        first.racer,
        share,
        expected,
        float(low),
        float(high),
        int(successes.sum()),
        len(trials),
    )


def profiles(trials: Sequence[Trial], budget: int, points: int = 60) -> list[Profile]:
    """The ECDF of every racer, in the order of the trials, from one evaluation to the budget."""
    spaced = [round(budget ** (place / (points - 1))) for place in range(points)]
    counts = np.array(sorted(set(spaced)), np.float64)
    return [profile(name, own, counts) for name, own in _grouped(trials, lambda trial: trial.racer).items()]


def by_problem_and_racer(trials: Sequence[Trial]) -> Mapping[tuple[str, str], list[Trial]]:
    """Trials that differ by seed alone."""
    return _grouped(trials, lambda trial: (trial.problem, trial.racer))


def _grouped(trials: Sequence[Trial], key: Callable[[Trial], K]) -> dict[K, list[Trial]]:
    groups = dict[K, list[Trial]]()
    for trial in trials:
        groups.setdefault(key(trial), []).append(trial)
    return groups


def _reached(trial: Trial, counts: Array, shares: Sequence[float]) -> Array:
    """(N,) share of targets reached within so many evaluations."""
    runtimes = np.sort([trial.runtime(share) for share in shares])
    return np.searchsorted(runtimes, counts, side="right") / len(shares)


def _over(spent: Array, successes: Array) -> Array:
    return np.where(successes > 0, spent / np.maximum(successes, 1), np.inf)


def _band(drawn: Array) -> tuple[Array, Array]:
    """Low and high percentiles over the draws (first axis); without interpolation, which infinite values forbid."""
    ends = (100.0 * (1.0 - LEVEL) / 2.0, 100.0 * (1.0 + LEVEL) / 2.0)
    low, high = np.percentile(drawn, ends, axis=0, method="nearest")
    return low, high
