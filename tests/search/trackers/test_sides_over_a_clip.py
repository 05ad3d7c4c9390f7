"""The parts of correcting sides over a clip: paths, movements, frames examined, what is kept; on points and by hand."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.foundations.progress import no_progress
from studio.search.trackers import side_exchange
from studio.search.trackers.agreement import limb_names
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.side_exchange import (
    Exchange,
    Kind,
    _Examined,
    _Work,
    best_path,
    kinds_of,
    moved,
    usual_movement,
    with_sides_right,
)
from studio.search.trackers.start_candidates import facing

Array = np.ndarray
BODY = load_body("human29")
PAIR, WHOLE = (
    Kind(what, np.arange(2), lambda pose: -pose, whole) for what, whole in (("pair", 0), ("all", 1))
)
CHANGE, MOTION = 0.3, 0.1


def work_on(poses: Array, frames: Array | None = None, fps: float = 30.0, *kinds: Kind) -> _Work:
    """The state of a clip of bodies that are one point each: poses (K, 3) are where it is, mm."""
    work, count = _Work.__new__(_Work), len(poses)
    work.body, work.poses, work._fps = BODY, poses.copy(), fps
    work.frames = np.arange(count) if frames is None else frames
    work._kinds = {
        kind: _Examined(np.full(count, np.nan), poses.copy(), np.zeros(count, np.bool_))
        for kind in kinds or (PAIR,)
    }
    work._here, work._share, work._progress = {}, 1.0, no_progress
    work._ends = lambda _, some: some[:, None, :3]
    return work


def along_x(*places: float) -> Array:
    return np.stack([np.array(places), np.zeros(len(places)), np.zeros(len(places))], axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_the_best_path_is_the_best_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 1 + seed
    gains, movements = rng.normal(0.3, 0.6, count), rng.exponential(0.3, (count - 1, 2, 2))
    if seed > 2:
        gains[1] = np.nan

    def cost(path: tuple[int, ...]) -> float:
        own = sum(-gain for gain, exchanged in zip(gains, path, strict=True) if exchanged)
        ways = sum(movements[row][path[row], path[row + 1]] for row in range(count - 1))
        # Nothing is exchanged before and behind the clip.
        changes = np.abs(np.diff([0, *path, 0])).sum()
        return np.inf if np.isnan(own) else own + ways + CHANGE * changes

    every = sorted(itertools.product((0, 1), repeat=count), key=cost)
    found, gained = best_path(gains, movements)
    assert found.tolist() == [bool(one) for one in every[0]]
    assert gained == pytest.approx(cost((0,) * count) - cost(every[0]))


def test_points_move_by_their_root_mean_square_distance() -> None:
    before = np.zeros((2, 2, 3))
    after = np.array([[[3.0, 4.0, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 2.0], [2.0, 0.0, 0.0]]])
    np.testing.assert_allclose(moved(after, before), [np.sqrt(12.5), 2.0])


def test_movements_cost_by_how_far_a_limb_usually_moves_a_frame() -> None:
    """Between frames 2 and 5 three times as far is usual."""
    tracked, exchanged = along_x(0.0, 50.0, 100.0, 400.0), along_x(10.0, 0.0, 90.0, 220.0)
    work = work_on(tracked, np.array([0, 1, 2, 5]))
    work._kinds[PAIR].poses = exchanged
    both = (tracked, exchanged)
    costs = work._movements(PAIR)
    for row, frames in enumerate((1, 1, 3)):
        for before, after in itertools.product((0, 1), repeat=2):
            apart = abs(both[after][row + 1, 0] - both[before][row, 0])
            expected = MOTION * np.log(1.0 + (apart / (50.0 * frames)) ** 2)
            assert costs[row, before, after] == pytest.approx(expected)
    assert work_on(tracked[:1])._movements(PAIR).shape == (0, 2, 2)


def test_a_limb_usually_moves_by_the_median_and_at_least_at_a_metre_a_second() -> None:
    for places, usual in (
        ((0.0, 40.0, 100.0, 300.0), 60.0),
        ((0.0, 1.0, 2.0), 1000.0 / 25.0),
        ((0.0,), 40.0),
    ):
        work = work_on(along_x(*places), fps=25.0)
        assert usual_movement(work.poses[:, None], work._fps) == pytest.approx(usual)


@pytest.mark.parametrize(
    ("fps", "rows"),
    [(30.0, [0, 3, 6, 9, 11]), (4.0, [*range(12)]), (60.0, [0, 6, 11]), (20.0, [0, 2, 4, 6, 8, 10, 11])],
)  # fmt: skip
def test_frames_are_examined_every_tenth_of_a_second_and_at_the_end(fps: float, rows: list[int]) -> None:
    assert work_on(along_x(*range(12)), fps=fps)._grid(PAIR) == rows


def test_the_body_as_a_whole_is_examined_every_half_second_and_both_where_they_jump() -> None:
    still = along_x(*[0.0] * 40)
    assert work_on(still)._grid(WHOLE) == [0, 15, 30, 39]
    # Four times a thirtieth of a metre is no jump yet.
    for far, rows in (
        (4000.0 / 30.0 - 1e-6, [0, 15, 30, 39]),
        (4000.0 / 30.0 + 1e-6, [0, 15, 20, 21, 30, 39]),
    ):
        jumping = still.copy()
        jumping[21:, 0] = far
        assert work_on(jumping)._grid(WHOLE) == rows


def test_a_gain_is_the_logarithm_of_how_much_more_is_explained() -> None:
    work = work_on(along_x(0.0, 1.0, 2.0))
    work._here = {row: (work.poses[row], 6.0) for row in range(3)}
    work._kinds[PAIR].losses[:2] = 3.0, np.inf
    found = [work._gain(PAIR, row) for row in range(3)]
    assert found[:2] == [pytest.approx(np.log(2.0)), -np.inf]
    assert np.isnan(found[2])


def test_a_row_is_examined_once_and_not_where_nothing_is_seen() -> None:
    work, offered = work_on(along_x(5.0, 6.0, 7.0)), []
    work._here = {0: (work.poses[0], 2.0), 1: (work.poses[1], 0.0), 2: (work.poses[2], 2.0)}
    work._offer = lambda kind, row, pose: offered.append((row, *pose))
    known = work._kinds[PAIR]
    known.losses[2] = 1.0
    for row in range(3):
        work._examine(PAIR, row)
    assert offered == [(0, -5.0, 0.0, 0.0)]
    assert known.losses.tolist() == [np.inf, np.inf, 1.0]
    assert known.wanted[0].tolist() == [[[-5.0, 0.0, 0.0]]]
    assert list(known.wanted) == [0]


@pytest.mark.parametrize(
    ("ended", "loss", "taken"),
    [
        (-100.0, 1.997, True),
        (-100.0, 1.999, False),
        (19.0, 1.0, True),
        (21.0, 1.0, False),
    ],
)  # fmt: skip
def test_an_exchange_is_kept_if_it_is_better_and_did_not_return(
    ended: float, loss: float, taken: bool
) -> None:
    """From 100 it is wanted at -100, with 40 mm in favour of the exchange: up to 20 it did not return."""
    work = work_on(along_x(100.0))
    known = work._kinds[PAIR]
    known.losses[0], known.wanted[0] = 2.0, np.array([[[-100.0, 0.0, 0.0]]])
    refined = along_x(ended)[0]
    work._here = {0: (work.poses[0], 9.0)}
    work._refined = lambda row, pose: (refined, loss)
    work._offer(PAIR, 0, along_x(-100.0)[0])
    assert known.losses[0] == (loss if taken else 2.0)
    assert known.poses[0, 0] == (ended if taken else 100.0)


@pytest.mark.parametrize(("loss", "taken"), [(4.99, True), (4.996, False)])
def test_a_neighbours_pose_is_tried_as_the_tracked_one_too(loss: float, taken: bool) -> None:
    work = work_on(along_x(0.0, 300.0))
    known = work._kinds[PAIR]
    known.losses[:], known.wanted[0] = 1.0, np.zeros((1, 1, 3))
    own, other = (work.poses[0], 5.0), (work.poses[1], 3.0)
    work._here = {0: own, 1: other}
    work._refined = lambda row, pose: (pose, loss)
    work._offer(PAIR, 0, along_x(700.0)[0])
    assert work._here[0] is own
    work._offer(PAIR, 0, along_x(700.0)[0], beside=1)
    assert work._here[0] == ((other[0], loss) if taken else own) or not taken
    assert work._here[0][1] == (loss if taken else 5.0)


def test_changes_are_stretches_by_kind_and_what_was_refitted_beside() -> None:
    work = work_on(along_x(*range(8)), np.arange(10, 26, 2), 30.0, PAIR, WHOLE)
    tracked = work.poses.copy()
    work._kinds[PAIR].odd[[1, 2, 7]] = True
    work._kinds[WHOLE].odd[[2]] = True
    work.poses[[1, 2, 4, 5, 7]] += 1.0
    assert work.changes(tracked) == (
        Exchange(12, 14, "pair"),
        Exchange(14, 14, "all"),
        Exchange(18, 20, "refitted"),
        Exchange(24, 24, "pair"),
    )
    work._kinds = {}
    assert work.changes(work.poses) == ()


def test_taken_poses_are_refined_from_their_neighbours_forwards_then_backwards() -> None:
    """A pose's loss is how far it is from 7, plus its row where that is what was offered."""
    work = work_on(along_x(0.0, 1.0, 2.0, 3.0))
    work._loss = lambda row, pose: abs(float(pose[0]) - 7.0)
    asked = []

    def refined(row: int, pose: Array) -> tuple[Array, float]:
        asked.append((row, float(pose[0])))
        return pose, work._loss(row, pose)

    work._refined = refined
    work._kinds[PAIR].poses = along_x(20.0, 9.0, 30.0, 6.0)
    work._take(np.arange(4), work._kinds[PAIR])
    # On the way forward 9 reaches row 2; on the way back 6 reaches all.
    assert asked == [(1, 20.0), (2, 9.0), (3, 9.0), (2, 6.0), (1, 6.0), (0, 6.0)]
    assert work.poses[:, 0].tolist() == [6.0] * 4
    assert [work._here[row][1] for row in range(4)] == [1.0] * 4


