"""The search for a start step by step: which lines are kept, which limbs are drawn and how, where candidates stand."""

import dataclasses
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from toy_problems import Bowl, HalfBowl, toy_space

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames
from studio.evidence.volume.blob_model import cone_blobs
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.tracking_space import Box
from studio.search.trackers import start_candidates as candidates
from studio.search.trackers.initialisation import Effort, StartSearch, confidence, facing_odds, first_noise
from studio.search.trackers.start_candidates import StartCandidates
from studio.search.trackers.start_lines import (
    AtEase,
    Line,
    LineSteps,
    Round,
    _in_parts,
    _pairs,
    _searched_limbs,
)
from studio.search.trackers.tracker import Hierarchy, SearchSpace

Array = np.ndarray
BODY = load_body("human25")
BOX = Box(np.array([-2000.0, -1000.0, 0.0]), np.array([2000.0, 3000.0, 2300.0]))


def test_odds_are_the_margin_by_cameras_and_confidence_their_probability() -> None:
    assert facing_odds(0.6, 4) == pytest.approx(0.6 / (4.0 * 0.03))
    for odds in (-3.0, 0.0, 2.0):
        assert confidence(odds) == pytest.approx(np.exp(odds) / (1.0 + np.exp(odds)))
    assert confidence(np.inf) == 1.0
    assert 0.0 < confidence(-np.inf) < 1e-300


def test_first_noise_is_a_share_of_a_range_and_of_the_root_without_limits_its_own() -> None:
    space = toy_space(6, limit=2.0, sigma=0.3)
    space.lower[[0, 1, 3]] = -np.inf
    scaled = SearchSpace(
        *(getattr(space, name) for name in ("names", "lower", "upper", "sigma", "limb", "hierarchy")),
        scale=2.0,
    )
    # A length and an angle of the root, a free joint, and joints with limits.
    np.testing.assert_allclose(first_noise(scaled), [160.0, 0.25, 0.6, 3.0, 0.6, 0.6])


# ------------------------------------------------------------------ which lines are kept


def search_with(values: dict[float, float], effort: Effort, seed: int = 5) -> StartSearch:
    """A search of poses of one number, which faces the way of its sign."""

    def facing(poses: Array) -> Array:
        return np.sign(poses) * [[1.0, 0.0, 0.0]]

    search = StartSearch(
        Bowl(np.zeros(6)), toy_space(6), np.zeros(6), facing, cameras=2, seed=seed, effort=effort
    )
    search._steps = SimpleNamespace(
        values=lambda poses: np.array([values[float(pose[0])] for pose in poses]),
        evaluations=123,
        problem=SimpleNamespace(problem=SimpleNamespace(log_likelihood=lambda poses: poses[:, 0] * 100.0)),
    )
    return search


def lines(*values: tuple[float, float]) -> list[Line]:
    return [Line(np.array([pose]), value) for pose, value in values]


def numbers(found: list[Line]) -> list[float]:
    return [float(line.pose[0]) for line in found]


def test_the_best_lines_are_kept_and_two_that_face_the_other_way() -> None:
    search = search_with({}, Effort(1, ()))
    some = lines((1.0, 0.5), (-2.0, -5.0), (3.0, 0.9), (-4.0, -1.0), (5.0, 0.7), (-6.0, -3.0))
    assert numbers(search._kept(some, 2)) == [3.0, 5.0, -4.0, -6.0]
    assert numbers(search._kept(some, 4)) == [3.0, 5.0, 1.0, -4.0, -6.0]
    assert numbers(search._kept(some[::2], 2)) == [3.0, 5.0]


