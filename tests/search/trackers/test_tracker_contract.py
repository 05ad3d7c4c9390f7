"""The contract of every tracker in the catalogue."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.foundations.errors import RunError
from studio.foundations.knobs import knobs_of
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import FrameSearch, SearchState, search_frame
from studio.search.trackers.layer_record import search_notes
from studio.search.trackers.tracker import FilterState, FrameResult, LayerRecord, ParticleSet, SearchSpace

COUNT = 9


def sizes(name: str, count: int) -> dict[str, int]:
    """Knobs of a search of so many particles in each layer."""
    knobs = [knob for names in TRACKERS[name].size_knobs for knob in names]
    return dict.fromkeys((knob for knob in knobs if knob.endswith("particles")), count)


START_POSE = np.full(COUNT, 0.6)


@pytest.fixture(params=sorted(TRACKERS))
def name(request: pytest.FixtureRequest) -> str:
    """Every tracker in turn."""
    return request.param


def started(poses: np.ndarray = START_POSE) -> FilterState:
    """A run's start: one pose."""
    return FilterState(ParticleSet(poses[None], np.zeros(1)))


def run(
    name: str,
    frames: int,
    seed: int = 0,
    space: SearchSpace | None = None,
    problem: Bowl | None = None,
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
                problem or Bowl(np.zeros(COUNT)),
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
    assert {*sizes(name, 1), "start_repeats", "estimate", "constraints", "limbs_apart"} <= set(names)


def test_shapes(name: str) -> None:
    results, records = run(name, 2, **sizes(name, 70))
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
        if np.isnan(record.beta):
            assert np.isnan([record.alpha_wanted, record.alpha_reached, record.beta]).all()
        else:
            assert 0.0 < record.alpha_reached <= 1.0 + 1e-12
            assert record.beta > 0.0 or (name == "tempered" and record.beta == 0.0)
    for result in results:
        layers = TRACKERS[name].layer_count(TRACKERS[name].settings_type())
        assert result.layers == layers
        assert result.evaluations == 70 * layers
        assert result.evaluations == TRACKERS[name].evaluations(
            TRACKERS[name].settings_type(**sizes(name, 70))
        )
        last = result.carried.particles
        assert np.exp(last.log_weights).sum() == pytest.approx(1.0)


class Limited(Bowl):
    """A bowl of a body with the limits of its space."""

    def __init__(self, space: SearchSpace) -> None:
        super().__init__(np.zeros(COUNT))
        self.space = space

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        """Within the limits."""
        return np.all((poses >= self.space.lower) & (poses <= self.space.upper), axis=1)


LIMITED = dataclasses.replace(toy_space(COUNT, sigma=0.6), lower=np.full(COUNT, 0.25))


def skip_unless_a_choice(name: str, constraints: str) -> None:
    """Not every tracker keeps constraints in every way."""
    (knob,) = (entry for entry in knobs_of(TRACKERS[name].settings_type) if entry.name == "constraints")
    if constraints not in knob.choices:
        pytest.skip(f"{name} has no '{constraints}'")


@pytest.mark.parametrize("constraints", ["clamp", "redraw"])
def test_limits_are_kept(name: str, constraints: str) -> None:
    skip_unless_a_choice(name, constraints)
    results, records = run(
        name, 3, space=LIMITED, problem=Limited(LIMITED), constraints=constraints, **sizes(name, 200)
    )
    for record in records:
        assert np.all(record.poses >= LIMITED.lower)
        assert np.all(record.poses <= LIMITED.upper)
    assert np.all(results[-1].estimate.pose >= LIMITED.lower - 1e-12)


def test_rejected_poses_are_weighed_and_never_reported(name: str) -> None:
    # A swarm is sampled about a corner of the limits: one particle of 512 is possible.
    count = 4000 if name == "swarm" else 400
    results, records = run(
        name, 3, space=LIMITED, problem=Limited(LIMITED), constraints="reject", **sizes(name, count)
    )
    # A density without a share beyond the limits draws none there.
    assert any((record.poses < LIMITED.lower).any() for record in records) == (name != "tempered")
    for result in results:
        assert np.all(result.estimate.pose >= LIMITED.lower - 1e-12)


def test_limits_may_be_ignored(name: str) -> None:
    # The best of 400 single particles is near in most parameters only; their mean in all.
    changes = {"estimate": "mean"} if name == "behaviour" else {}
    results, _ = run(
        name, 8, space=LIMITED, problem=Limited(LIMITED), constraints="ignore", **sizes(name, 400), **changes
    )
    assert np.all(results[-1].estimate.pose < 0.25)


@pytest.mark.parametrize("constraints", ["redraw", "reject", "clamp"])
def test_a_body_without_possible_poses_is_still_tracked(name: str, constraints: str) -> None:
    skip_unless_a_choice(name, constraints)

    class Nothing(Bowl):
        """No pose is possible."""

        def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
            """None."""
            return np.zeros(len(poses), dtype=bool)

    results, records = run(
        name, 8, problem=Nothing(np.zeros(COUNT)), constraints=constraints, **sizes(name, 100)
    )
    assert np.linalg.norm(results[-1].estimate.pose) < 0.5 * np.linalg.norm(START_POSE)
    assert len({record.poses.tobytes() for record in records}) == len(records)


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
    start = float(bowl.log_likelihood(START_POSE[None])[0])
    reached = [float(bowl.log_likelihood(result.estimate.pose[None])[0]) for result in results]
    assert min(reached) > start
    # A swarm is resampled around its last estimate: where that was good already, it ends about as good.
    assert reached[-1] > reached[0] or reached[-1] > 0.1 * start


@pytest.mark.parametrize("name", ["annealed", "condensation"])
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


def test_a_change_in_the_middle_of_a_frame_leaves_the_layers_before(name: str) -> None:
    tracker, bowl = TRACKERS[name], Bowl(np.zeros(COUNT))
    settings = tracker.settings_type(**sizes(name, 50))
    changed = dataclasses.replace(settings, diffusion_scale=2.0)

    def records(change_at: int) -> list[LayerRecord]:
        search = FrameSearch(tracker, started(), toy_space(COUNT), seed=0, frame=0, repeats=2)
        found = []
        while not search.finished:
            found.append(search.step(bowl, 1, settings if len(found) < change_at else changed))
        return found

    layers = tracker.layer_count(settings)
    plain, other = records(10**6), records(layers)
    for one, two in zip(plain[:layers], other[:layers], strict=True):
        assert np.array_equal(one.poses, two.poses)
        assert np.array_equal(one.variance_diffused, two.variance_diffused)
    assert not np.array_equal(plain[layers].poses, other[layers].poses)


def test_checkpoint_and_resume_are_bit_identical(name: str) -> None:
    tracker, bowl, space = TRACKERS[name], Bowl(np.zeros(COUNT)), toy_space(COUNT)
    settings = tracker.settings_type(**sizes(name, 80))

    def finished_from(state: SearchState | None) -> tuple[FrameResult, list[SearchState]]:
        search = FrameSearch(tracker, started(), space, seed=2, frame=4, repeats=3, state=state)
        states: list[SearchState] = []
        while not search.finished:
            search.step(bowl, 1, settings)
            states.append(search.state)
        return search.result(), states

    whole, states = finished_from(None)
    # Some of a swarm's 180 layers are enough; they are in all of its stages.
    for state in states[: -1 : max(len(states) // 25, 1)]:
        resumed, _ = finished_from(state)
        assert np.array_equal(resumed.estimate.pose, whole.estimate.pose)
        one, other = resumed.carried.particles, whole.carried.particles
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
        FilterState(None),
        toy_space(COUNT),
        seed=0,
        frame=0,
        settings_source=lambda: (1, settings),
    )
    # A uniform draw's mean distance from the centre is about √(9 · 25/3) = 8.7.
    assert np.linalg.norm(result.estimate.pose) < 5.0


def weights_gone_wrong(kind: str, poses: np.ndarray) -> np.ndarray:
    """Log-weights (N,) as a scene without evidence gives them."""
    if kind == "all equal":
        return np.full(len(poses), -3.0)
    if kind == "one survivor":
        return np.where(np.arange(len(poses)) == len(poses) // 2, 0.0, -1e6)
    if kind == "far below":
        return -1e12 - np.arange(len(poses))
    return np.full(len(poses), {"none possible": -np.inf, "no number": np.nan}[kind])


@pytest.mark.parametrize("kind", ["all equal", "one survivor", "far below"])
def test_weights_that_say_little_leave_a_defined_answer(name: str, kind: str) -> None:
    """And whatever is drawn around them: a set whose covariance is singular is one of these."""

    class Little(Bowl):
        def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
            return weights_gone_wrong(kind, poses)

    results, records = run(name, 3, problem=Little(np.zeros(COUNT)), **sizes(name, 12))
    for result in results:
        assert np.isfinite(result.estimate.pose).all()
        assert np.isfinite(result.estimate.log_weight)
        particles = result.carried.particles
        assert np.isfinite(particles.poses).all()
        assert np.exp(particles.log_weights).sum() == pytest.approx(1.0)
    assert all(np.isfinite(record.poses).all() for record in records)
    notes = [search_notes([one for one in records if one.frame == result.frame]) for result in results]
    equal = [any("All weights were equal" in note for note in of_frame) for of_frame in notes]
    # A set that keeps its members' weights keeps those that hang on a place in the set, not on a pose.
    assert equal == [kind == "all equal"] * len(results) or name == "tempered"


def test_a_usual_search_has_no_notes(name: str) -> None:
    results, records = run(name, 3, **sizes(name, 12))
    assert len(results) == 3
    notes = search_notes(records)
    # Without annealing nothing keeps a sharp likelihood from choosing one particle.
    assert all(note.startswith("One particle held") and name == "condensation" for note in notes)


@pytest.mark.parametrize("kind", ["none possible", "no number"])
def test_without_a_finite_weight_the_frame_is_refused_in_words(name: str, kind: str) -> None:
    class Nothing(Bowl):
        def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
            return weights_gone_wrong(kind, poses)

    with pytest.raises(RunError) as caught:
        run(name, 1, problem=Nothing(np.zeros(COUNT)), **sizes(name, 12))
    assert caught.value.hint
