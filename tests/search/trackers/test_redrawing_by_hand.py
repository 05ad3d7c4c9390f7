"""How lost limbs are drawn again, step by step; what says that a frame is lost; and edges of a smoothed track."""

import dataclasses
import functools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.model import BodyModel
from studio.evidence.volume.alignment import root_parameters
from studio.search.likelihood.catalogue import LossLimit
from studio.search.trackers import frame_refinement, limb_resampling
from studio.search.trackers.agreement import Disagreement
from studio.search.trackers.limb_colours import Gain
from studio.search.trackers.limb_resampling import Hypothesis, SeenFrame
from studio.search.trackers.limbs_elsewhere import Elsewhere
from studio.search.trackers.loss_detection import Onlooker, Sight, WeightWatch, is_blank, shown_by
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.smoothing import SmoothingSettings, _noise, _stretches, _trusted
from studio.search.trackers.tracker import (
    LOST,
    NO_EVIDENCE,
    TRACKED,
    Estimate,
    FilterState,
    FrameResult,
    ParticleSet,
)

Array = np.ndarray
CAMERAS = ring_of_cameras(2, 160, 120)


@pytest.fixture(scope="module")
def refiner(body: BodyModel) -> Refiner:
    return Refiner(body, CAMERAS, RefinementSettings())


def test_a_limb_is_bent_by_its_angles_with_limits(refiner: Refiner) -> None:
    for limb in ("left arm", "root", "right leg"):
        own = limb_resampling.bent_by(refiner.body, limb)
        expected = [
            at
            for at, entry in enumerate(refiner.body.parameters)
            if entry.limb == limb and entry.kind == "angle" and math.isfinite(entry.upper - entry.lower)
        ]
        assert own == expected


def test_half_of_the_draws_lie_about_a_limbs_pose_and_half_anywhere_in_its_range(refiner: Refiner) -> None:
    """Of 100, 25 with a tenth of the range as deviation, 25 with three tenths, 50 evenly."""
    own = limb_resampling.bent_by(refiner.body, "left arm")
    lower, upper = refiner.lower[own], refiner.upper[own]
    poses = np.stack([refiner.neutral, refiner.neutral + 0.1])
    found = limb_resampling._drawn(np.random.default_rng(0), refiner, poses, own, 100).reshape(2, 100, -1)
    others = np.setdiff1d(np.arange(poses.shape[1]), own)
    np.testing.assert_array_equal(found[:, :, others], np.repeat(poses[:, None, others], 100, axis=1))
    rng = np.random.default_rng(0)
    parts = [
        poses[:, None, own] + spread * (upper - lower) * rng.standard_normal((2, 25, len(own)))
        for spread in (0.1, 0.3)
    ]
    parts.append(lower + (upper - lower) * rng.random((2, 50, len(own))))
    np.testing.assert_allclose(found[:, :, own], np.clip(np.concatenate(parts, axis=1), lower, upper))
    assert len(limb_resampling._drawn(np.random.default_rng(0), refiner, poses[:1], own)) == 1024


def test_the_best_draws_differ_by_four_tenths_of_a_radian_in_some_angle() -> None:
    drawn = np.array([[0.0, 0.0], [0.39, 0.0], [0.41, 9.0], [0.0, 0.41], [2.0, 2.0], [-0.41, 0.0]])
    off = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 3.0])
    # 0.39 first; 0.41 and 0 are too near to it.
    for most, rows in ((1, [1]), (2, [1, 5]), (3, [1, 5, 4]), (9, [1, 5, 4, 3])):
        found = limb_resampling._best_apart(drawn, off, [0, 1] if most == 9 else [0], most)
        expected = rows if most < 9 else [1, 2, 5, 4, 3]
        assert [one.tolist() for one in found] == [drawn[row].tolist() for row in expected]


def test_angles_are_drawn_joint_by_joint_from_the_root_on() -> None:
    mouse = load_body("mouse")
    tail = [
        at for at, entry in enumerate(mouse.parameters) if entry.limb == "tail" and mouse.bounded_angles[at]
    ]
    found = limb_resampling._joints_of(mouse, tail)
    assert [angle for angles in found for angle in angles] == sorted(tail)
    for angles in found:
        assert [set(angles) <= set(joint.parameters) for joint in mouse.joints].count(True) == 1


