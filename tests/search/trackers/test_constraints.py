"""Redraw, reject, clamp and ignore: handling of impossible poses, for every tracker."""

import dataclasses

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.constraints import MOST_REDRAWS, Indices, Proposals, constrain, possible
from studio.search.trackers.frame_loop import FrameSearch
from studio.search.trackers.particle_swarm import VELOCITIES
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tracker import FilterState, LayerRecord, ParticleSet

SPACE = toy_space(3, limit=1.0)
RULES = AnnealedSettings()


class Picky(Bowl):
    """Accepts poses whose first parameter is at most `most`; counts the calls and remembers `limbs_apart`."""

    def __init__(self, most: float, dimensions: int = 3) -> None:
        super().__init__(np.zeros(dimensions))
        self.most = most
        self.counts: list[int] = []
        self.apart: set[bool] = set()

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        """x0 <= most."""
        self.counts.append(len(poses))
        self.apart.add(limbs_apart)
        return poses[:, 0] <= self.most


def rules(constraints: str, limbs_apart: bool = True) -> AnnealedSettings:
    """Settings with these constraints."""
    return dataclasses.replace(RULES, constraints=constraints, limbs_apart=limbs_apart)


def column(values: list[float]) -> np.ndarray:
    """(N, 3) poses that differ in the first parameter."""
    return np.stack([np.array(values, dtype=float), np.zeros(len(values)), np.zeros(len(values))], axis=1)


def never(rows: Indices) -> Proposals:
    """Another draw is not expected."""
    raise AssertionError(f"drawn again: {rows}")


def test_redraw_draws_only_what_is_impossible_and_stops_when_it_is_not() -> None:
    problem = Picky(0.5)
    draws: list[list[int]] = []

    def again(rows: Indices, attempt: int) -> Proposals:
        draws.append(rows.tolist())
        assert attempt == len(draws)
        # Row 1 is possible with the second draw, row 3 with the fourth.
        values = [0.2 if (row, len(draws)) in {(1, 2), (3, 4)} else 0.9 for row in rows]
        return Proposals(column(values), np.full((len(rows), 3), float(len(draws))))

    first = Proposals(column([0.1, 0.8, 0.3, 0.7]), np.zeros((4, 3)))
    done = constrain(problem, SPACE, rules("redraw"), first, column([0.0] * 4), again)
    assert draws == [[1, 3], [1, 3], [3], [3]]
    assert np.array_equal(done.poses[:, 0], [0.1, 0.2, 0.3, 0.2])
    assert np.array_equal(done.velocities[:, 0], [0.0, 2.0, 0.0, 4.0])
    assert problem.apart == {True}


def test_after_ten_redraws_a_particle_stays_where_it_came_from() -> None:
    problem = Picky(0.5)
    draws: list[int] = []

    def again(rows: Indices, _attempt: int) -> Proposals:
        draws.append(len(rows))
        return Proposals(column([0.9] * len(rows)), np.full((len(rows), 3), 7.0))

    first = Proposals(column([0.1, 0.8]), np.full((2, 3), 3.0))
    done = constrain(problem, SPACE, rules("redraw"), first, column([0.05, 0.4]), again)
    assert draws == [1] * MOST_REDRAWS == [1] * 10
    assert np.array_equal(done.poses[:, 0], [0.1, 0.4])
    assert np.array_equal(done.velocities, [[3.0] * 3, [0.0] * 3])
    assert np.array_equal(first.poses[:, 0], [0.1, 0.8]), "the proposals are not changed"


def test_where_nothing_is_possible_the_first_draw_stays() -> None:
    first = Proposals(column([0.6, 0.8]), np.full((2, 3), 3.0))

    def again(rows: Indices, _attempt: int) -> Proposals:
        return Proposals(column([0.9] * len(rows)), np.zeros((len(rows), 3)))

    done = constrain(Picky(-5.0), SPACE, rules("redraw"), first, column([0.0, 0.0]), again)
    assert done is first


def test_possible_poses_are_unchanged() -> None:
    first = Proposals(column([0.1, 0.2]), np.ones((2, 3)))
    assert constrain(Picky(0.5), SPACE, rules("redraw"), first, column([0, 0]), never) is first


def test_clamp_sets_on_the_limit_and_stops_there() -> None:
    poses = np.array([[1.5, 0.2, -3.0], [0.1, 0.2, 0.3]])
    velocities = np.array([[0.7, 0.1, -0.9], [0.4, 0.5, 0.6]])
    done = constrain(Picky(0.5), SPACE, rules("clamp"), Proposals(poses, velocities), np.zeros((2, 3)), never)
    assert np.array_equal(done.poses, [[1.0, 0.2, -1.0], [0.1, 0.2, 0.3]])
    assert np.array_equal(done.velocities, [[0.0, 0.1, 0.0], [0.4, 0.5, 0.6]])
    # A pose that clamping cannot make possible is rejected.
    assert np.array_equal(possible(Picky(0.5), done.poses, rules("clamp")), [False, True])


