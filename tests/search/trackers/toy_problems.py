"""Frame problems without pictures, whose answers are known in closed form."""

import numpy as np

from studio.search.trackers.tracker import Hierarchy, SearchSpace


class Bowl:
    """log w = -Σ ((x - centre) / width)²: one smooth maximum."""

    def __init__(self, centre: np.ndarray, width: float = 1.0) -> None:
        self.centre, self.width = centre, width
        self.weighed = 0

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        """Log-weights, counting the poses."""
        self.weighed += len(poses)
        return -np.sum(((poses - self.centre) / self.width) ** 2, axis=1)

    def fitness(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        """The log-weights."""
        return self.log_likelihood(poses, stage)

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        """Every pose is possible."""
        return np.ones(len(poses), dtype=bool)


class HalfBowl(Bowl):
    """A bowl whose maximum is impossible: x0 must not be positive."""

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        """Possible where x0 <= 0."""
        return poses[:, 0] <= 0.0


def toy_hierarchy(count: int = 6) -> Hierarchy:
    """The first third of the parameters is the root (its first a length); then two limbs of a kind."""
    third = max(count // 3, 1)
    place = np.arange(count)
    depth = np.minimum(place // third, 2)
    return Hierarchy(depth, place == 0, place, np.where(depth > 0, 0, -1))


def toy_space(count: int = 6, limit: float = 5.0, sigma: float = 0.3) -> SearchSpace:
    """`count` parameters within ±limit, three to a limb."""
    return SearchSpace(
        tuple(f"x{index}" for index in range(count)),
        np.full(count, -limit),
        np.full(count, limit),
        np.full(count, sigma),
        np.arange(count) // 3,
        toy_hierarchy(count),
    )