def test_a_chain_of_eight_is_a_tail_where_limits_keep_a_body_off_its_back() -> None:
    mouse = load_body("mouse")
    root = [int(at) for at in root_parameters(mouse) if mouse.angles[at]]
    tail = next(at for at, entry in enumerate(mouse.parameters) if entry.limb == "tail")

    def limited(*places: int, limit: float) -> BodyModel:
        entries = list(mouse.parameters)
        for at in places:
            entries[at] = dataclasses.replace(entries[at], lower=-limit, upper=limit)
        return dataclasses.replace(mouse, parameters=tuple(entries))

    assert not limb_resampling.has_tail(mouse)
    upright = limited(root[0], limit=1.0)
    assert limb_resampling.has_tail(upright)
    mouse = upright
    # Of seven angles with limits it is drawn at once.
    assert not limb_resampling.has_tail(limited(tail, limit=math.inf))
    assert not limb_resampling.has_tail(load_body("planar_arm4"))


def test_a_body_is_turned_by_half_a_turn_about_the_middle_of_its_trunk() -> None:
    mouse = load_body("mouse")
    pose = mouse.neutral.copy()
    root = root_parameters(mouse)
    pose[root] += np.where(mouse.angles[root], 0.1, 20.0)
    turned = limb_resampling.turned_pose(mouse, pose)
    trunk = [number for number, limb in enumerate(mouse.drawn) if limb.part == "trunk"]
    middle = [limb_ends(mouse, one[None])[0, trunk].mean(axis=(0, 1)) for one in (pose, turned)]
    np.testing.assert_allclose(middle[1], middle[0], atol=1e-6)
    before, after = (joint_frames(mouse, one)[0, 0, :, :3] for one in (pose, turned))
    np.testing.assert_allclose(after, np.diag([-1.0, -1.0, 1.0]) @ before, atol=1e-9)
    rest = np.setdiff1d(np.arange(len(pose)), root)
    np.testing.assert_array_equal(turned[rest], pose[rest])
    assert limb_resampling.turned_pose(load_body("planar_arm4"), np.zeros(4)) is None


def hypothesis(loss: float, **shares: float) -> Hypothesis:
    """With these shares of areas of 10 000 mm² bare."""
    bare = np.array([[1e4 * share for share in shares.values()]])
    off = Disagreement(
        np.full_like(bare, 1e4), 0.0 * bare, bare, tuple(shares), np.zeros((1, len(shares), 4, 2)), [1.0]
    )
    return Hypothesis(np.array([loss]), loss, off)


class Told:
    """A frame whose every answer is planned; what it was asked stands in a list."""

    def __init__(self, body: BodyModel, refiner: Refiner, after: dict[str, Hypothesis] | None = None) -> None:
        self.refiner, self.asked, self.after = refiner, [], after or {}
        self.agreement = SimpleNamespace(of_places=self.places)
        self.silhouettes = ()

    def places(self, poses: Array, silhouettes: object, without: str | None = None) -> Array:
        self.asked.append(("places", len(poses), without))
        return np.arange(len(poses), dtype=float)

    def better(self, than: Hypothesis, start: Array, share: float = 0.85) -> Hypothesis:
        self.asked.append(("better", float(start[0]), share))
        return self.after.get("last", than)

    def best_of(
        self, than: Hypothesis, drawn: Array, own: list[int], share: float = 0.85, most: int = 3
    ) -> Hypothesis:
        limbs = {self.refiner.body.parameters[at].limb for at in own}
        self.asked.append(("best of", tuple(sorted(limbs)), len(drawn), share))
        return self.after.get("+".join(sorted(limbs)), than)

    def refine(self, one: Hypothesis) -> Hypothesis:
        self.asked.append(("refined", one.loss))
        return one


@pytest.fixture(scope="module")
def posed(body: BodyModel) -> Array:
    return standing(body)


def with_pose(one: Hypothesis, pose: Array) -> Hypothesis:
    return dataclasses.replace(one, pose=pose)


