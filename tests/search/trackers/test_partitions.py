"""Every partition weighs as many poses, moves only free parameters, and follows the body's tree."""

import dataclasses

import numpy as np
import pytest
from toy_problems import Bowl, toy_hierarchy, toy_space

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import changed
from studio.search.trackers import partitions
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.frame_loop import FrameSearch
from studio.search.trackers.particle_swarm import LEADER, ParticleSwarm
from studio.search.trackers.swarm_settings import PARTITIONS, SwarmSettings
from studio.search.trackers.tracker import FilterState, Hierarchy, ParticleSet

COUNT = 12
SPACE = toy_space(COUNT)
START = np.linspace(-0.4, 0.5, COUNT)


def settings_of(partition: str) -> SwarmSettings:
    """Defaults with another partition."""
    return SwarmSettings(partition=partition)


def sets_of(partition: str) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The poses weighed in each layer, and the best pose after it."""
    swarm = ParticleSwarm()
    search = FrameSearch(swarm, FilterState(ParticleSet(START[None], np.zeros(1))), SPACE, seed=1, frame=2)
    poses, leaders = [], []
    while not search.finished:
        poses.append(search.step(Bowl(np.zeros(COUNT)), 1, settings_of(partition)).poses)
        leaders.append(search.state.particles.extra[LEADER])
    return poses, leaders


@pytest.mark.parametrize("partition", PARTITIONS)
def test_all_weigh_a_thousand_poses_by_default(partition: str) -> None:
    stages = partitions.stages_of(SPACE.hierarchy, settings_of(partition))
    assert sum(stage.particles * stage.iterations for stage in stages) == 1000
    assert sum(stage.iterations for stage in stages) == partitions.layer_count(settings_of(partition))
    assert partitions.evaluations(settings_of(partition)) == 1000
    assert sum(len(poses) for poses in sets_of(partition)[0]) == 1000
    assert all(stage.iterations > 2 for stage in stages)


@pytest.mark.parametrize("partition", PARTITIONS)
@pytest.mark.parametrize(("n1", "n2"), [(7, 13), (9, 20), (33, 64)])
def test_totals_differ_by_half_a_swarm_at_most(partition: str, n1: int, n2: int) -> None:
    settings = changed(
        settings_of(partition),
        {"stage1_particles": n1, "stage2_particles": n2, "stage2_iterations": 41},
    )
    stages = partitions.stages_of(SPACE.hierarchy, settings)
    total = sum(stage.particles * stage.iterations for stage in stages)
    assert total == partitions.evaluations(settings)
    assert abs(total - settings.wanted_evaluations) <= n2 / 2
    if partition not in ("hard-twelve", "global"):
        assert total == settings.wanted_evaluations


@pytest.mark.parametrize("partition", PARTITIONS)
def test_only_free_parameters_move(partition: str) -> None:
    poses, leaders = sets_of(partition)
    stages = partitions.stages_of(SPACE.hierarchy, settings_of(partition))
    for layer, weighed in enumerate(poses):
        moment = partitions.moment_of(stages, layer)
        free = stages[moment.number].freedom > 0.0
        start = START if moment.number == 0 else leaders[layer - moment.iteration]
        assert np.array_equal(weighed[:, ~free], np.broadcast_to(start[~free], weighed[:, ~free].shape))
        assert np.all(weighed[:, free].std(axis=0) > 0.0)


def test_the_soft_partition_is_the_papers() -> None:
    first, second = partitions.stages_of(SPACE.hierarchy, settings_of("soft"))
    assert np.array_equal(first.freedom, [1.0] * 4 + [0.0] * 8)
    assert np.array_equal(second.freedom, [0.1] + [1.0] * 11)
    assert (first.particles, first.iterations, second.particles, second.iterations) == (10, 20, 20, 40)
    undivided = partitions.stages_of(SPACE.hierarchy, changed(settings_of("soft"), {"position_divisor": 1.0}))
    assert np.array_equal(undivided[1].freedom, np.ones(12))


def test_the_other_partitions_by_hand() -> None:
    def freedoms(partition: str) -> list[list[float]]:
        return [
            stage.freedom.tolist() for stage in partitions.stages_of(SPACE.hierarchy, settings_of(partition))
        ]

    root, rest = [1.0] * 4 + [0.0] * 8, [0.0] * 4 + [1.0] * 8
    assert freedoms("soft-three") == [
        root,
        [0.1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0],
        [0.1] + [1.0] * 11,
    ]
    assert freedoms("hard-two") == [root, rest]
    assert freedoms("hard-twelve") == np.eye(12).tolist()
    assert freedoms("global") == [[1.0] * 12]
    assert freedoms("global-local") == [[1.0] * 12, rest]


def test_iterations_are_shared_evenly() -> None:
    stages = partitions.stages_of(SPACE.hierarchy, settings_of("hard-twelve"))
    assert [stage.iterations for stage in stages] == [9] * 4 + [8] * 8
    assert {stage.particles for stage in stages} == {10}


def test_more_subspaces_than_twelve_are_joined() -> None:
    count = 16
    tree = toy_hierarchy(count)
    # Three parameters in subspace 0, one in each of the other thirteen.
    crowded = dataclasses.replace(tree, subspace=np.maximum(np.arange(count) - 2, 0))
    stages = partitions.stages_of(crowded, settings_of("hard-twelve"))
    sizes = [int(stage.freedom.sum()) for stage in stages]
    assert len(sizes) == 12
    assert sum(sizes) == count
    assert sorted(sizes) == [1] * 9 + [2] * 2 + [3]


def test_kinds_of_limbs_are_searched_apart() -> None:
    tree = toy_hierarchy(COUNT)
    pairs = np.array([-1] * 4 + [0, 0, 1, 1, 0, 0, 1, -1])
    stages = partitions.stages_of(dataclasses.replace(tree, pair=pairs), settings_of("global-local"))
    assert [stage.iterations for stage in stages] == [40, 10, 10]
    assert np.array_equal(stages[1].freedom, pairs == 0)
    assert np.array_equal(stages[2].freedom, pairs == 1)


def test_a_body_with_only_a_root_is_searched_whole() -> None:
    zeros = np.zeros(3, dtype=np.int64)
    point = Hierarchy(zeros, np.ones(3, dtype=bool), zeros, zeros - 1)
    for partition in ("hard-two", "global-local"):
        stages = partitions.stages_of(point, settings_of(partition))
        assert all(stage.freedom.all() for stage in stages)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stage1_iterations": 2}, "'stage1_iterations'"),
        ({"stage2_iterations": 1}, "'stage2_iterations'"),
        ({"c_first": 2.0}, "'c_first'"),
        ({"c_last": 1.9}, "'c_last'"),
        ({"partition": "soft-three", "stage2_iterations": 5}, "'stage2_iterations'"),
        ({"partition": "global-local", "stage1_iterations": 5}, "'stage1_iterations'"),
        ({"partition": "hard-twelve", "stage1_particles": 100}, "'stage2_iterations'"),
        ({"partition": "thirteen"}, "'partition'"),
    ],
)
def test_too_few_iterations_and_small_phi_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError, match=message) as caught:
        changed(SwarmSettings(), changes)
    assert caught.value.hint


@pytest.mark.parametrize(
    "wrong", [{"stage1_iterations": 2}, {"stage2_iterations": 2}, {"c_first": 2.0}, {"c_last": 2.0}]
)
def test_settings_made_by_hand_are_checked_too(wrong: dict[str, float]) -> None:
    with pytest.raises(SettingsError):
        SwarmSettings(**wrong)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("tracker", ["annealed", "behaviour", "condensation", "swarm"])
@pytest.mark.parametrize("wanted", [200, 500, 1000, 2000, 4000])
def test_knobs_give_the_requested_evaluations(tracker: str, wanted: int) -> None:
    knobs = knobs_for_evaluations(tracker, wanted)
    settings = changed(TRACKERS[tracker].settings_type(), knobs)
    assert TRACKERS[tracker].evaluations(settings) == wanted


def test_table_1_in_proportion() -> None:
    assert knobs_for_evaluations("swarm", 1000) == {
        "stage1_particles": 10,
        "stage1_iterations": 20,
        "stage2_particles": 20,
        "stage2_iterations": 40,
    }
    doubled = knobs_for_evaluations("swarm", 2000)
    assert (doubled["stage1_particles"], doubled["stage2_particles"]) == (20, 40)
    assert knobs_for_evaluations("annealed", 1000, layers=20) == {"layers": 20, "particles": 50}


@pytest.mark.parametrize(
    ("tracker", "wanted"), [("swarm", 119), ("annealed", 19), ("condensation", 1), ("behaviour", 1)]
)
def test_too_few_evaluations_are_refused(tracker: str, wanted: int) -> None:
    with pytest.raises(SettingsError, match=f"{wanted} evaluations"):
        knobs_for_evaluations(tracker, wanted)


def test_too_many_evaluations_are_refused() -> None:
    with pytest.raises(SettingsError, match="stage1_particles"):
        knobs_for_evaluations("swarm", 10**7)
