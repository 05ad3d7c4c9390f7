"""A frame as a black box: what it weighs, counts, holds and refuses; the same function after it travelled as a file."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_arena import EVALUATIONS, JOINTS, PART, WHOLE, ToyArena

from studio.foundations.errors import NotFoundError
from studio.results.arena import making, problem_files
from studio.results.arena.making import frame_start, problems_of_run
from studio.results.arena.problem import ArenaError, BudgetSpentError, Problem
from studio.results.arena.problem_files import read_problems, write_problems
from studio.results.inspection.likelihoods import evaluation_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import changed_settings


def drawn(problem: Problem, count: int = 50, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(problem.lower, problem.upper, (count, problem.dimensions))


def test_it_weighs_what_the_run_weighs(arena: ToyArena) -> None:
    problem, frame = arena.problem(), arena.run.frame(WHOLE)
    poses = drawn(problem)
    assert np.array_equal(problem.log_likelihood(poses), evaluation_of(frame).log_weights(poses))


def test_a_problem_of_a_run_on_a_card_needs_none(arena: ToyArena) -> None:
    on_card = changed_settings(arena.run.frame(WHOLE).settings, {"device": "gpu", "edge_weight": 2.5})
    knobs = making._maps(arena.run, WHOLE, on_card).knobs
    assert (knobs["device"], knobs["edge_weight"]) == ("cpu", 2.5)


def test_a_part_is_searched_and_the_rest_held_as_the_run_reported_it(arena: ToyArena) -> None:
    problem, frame = Problem(arena.part), arena.run.frame(PART)
    assert (problem.parameters, problem.dimensions, problem.units) == (JOINTS, 2, ("rad", "rad"))
    assert frame.result is not None
    poses = drawn(problem)
    whole = np.repeat(frame.result.estimate.pose[None], len(poses), axis=0)
    whole[:, 2:] = poses
    assert np.array_equal(problem.log_likelihood(poses), evaluation_of(frame).log_weights(whole))


def test_the_prior_is_what_the_frame_before_left(arena: ToyArena) -> None:
    before = arena.run.frame(WHOLE - 1).result
    assert before is not None
    assert before.carried.particles is not None
    prior = arena.whole.prior
    assert np.array_equal(prior.start, before.estimate.pose)
    assert np.array_equal(prior.poses, before.carried.particles.poses)
    assert np.exp(prior.log_weights).sum() == pytest.approx(1.0)
    assert np.array_equal(prior.sigma, arena.run.run.record.sigma)


def test_evaluations_are_counted_one_a_pose(arena: ToyArena) -> None:
    problem = arena.problem()
    for count in (1, 7, 0, 30):
        problem.log_likelihood(drawn(problem, count))
    assert problem.evaluations == 38
    assert problem.seconds > 0.0
    assert problem.again().evaluations == 0


def test_improvements_say_when_they_were_met(arena: ToyArena, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = arena.problem()
    weights = iter([np.array([1.0, 3.0, 2.0]), np.array([3.0, 5.0]), np.array([-np.inf])])
    monkeypatch.setattr(Problem, "weigh", lambda self, poses: next(weights))
    poses = drawn(problem, 6)
    for rows in (slice(0, 3), slice(3, 5), slice(5, 6)):
        problem.log_likelihood(poses[rows])
    assert [(one.evaluations, one.log_weight) for one in problem.improvements] == [
        (1, 1.0),
        (2, 3.0),
        (5, 5.0),
    ]
    assert problem.heaviest is not None
    assert np.array_equal(problem.heaviest.pose, poses[4])


def test_a_budget_ends_the_search_with_all_of_it_spent(arena: ToyArena) -> None:
    problem = arena.problem(budget=10)
    problem.log_likelihood(drawn(problem, 8))
    with pytest.raises(BudgetSpentError, match="All 10 evaluations"):
        problem.log_likelihood(drawn(problem, 8))
    with pytest.raises(BudgetSpentError):
        problem.log_likelihood(drawn(problem, 1))
    assert problem.evaluations == 10
    known = problem.weigh(np.concatenate([drawn(problem, 8), drawn(problem, 8)[:2]]))
    assert problem.heaviest is not None
    assert problem.heaviest.log_weight == known.max()


def test_poses_outside_the_bounds_weigh_nothing_and_count(arena: ToyArena) -> None:
    problem = arena.problem()
    poses = drawn(problem, 3)
    poses[1, 2] = problem.upper[2] + 1e-6
    weights = problem.log_likelihood(poses)
    assert np.isfinite(weights).tolist() == [True, False, True]
    assert problem.evaluations == 3
    body = problem.body
    assert np.all(problem.lower >= body.lower)
    assert np.all(problem.upper <= body.upper)
    assert problem.best is not None
    for pose in (problem.best.pose, problem.prior.start):
        assert np.all((pose >= problem.lower) & (pose <= problem.upper))


@pytest.mark.parametrize("given", [np.zeros(4), np.zeros((2, 3)), "poses", None])
def test_what_is_no_batch_of_poses_is_refused(arena: ToyArena, given: object) -> None:
    problem = arena.problem()
    with pytest.raises(ArenaError, match=r"array of shape"):
        problem.log_likelihood(given)  # pyright: ignore[reportArgumentType]
    assert problem.evaluations == 0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_pose_that_is_not_finite_is_refused_by_parameter(arena: ToyArena, value: float) -> None:
    problem = arena.problem()
    poses = drawn(problem, 3)
    poses[2, 1] = value
    with pytest.raises(ArenaError, match=f"given {value} for '{problem.parameters[1]}'"):
        problem.log_likelihood(poses)


def test_the_heaviest_known_pose_weighs_what_it_is_said_to(arena: ToyArena) -> None:
    for definition in (arena.whole, arena.part):
        best, problem = definition.best, Problem(definition)
        assert best is not None
        assert problem.weigh(best.pose[None])[0] == best.log_weight
        assert best.log_weight > problem.start_log_weight
        assert best.log_weight >= problem.weigh(drawn(problem, 5000)).max()
        assert best.hash == definition.hash_of(best.pose, best.log_weight)


def test_a_problem_made_again_is_the_same(arena: ToyArena) -> None:
    (again,) = problems_of_run(arena.run, [WHOLE], evaluations=EVALUATIONS)
    assert again.hash == arena.whole.hash
    assert again.best is not None
    assert arena.whole.best is not None
    assert again.best.hash == arena.whole.best.hash
    assert again.kind == arena.whole.kind
    assert replace(again, lower=again.lower - 1e-9).hash != again.hash


def test_a_search_that_is_ended_gives_nothing(arena: ToyArena) -> None:
    def stop(step: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        problems_of_run(arena.run, [WHOLE], evaluations=EVALUATIONS, report=stop)


def test_what_cannot_be_a_problem_is_refused(arena: ToyArena, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(NotFoundError, match="has no limb and no parameter 'tail'"):
        problems_of_run(arena.run, [WHOLE], ["tail"])
    with pytest.raises(NotFoundError, match="frame 7"):
        frame_start(arena.run, 7)
    hull = replace(WEIGHTINGS["edge-region"], edge_kind="hull")
    monkeypatch.setattr("studio.results.arena.making.WEIGHTINGS", {"edge-region": hull})
    with pytest.raises(ArenaError, match="reads pictures and a hull"):
        frame_start(arena.run, WHOLE)


def test_a_set_that_travelled_weighs_the_same(arena: ToyArena) -> None:
    for made, travelled in zip((arena.whole, arena.part), read_problems(arena.file), strict=True):
        one, other = Problem(made), Problem(travelled)
        poses = drawn(one, 500)
        assert np.array_equal(one.log_likelihood(poses), other.log_likelihood(poses))
        assert travelled.hash == made.hash
        assert (travelled.name, travelled.kind, travelled.about) == (made.name, made.kind, made.about)
        assert travelled.microseconds == made.microseconds
        assert np.array_equal(other.prior.poses, one.prior.poses)
        assert np.array_equal(other.space.hierarchy.depth, one.space.hierarchy.depth)


def test_the_same_set_is_the_same_file_that_numpy_reads_without_pickles(
    arena: ToyArena, tmp_path: Path
) -> None:
    again = write_problems([arena.whole, arena.part], tmp_path / "again.npz")
    assert again.read_bytes() == arena.file.read_bytes()
    with np.load(again, allow_pickle=False) as arrays:
        head = json.loads(arrays["head"].tobytes())
        assert [one["name"] for one in head["problems"]] == [arena.whole.name, arena.part.name]
        assert arrays["0.0.mask"].dtype == np.uint8


def test_problems_of_one_frame_share_its_maps(arena: ToyArena, tmp_path: Path) -> None:
    other = replace(arena.whole, name="other").knowing(np.array(arena.whole.prior.start), -1.0, 1)
    read = read_problems(write_problems([arena.whole, other], tmp_path / "both.npz"))
    assert read[0].maps is read[1].maps


def changed_file(arena: ToyArena, place: Path, **changes: object) -> Path:
    """The set with arrays in place of its own, by names with "__" for what no keyword can have."""
    with np.load(arena.file) as arrays:
        known = {name: arrays[name] for name in arrays.files}
    for name, value in changes.items():
        for key in [key for key in known if key.endswith(name)][:1]:
            known[key] = value(known[key]) if callable(value) else value
    stream = io.BytesIO()
    np.savez_compressed(stream, **known)
    place.write_bytes(stream.getvalue())
    return place


@pytest.mark.parametrize(
    ("entry", "change"),
    [
        ("mask", lambda mask: mask[:-1]),
        ("edges", lambda edges: edges.astype(np.float64)),
        ("matrix", lambda matrix: np.full_like(matrix, np.nan)),
        ("free", lambda free: free + 100),
        ("sigma", lambda sigma: -sigma),
        ("poses", lambda poses: poses[:, :-1]),
        ("start", lambda start: start + 100.0),
        ("head", lambda head: head[:-3]),
        ("head", lambda head: np.frombuffer(head.tobytes().replace(b'"easy"', b'"evil"'), np.uint8)),
        ("held", lambda held: np.array([None] * len(held), dtype=object)),
    ],
)
def test_a_damaged_set_is_refused(arena: ToyArena, tmp_path: Path, entry: str, change: object) -> None:
    damaged = changed_file(arena, tmp_path / "damaged.npz", **{entry: change})
    with pytest.raises(ArenaError, match=r"'damaged\.npz' is not a set of arena problems"):
        read_problems(damaged)


@pytest.mark.parametrize("entry", ["mask", "upper", "best"])
def test_a_set_that_was_changed_has_another_hash(arena: ToyArena, tmp_path: Path, entry: str) -> None:
    def change(array: np.ndarray) -> np.ndarray:
        return array ^ 255 if array.dtype == np.uint8 else array + (1e-7 if entry == "upper" else -1e-7)

    with pytest.raises(ArenaError, match="its hash differs"):
        read_problems(changed_file(arena, tmp_path / "changed.npz", **{entry: change}))


def test_files_that_are_none_and_sets_that_are_too_large(
    arena: ToyArena, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "text.npz").write_text("no archive")
    for name, why in (("text.npz", "is not a set"), ("gone.npz", "cannot be read")):
        with pytest.raises(ArenaError, match=why):
            read_problems(tmp_path / name)
    with pytest.raises(ArenaError, match=r"does not end in \.npz"):
        write_problems([arena.whole], tmp_path / "set.zip")
    with pytest.raises(ArenaError, match="its own name"):
        write_problems([arena.whole, arena.whole], tmp_path / "set.npz")
    with pytest.raises(ArenaError, match="has no known best"):
        write_problems([replace(arena.whole, best=None)], tmp_path / "set.npz")
    monkeypatch.setattr(problem_files, "LARGEST_SET", 1000)
    with pytest.raises(ArenaError, match="Export fewer frames"):
        write_problems([arena.whole], tmp_path / "set.npz")
    assert not (tmp_path / "set.npz").exists()
