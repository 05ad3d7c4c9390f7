"""Children are cut as in Eq. 19."""

import numpy as np
import pytest
from toy_problems import toy_hierarchy

from studio.search.trackers.crossover import cross, limb_places
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import SearchSpace


def space_of(limbs: list[int]) -> SearchSpace:
    """A space whose parameters belong to the limbs given."""
    count = len(limbs)
    names = tuple(f"x{index}" for index in range(count))
    ones = np.ones(count)
    return SearchSpace(names, -ones, ones, ones, np.array(limbs), toy_hierarchy(count))


def children(share: float, by: str, limbs: list[int], count: int = 20000, seed: int = 0) -> np.ndarray:
    """(count, D) of 0 where the first parent's parameter was taken, 1 where the second's."""
    space = space_of(limbs)
    shape = (count, len(limbs))
    made, crossed = cross(
        RandomNumbers(seed, 0, 0), np.zeros(shape), np.ones(shape), space, share=share, by=by
    )
    assert np.array_equal(crossed, made.any(axis=1))
    return made


def test_no_share_leaves_the_first_parent() -> None:
    assert not children(0.0, "parameters", [0, 1, 2, 3]).any()


@pytest.mark.parametrize("length", [4, 6])
def test_each_parameter_comes_from_the_second_parent_as_often_as_in_equation_19(length: int) -> None:
    # γ ≤ ε: the smaller and larger of two uniform numbers of 1 … L; x_j is the second's where γ < j ≤ ε.
    made = children(1.0, "parameters", list(range(length)))
    place = np.arange(1, length + 1)
    expected = 2 * (place - 1) * (length - place + 1) / length**2
    assert np.allclose(made.mean(axis=0), expected, atol=4 * 0.5 / np.sqrt(len(made)))


def test_the_second_parent_gives_one_piece() -> None:
    made = children(1.0, "parameters", list(range(7)))
    edges = np.abs(np.diff(made, axis=1, prepend=0, append=0)).sum(axis=1)
    assert set(edges) == {0, 2}


def test_share_is_the_part_with_two_parents() -> None:
    whole = children(1.0, "parameters", list(range(6)), seed=1).any(axis=1).mean()
    half = children(0.5, "parameters", list(range(6)), seed=2).any(axis=1).mean()
    assert half == pytest.approx(0.5 * whole, abs=4 * 0.5 / np.sqrt(20000))


def test_limbs_are_not_torn() -> None:
    limbs = [7, 7, 7, 2, 2, 5, 9, 9]
    made = children(1.0, "limbs", limbs)
    assert made.any()
    for limb in set(limbs):
        columns = made[:, np.array(limbs) == limb]
        assert np.all(columns == columns[:, :1])
    torn = children(1.0, "parameters", limbs)[:, :3]
    assert not np.all(torn == torn[:, :1])


def test_places_number_limbs_in_order() -> None:
    assert np.array_equal(limb_places(space_of([7, 7, 2, 5, 5])), [1, 1, 2, 3, 3])
