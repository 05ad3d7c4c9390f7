"""Both parents of every particle are stored, with the numbers of the particles that are."""

import dataclasses

import numpy as np
from store_records import layer_of
from toy_problems import toy_hierarchy

from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.particles import unweighted
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.tracker import NO_PARENT, SearchSpace
from studio.sessions.results_codec import pack, pack_layer, unpack, unpack_layer


class Hill:
    """A weight that every pose has in another amount."""

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return -np.sum(poses**2, axis=1)

    def fitness(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return self.log_likelihood(poses)

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        return np.ones(len(poses), dtype=bool)


def test_without_noise_each_particle_is_made_of_its_parents() -> None:
    size, count, limbs = 6, 50, np.array([0, 0, 1, 1, 2, 2])
    still = np.zeros(size)
    space = SearchSpace(
        tuple(f"x{at}" for at in range(size)), still - 9.0, still + 9.0, still, limbs, toy_hierarchy(size)
    )
    settings = AnnealedSettings(particles=count, layers=3, adaptive_diffusion=False, crossover=0.7)
    poses = np.random.default_rng(1).normal(size=(count, size))
    made, record = AnnealedParticleFilter().step_layer(
        RandomNumbers(2, 0, 0), unweighted(poses), 0, Hill(), space, settings
    )
    first, second = record.parents
    assert record.parents.shape == (2, count)
    crossed = second != NO_PARENT
    assert 0 < crossed.sum() < count
    assert np.array_equal(made.poses[~crossed], poses[first[~crossed]])
    for at in np.flatnonzero(crossed):
        own = made.poses[at] == poses[first[at]]
        other = made.poses[at] == poses[second[at]]
        assert (own | other).all()
        assert other.any()


def test_parents_and_numbers_are_kept() -> None:
    layer = layer_of(3, 1, count=12)
    parents = np.stack([np.arange(12), np.full(12, NO_PARENT)])
    whole = unpack_layer(pack_layer(dataclasses.replace(layer, parents=parents)))
    assert np.array_equal(whole.parents, parents)
    assert whole.rows.shape == (0,)
    some = unpack_layer(pack_layer(dataclasses.replace(layer, parents=parents), 5))
    heaviest = np.sort(np.argsort(-layer.log_weights)[:5])
    assert np.array_equal(some.rows, heaviest)
    assert np.array_equal(some.poses, layer.poses[heaviest])
    assert some.parents.shape == (2, 12)
    # Packed again with fewer, the numbers are still those in the whole set.
    fewer = unpack_layer(pack_layer(some, 3))
    assert np.array_equal(fewer.rows, np.sort(np.argsort(-layer.log_weights)[:3]))


def test_layers_of_before_have_no_parents() -> None:
    arrays = unpack(pack_layer(layer_of(0, 0)))
    assert set(arrays) == {"numbers", "vectors", "poses", "log_weights"}
    found = unpack_layer(pack(arrays))
    assert found.parents.shape == (2, 0)
    assert found.rows.shape == (0,)
