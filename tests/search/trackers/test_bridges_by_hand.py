"""The parts of bridging limbs: where a limb is doubtful, which path is best, and which margins; on points, by hand."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.search.trackers import limb_bridging
from studio.search.trackers.limb_bridging import Bridge, _Work
from studio.search.trackers.refinement import RefinementSettings

Array = np.ndarray
BODY = load_body("human29")
LIMB, STIFF = "left arm", "neck"
NEAR_MM, MOTION = 40.0, 0.1


def work_on(places: Array, fps: float = 30.0, frames: Array | None = None) -> _Work:
    """The state of a clip of one point, which lies at places (K,) mm on a line: the limb's first two angles."""
    work, count = _Work.__new__(_Work), len(places)
    work.poses = np.zeros((count, 3))
    work.poses[:, 0] = places
    work._frames, work._fps = np.arange(count) if frames is None else frames, fps
    work._own, work.bridges = {LIMB: [0, 1], STIFF: [2]}, []
    work._ends = lambda limb, poses: np.concatenate(
        [poses[:, None, :1], np.zeros((len(poses), 1, 2))], axis=2
    )
    return work


def flags(count: int, *rows: int) -> Array:
    found = np.zeros(count, np.bool_)
    found[list(rows)] = True
    return found


@pytest.mark.parametrize(
    ("fps", "rows", "expected"),
    [
        (30.0, [4, 5, 11], [(4, 12)]),  # Five frames between them: less than a fifth of a second.
        (30.0, [4, 5, 12], [(4, 6), (12, 13)]),
        (10.0, [4, 6], [(4, 7)]),
        (10.0, [4, 7], [(4, 5), (7, 8)]),
        (2.0, [4, 6], [(4, 5), (6, 7)]),
        (10.0, [*range(10, 30)], [(10, 30)]),  # Two seconds.
        (10.0, [*range(10, 31)], []),
        (10.0, [3, *range(10, 31)], [(3, 4)]),
        (30.0, [], []),
    ],
)
def test_doubtful_frames_that_are_near_make_one_stretch_and_long_ones_none(
    fps: float, rows: list[int], expected: list[tuple[int, int]]
) -> None:
    work = work_on(np.zeros(40), fps)
    work._jumps = lambda limb: flags(40, *rows[::2])
    assert work.stretches(LIMB, flags(40, *rows[1::2])) == expected
    assert work.stretches(STIFF, flags(40, *rows)) == []
    assert work_on(np.zeros(2)).stretches(LIMB, flags(2, 0)) == []


def with_bends(bends: Array) -> Array:
    """(K,) places with second differences (K - 2,)."""
    return np.concatenate([[0.0, 0.0], np.cumsum(np.cumsum(bends))])


def bent_at(row: int, by: float, others: float = 0.0, count: int = 41) -> Array:
    """(K,) places whose second differences are 0 but at a row; `others` : those of all other rows, up and down."""
    bends = others * (-1.0) ** np.arange(count - 2)
    bends[row - 1] = by
    return with_bends(bends)


@pytest.mark.parametrize(
    ("by", "others", "jumps"),
    [(59.0, 0.0, False), (61.0, 0.0, True), (-61.0, 0.0, True), (79.0, 20.0, False), (81.0, 20.0, True)],
)
def test_a_limb_jumps_where_it_bends_far_and_beyond_what_is_usual(
    by: float, others: float, jumps: bool
) -> None:
    """Beside frames that all bend alike, by more than four times their bend."""
    found = work_on(bent_at(20, by, others))._jumps(LIMB)
    assert np.flatnonzero(found).tolist() == ([20] if jumps else [])


def test_a_jump_is_beyond_eight_deviations_of_the_clips_bends() -> None:
    """Bends of 5, 15 and 25 in turn: their median is 15, and 10 their usual distance from it."""
    bound = 15.0 + 8.0 * 1.4826 * 10.0
    for by, jumps in ((bound - 1.0, []), (bound + 1.0, [101])):
        bends = np.tile([5.0, 15.0, 25.0, -5.0, -15.0, -25.0], 34)[:201]
        bends[100] = by
        assert np.flatnonzero(work_on(with_bends(bends))._jumps(LIMB)).tolist() == jumps