def test_doubtful_limbs_are_drawn_once_each_the_worst_first_then_a_lost_one_with_its_twin(
    body: BodyModel, refiner: Refiner, posed: Array
) -> None:
    limbs = ("left arm", "right arm", "left leg", "right leg")

    def of(loss: float, *shares: float) -> Hypothesis:
        return with_pose(hypothesis(loss, **dict(zip(limbs, shares, strict=True))), posed)

    start = of(9.0, 0.031, 0.05, 0.2, 0.029)
    frame = Told(body, refiner, {"left leg": of(8.0, 0.031, 0.02, 0.061, 0.029)})
    found, evaluated = limb_resampling.redrawn(np.random.default_rng(0), start, frame)
    # The leg is drawn and is still lost, the right arm has become sound; so both legs are drawn together.
    assert [one for one in frame.asked if one[0] == "best of"] == [
        ("best of", ("left leg",), 1024, 0.85),
        ("best of", ("left arm",), 1024, 0.85),
        ("best of", ("left leg", "right leg"), 4096, 0.85),
    ]
    assert ("places", 1024, "right leg") in frame.asked
    assert evaluated == 3 * 1024 + 4096
    assert frame.asked[-1] == ("refined", 8.0)
    assert found.loss == 8.0


def test_sound_limbs_are_not_drawn_and_the_last_pose_is_tried_first(
    body: BodyModel, refiner: Refiner, posed: Array
) -> None:
    sound = with_pose(hypothesis(9.0, **{"left arm": 0.0299, "left leg": 0.0}), posed)
    frame = Told(body, refiner)
    assert limb_resampling.redrawn(np.random.default_rng(0), sound, frame) == (sound, 0)
    assert frame.asked == []
    other = dataclasses.replace(sound, loss=3.0)
    frame = Told(body, refiner, {"last": other})
    assert limb_resampling.redrawn(np.random.default_rng(0), sound, frame, np.array([5.0])) == (other, 0)
    assert frame.asked == [("better", 5.0, 0.85), ("refined", 3.0)]
    doubtful = with_pose(hypothesis(9.0, **{"left arm": 0.03, "left leg": 0.06}), posed)
    frame = Told(body, refiner)
    assert limb_resampling.redrawn(np.random.default_rng(0), doubtful, frame) == (doubtful, 2048)
    assert len(frame.asked) == 2


def recoloured_with(
    refiner: Refiner,
    *,
    shown: float,
    now: tuple[float, float],
    then: tuple[float, float],
    loss: float,
    explained: float = 0.93,
) -> tuple[bool, int]:
    """Whether a drawn pose is taken of an arm that shows so much of itself, of which so much changed, and that has such
    a gain and expectation, where all others have such ones and such a share of its loss; and how many were drawn.
    """
    pose = np.zeros(len(refiner.body.parameters))

    def gains_of(poses: Array, limb: str) -> Gain:
        moved = (poses != pose).any(axis=1)
        return Gain(*(np.where(moved, after, before) for before, after in zip(now, then, strict=True)))

    frame = SimpleNamespace(
        refiner=SimpleNamespace(
            body=refiner.body, bounded=refiner.bounded, lower=refiner.lower, upper=refiner.upper,
            refine=lambda start, silhouettes: SimpleNamespace(pose=start),
            loss_with_pull=lambda one, silhouettes: 10.0 * loss,
        ),
        agreement=SimpleNamespace(of_places=lambda poses, silhouettes: np.zeros(len(poses))),
        silhouettes=(),
        hypothesis=lambda one: Hypothesis(one, 10.0 * loss, None),
    )  # fmt: skip
    arms, began_with = {"left arm": Elsewhere(0.0, explained, shown)}, Hypothesis(pose, 10.0, None)
    found, drawn = limb_resampling.recoloured(np.random.default_rng(0), began_with, frame, arms, gains_of)
    return found is not began_with, drawn