def test_what_is_found_says_by_how_much_it_beats_the_other_facing() -> None:
    search = search_with({}, Effort(1, ()))
    found = search._found(lines((2.0, 0.5), (-3.0, 0.2), (4.0, 0.1), (-5.0, -7.0)))
    assert found.pose.tolist() == [2.0]
    assert found.rival.tolist() == [-3.0]
    assert found.margin == pytest.approx(0.3)
    assert found.confidence == pytest.approx(1.0 / (1.0 + np.exp(-0.3 / 0.06)))
    assert (found.agreement, found.log_weight, found.evaluations) == (0.5, 200.0, 123)
    alone = search._found(lines((2.0, 0.5), (4.0, 0.1)))
    assert (alone.margin, alone.rival, alone.agreement, alone.confidence) == (np.inf, None, 1.0, 1.0)


def test_the_best_twenty_of_each_family_begin_a_line_and_the_next_twenty_another() -> None:
    rng = np.random.default_rng(0)
    poses, family = np.arange(75.0)[:, None], np.array([4] * 50 + [1] * 25)
    values = dict(zip(poses[:, 0], rng.normal(size=75), strict=True))
    groups = search_with(values, Effort(2, ()))._groups(StartCandidates(poses, family, fixed=False))
    best = [sorted(poses[family == one][:, 0], key=lambda pose: -values[pose]) for one in (1, 4)]
    expected = [best[0][:20], best[0][20:], best[1][:20], best[1][20:40]]
    assert [group[:, 0].tolist() for group in groups] == expected
    assert len(search_with(values, Effort(1, ()))._groups(StartCandidates(poses, family, fixed=False))) == 2


def test_rounds_improve_what_is_kept_with_random_numbers_and_noise_of_their_own() -> None:
    search = search_with(
        {1.0: 0.1, 2.0: 0.2, -3.0: 0.0, 9.0: -8.0}, Effort(1, (Round(2, 7, 8, 0.5), Round(1, 7, 8, 0.2)))
    )
    told, annealed = [], []

    def improved(
        rng: np.random.Generator, line: Line, others: list[Line], noise: Array, entry: Round
    ) -> Line:
        told.append((float(line.pose[0]), numbers(others), noise, entry, rng.random()))
        return Line(line.pose + np.sign(line.pose) * 0.25, line.value + 1.0)

    def anneal(rng: np.random.Generator, poses: Array, noise: Array, particles: int, layers: int) -> Line:
        annealed.append((noise, particles, layers, rng.random()))
        return Line(poses[0], float(poses[0, 0]) / 10.0)

    search._steps.improved, search._steps.annealed = improved, anneal
    given = StartCandidates(np.array([[1.0], [2.0], [-3.0]]), np.array([0, 1, 2]), fixed=False)
    found = search.run(given, known=np.array([[9.0]]))
    noise = first_noise(toy_space(6))
    for number, (own, particles, layers, drawn) in enumerate(sorted(annealed, key=lambda one: one[3])):
        np.testing.assert_allclose(own, 0.6 * noise)
        assert (particles, layers) == (100, 8)
        assert drawn in [
            np.random.default_rng(np.random.SeedSequence((5, 0x57A27, 0, place))).random()
            for place in range(3)
        ], number
    first = [one for one in told if one[3].lines == 2]
    assert sorted(one[0] for one in first) == [-3.0, 1.0, 2.0]
    assert all(one[1] == [2.0, 1.0, -3.0] for one in first)
    for one in first:
        np.testing.assert_allclose(one[2], 0.5 * noise)
        place = one[1].index(one[0])
        assert one[4] == np.random.default_rng(np.random.SeedSequence((5, 0x57A27, 1, place))).random()
    last = [one for one in told if one[3].lines == 1]
    assert sorted(one[0] for one in last) == [-3.25, 2.25]
    np.testing.assert_allclose(last[0][2], 0.2 * noise)
    assert found.pose.tolist() == [2.5]


# ------------------------------------------------------------------ limbs of a line


def space_of(
    limb: list[int], depth: list[int], pair: list[int], unlimited: tuple[int, ...] = ()
) -> SearchSpace:
    count = len(limb)
    space = toy_space(count, limit=2.0)
    lower, upper = space.lower.copy(), space.upper.copy()
    lower[list(unlimited)] = -np.inf
    tree = Hierarchy(np.array(depth), np.zeros(count, bool), np.zeros(count, np.int64), np.array(pair))
    return SearchSpace(space.names, lower, upper, space.sigma, np.array(limb), tree)