def test_long_stretches_are_taken_in_parts_that_go_on_from_the_part_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(side_exchange, "TAKEN_TOGETHER", 2)
    work, asked = work_on(along_x(*range(5))), []
    work._loss = lambda row, pose: 1.0

    def refined(row: int, pose: Array) -> tuple[Array, float]:
        asked.append((row, float(pose[0])))
        return pose, 1.0

    work._refined = refined
    work._take(np.arange(1, 5), work._kinds[PAIR])
    assert asked == [(2, 1.0), (1, 2.0), (3, 2.0), (4, 3.0), (3, 4.0)]
    # What is as good is not taken.
    assert work.poses[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def prepared(work: _Work, gains: dict[Kind, list[float]]) -> list[tuple[Kind, list[int]]]:
    """Fix what is gained by rows; what is taken is told in the list."""
    taken: list[tuple[Kind, list[int]]] = []
    work._grid = lambda kind: []
    work._examine_around = lambda kind, backwards: None
    work._gain = lambda kind, row: gains[kind][row]
    work._backwards = lambda: np.zeros(len(work.frames))
    by_examined = {id(known): kind for kind, known in work._kinds.items()}
    work._take = lambda rows, known: taken.append((by_examined[id(known)], rows.tolist()))
    return taken


def test_the_kind_that_gains_most_is_put_right_first() -> None:
    work = work_on(along_x(*[0.0] * 6), None, 30.0, WHOLE, PAIR)
    taken = prepared(
        work, {WHOLE: [-1.0, 0.9, -1.0, -1.0, -np.inf, np.nan], PAIR: [-1.0, 0.7, 5.0, -1.0, -1.0, 0.7]}
    )
    work._kinds[PAIR].losses[:] = work._kinds[WHOLE].losses[:] = 3.0
    assert work.put_right()
    assert taken == [(PAIR, [1, 2]), (PAIR, [5])]
    assert work._kinds[PAIR].odd.tolist() == [False, True, True, False, False, True]
    assert not work._kinds[WHOLE].odd.any()
    for known in work._kinds.values():
        assert np.isnan(known.losses).tolist() == [False, True, True, False, False, True]
    # Exchanged once more, they are as they were.
    assert work.put_right()
    assert not work._kinds[PAIR].odd.any()


def test_no_gain_beyond_one_counts_and_without_a_gain_nothing_is_put_right() -> None:
    """Twice 0.3 for both changes: 0.6 has to be gained, and more than 1 a frame is none."""
    for gains, done in (([-1.0, 0.61, -1.0], True), ([-1.0, 0.59, -1.0], False), ([-9.0, 0.9, 0.9], True),
                        ([0.29, -1.0, 0.29], False), ([3.0, -2.0, 3.0], True)):  # fmt: skip
        work = work_on(along_x(0.0, 0.0, 0.0))
        taken = prepared(work, {PAIR: gains})
        assert work.put_right() == done
        if gains[0] == 3.0:
            # -2 counts as -1, so that one stretch is as good as two: 1 - 1 + 1 - 0.6 against 2 - 1.2.
            assert taken == [(PAIR, [0]), (PAIR, [2])]
    assert not work_on(np.zeros((0, 3))).put_right()


def test_half_the_gain_a_frame_counts_at_twice_the_rate() -> None:
    for fps, share in ((30.0, 1.0), (60.0, 0.5), (20.0, 1.5), (10.0, 1.5)):
        assert (
            _Work(BODY, (), np.arange(2), np.zeros((2, 29)), fps, dict, RefinementSettings())._share == share
        )


def test_a_body_that_walks_backwards_counts_for_an_exchange_of_its_sides() -> None:
    work = work_on(along_x(*[0.0] * 3), None, 30.0, WHOLE, PAIR)
    taken = prepared(work, {WHOLE: [0.19] * 3, PAIR: [-1.0] * 3})
    assert not work.put_right()
    work._backwards = lambda: np.full(3, 1.0)
    # A tenth of g more in each frame: 3 x 0.29 - 0.6.
    assert work.put_right()
    assert taken == [(WHOLE, [0, 1, 2])]


def walking(steps: Array, turn: float = 0.0) -> tuple[Array, Array]:
    """Poses of a body that goes the way it faces by steps (K - 1,), mm a frame; that way, in the plane."""
    start = standing(BODY, heading=turn)
    names = [entry.name for entry in BODY.parameters]
    ahead = facing(BODY, start[None])[0, :2]
    poses = np.repeat(start[None], len(steps) + 1, axis=0)
    poses[1:, [names.index("pelvis_x"), names.index("pelvis_y")]] += np.cumsum(steps)[:, None] * ahead
    return poses, ahead


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_backwards_is_the_speed_against_the_way_that_the_body_faces(turn: float) -> None:
    for speed, expected in ((600.0, -0.6), (-600.0, 0.6), (-1500.0, 1.0), (1500.0, -1.0)):
        poses, _ = walking(np.full(23, speed / 30.0), turn)
        work = work_on(poses)
        np.testing.assert_allclose(work._backwards(), expected, atol=1e-9)
        work.frames = 2 * np.arange(24)
        np.testing.assert_allclose(work._backwards(), np.clip(-speed / 2000.0, -1, 1), atol=1e-9)


def test_backwards_is_measured_over_half_a_second_of_a_body_that_leaves_its_place() -> None:
    steps = np.where(np.arange(39) < 15, 0.0, -20.0)
    poses, ahead = walking(steps)
    places = np.concatenate([[0.0], np.cumsum(steps)])
    found = work_on(poses, fps=20.0)._backwards()
    for row in range(40):
        first, last = max(row - 5, 0), min(row + 5, 39)
        assert found[row] == pytest.approx(-(places[last] - places[first]) / (last - first) * 20.0 / 1000.0)
    longest = np.abs(ahead).max()
    for far, moves in ((301.0, True), (299.0, False)):
        poses, _ = walking(np.full(10, -far / 10.0 / longest))
        assert work_on(poses)._backwards().any() == moves
    sideways, _ = walking(np.full(10, 60.0))
    names = [entry.name for entry in BODY.parameters]
    sideways[:, names.index("heading")] += np.pi / 2.0
    np.testing.assert_allclose(work_on(sideways)._backwards(), 0.0, atol=1e-9)


def test_a_body_twice_as_large_walks_twice_as_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_exchange, "scale_of", lambda body: 2.0)
    poses, _ = walking(np.full(30, -25.0))
    np.testing.assert_allclose(work_on(poses)._backwards(), 0.375, atol=1e-9)
    work = _Work(BODY, (), np.arange(31), poses, 30.0, dict, RefinementSettings())
    kind = kinds_of(BODY)[1]
    expected = limb_ends(BODY, poses)[:, kind.limbs].reshape(31, -1, 3) / 2.0
    np.testing.assert_allclose(work._ends(kind, poses), expected)