@pytest.mark.parametrize(
    ("beside", "jumps"),
    [((7, 8, 33), True), ((7, 32, 33), True), ((8, 32), False), ((0, 1, 2, 38, 39), True)],
)
def test_jumps_stand_out_among_the_twelve_frames_to_either_side(beside: tuple[int, ...], jumps: bool) -> None:
    """Frames 15 to 25 are wild, too, so that with two more of frames 8 to 32 most are."""
    bends = np.zeros(39)
    bends[[row - 1 for row in (*range(15, 26), *beside) if row > 0]] = 30.0
    bends[19] = 100.0
    assert work_on(with_bends(bends))._jumps(LIMB)[20] == jumps


def test_the_ends_of_a_clip_bend_nowhere() -> None:
    found = work_on(np.array([0.0, 500.0, 500.0, 500.0, 500.0, 0.0]))._jumps(LIMB)
    assert not found[[0, -1]].any()


def test_a_limb_usually_moves_by_the_median_and_at_least_at_a_metre_a_second() -> None:
    assert work_on(np.array([0.0, 40.0, 100.0, 400.0]))._usual(LIMB) == 60.0
    assert work_on(np.array([0.0, 1.0, 2.0]), fps=25.0)._usual(LIMB) == 40.0


def offered(places: Array) -> Array:
    """(R, 4, 3) poses of offers at places (R, 4)."""
    return np.concatenate([places[..., None], np.zeros((*places.shape, 2))], axis=2)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("fps", [30.0, 60.0, 10.0])
def test_the_best_path_through_what_is_offered_is_the_best_of_all(seed: int, fps: float) -> None:
    rng, usual = np.random.default_rng(seed), 50.0
    places = rng.uniform(-150.0, 150.0, (5, 4))
    places[[0, -1]] = places[[0, -1], :1]
    places[2, 3] = places[2, 0] + NEAR_MM - 1.0
    places[3, 2] = places[3, 0] + NEAR_MM + 1.0
    losses = rng.uniform(0.2, 2.0, (5, 4))
    losses[1, 0] = 0.0
    work = work_on(places[:, 0], fps)
    work._offers = lambda limb, begin, end: offered(places)
    by_place = {float(place): loss for place, loss in zip(places.ravel(), losses.ravel(), strict=True)}
    work._loss = lambda row, pose: by_place[float(pose[0])]
    for row in (0, 4):
        by_place[float(places[row, 0])] = 1.0
        losses[row] = 1.0
    share = {30.0: 1.0, 60.0: 0.5, 10.0: 1.5}[fps]

    def cost(path: tuple[int, ...]) -> float:
        known = np.where(losses > 0.0, losses, 1.0)
        own = sum(share * np.log(known[row, at] / known[row, 0]) for row, at in enumerate(path))
        same = any(at and abs(places[row, at] - places[row, 0]) < NEAR_MM for row, at in enumerate(path))
        steps = np.diff([places[row, at] for row, at in enumerate(path)])
        return np.inf if same else own + MOTION * np.log(1.0 + (steps / usual) ** 2).sum()

    best = min(itertools.product(range(4), repeat=5), key=cost)
    path, gained = work._path(LIMB, 0, 4, usual)
    assert path[:, 0].tolist() == [places[row, at] for row, at in enumerate(best)]
    assert gained == pytest.approx(cost((0,) * 5) - cost(best))


def test_a_limb_is_offered_on_the_line_and_carried_on_from_either_end() -> None:
    work, refined = work_on(np.array([0.0, 100.0, 200.0, 300.0, 80.0])), []
    work.poses[:, 1], work.poses[:, 2] = np.arange(5.0), 7.0

    def refine(row: int, limb: str, angles: Array) -> Array:
        refined.append((row, limb))
        return np.array([angles[0] + 1.0, angles[1], 9.0])

    work._refined = refine
    found = work._offers(LIMB, 1, 4)
    assert found[:, 0].tolist() == work.poses[1:5].tolist()
    # On a line from 100 to 80; from 100 on, one more each; from 80 back, one more each.
    np.testing.assert_allclose(found[1:3, 1, 0], [100.0 - 20.0 / 3.0 + 1.0, 100.0 - 40.0 / 3.0 + 1.0])
    np.testing.assert_allclose(found[1:3, 1, 1], [2.0, 3.0])
    assert found[:, 2, 0].tolist() == [100.0, 101.0, 102.0, 80.0]
    assert found[:, 3, 0].tolist() == [100.0, 82.0, 81.0, 80.0]
    assert (found[1:3, 1:, 2] == 9.0).all()
    assert set(refined) == {(2, LIMB), (3, LIMB)}