def test_a_limb_that_shows_by_itself_is_drawn_elsewhere_only_where_colours_and_silhouettes_plainly_agree(
    refiner: Refiner,
) -> None:
    shows = functools.partial(recoloured_with, refiner, shown=0.5)
    denied, confirmed = (37.0, 150.0), (60.0, 150.0)
    assert shows(now=denied, then=confirmed, loss=0.96) == (False, 0)  # 23 more are not enough
    denied = (-90.0, 150.0)
    assert shows(now=denied, then=confirmed, loss=0.96) == (True, 4096)
    assert shows(now=denied, then=confirmed, loss=0.96, explained=0.92) == (False, 0)
    assert shows(now=denied, then=confirmed, loss=0.98) == (False, 4096)
    assert shows(now=denied, then=(59.0, 150.0), loss=0.96) == (False, 4096)
    assert shows(now=(38.0, 150.0), then=(150.0, 150.0), loss=0.5) == (False, 0)
    assert shows(now=(-90.0, 79.0), then=confirmed, loss=0.5) == (False, 0)
    # One that hardly shows is drawn where colours gain less than expected, and silhouettes need not agree better.
    hardly = functools.partial(recoloured_with, refiner, shown=0.38)
    assert hardly(now=(38.0, 79.0), then=(78.0, 150.0), loss=1.0) == (True, 1024)
    assert hardly(now=(38.0, 79.0), then=(77.0, 150.0), loss=1.0) == (False, 0)
    assert hardly(now=(40.0, 79.0), then=confirmed, loss=0.5) == (False, 0)
    assert hardly(now=denied, then=confirmed, loss=1.01) == (False, 1024)


@pytest.fixture(scope="module")
def tailed() -> Refiner:
    """Of a mouse whose roll has limits, so that its tail of eight angles is drawn joint by joint."""
    mouse = load_body("mouse")
    at = next(int(at) for at in root_parameters(mouse) if mouse.angles[at])
    entries = list(mouse.parameters)
    entries[at] = dataclasses.replace(entries[at], lower=-1.0, upper=1.0)
    return Refiner(dataclasses.replace(mouse, parameters=tuple(entries)), CAMERAS, RefinementSettings())


def test_a_chain_is_drawn_joint_by_joint_from_a_straight_one(tailed: Refiner) -> None:
    """One pose and 160 draws of it for the first joint; of six that are kept 160 each for every other."""
    own, asked = limb_resampling.bent_by(tailed.body, "tail"), []
    pose = tailed.neutral + 0.05
    joints = limb_resampling._joints_of(tailed.body, own)
    frame = Told(tailed.body, tailed)

    def places(poses: Array, silhouettes: object) -> Array:
        asked.append(poses)
        # The last ones are best.
        return -np.arange(len(poses), dtype=float)

    frame.agreement = SimpleNamespace(of_places=places)
    kept, weighed = limb_resampling.drawn_along(np.random.default_rng(0), frame, pose, own)
    assert [len(poses) for poses in asked] == [161] + [6 + 6 * 160] * (len(joints) - 1)
    assert weighed == sum(len(poses) for poses in asked)
    assert kept.shape == (6, len(pose))
    for number, poses in enumerate(asked):
        beyond = [at for later in joints[number + 1 :] for at in later]
        np.testing.assert_array_equal(poses[:, beyond], np.tile(tailed.neutral[beyond], (len(poses), 1)))
        others = np.setdiff1d(np.arange(len(pose)), own)
        np.testing.assert_array_equal(poses[:, others], np.tile(pose[others], (len(poses), 1)))
        if number:
            # What was kept is among the draws: the best that differ, of which the very last is the first.
            np.testing.assert_array_equal(poses[0], asked[number - 1][-1])


@pytest.mark.parametrize(("loss", "turned"), [(9.49, True), (9.5, False)])
def test_a_body_is_turned_round_where_its_loss_is_clearly_lower(
    tailed: Refiner, loss: float, turned: bool
) -> None:
    own = limb_resampling.bent_by(tailed.body, "tail")
    found, other = (with_pose(hypothesis(value, tail=0.5), tailed.neutral) for value in (10.0, loss))
    frame = Told(tailed.body, tailed, {"tail": other})
    frame.hypothesis = lambda pose: with_pose(found, pose)
    frame.refiner = SimpleNamespace(
        refine=lambda pose, views: SimpleNamespace(pose=pose), body=tailed.body, neutral=tailed.neutral,
        lower=tailed.lower, upper=tailed.upper, bounded=tailed.bounded,
    )  # fmt: skip
    one, weighed = limb_resampling._turned_round(np.random.default_rng(0), found, frame, own)
    assert one is (other if turned else found)
    assert weighed > 1000
    # What is drawn of the tail is taken wherever it is better at all.
    assert [asked for asked in frame.asked if asked[0] == "best of"] == [("best of", ("tail",), 6, 1.0)]