def test_rounds_end_where_nothing_gains_or_after_ten(monkeypatch: pytest.MonkeyPatch) -> None:
    for gains, expected in ((3, 4), (99, 10)):
        calls = []

        class Counted:
            poses = np.zeros((1, 3))

            def __init__(self, *_: object) -> None:
                pass

            def put_right(self, calls: list[int] = calls, gains: int = gains) -> bool:
                calls.append(1)
                return len(calls) <= gains

            def changes(self, poses: Array) -> tuple[Exchange, ...]:
                return ()

        monkeypatch.setattr(side_exchange, "_Work", Counted)
        with_sides_right(BODY, (), np.arange(1), np.zeros((1, 3)), 30.0, dict)
        assert len(calls) == expected


def test_an_exchange_moves_its_own_limbs_there_and_back() -> None:
    names, kinds = np.array(limb_names(BODY)), kinds_of(BODY)
    assert [kind.whole for kind in kinds] == [True, False, False]
    assert len(kinds[0].limbs) == len(names)
    pose = standing(BODY, left_hip_swing=0.4, right_knee=0.3, left_shoulder_swing=0.5)
    for kind, part in ((kinds[1], "arm"), (kinds[2], "leg")):
        assert kind.what == f"left and right {part} exchanged"
        assert set(names[kind.limbs]) == {f"left {part}", f"right {part}"}
        offered = kind.offered(pose)
        changed = limb_ends(BODY, offered[None])[0] - limb_ends(BODY, pose[None])[0]
        rest = np.delete(np.arange(len(names)), kind.limbs)
        np.testing.assert_allclose(changed[rest], 0.0, atol=1e-9)
        assert np.abs(changed[kind.limbs]).max() > 50.0