def bridged(
    work: _Work, gains: dict[tuple[int, int], float], first: int, after: int
) -> list[tuple[int, int]]:
    """Bridge a stretch, where a path lifts its inner rows; the first and last rows of all paths that were tried."""
    tried: list[tuple[int, int]] = []
    work._usual = lambda limb: 1.0

    def path(limb: str, begin: int, end: int, usual: float) -> tuple[Array, float]:
        tried.append((begin, end))
        poses = work.poses[begin : end + 1].copy()
        poses[1:-1, 1] = 5.0
        return poses, gains.get((begin, end), 0.0)

    work._path = path
    work.bridge(LIMB, first, after)
    return tried


def test_a_stretch_is_bridged_from_the_margins_that_gain_most() -> None:
    work = work_on(np.zeros(20), frames=np.arange(100, 120))
    tried = bridged(work, {(7, 11): 0.3, (6, 13): 0.5, (4, 11): 0.5}, 8, 11)
    assert sorted(tried) == sorted(itertools.product((7, 6, 4), (11, 12, 14)))
    assert work.bridges == [Bridge(105, 110, LIMB)]
    assert np.flatnonzero(work.poses[:, 1]).tolist() == [5, 6, 7, 8, 9, 10]


@pytest.mark.parametrize(("gain", "done"), [(0.1, False), (0.11, True)])
def test_a_tenth_must_be_gained(gain: float, done: bool) -> None:
    work = work_on(np.zeros(20))
    bridged(work, {(7, 11): gain}, 8, 11)
    assert len(work.bridges) == done
    assert work.poses.any() == done


def test_margins_end_with_the_clip_and_where_frames_are_missing() -> None:
    assert sorted(bridged(work_on(np.zeros(10)), {}, 2, 8)) == [(0, 8), (0, 9), (1, 8), (1, 9)]
    assert bridged(work_on(np.zeros(10)), {}, 0, 8) == []
    assert bridged(work_on(np.zeros(10)), {}, 5, 10) == []
    frames = np.delete(np.arange(21), 13)
    assert sorted(bridged(work_on(np.zeros(20), frames=frames), {}, 8, 11)) == sorted(
        itertools.product((7, 6, 4), (11, 12))
    )


def test_ends_are_those_of_the_limbs_parts_at_a_persons_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limb_bridging, "scale_of", lambda body: 2.0)
    poses = np.stack([BODY.neutral, BODY.neutral + 0.1])
    work = _Work(BODY, (), np.arange(2), poses, 30.0, dict, RefinementSettings(), ())
    parts = [
        n for n, limb in enumerate(BODY.drawn) if limb.name in ("left upper arm", "left forearm", "left hand")
    ]
    found = work._ends(LIMB, poses)
    np.testing.assert_allclose(found, limb_ends(BODY, poses)[:, parts].reshape(2, -1, 3) / 2.0)
    assert "left_elbow" in [BODY.parameters[at].name for at in work._own[LIMB]]


def test_bridges_are_told_in_the_order_of_their_frames_and_limbs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_Work, "stretches", lambda self, limb, lost: [(3, 5)] if lost.any() else [])

    def bridge(self: _Work, limb: str, first: int, after: int) -> None:
        self.bridges.append(Bridge(4 if "leg" in limb else 2, 9, limb))

    monkeypatch.setattr(_Work, "bridge", bridge)
    named = [("left leg", "right arm"), ("left arm",), ()]
    poses = np.repeat(BODY.neutral[None], 3, axis=0)
    _, found = limb_bridging.with_limbs_bridged(BODY, (), np.arange(3), poses, named, 30.0, dict)
    assert [one.limb for one in found] == ["left arm", "right arm", "left leg"]


def test_limbs_that_are_kept_are_neither_bridged_nor_bent(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(_Work, "stretches", lambda self, limb, lost: asked.append(limb) or [])
    poses = np.repeat(BODY.neutral[None], 3, axis=0)
    limb_bridging.with_limbs_bridged(BODY, (), np.arange(3), poses, [(), (), ()], 30.0, dict, kept=[LIMB])
    assert LIMB not in asked
    assert "right arm" in asked
    work = _Work(BODY, (), np.arange(3), poses, 30.0, dict, RefinementSettings(), [LIMB])
    everything = SimpleNamespace(refine=lambda pose, seen: SimpleNamespace(pose=pose + 1.0))
    work._seen = lambda row: (everything, ())
    other = "right arm"
    found = work._refined(1, other, np.full(len(work._own[other]), 0.5))
    np.testing.assert_array_equal(found[work._own[LIMB]], BODY.neutral[work._own[LIMB]])
    np.testing.assert_allclose(found[work._own[other]], 1.5)
