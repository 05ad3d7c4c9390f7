"""A frame can be stopped, saved, resumed and replayed; settings may change between its layers."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.foundations.errors import RunError
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.frame_loop import (
    FrameSearch,
    SearchState,
    held_over,
    search_frame,
)
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.tracker import FilterState, FrameResult, LayerRecord, ParticleSet

TRACKER, SPACE = AnnealedParticleFilter(), toy_space(6)
PROBLEM = Bowl(np.full(6, 0.4))
START = FilterState(ParticleSet(np.zeros((1, 6)), np.zeros(1)))
SETTINGS = AnnealedSettings(layers=4, particles=60)


def searched(**options: Any) -> tuple[FrameResult, list[LayerRecord]]:  # noqa: ANN401
    """A whole frame with SETTINGS, and its records."""
    records: list[LayerRecord] = []
    arguments: dict[str, Any] = {"seed": 7, "frame": 3, "settings_source": lambda: (5, SETTINGS)} | options
    result = search_frame(TRACKER, PROBLEM, START, SPACE, on_layer=records.append, **arguments)
    return result, records


def new_search(repeats: int = 1, state: SearchState | None = None) -> FrameSearch:
    """The same frame's search, by hand."""
    return FrameSearch(TRACKER, START, SPACE, seed=7, frame=3, repeats=repeats, state=state)


def test_records_are_numbered_through_the_repeats() -> None:
    PROBLEM.weighed = 0
    result, records = searched(repeats=3)
    assert [record.layer for record in records] == list(range(12))
    assert {record.frame for record in records} == {3}
    assert {record.settings_version for record in records} == {5}
    assert result.layers == 12
    assert result.evaluations == PROBLEM.weighed == 3 * 4 * 60
    assert result.milliseconds == pytest.approx(sum(record.milliseconds for record in records))
    assert all(record.milliseconds > 0 for record in records)


def test_carried_holds_the_final_set_and_two_estimates() -> None:
    first, _ = searched()
    assert first.carried.previous_estimate is None
    assert first.carried.estimate is first.estimate.pose
    second = search_frame(
        TRACKER, PROBLEM, first.carried, SPACE, seed=7, frame=4, settings_source=lambda: (1, SETTINGS)
    )
    assert second.carried.previous_estimate is first.estimate.pose
    assert len(second.carried.particles.raw_log_weights) == 60


@pytest.mark.parametrize("stop_after", range(8))
def test_resuming_a_saved_state_changes_nothing(stop_after: int) -> None:
    whole, _ = searched(repeats=2)
    search = new_search(2)
    for _ in range(stop_after):
        search.step(PROBLEM, 5, SETTINGS)
    resumed = new_search(2, search.state)
    records = []
    while not resumed.finished:
        records.append(resumed.step(PROBLEM, 5, SETTINGS))
    assert [record.layer for record in records] == list(range(stop_after, 8))
    assert np.array_equal(resumed.result().estimate.pose, whole.estimate.pose)
    assert resumed.result().evaluations == whole.evaluations


def test_a_repeat_begins_where_the_search_before_ended() -> None:
    _, records = searched(repeats=2)
    again, at_end = records[4], records[3]
    noise = again.poses - at_end.poses
    assert noise.std() == pytest.approx(0.3, rel=0.15)
    # A repeat has its own random numbers: the noise is not that of the first search.
    assert not np.allclose(noise, records[0].poses)


def test_quick_knobs_change_at_the_next_layer_and_slow_ones_wait() -> None:
    search = new_search()
    changed = dataclasses.replace(SETTINGS, survival=0.2, particles=999, layers=9)
    first = search.step(PROBLEM, 1, SETTINGS)
    second = search.step(PROBLEM, 2, changed)
    assert (first.alpha_reached, second.alpha_reached) == pytest.approx((SETTINGS.survival, 0.2))
    assert (first.settings_version, second.settings_version) == (1, 2)
    assert len(second.poses) == 60
    search.step(PROBLEM, 2, changed)
    search.step(PROBLEM, 2, changed)
    assert search.finished
    assert search.result().settings_version == 2


def test_held_over_keeps_only_slow_knobs() -> None:
    now = dataclasses.replace(SETTINGS, survival=0.3, crossover=0.9, layers=20, carry="mode", start_repeats=9)
    assert held_over(now, SETTINGS) == dataclasses.replace(SETTINGS, survival=0.3, crossover=0.9)


def test_only_the_knob_differs_when_a_frame_is_annealed_again() -> None:
    _, plain = searched()
    changed = dataclasses.replace(SETTINGS, crossover=1.0)
    _, other = searched(settings_source=lambda: (6, changed))
    assert np.array_equal(plain[0].poses, other[0].poses)
    assert not np.array_equal(plain[1].poses, other[1].poses)


def test_misuse_raises() -> None:
    search = new_search()
    with pytest.raises(RunError, match="Frame 3 is not searched"):
        search.result()
    while not search.finished:
        search.step(PROBLEM, 1, SETTINGS)
    with pytest.raises(RunError, match="Frame 3 has no layer left"):
        search.step(PROBLEM, 1, SETTINGS)


def test_random_numbers_of_all_moments_differ() -> None:
    layers = [RandomNumbers(7, frame, layer) for frame in range(3) for layer in range(5)]
    layers += [RandomNumbers.of_beginning(7, frame, search) for frame in range(3) for search in range(4)]
    assert len({numbers.shares(1, 1)[0, 0] for numbers in layers}) == 3 * 5 + 3 * 4
    assert RandomNumbers(7, 2, 20, search=1).beginning.key == RandomNumbers.of_beginning(7, 2, 1).key