def test_limbs_that_hang_on_the_root_and_have_limits_are_searched_and_those_of_a_kind_in_pairs() -> None:
    space = space_of(
        [0, 0, 1, 1, 2, 2, 3, 4, 5, 5],
        [0, 0, 1, 2, 1, 2, 1, 1, 0, 1],
        [-1, -1, 0, 0, 0, 0, -1, 1, -1, -1],
        (0, 6),
    )
    limbs = _searched_limbs(space)
    assert [limb.tolist() for limb in limbs] == [[2, 3], [4, 5], [7]]
    assert [[one.tolist() for one in pair] for pair in _pairs(space, limbs)] == [[[2, 3], [4, 5]]]


def test_a_long_chain_is_drawn_in_parts_where_the_roots_limits_keep_the_body_off_its_back() -> None:
    depth = [0, *[1] * 3, *[2] * 5]
    bounded = space_of([0, *[1] * 8], depth, [-1] * 9)
    assert [part.tolist() for part in _in_parts(bounded, np.arange(1, 9))] == [[1, 2, 3], [4, 5, 6, 7, 8]]
    assert [part.tolist() for part in _in_parts(bounded, np.arange(1, 8))] == [[*range(1, 8)]]
    free = space_of([0, *[1] * 8], depth, [-1] * 9, (0,))
    assert [part.tolist() for part in _in_parts(free, np.arange(1, 9))] == [[*range(1, 9)]]


def steps_on(problem: Bowl, space: SearchSpace, rest: Array) -> LineSteps:
    return LineSteps(AtEase(problem, rest, np.zeros(len(rest)), 1.0), space, rest)


def test_values_of_impossible_poses_are_a_million_lower_and_all_are_counted() -> None:
    steps = steps_on(HalfBowl(np.zeros(6)), toy_space(6), np.zeros(6))
    poses = np.zeros((3, 6))
    poses[:, 0] = -1.0, 1.0, 0.0
    np.testing.assert_allclose(steps.values(poses), [-1.0, -1.0 - 1e6, 0.0])
    assert steps.evaluations == 3


def test_a_limb_is_drawn_over_its_range_about_its_pose_and_from_other_lines() -> None:
    """Of six times 20 poses 80 lie anywhere, 40 about the limb's own, the last two are other lines'."""
    space = space_of([0, 0, 1, 1, 1], [0, 0, 1, 1, 1], [-1] * 5)
    steps, limb, given = steps_on(Bowl(np.zeros(5)), space, np.zeros(5)), np.array([2, 3]), []
    steps._best_of = lambda rng, line, drawn, count: given.append((drawn, count)) or line
    line = Line(np.array([0.1, 0.2, 1.9, -0.5, 0.3]), 0.0)
    others = [Line(np.full(5, 0.7), 0.0), Line(np.full(5, -0.8), 0.0)]
    steps._with_limb(np.random.default_rng(0), line, limb, others, 20)
    (drawn, count), rng = given[0], np.random.default_rng(0)
    assert (drawn.shape, count) == ((120, 5), 20)
    np.testing.assert_array_equal(drawn[:, [0, 1, 4]], np.tile(line.pose[[0, 1, 4]], (120, 1)))
    np.testing.assert_allclose(drawn[:80, limb], -2.0 + 4.0 * rng.random((80, 2)))
    near = np.clip(line.pose[limb] + 0.12 * 4.0 * rng.standard_normal((40, 2)), -2.0, 2.0)
    np.testing.assert_allclose(drawn[80:118, limb], near[:38])
    np.testing.assert_array_equal(drawn[118:, limb], [[-0.8, -0.8], [0.7, 0.7]])


