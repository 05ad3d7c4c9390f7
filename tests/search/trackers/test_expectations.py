"""Each search informs the frame once of the expected poses; its memory goes to the next frame."""

from collections.abc import Mapping

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.condensation import Condensation
from studio.search.trackers.frame_loop import FrameSearch, SearchState, search_frame
from studio.search.trackers.settings import AnnealedSettings, CondensationSettings
from studio.search.trackers.tracker import FilterState, FrameResult, ParticleSet, SearchSpace

Array = np.ndarray
SPACE = toy_space(6)
SETTINGS = AnnealedSettings(layers=3, particles=40)
START = FilterState(ParticleSet(np.full((1, 6), 0.2), np.zeros(1)))


class Informed(Bowl):
    """A bowl about the mean of the expected poses."""

    def __init__(self, centre: Array, expected: Array, memory: Mapping[str, Array]) -> None:
        super().__init__(centre)
        self.expected, self.memory = expected, memory

    def expecting(self, poses: Array, memory: Mapping[str, Array]) -> "Informed":
        raise AssertionError("informed twice")

    def remembered(self, pose: Array) -> Mapping[str, Array]:
        seen = self.memory.get("seen", np.zeros((0, 6)))
        return {"seen": np.concatenate([seen, pose[None]])}


class Informable(Bowl):
    """A frame whose weights depend on the expected poses."""

    def __init__(self) -> None:
        super().__init__(np.zeros(6))
        self.calls: list[tuple[Array, Mapping[str, Array]]] = []

    def expecting(self, poses: Array, memory: Mapping[str, Array]) -> Informed:
        self.calls.append((poses.copy(), memory))
        return Informed(0.5 * poses.mean(axis=0) + 0.1, poses, memory)

    def remembered(self, pose: Array) -> Mapping[str, Array]:
        return self.expecting(pose[None], {}).remembered(pose)

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        raise AssertionError("weighed before it was informed")


def searched(problem: Bowl, previous: FilterState, repeats: int = 1, frame: int = 3) -> FrameResult:
    return search_frame(
        AnnealedParticleFilter(),
        problem,
        previous,
        SPACE,
        seed=7,
        frame=frame,
        settings_source=lambda: (1, SETTINGS),
        repeats=repeats,
    )


def test_each_search_expects_the_mean_of_its_first_set() -> None:
    problem = Informable()
    result = searched(problem, START, repeats=2)
    assert len(problem.calls) == 2
    (first, memory), (second, _) = problem.calls
    assert first.shape == second.shape == (1, 6)
    assert dict(memory) == {}
    # 40 particles of σ 0.3 about the start pose.
    np.testing.assert_allclose(first[0], 0.2, atol=5 * 0.3 / np.sqrt(40))
    assert not np.allclose(first, second)
    assert result.evaluations == 2 * 3 * 40


def test_the_last_reported_pose_is_expected_and_memory_is_passed_on() -> None:
    problem, carried, poses = Informable(), START, []
    for frame in range(4):
        result = searched(problem, carried, frame=frame)
        carried = result.carried
        poses.append(result.estimate.pose)
    assert [len(expected) for expected, _ in problem.calls] == [1, 2, 3, 3]
    for frame in (1, 2, 3):
        expected, memory = problem.calls[frame]
        np.testing.assert_array_equal(expected[-1], poses[frame - 1])
        if frame > 1:
            np.testing.assert_array_equal(expected[1], 2.0 * poses[frame - 1] - poses[frame - 2])
        np.testing.assert_array_equal(memory["seen"], poses[:frame])
    np.testing.assert_array_equal(carried.memory["seen"], poses)


class Foreseer(AnnealedParticleFilter):
    """Expects three poses."""

    def expectations(self, particles: ParticleSet, space: SearchSpace, settings: AnnealedSettings) -> Array:
        return np.stack([np.full(6, float(place)) for place in (1, 2, 3)])


def test_a_tracker_may_expect_several_poses_the_likeliest_first() -> None:
    problem = Informable()
    search = FrameSearch(
        Foreseer(), FilterState(START.particles, np.full(6, 9.0)), SPACE, seed=1, frame=0, repeats=1
    )
    search.step(problem, 1, SETTINGS)
    assert problem.calls[0][0][:, 0].tolist() == [1, 9, 2, 3]
    assert isinstance(search.problem, Informed)


@pytest.mark.parametrize("stop_after", range(7))
def test_a_resumed_search_expects_the_same(stop_after: int) -> None:
    whole = searched(Informable(), START, repeats=2)
    search = FrameSearch(AnnealedParticleFilter(), START, SPACE, seed=7, frame=3, repeats=2)
    for _ in range(stop_after):
        search.step(Informable(), 1, SETTINGS)
    kept = search.state
    assert isinstance(kept, SearchState)
    resumed = FrameSearch(AnnealedParticleFilter(), START, SPACE, seed=7, frame=3, repeats=2, state=kept)
    while not resumed.finished:
        resumed.step(Informable(), 1, SETTINGS)
    result = resumed.result()
    np.testing.assert_array_equal(result.estimate.pose, whole.estimate.pose)
    np.testing.assert_array_equal(result.carried.memory["seen"], whole.carried.memory["seen"])


def test_plain_problems_are_not_informed_and_have_no_memory() -> None:
    bowl = Bowl(np.full(6, 0.4))
    search = FrameSearch(AnnealedParticleFilter(), START, SPACE, seed=7, frame=3)
    assert search.problem is None
    while not search.finished:
        search.step(bowl, 1, SETTINGS)
    assert search.problem is bowl
    assert dict(search.result().carried.memory) == {}


def test_condensation_passes_memory_on() -> None:
    problem = Informable()
    result = search_frame(
        Condensation(),
        problem,
        START,
        SPACE,
        seed=2,
        frame=0,
        settings_source=lambda: (1, CondensationSettings(particles=50)),
    )
    assert len(problem.calls) == 1
    np.testing.assert_array_equal(result.carried.memory["seen"], result.estimate.pose[None])