def test_reject_and_ignore_move_nothing() -> None:
    first = Proposals(column([2.0, 0.2]), np.ones((2, 3)))
    for constraints in ("reject", "ignore"):
        assert constrain(Picky(0.5), SPACE, rules(constraints), first, first.poses, never) is first
    assert np.array_equal(possible(Picky(0.5), first.poses, rules("reject")), [False, True])
    problem = Picky(0.5)
    assert possible(problem, first.poses, rules("ignore")).all()
    assert not problem.counts


# ----------------------------------------------------------------- in the trackers


def search(name: str, problem: Picky, **changes: object) -> list[LayerRecord]:
    """The layers of a frame that starts at -0.2, noise 0.3."""
    settings = dataclasses.replace(TRACKERS[name].settings_type(), **changes)
    start = FilterState(ParticleSet(np.full((1, 3), -0.2), np.zeros(1)))
    found = FrameSearch(TRACKERS[name], start, toy_space(3), seed=5, frame=1)
    records = []
    while not found.finished:
        records.append(found.step(problem, 1, settings))
    return records


REDRAWING = sorted(set(TRACKERS) - {"tempered"})
"""A tempered frame draws from a density that has no share beyond the limits (`test_tempered`)."""


@pytest.mark.parametrize("limbs_apart", [True, False])
@pytest.mark.parametrize("name", REDRAWING)
def test_every_set_is_possible_with_redraw(name: str, limbs_apart: bool) -> None:
    problem = Picky(-0.15)
    records = search(name, problem, constraints="redraw", limbs_apart=limbs_apart)
    assert all((record.poses[:, 0] <= -0.15).all() for record in records)
    assert problem.apart == {limbs_apart}


@pytest.mark.parametrize("name", REDRAWING)
def test_redraw_gives_the_law_of_the_noise_cut_off(name: str) -> None:
    # First layer, normal noise about -0.2 cut off at -0.15: the mean of a truncated normal, by hand.
    sizes = {"swarm": {"stage1_particles": 2000}}.get(name, {"particles": 2000})
    first = search(name, Picky(-0.15), constraints="redraw", **sizes)[0].poses[:, 0]
    z = 0.05 / 0.3
    density, below = np.exp(-z * z / 2) / np.sqrt(2 * np.pi), 0.5 * (1 + z * 0.7978845608 * (1 - z * z / 6))
    assert first.mean() == pytest.approx(-0.2 - 0.3 * density / below, abs=4 * 0.3 / np.sqrt(2000))
    assert (first == -0.2).mean() < 0.01


@pytest.mark.parametrize("name", REDRAWING)
def test_particles_without_redraw_keep_their_random_numbers(name: str) -> None:
    free, ignored = (
        search(name, Picky(9.0), constraints=constraints) for constraints in ("redraw", "ignore")
    )
    for one, other in zip(free, ignored, strict=True):
        assert np.array_equal(one.poses, other.poses)


@pytest.mark.parametrize("name", sorted(TRACKERS))
def test_a_possible_best_beats_an_impossible_one(name: str) -> None:
    records = search(name, Picky(-0.15), constraints="reject")
    assert any((record.poses[:, 0] > -0.15).any() for record in records)
    for record in records:
        if (record.poses[:, 0] <= -0.15).any():
            assert record.best[0] <= -0.15


def test_a_swarms_particle_that_is_stuck_has_no_velocity() -> None:
    class Narrow(Picky):
        """Only the start itself is possible."""

        def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
            """x0 = -0.2 exactly."""
            return poses[:, 0] == -0.2

    start = FilterState(ParticleSet(np.full((1, 3), -0.2), np.zeros(1)))
    settings = SwarmSettings(partition="global")
    found = FrameSearch(TRACKERS["swarm"], start, toy_space(3), seed=5, frame=1)
    for _ in range(4):
        record = found.step(Narrow(0.0), 1, settings)
        assert np.array_equal(record.poses, np.full((20, 3), -0.2))
        assert not found.state.particles.extra[VELOCITIES].any()


def test_redraws_do_not_depend_on_where_a_frame_was_interrupted() -> None:
    tracker, settings = TRACKERS["swarm"], SwarmSettings(constraints="redraw")
    start = FilterState(ParticleSet(np.full((1, 3), -0.2), np.zeros(1)))
    whole = FrameSearch(tracker, start, toy_space(3), seed=5, frame=1)
    kept = None
    while not whole.finished:
        whole.step(Picky(-0.15), 1, settings)
        kept = kept or (whole.state if whole.state.layers_done == 30 else None)
    resumed = FrameSearch(tracker, start, toy_space(3), seed=5, frame=1, state=kept)
    while not resumed.finished:
        resumed.step(Picky(-0.15), 1, settings)
    assert np.array_equal(resumed.result().estimate.pose, whole.result().estimate.pose)