@pytest.mark.parametrize(("possible", "asked"), [(0, False), (1, False), (2, True)])
def test_a_limb_stays_where_hardly_a_pose_of_it_is_possible(possible: int, asked: bool) -> None:
    space, given = space_of([0, 1], [0, 1], [-1] * 2), []
    problem = Bowl(np.zeros(2))
    problem.feasible = lambda poses, limbs_apart=False: (
        np.arange(len(poses)) < (possible if limbs_apart else 99)
    )
    steps, line = steps_on(problem, space, np.zeros(2)), Line(np.zeros(2), 0.0)
    steps._best_of = lambda rng, line, drawn, count: given.append(len(drawn)) or line
    assert steps._with_limb(np.random.default_rng(0), line, np.array([1]), [], 3) is line
    assert given == ([possible] if asked else [])


def test_a_pair_is_drawn_with_the_other_limb_at_rest_and_the_best_are_combined() -> None:
    """400 poses of each, some of them lines'; the best nineteen of either with the line's own make 400."""
    space, rest = space_of([0, 1, 2], [0, 1, 1], [-1, 0, 0]), np.array([0.0, 0.5, -0.25])
    steps, weighed, given = steps_on(Bowl(np.zeros(3)), space, rest), [], []

    def values(poses: Array) -> Array:
        weighed.append(poses)
        return -np.abs(poses - [0.0, 1.0, -1.0]).sum(axis=1)

    steps.values = values
    steps._best_of = lambda rng, line, drawn, count: given.append((drawn, count)) or line
    line, other = Line(np.array([0.1, 0.2, 0.3]), 0.0), Line(np.array([0.9, 1.0, -1.5]), 0.0)
    steps._with_pair(np.random.default_rng(0), line, (np.array([1]), np.array([2])), [other], 11)
    rng, places = np.random.default_rng(0), []
    for poses, own, twin in ((weighed[0], 1, 2), (weighed[1], 2, 1)):
        assert poses.shape == (400, 3)
        assert (poses[:, 0] == 0.1).all()
        assert (poses[:, twin] == rest[twin]).all()
        expected = -2.0 + 4.0 * rng.random(400)
        expected[:2] = line.pose[own], other.pose[own]
        np.testing.assert_allclose(poses[:, own], expected)
        best = np.argsort(np.abs(expected - (1.0 if own == 1 else -1.0)), kind="stable")[:19]
        places.append([line.pose[own], *expected[best]])
    ((drawn, count),) = given
    assert count == 11
    np.testing.assert_allclose(drawn, [[0.1, one, two] for one in places[0] for two in places[1]])


def test_the_best_is_that_of_a_line_of_what_was_drawn_and_of_a_search_from_there() -> None:
    steps, asked = steps_on(Bowl(np.zeros(2)), space_of([0, 1], [0, 1], [-1] * 2), np.zeros(2)), []
    drawn = np.array([[2.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.6, 0.0]])
    for value, expected in ((-0.1, 0.1), (-0.3, 0.5)):

        def annealed(
            rng: object, poses: Array, noise: Array, particles: int, layers: int, value: float = value
        ) -> Line:
            asked.append((poses[:, 0].tolist(), noise.tolist(), particles, layers))
            return Line(np.array([0.1, 0.0]), value)

        steps.annealed = annealed
        found = steps._best_of(np.random.default_rng(0), Line(np.full(2, 9.0), -0.4), drawn, 3)
        assert found.pose[0] == expected
        assert steps._best_of(np.random.default_rng(0), Line(np.full(2, 9.0), 0.0), drawn, 3).pose[0] == 9.0
    assert asked[0] == ([0.5, 0.6, 1.0], [0.0, 0.0], 3, 5)