def test_nothing_is_seen_without_border() -> None:
    work = work_on(along_x(0.0))
    refiner = SimpleNamespace(loss_with_pull=lambda pose, views: 4.0)
    for border, loss in (([], 0.0), ([1], 4.0)):
        views = (SimpleNamespace(border=[]), SimpleNamespace(border=border))
        work._sight = lambda row, views=views: (refiner, views)
        assert work._loss(0, work.poses[0]) == loss


def test_an_animal_that_stands_up_cannot_turn_about_itself_between_two_frames_and_people_can() -> None:
    """At 400 degrees a second it turns half round in half a second."""
    mouse, turn = load_body("mouse31"), 1.0
    names = [entry.name for entry in mouse.parameters]
    reared = np.repeat(mouse.neutral[None], 4, axis=0)
    reared[:, names.index("pitch")] = np.radians(-85.0)
    # The search itself turned it in the last frame.
    reared[3, names.index("heading")] = np.pi
    whole = kinds_of(mouse)[0]
    assert whole.whole
    exchanged = reared.copy()
    exchanged[:, names.index("heading")] += np.pi
    work = work_on(reared, np.array([0, 1, 61, 62]), 120.0, whole)
    work.body, work._kinds[whole].poses = mouse, exchanged
    costs = work._movements(whole)
    sudden, slow = [[0.0, turn], [turn, 0.0]], np.zeros((2, 2))
    # It stays in its place, so that nothing else costs anything.
    np.testing.assert_array_equal(costs, [sudden, slow, [[turn, 0.0], [0.0, turn]]])

    person = work_on(np.repeat(BODY.neutral[None], 2, axis=0), None, 120.0, WHOLE)
    person._ends = lambda *_: np.zeros((2, 1, 3))
    person._kinds[WHOLE].poses = person.poses + np.pi
    assert not person._movements(WHOLE).any()
