"""What every tracker of the catalogue must keep."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.knobs import knobs_of
from studio.tracking.catalogue import TRACKERS
from studio.tracking.frame_loop import FrameSearch, SearchState, search_frame
from studio.tracking.tracker import Carried, FrameResult, LayerRecord, ParticleSet, SearchSpace

COUNT = 9
START_POSE = np.full(COUNT, 0.6)


@pytest.fixture(params=sorted(TRACKERS))
def name(request: pytest.FixtureRequest) -> str:
    """Every tracker in turn."""
    return request.param


def started(poses: np.ndarray = START_POSE) -> Carried:
    """A run's start: one pose."""
    return Carried(ParticleSet(poses[None], np.zeros(1)))


def run(
    name: str,
    frames: int,
    seed: int = 0,
    space: SearchSpace | None = None,
    **changes: Any,  # noqa: ANN401
) -> tuple[list[FrameResult], list[LayerRecord]]:
    """Some frames of a bowl at the origin."""
    tracker = TRACKERS[name]
    settings = tracker.settings_type(**changes)
    records: list[LayerRecord] = []
    results: list[FrameResult] = []
    for frame in range(frames):
        results.append(
            search_frame(
                tracker,
                Bowl(np.zeros(COUNT)),
                results[-1].carried if results else started(),
                space or toy_space(COUNT),
                seed=seed,
                frame=frame,
                settings_source=lambda: (1, settings),
                on_layer=records.append,
            )
        )
    return results, records


def test_names_agree(name: str) -> None:
    tracker = TRACKERS[name]
    assert tracker.name == name
    assert tracker.label
    names = [entry.name for entry in knobs_of(tracker.settings_type)]
    assert {"particles", "start_repeats", "estimate", "limits"} <= set(names)


def test_shapes(name: str) -> None:
    results, records = run(name, 2, particles=70)
    for record in records:
        assert record.poses.shape == (70, COUNT)
        assert record.log_weights.shape == (70,)
        for vector in (
            record.variance_weighed,
            record.variance_resampled,
            record.variance_diffused,
            record.best,
            record.mean,
        ):
            assert vector.shape == (COUNT,)
            assert np.isfinite(vector).all()
        assert record.best_log_weight == record.log_weights.max()
        assert 0.0 < record.alpha_reached <= 1.0 + 1e-12
        assert record.beta > 0.0
    for result in results:
        layers = TRACKERS[name].layer_count(TRACKERS[name].settings_type())
        assert result.layers == layers
        assert result.evaluations == 70 * layers
        last = result.carried.particles
        assert last is not None
        assert np.exp(last.log_weights).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("limits", ["clamp", "reflect"])
def test_limits_are_kept(name: str, limits: str) -> None:
    space = dataclasses.replace(toy_space(COUNT, sigma=2.0), lower=np.full(COUNT, 0.25))
    results, records = run(name, 3, space=space, limits=limits, particles=200)
    for record in records:
        assert np.all(record.poses >= space.lower)
        assert np.all(record.poses <= space.upper)
    assert np.all(results[-1].estimate.pose >= space.lower - 1e-12)


def test_limits_may_be_ignored(name: str) -> None:
    space = dataclasses.replace(toy_space(COUNT), lower=np.full(COUNT, 0.25))
    results, _ = run(name, 8, space=space, limits="ignore", particles=400)
    assert np.all(results[-1].estimate.pose < 0.25)


def test_same_seed_same_result(name: str) -> None:
    first, records = run(name, 3, seed=5)
    second, again = run(name, 3, seed=5)
    assert np.array_equal(first[-1].estimate.pose, second[-1].estimate.pose)
    for one, other in zip(records, again, strict=True):
        assert np.array_equal(one.poses, other.poses)
    other_seed, _ = run(name, 3, seed=6)
    assert not np.array_equal(first[-1].estimate.pose, other_seed[-1].estimate.pose)


@pytest.mark.parametrize("seed", range(5))
def test_never_worse_than_its_start_on_a_bowl(name: str, seed: int) -> None:
    results, _ = run(name, 3, seed=seed)
    bowl = Bowl(np.zeros(COUNT))
    start = float(bowl.weigh(START_POSE[None])[0])
    reached = [float(bowl.weigh(result.estimate.pose[None])[0]) for result in results]
    assert min(reached) > start
    assert reached[-1] > reached[0]


def test_settings_change_is_seen_at_the_next_layer(name: str) -> None:
    tracker = TRACKERS[name]
    settings = tracker.settings_type(particles=50)
    search = FrameSearch(tracker, started(), toy_space(COUNT), seed=0, frame=0, repeats=2)
    bowl = Bowl(np.zeros(COUNT))
    rate = "survival" if name == "annealed" else "scale_survival"
    before = search.step(bowl, 1, settings)
    after = search.step(bowl, 2, dataclasses.replace(settings, **{rate: 0.2}))
    assert after.alpha_reached == pytest.approx(0.2)
    assert before.alpha_reached != pytest.approx(0.2)
    assert after.settings_version == 2


def test_checkpoint_and_resume_are_bit_identical(name: str) -> None:
    tracker, bowl, space = TRACKERS[name], Bowl(np.zeros(COUNT)), toy_space(COUNT)
    settings = tracker.settings_type(particles=80)

    def finished_from(state: SearchState | None) -> tuple[FrameResult, list[SearchState]]:
        search = FrameSearch(tracker, started(), space, seed=2, frame=4, repeats=3, state=state)
        states = []
        while not search.finished:
            search.step(bowl, 1, settings)
            states.append(search.state)
        return search.result(), states

    whole, states = finished_from(None)
    for state in states[:-1]:
        resumed, _ = finished_from(state)
        assert np.array_equal(resumed.estimate.pose, whole.estimate.pose)
        one, other = resumed.carried.particles, whole.carried.particles
        assert one is not None
        assert other is not None
        assert np.array_equal(one.poses, other.poses)
        assert np.array_equal(one.log_weights, other.log_weights)
        assert one.extra.keys() == other.extra.keys()
        assert all(np.array_equal(one.extra[key], other.extra[key]) for key in one.extra)


def test_a_start_without_a_pose(name: str) -> None:
    tracker = TRACKERS[name]
    settings = tracker.settings_type()
    result = search_frame(
        tracker,
        Bowl(np.zeros(COUNT)),
        Carried(None),
        toy_space(COUNT),
        seed=0,
        frame=0,
        settings_source=lambda: (1, settings),
    )
    # A uniform draw's mean distance from the centre is about √(9 · 25/3) = 8.7.
    assert np.linalg.norm(result.estimate.pose) < 5.0