def test_a_line_is_improved_limb_by_limb_then_in_pairs_then_as_a_whole() -> None:
    space = space_of([0, 1, 2, 3], [0, 1, 1, 1], [-1, 0, 0, -1])
    steps, told = steps_on(Bowl(np.zeros(4)), space, np.zeros(4)), []

    def step(kind: str):
        def made(rng: object, line: Line, what: object, others: object, count: int) -> Line:
            told.append((kind, np.ravel(what).tolist(), count))
            return Line(line.pose, line.value + 1.0)

        return made

    def annealed(rng: object, poses: Array, noise: Array, particles: int, layers: int) -> Line:
        told.append(("whole", noise.tolist(), particles, layers))
        return Line(poses[0] + 1.0, 4.5)

    steps._with_limb, steps._with_pair, steps.annealed = step("limb"), step("pair"), annealed
    noise = np.arange(4.0)
    found = steps.improved(np.random.default_rng(0), Line(np.zeros(4), 0.0), [], noise, Round(9, 30, 40, 0.1))
    order = np.random.default_rng(0).permutation(3)
    assert told == [
        *(("limb", [int(number) + 1], 30) for number in order),
        ("pair", [1, 2], 30),
        ("whole", [0.0, 1.0, 2.0, 3.0], 40, 10),
    ]
    assert (found.value, found.pose[0]) == (4.5, 1.0)
    assert (
        steps.improved(np.random.default_rng(0), Line(np.zeros(4), 1.0), [], noise, Round(9, 3, 4, 0.1)).value
        == 5.0
    )


def test_an_annealed_search_gives_the_best_possible_pose_and_counts_what_it_weighed() -> None:
    space = toy_space(6, limit=3.0)
    steps = steps_on(HalfBowl(np.array([-0.5, *[0.2] * 5])), space, np.zeros(6))
    start = -np.ones((4, 6))
    found = steps.annealed(np.random.default_rng(0), start, np.full(6, 0.5), 60, 7)
    assert steps.evaluations == 60 * 7
    assert found.value == pytest.approx(steps.problem.log_likelihood(found.pose[None])[0])
    assert found.value > -1.0
    assert found.pose[0] <= 0.0
    assert isinstance(steps._counting, type(threading.Lock()))


# ------------------------------------------------------------------ candidates


def test_attitudes_are_drawn_about_rest_narrowly_and_widely_within_limits() -> None:
    names, rng = [entry.name for entry in BODY.parameters], np.random.default_rng(0)
    found = candidates._attitudes(np.random.default_rng(0), BODY, 400, None)
    wide = np.where(rng.random((400, 1)) < 0.5, 0.12, 0.25)
    normals = rng.standard_normal((400, len(names)))
    for at, entry in enumerate(BODY.parameters):
        if np.isfinite([entry.lower, entry.upper]).all():
            expected = BODY.neutral[at] + wide[:, 0] * (entry.upper - entry.lower) * normals[:, at]
            np.testing.assert_allclose(found[:, at], np.clip(expected, entry.lower, entry.upper))
        else:
            assert (found[:, at] == BODY.neutral[at]).all()
    known = BODY.neutral + np.linspace(-0.05, 0.05, 3)[:, None]
    known = np.clip(known, BODY.lower, BODY.upper)
    mixed = candidates._attitudes(np.random.default_rng(0), BODY, 400, known)
    which = (mixed[:, None] == known).all(axis=2)
    assert 150 < which.any(axis=1).sum() < 250
    assert (which.sum(axis=0) > 30).all()
    np.testing.assert_array_equal(mixed[~which.any(axis=1)], found[~which.any(axis=1)])


def test_a_joint_with_one_limit_stays_at_rest() -> None:
    at, entries = len(BODY.parameters) - 1, list(BODY.parameters)
    for limits in ({"upper": np.inf}, {"lower": -np.inf}):
        entries[at] = dataclasses.replace(BODY.parameters[at], **limits)
        body = dataclasses.replace(BODY, parameters=tuple(entries))
        found = candidates._attitudes(np.random.default_rng(0), body, 20, None)
        assert (found[:, at] == BODY.neutral[at]).all()
        assert np.ptp(found[:, at - 1]) > 0.0