def test_a_lost_tail_is_drawn_along_and_then_with_the_body_turned_round(
    tailed: Refiner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limb_resampling, "_turned_round", lambda rng, found, frame, own: (found, 7))
    monkeypatch.setattr(limb_resampling, "drawn_along", lambda rng, frame, pose, own: (pose[None], 100))
    for share, weighed in ((0.061, 107), (0.06, 100)):
        lost = with_pose(hypothesis(9.0, tail=share, trunk=0.0), tailed.neutral)
        frame = Told(tailed.body, tailed)
        assert limb_resampling.redrawn(np.random.default_rng(0), lost, frame) == (lost, weighed)
        assert frame.asked == [("best of", ("tail",), 1, 0.97)]


def test_a_tail_that_disagrees_with_nothing_is_drawn_where_others_leave_something_bare(
    tailed: Refiner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lies before the body; where it should be, the rump is the nearest limb."""
    turns: list[float] = []
    monkeypatch.setattr(
        limb_resampling, "_turned_round", lambda rng, found, frame, own: turns.append(found.loss)
    )
    monkeypatch.setattr(limb_resampling, "drawn_along", lambda rng, frame, pose, own: (pose[None], 100))
    neutral = tailed.body.neutral
    hidden = with_pose(hypothesis(9.0, tail=0.0, root=0.029, head=0.002), neutral)
    frame = Told(tailed.body, tailed, {"tail": with_pose(hypothesis(4.0, tail=0.0, root=0.0), neutral)})
    found, weighed = limb_resampling.redrawn(np.random.default_rng(0), hidden, frame)
    assert (found.loss, weighed) == (4.0, 100)
    assert frame.asked[0] == ("best of", ("tail",), 1, 0.97)
    # A tail that itself agrees is no reason to turn the body round.
    assert not turns
    # What others cover outside is not the tail's, nor does a body without one look for it.
    off = hypothesis(9.0, tail=0.0, root=0.5).off
    outside = dataclasses.replace(off, outside=off.bare, bare=off.outside)
    assert limb_resampling._doubts(outside, ["tail"]) == {"tail": 0.0, "root": 0.5}
    assert limb_resampling._doubts(off, []) == {"tail": 0.0, "root": 0.5}
    # 5000 mm² are bare, and the tail has 10 000.
    assert limb_resampling._doubts(off, ["tail"]) == {"tail": 0.5, "root": 0.5}


def test_another_pose_is_taken_below_its_share_of_the_loss() -> None:
    losses = {1.0: 8.49, 2.0: 8.5, 3.0: 9.69, 4.0: 9.7}
    seen = SeenFrame(
        SimpleNamespace(
            refine=lambda pose, views: SimpleNamespace(pose=pose + 0.0),
            loss_with_pull=lambda pose, views: losses[float(pose[0])],
        ),
        SimpleNamespace(
            of=lambda pose, views: "off", of_places=lambda poses, views: np.abs(poses[:, 0] - 2.9)
        ),
        (),
    )
    than = Hypothesis(np.zeros(1), 10.0, None)
    for place, share, taken in ((1.0, 0.85, True), (2.0, 0.85, False), (3.0, 0.97, True), (4.0, 0.97, False)):
        found = seen.better(than, np.array([place]), share)
        assert (found is not than) == taken
        if taken:
            assert (found.pose[0], found.loss, found.off) == (place, losses[place], "off")
    assert seen.better(than, np.array([2.0])) is than
    # Three of those drawn that disagree least: 3, 2, 4, and not 1.
    drawn = np.array([[1.0], [2.0], [3.0], [4.0]])
    assert seen.best_of(than, drawn, [0], 0.9).pose[0] == 2.0
    assert seen.refine(seen.hypothesis(np.array([1.0]))).loss == 8.49


def test_the_next_frame_starts_at_the_refined_pose_or_in_the_cloud_moved_with_it(refiner: Refiner) -> None:
    size = len(refiner.neutral)
    cloud = refiner.neutral + 0.01 * np.arange(3)[:, None]
    found, pose = refiner.neutral + 0.02, np.clip(refiner.neutral + 0.3, refiner.lower, refiner.upper)
    result = FrameResult(
        0, Estimate(found, found, found, 0.0), 1, 3, 1, 1.0,
        FilterState(ParticleSet(cloud, np.zeros(3)), found, found - 1.0, {"kept": np.ones(1)}),
    )  # fmt: skip
    at, moved = (frame_refinement._carried(result, pose, start, refiner) for start in ("pose", "cloud"))
    np.testing.assert_array_equal(at.particles.poses, np.tile(pose, (3, 1)))
    np.testing.assert_allclose(
        moved.particles.poses, np.clip(cloud + (pose - found), refiner.lower, refiner.upper)
    )
    for carried in (at, moved):
        assert carried.estimate is pose
        assert carried.memory == result.carried.memory
        np.testing.assert_array_equal(carried.previous_estimate, found - 1.0)
    assert at.particles.poses.shape == (3, size)


# ------------------------------------------------------------------ lost frames


LIMIT = LossLimit(spreads=4.0, spread=0.1)


def watch(weights: list[float], overlaps: list[float]) -> WeightWatch:
    return WeightWatch(LIMIT, zip(weights, overlaps, strict=True))


def test_a_weight_is_lost_four_spreads_below_the_median_of_the_last_sixty() -> None:
    """Of 1, 2, 3, 4, 5 over and over the median is 3, and 1 the median distance from it."""
    known = watch([1.0, 2.0, 3.0, 4.0, 5.0] * 4, [0.8] * 20)
    bound = 3.0 - 4.0 * 1.4826
    assert [known.is_lost(bound + by, Sight(0.8, seen=True)) for by in (0.01, -0.01)] == [False, True]
    calm = watch([3.0] * 10, [0.8] * 10)
    assert [calm.is_lost(3.0 - 0.4 + by, Sight(0.8, seen=True)) for by in (0.01, -0.01)] == [False, True]
    few = watch([3.0] * 9, [0.8] * 9)
    assert not few.is_lost(-99.0, Sight(0.8, seen=True))
    for _ in range(31):
        calm.well_tracked(50.0, 0.8)
    # Ten, then 31: of the last sixty most are at 50.
    assert calm.is_lost(49.5, Sight(0.8, seen=True))
    for _ in range(30):
        calm.well_tracked(3.0, 0.8)
    # 30 of 60 are at 3 and 30 at 50: the median between them.
    assert not calm.is_lost(3.0, Sight(0.8, seen=True))


def test_overlap_is_lost_below_half_and_below_its_share_of_the_median() -> None:
    known = watch([0.0] * 10, [0.6, 0.7, 0.8, 0.8, 0.8, 0.8, 0.8, 0.9, 0.9, 0.9])
    for overlap, lost in ((0.681, False), (0.679, True), (math.nan, False)):
        assert known.is_lost(0.0, Sight(overlap, seen=True)) == lost
    unknown = watch([0.0] * 20, [0.8] * 9 + [math.nan] * 11)
    for overlap, lost in ((0.5, False), (0.499, True)):
        assert unknown.is_lost(0.0, Sight(overlap, seen=True)) == lost


def test_a_picture_is_blank_where_every_eighth_pixel_differs_by_less_than_four() -> None:
    evidence = drawn_evidence(load_body("human25"), None, CAMERAS)
    view = evidence.views[0]
    for spread, blank in ((3.9, True), (4.1, False)):
        picture = np.full(view.picture.shape, 90.0)
        picture[::16] += 2.0 * spread
        rows = np.arange(0, picture.shape[0], 8)
        assert picture[rows][:, ::8].std() == pytest.approx(spread, rel=0.01)
        assert is_blank(dataclasses.replace(view, picture=picture)) == blank
    between = np.full(view.picture.shape, 90, np.uint8)
    between[1::8] = 255
    assert is_blank(dataclasses.replace(view, picture=between))
    assert not is_blank(dataclasses.replace(view, picture=between[:0]))


def test_cameras_that_say_nothing_are_named() -> None:
    own = load_body("human25")
    cameras = ring_of_cameras(3)
    shown, nobody = (drawn_evidence(own, pose, cameras) for pose in (own.neutral, None))
    grey = dataclasses.replace(shown.views[0], picture=np.full_like(shown.views[0].picture, 9))
    mixed = dataclasses.replace(shown, views=(grey, nobody.views[1], shown.views[2]))
    blank, empty = shown_by(mixed)
    assert (blank.tolist(), empty.tolist()) == ([True, False, False], [False, True, False])
    assert shown_by(mixed)[0] is blank
    sight = Onlooker(own, cameras).sight(mixed, own.neutral)
    assert sight.seen
    notes = " ".join(sight.notes)
    assert "'cam1'" in sight.notes[0]
    assert "'cam2'" in sight.notes[1]
    assert "cam3" not in notes
    behind = own.neutral.copy()
    far = cameras[2].rotation[2]
    behind[:3] -= 9000.0 * far
    assert "'cam3'" in " ".join(Onlooker(own, cameras).sight(shown, behind).notes)
    gone = dataclasses.replace(
        nobody, views=tuple(dataclasses.replace(view, background=view.picture) for view in nobody.views)
    )
    for quality, seen in ((-np.inf, False), (0.0, True)):

        class Measured:
            lost_evidence = True

            def __init__(self, value: float = quality) -> None:
                self.quality = value

        look = Onlooker(own, cameras).looking(gone, Measured())(own.neutral)
        assert math.isnan(look.overlap)
        assert look.seen == seen
        assert look.called_lost
    assert not Onlooker(own, cameras).looking(gone)(own.neutral).called_lost


# ------------------------------------------------------------------ smoothing


def test_frames_are_trusted_that_are_not_lost_and_agree_enough_or_are_unknown() -> None:
    confidence = np.array([0.5, 0.49, np.nan, 0.9, 0.9])
    states = (TRACKED, TRACKED, TRACKED, LOST, NO_EVIDENCE)
    assert _trusted(confidence, states, SmoothingSettings()).tolist() == [True, False, True, False, False]


def test_noise_is_the_inverse_square_of_confidence_beside_the_usual() -> None:
    found = _noise(np.array([0.8, 0.4, np.nan, 0.8, 0.04, 0.9]))
    np.testing.assert_allclose(found, [1.0, 4.0, 1.0, 1.0, 100.0, (0.8 / 0.9) ** 2])
    np.testing.assert_allclose(_noise(np.full(3, np.nan)), 1.0)
    np.testing.assert_allclose(_noise(np.array([0.0, 0.0, 0.9])), [100.0, 100.0, 1.0 / 9e8**2], rtol=1e-6)


def stretches(
    rows: list[int], places: list[float], angle: bool = True, gap: float = 0.1
) -> list[tuple[int, int]]:
    poses = np.column_stack([np.array(places), np.zeros(len(places))])
    settings = SmoothingSettings(longest_gap=gap)
    found = _stretches(np.array(rows), poses, np.array([angle, True]), 30.0, settings)
    return [(part.start, part.stop) for part in found]


def test_a_track_breaks_where_more_is_missing_than_may_be_filled_and_where_an_angle_jumps() -> None:
    """A tenth of a second at 30 a second is three limbs."""
    assert stretches([0, 1, 5, 6], [0.0] * 4) == [(0, 4)]
    assert stretches([0, 1, 6, 7], [0.0] * 4) == [(0, 2), (2, 4)]
    for by, parts in ((1.49, [(0, 3)]), (1.51, [(0, 1), (1, 3)]), (-1.51, [(0, 1), (1, 3)])):
        assert stretches([0, 1, 2], [0.0, by, by]) == parts
    # In two frames twice as far is no jump; a length never jumps.
    assert stretches([0, 2, 3], [0.0, 2.99, 2.99]) == [(0, 3)]
    assert stretches([0, 2, 3], [0.0, 3.01, 3.01]) == [(0, 1), (1, 3)]
    assert stretches([0, 1, 2], [0.0, 90.0, 90.0], angle=False) == [(0, 3)]
