"""The swarm against Algorithm 1 written out for one particle and one parameter at a time, and against values of Eq. 2
and 3 worked out by hand.
"""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.foundations.errors import RunError
from studio.search.trackers.counted_numbers import (
    OF_TRIES,
    OF_VELOCITIES,
    as_normals,
    as_share,
    random_words,
)
from studio.search.trackers.frame_loop import FrameSearch, search_frame
from studio.search.trackers.particle_swarm import (
    BEST_POSES,
    FREEDOM,
    LEADER,
    VELOCITIES,
    ParticleSwarm,
    acceleration,
    constriction,
)
from studio.search.trackers.random_numbers import BEGINNINGS, RandomNumbers
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tracker import FilterState, FrameResult, LayerRecord, ParticleSet

SWARM = ParticleSwarm()
SPACE = toy_space(6)
START = np.linspace(0.2, 0.7, 6)
SMALL = SwarmSettings(stage1_particles=4, stage1_iterations=5, stage2_particles=6, stage2_iterations=7)


def started(pose: np.ndarray = START) -> FilterState:
    """A run's start: one pose."""
    return FilterState(ParticleSet(pose[None], np.zeros(1)))


def searched(
    settings: SwarmSettings = SMALL,
    problem: Bowl | None = None,
    start: FilterState | None = None,
    **options: Any,  # noqa: ANN401
) -> tuple[FrameResult, list[LayerRecord], list[ParticleSet]]:
    """A frame with its records and the set after each layer."""
    arguments: dict[str, Any] = {"seed": 3, "frame": 8} | options
    search = FrameSearch(SWARM, start or started(), SPACE, **arguments)
    records, sets = [], []
    while not search.finished:
        records.append(search.step(problem or Bowl(np.zeros(6)), 1, settings))
        assert search.state.particles is not None
        sets.append(search.state.particles)
    return search.result(), records, sets


def test_equation_2_by_hand() -> None:
    # N = 42: 0.1 / 40 a step from 2.05.
    assert acceleration(2, 42, 2.05, 2.15) == pytest.approx(2.05)
    assert acceleration(22, 42, 2.05, 2.15) == pytest.approx(2.10)
    assert acceleration(42, 42, 2.05, 2.15) == pytest.approx(2.15)
    assert acceleration(3, 3, 2.05, 2.15) == pytest.approx(2.15)


@pytest.mark.parametrize(
    ("c", "chi"),
    [
        # φ = 4.1: √(16.81 - 16.4) = √0.41 = 0.6403124; 2 / 2.7403124. Clerc & Kennedy give 0.7298.
        (2.05, 0.7298437881),
        # φ = 4.3: √(18.49 - 17.2) = √1.29 = 1.1357817; 2 / 3.4357817.
        (2.15, 0.5821091654),
        # φ = 4.5: √(20.25 - 18) = 1.5; 2 / 4.
        (2.25, 0.5),
        # φ = 5: √5; 2 / (3 + √5), the golden ratio squared, inverted.
        (2.5, 0.3819660113),
    ],
)
def test_equation_3_by_hand(c: float, chi: float) -> None:
    assert constriction(c) == pytest.approx(chi, abs=1e-9)


class AlgorithmOne:
    """Algorithm 1 as printed, loops over particles and parameters; only p_g waits for the end of an iteration."""

    def __init__(self, settings: SwarmSettings, seed: int, frame: int) -> None:
        self.settings, self.seed, self.frame = settings, seed, frame
        self.layer = 0
        self.visited: list[np.ndarray] = []
        self.number = BEGINNINGS

    def stage(self, start: np.ndarray, sigma: np.ndarray, count: int, iterations: int) -> np.ndarray:
        """p_g of one stage that starts from x̂."""
        dimensions = range(len(start))
        normal = [[self.normal(i, d) for d in dimensions] for i in range(count)]
        uniform = [
            [as_share(self.words(i, OF_VELOCITIES + d - d % 4)[d % 4]) for d in dimensions]
            for i in range(count)
        ]
        x = [[start[d] + normal[i][d] * sigma[d] for d in dimensions] for i in range(count)]
        v = [[(2.0 * uniform[i][d] - 1.0) * sigma[d] for d in dimensions] for i in range(count)]
        own = [list(pose) for pose in x]
        value = [self.fitness(pose) for pose in x]
        best = max(range(count), key=lambda i: (value[i], -i))
        leader, leader_value = list(own[best]), value[best]
        self.visited.append(np.array(x))
        for k in range(2, iterations + 1):
            self.begin_layer()
            c = (self.settings.c_last - self.settings.c_first) / (iterations - 2) * (
                k - 2
            ) + self.settings.c_first
            phi = c + c
            chi = 2.0 / abs(2.0 - phi - math.sqrt(phi**2 - 4.0 * phi))
            luck = [[[self.luck(i, d, of) for d in dimensions] for i in range(count)] for of in range(2)]
            for i in range(count):
                for d in dimensions:
                    drawn = luck[0][i][d] * (own[i][d] - x[i][d]), luck[1][i][d] * (leader[d] - x[i][d])
                    v[i][d] = chi * (v[i][d] + c * drawn[0] + c * drawn[1])
                    v[i][d] = max(-2.0 * sigma[d], min(2.0 * sigma[d], v[i][d]))
                    x[i][d] = x[i][d] + v[i][d]
            for i in range(count):
                found = self.fitness(x[i])
                if found > value[i]:
                    own[i], value[i] = list(x[i]), found
            for i in range(count):
                if value[i] > leader_value:
                    leader, leader_value = list(own[i]), value[i]
            self.visited.append(np.array(x))
        self.begin_layer()
        return np.array(leader)

    def begin_layer(self) -> None:
        """Take the random numbers of one layer after the other."""
        self.number = self.layer
        self.layer += 1

    def words(self, particle: int, place: int) -> tuple[int, ...]:
        """Four words of a particle."""
        return random_words(*map(np.uint64, (self.seed, self.frame, self.number, particle, place)))

    def normal(self, particle: int, parameter: int) -> float:
        """A normal number of a sample: two parameters have a counter."""
        words = self.words(particle, OF_TRIES + parameter - parameter % 2)
        return as_normals(words[0], words[1])[parameter % 2]

    def luck(self, particle: int, parameter: int, of: int) -> float:
        """ε1 or ε2 of a step."""
        words = self.words(particle, OF_TRIES + parameter - parameter % 2)
        return as_share(words[2 * (parameter % 2) + of])

    @staticmethod
    def fitness(pose: list[float]) -> float:
        """The bowl's."""
        return -sum(number * number for number in pose)