def test_places_are_in_the_middle_half_of_the_box_with_the_feet_on_the_floor() -> None:
    found = candidates._places(np.random.default_rng(0), BODY, BOX, 2000)
    for axis, (low, high) in enumerate(((-1000.0, 1000.0), (0.0, 2000.0))):
        assert low <= found[:, axis].min() < low + 20.0
        assert high - 20.0 < found[:, axis].max() <= high
    assert np.ptp(found[:, 2]) == 0.0
    blobs = cone_blobs(BODY).mixture(BODY, BODY.neutral[None])
    assert found[0, 2] == pytest.approx(blobs.weights @ blobs.means[0, :, 2], abs=30.0)


def test_poses_are_moved_so_that_the_middle_of_their_volume_is_where_it_should_be() -> None:
    rng, root = np.random.default_rng(1), np.arange(6)
    poses = np.clip(BODY.neutral + 0.2 * rng.normal(size=(5, len(BODY.neutral))), BODY.lower, BODY.upper)
    targets = rng.normal(0.0, 800.0, (5, 3))
    moved = candidates._moved(BODY, poses, root, targets)
    blobs = cone_blobs(BODY).mixture(BODY, moved)
    np.testing.assert_allclose(np.einsum("b,nbi->ni", blobs.weights, blobs.means), targets, atol=1e-3)
    lengths = [at for at, entry in enumerate(BODY.parameters) if entry.kind == "length"]
    np.testing.assert_array_equal(np.delete(moved, lengths, axis=1), np.delete(poses, lengths, axis=1))


def test_families_turn_the_rest_pose_about_the_vertical_by_sixteenths() -> None:
    made = candidates.start_candidates(np.random.default_rng(0), BODY, None, BOX, 3)
    assert made.family.tolist() == [number for number in range(16) for _ in range(3)]
    frames = joint_frames(BODY, made.poses)[:, 0, :, :3]
    rest = joint_frames(BODY, BODY.neutral)[0, 0, :, :3]
    for family, frame in zip(made.family, frames, strict=True):
        angle = 2.0 * np.pi * family / 16.0
        turn = np.array(
            [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
        )
        np.testing.assert_allclose(frame, turn @ rest, atol=1e-9)
    np.testing.assert_allclose(candidates.facing(BODY, made.poses), frames[:, :, 0])
    attitudes = candidates._attitudes(np.random.default_rng(0), BODY, 48, None)
    np.testing.assert_array_equal(made.poses[:, 6:], attitudes[:, 6:])


def hull_of(middle: Array, half: Array) -> Hull:
    axes = [np.arange(-size, size, 50.0) + 25.0 + place for place, size in zip(middle, half, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    colours = np.zeros((len(centres), 3), np.float32)
    return Hull(centres, np.full(len(centres), 50.0), colours, colours[:, None], 6, BOX)


def test_candidates_lie_on_a_hull_that_lies_and_not_on_one_that_is_upright() -> None:
    """Along the hull's longest axis, with the middle of their volume in its own."""
    lying = hull_of(np.array([300.0, 400.0, 150.0]), np.array([850.0, 200.0, 150.0]))
    made = candidates.start_candidates(np.random.default_rng(0), BODY, lying, BOX, 2)
    blobs = cone_blobs(BODY).mixture(BODY, made.poses)
    middles = np.einsum("b,nbi->ni", blobs.weights, blobs.means)
    np.testing.assert_allclose(middles, np.tile([300.0, 400.0, 150.0], (len(middles), 1)), atol=1e-3)
    upright = joint_frames(BODY, made.poses)[:, 0, 2, 2]
    extra = made.family >= 16
    assert extra.any()
    assert (upright[extra] < 0.6).all()
    assert (upright[~extra] > 0.9).all()
    tall = hull_of(np.array([0.0, 0.0, 900.0]), np.array([200.0, 200.0, 850.0]))
    stood = candidates.start_candidates(np.random.default_rng(0), BODY, tall, BOX, 2)
    assert (joint_frames(BODY, stood.poses)[stood.family >= 16][:, 0, 2, 2] < 0.6).all()