def test_the_swarm_is_algorithm_1() -> None:
    result, records, _ = searched(SMALL)
    plain = AlgorithmOne(SMALL, 3, 8)
    root = np.array([1.0, 1.0, 0, 0, 0, 0])
    calmed = np.array([0.1, 1.0, 1, 1, 1, 1])
    first = plain.stage(START, SPACE.sigma * root, 4, 5)
    second = plain.stage(first, SPACE.sigma * calmed, 6, 7)
    assert len(records) == len(plain.visited) == 12
    for record, poses in zip(records, plain.visited, strict=True):
        assert np.allclose(record.poses, poses, rtol=0, atol=1e-6)
    assert np.allclose(result.estimate.pose, second, rtol=0, atol=1e-6)
    assert result.estimate.log_weight == pytest.approx(float(-np.sum(second**2)), abs=1e-6)


def test_velocities_stay_within_two_sigma() -> None:
    far = started(np.full(6, 4.0))
    _, _, sets = searched(dataclasses.replace(SMALL, stage1_particles=200), start=far)
    limit = 2.0 * SPACE.sigma
    for swarm in sets:
        assert np.all(np.abs(swarm.extra[VELOCITIES]) <= limit * swarm.extra[FREEDOM])
    # Far from the optimum some particle flies as fast as it may.
    assert np.abs(sets[2].extra[VELOCITIES]).max() == pytest.approx(limit[0])


def test_the_start_is_sampled_as_the_paper_has_it() -> None:
    settings = dataclasses.replace(SMALL, stage1_particles=2000)
    swarm = SWARM.begin_frame(RandomNumbers.of_beginning(0, 0), started(), SPACE, settings)
    velocities = swarm.extra[VELOCITIES][:, :2]
    assert np.allclose(swarm.poses[:, :2].mean(axis=0), START[:2], atol=4 * 0.3 / math.sqrt(2000))
    assert np.allclose(swarm.poses[:, :2].std(axis=0), 0.3, rtol=0.08)
    assert np.abs(velocities).max() <= 0.3
    assert np.allclose(velocities.std(axis=0), 0.3 / math.sqrt(3), rtol=0.08)
    assert np.array_equal(swarm.poses[:, 2:], np.broadcast_to(START[2:], (2000, 4)))
    still = SWARM.begin_frame(
        RandomNumbers.of_beginning(0, 0),
        started(),
        SPACE,
        dataclasses.replace(settings, start_velocity="zero"),
    )
    assert np.array_equal(still.poses, swarm.poses)
    assert not still.extra[VELOCITIES].any()


@pytest.mark.parametrize("seed", range(4))
def test_the_bottom_of_a_bowl_is_found(seed: int) -> None:
    centre = np.linspace(-0.5, 0.5, 6)
    start = started(np.zeros(6))
    result = None
    for frame in range(6):
        result, _, _ = searched(
            SwarmSettings(position_divisor=2.0), Bowl(centre), start, seed=seed, frame=frame
        )
        start = result.carried
    assert np.abs(result.estimate.pose - centre).max() < 0.05


def test_bests_never_get_worse_within_a_stage() -> None:
    _, records, sets = searched()
    bowl = Bowl(np.zeros(6))
    for stage in (range(4), range(5, 12)):
        leaders = [float(bowl.log_likelihood(sets[layer].extra[LEADER][None])[0]) for layer in stage]
        assert all(later >= earlier for earlier, later in itertools.pairwise(leaders))
    best = max(record.best_log_weight for record in records[5:])
    assert leaders[-1] == pytest.approx(best, abs=1e-12)


def test_first_stage_uses_the_trunk_only() -> None:
    class Watched(Bowl):
        """Records the requested stages."""

        stages: list[int]

        def fitness(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
            """The bowl's."""
            self.stages.append(stage)
            return super().fitness(poses, stage)

    requested = {}
    for partition in ("soft", "soft-three", "hard-two", "global-local", "global"):
        problem = Watched(np.zeros(6))
        problem.stages = []
        settings = dataclasses.replace(SMALL, partition=partition, stage1_iterations=6)
        searched(settings, problem)
        requested[partition] = problem.stages
    for partition in ("soft", "soft-three", "hard-two"):
        assert requested[partition] == [1] * 6 + [0] * 7
    assert set(requested["global-local"]) == set(requested["global"]) == {0}


def test_the_reported_pose_is_the_best_or_the_mean_of_bests() -> None:
    result, _, sets = searched()
    assert np.array_equal(result.estimate.pose, sets[-1].extra[LEADER])
    mean, _, _ = searched(dataclasses.replace(SMALL, estimate="mean"))
    assert np.array_equal(mean.estimate.pose, sets[-1].extra[BEST_POSES].mean(axis=0))
    assert np.array_equal(mean.estimate.mode, result.estimate.pose)


def test_a_frame_starts_from_the_reported_pose() -> None:
    still = dataclasses.replace(SPACE, sigma=np.zeros(6))
    first, _, _ = searched(dataclasses.replace(SMALL, estimate="mean"))
    begun = SWARM.begin_frame(RandomNumbers.of_beginning(0, 9), first.carried, still, SMALL)
    assert np.allclose(begun.poses, first.estimate.pose, atol=0, rtol=0)
    moving = FilterState(first.carried.particles, first.estimate.pose, first.estimate.pose - 0.25)
    ahead = SWARM.begin_frame(
        RandomNumbers.of_beginning(0, 9),
        moving,
        still,
        dataclasses.replace(SMALL, dynamics="constant_velocity"),
    )
    assert np.allclose(ahead.poses, first.estimate.pose + 0.25)


def test_a_repeated_search_starts_from_the_best() -> None:
    _, records, sets = searched(repeats=2)
    assert np.array_equal(records[12].poses[:, 2:], np.broadcast_to(sets[11].extra[LEADER], (4, 6))[:, 2:])


def test_c_moved_takes_effect_with_the_next_layer_and_particles_with_the_next_frame() -> None:
    changed = dataclasses.replace(SMALL, c_last=3.5, stage2_particles=9)

    def records(change_at: int) -> list[LayerRecord]:
        search = FrameSearch(SWARM, started(), SPACE, seed=3, frame=8)
        found = []
        while not search.finished:
            now = SMALL if len(found) < change_at else changed
            found.append(search.step(Bowl(np.zeros(6)), 1, now))
        return found

    plain, moved = records(99), records(8)
    for layer in range(9):
        assert np.array_equal(plain[layer].poses, moved[layer].poses)
    # The layer in which c is new moves the swarm differently: what the next one weighs.
    assert not np.array_equal(plain[8].variance_diffused, moved[8].variance_diffused)
    assert not np.array_equal(plain[9].poses, moved[9].poses)
    assert [len(record.poses) for record in moved] == [4] * 5 + [6] * 7
    assert [len(record.poses) for record in records(0)] == [4] * 5 + [9] * 7


def test_variances_are_of_positions_bests_and_moved_positions() -> None:
    _, records, sets = searched()
    for layer, (record, swarm) in enumerate(zip(records, sets, strict=True)):
        assert np.allclose(record.variance_weighed, record.poses.var(axis=0))
        if layer == 11:
            assert np.array_equal(record.variance_diffused, record.variance_resampled)
        else:
            assert np.array_equal(record.variance_diffused, records[layer + 1].poses.var(axis=0))
        if layer not in (4, 11):
            assert np.array_equal(record.variance_resampled, swarm.extra[BEST_POSES].var(axis=0))


def test_without_a_start_pose_everything_moves_at_first() -> None:
    _, records, _ = searched(start=FilterState(None))
    assert np.all(records[0].poses.std(axis=0) > 0.5)
    result = search_frame(
        SWARM,
        Bowl(np.zeros(6)),
        FilterState(None),
        SPACE,
        seed=1,
        frame=0,
        settings_source=lambda: (1, SwarmSettings(position_divisor=1.0)),
        repeats=3,
    )
    assert np.linalg.norm(result.estimate.pose) < 0.5


def test_a_fitness_that_is_not_finite_raises() -> None:
    class Broken(Bowl):
        """A problem whose fitness is NaN."""

        def fitness(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
            """NaN."""
            return np.full(len(poses), np.nan)

    with pytest.raises(RunError, match="nan"):
        searched(problem=Broken(np.zeros(6)))
