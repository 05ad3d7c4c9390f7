"""The search for a start pose on a problem whose answer is known: distance from the markers of a pose."""

import numpy as np
import pytest
from numpy.typing import NDArray

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, marker_points
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.tracking_space import Box
from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.runs.search_space import default_sigma, search_space
from studio.search.likelihood.hard_priors import HardPriors
from studio.search.trackers.initialisation import (
    QUICK,
    Effort,
    StartSearch,
    confidence,
    facing_odds,
    first_noise,
)
from studio.search.trackers.start_candidates import HEADINGS, StartCandidates, facing, start_candidates
from studio.search.trackers.start_lines import MARGIN_SCALE, AtEase, Line, LineSteps, Round
from studio.search.trackers.tracker import FrameLikelihood

BODY = load_body("human25")
SPACE = search_space(BODY, default_sigma(BODY, 60.0))
BOX = Box(np.array([-2000.0, -2000.0, 0.0]), np.array([2000.0, 2000.0, 2300.0]))
NAMES = [entry.name for entry in BODY.parameters]


class NearMarkers:
    """Log weight: minus the mean square (in 100 mm) of the distance from a pose's markers."""

    def __init__(self, pose: Array) -> None:
        self.wanted, self.priors = marker_points(BODY, pose)[0], HardPriors(BODY)

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        apart = np.linalg.norm(marker_points(BODY, poses) - self.wanted, axis=2)
        return -np.mean((apart / 100.0) ** 2, axis=1)

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        return self.log_likelihood(poses, stage)

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        return self.priors.hold(poses, limbs_apart=limbs_apart)

    def error(self, pose: Array) -> float:
        return float(np.linalg.norm(marker_points(BODY, pose)[0] - self.wanted, axis=1).mean())


def pose_with(**values: float) -> Array:
    """The rest pose with some parameters changed, degrees and mm."""
    pose = BODY.neutral.copy()
    for name, value in values.items():
        length = BODY.parameters[NAMES.index(name)].kind == "length"
        pose[NAMES.index(name)] = value if length else np.radians(value)
    return pose


def column_hull(middle: tuple[float, float, float], half: tuple[float, float, float]) -> Hull:
    """A hull of 50 mm voxels that fills a box."""
    axes = [np.arange(-h, h, 50.0) + 25.0 + m for m, h in zip(middle, half, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    colours = np.zeros((len(centres), 3), np.float32)
    return Hull(centres, np.full(len(centres), 50.0), colours, colours[:, None], 6, BOX)


def search(problem: FrameLikelihood, seed: int = 3) -> StartSearch:
    return StartSearch(
        problem, SPACE, BODY.neutral, lambda poses: facing(BODY, poses), cameras=4, seed=seed, effort=QUICK
    )


def candidates(middle: tuple[float, float, float], seed: int = 1) -> StartCandidates:
    hull = column_hull(middle, (200.0, 200.0, 850.0))
    return start_candidates(np.random.default_rng(seed), BODY, hull, BOX, 40)


def test_an_attitude_far_from_rest_is_found_and_faces_the_right_way() -> None:
    truth = pose_with(
        pelvis_x=420, pelvis_y=-310, pelvis_z=900, heading=140, left_shoulder_spread=80, left_elbow=70,
        right_shoulder_swing=90, right_elbow=30, left_hip_swing=50, left_knee=60, head_turn=30,
    )  # fmt: skip
    problem = NearMarkers(truth)
    found = search(problem).run(candidates((400.0, -300.0, 900.0)))
    assert problem.error(found.pose) < 40.0
    assert found.log_weight == pytest.approx(problem.log_likelihood(found.pose[None])[0])
    assert facing(BODY, found.pose[None])[0] @ facing(BODY, truth[None])[0] > 0.9
    assert facing(BODY, found.rival[None])[0] @ facing(BODY, found.pose[None])[0] < 0.0
    assert found.margin > 1.0
    assert found.confidence > 0.99
    assert 0.0 < found.agreement < 1.0


@pytest.mark.slow
def test_the_same_seed_gives_the_same_pose_and_progress_counts_up_to_its_end() -> None:
    problem, reports = NearMarkers(pose_with(heading=-60, pelvis_z=920)), []
    first = candidates((0.0, 0.0, 900.0))
    poses = [search(problem).run(first).pose for _ in range(2)]
    assert np.array_equal(poses[0], poses[1])
    watched = StartSearch(
        problem,
        SPACE,
        BODY.neutral,
        lambda some: facing(BODY, some),
        cameras=4,
        seed=4,
        effort=QUICK,
        progress=lambda done, total: reports.append((done, total)),
    )
    assert not np.array_equal(watched.run(first).pose, poses[0])
    assert [done for done, _ in reports] == sorted(done for done, _ in reports)
    assert len({total for _, total in reports}) == 1
    assert reports[-1][0] <= reports[-1][1]


def test_progress_counts_lines_and_begins_each_round_where_the_last_could_have_ended() -> None:
    """Of one family and rounds of one line, each could have improved two more that face the other way."""
    problem, reports = NearMarkers(BODY.neutral), list[tuple[int, int]]()
    effort, progress = (
        Effort(1, 3 * (Round(1, 4, 4, 0.2),)),
        lambda done, total: reports.append((done, total)),
    )
    family = StartCandidates(BODY.neutral[None], np.zeros(1, np.int64), fixed=False)
    StartSearch(
        problem,
        SPACE,
        BODY.neutral,
        lambda poses: facing(BODY, poses),
        cameras=4,
        seed=1,
        effort=effort,
        progress=progress,
    ).run(family)
    assert reports == [(1, 10), (2, 10), (5, 10), (8, 10)]


@pytest.mark.slow
def test_a_known_pose_is_a_line_from_the_start() -> None:
    truth = pose_with(heading=75, pelvis_x=900, pelvis_z=915, left_knee=40, right_elbow=90)
    problem = NearMarkers(truth)
    misled = candidates((-900.0, 0.0, 900.0))
    assert problem.error(search(problem).run(misled, known=truth[None]).pose) < 15.0


def test_progress_may_end_the_search() -> None:
    def stop(done: int, total: int) -> None:
        raise KeyError(done)

    problem = NearMarkers(BODY.neutral)
    ended = StartSearch(
        problem, SPACE, BODY.neutral, lambda some: facing(BODY, some), cameras=4, seed=0, progress=stop
    )
    with pytest.raises(KeyError):
        ended.run(candidates((0.0, 0.0, 900.0)))


def test_no_candidates_are_refused() -> None:
    nothing = StartCandidates(np.zeros((0, len(NAMES))), np.zeros(0, np.int64), fixed=False)
    with pytest.raises(RunError, match="no candidate pose"):
        search(NearMarkers(BODY.neutral)).run(nothing)


def test_exchanged_legs_are_corrected_in_pairs() -> None:
    truth = pose_with(left_hip_swing=45, left_knee=20, right_hip_swing=-20, right_knee=35)
    swapped = pose_with(right_hip_swing=45, right_knee=20, left_hip_swing=-20, left_knee=35)
    problem = NearMarkers(truth)
    steps = LineSteps(AtEase.of(problem, SPACE, BODY.neutral, 4), SPACE, BODY.neutral)
    line = Line(swapped, float(steps.values(swapped[None])[0]))
    noise = 0.2 * first_noise(SPACE)
    found = steps.improved(np.random.default_rng(0), line, [line], noise, Round(1, 60, 150, 0.2))
    assert found.value > line.value
    assert problem.error(found.pose) < 0.5 * problem.error(swapped)
    assert steps.evaluations > 1000


def test_a_limb_without_a_twin_is_searched_alone_and_stays_where_no_other_pose_of_it_is_possible() -> None:
    at, rest = NAMES.index("head_turn"), BODY.neutral

    class Turned(NearMarkers):
        def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
            return -10.0 * (poses[:, at] - 0.7) ** 2

    class OnlyAtRest(Turned):
        def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
            return poses[:, at] == rest[at]

    for kind, wanted in ((Turned, 0.7), (OnlyAtRest, 0.0)):
        steps = LineSteps(AtEase.of(kind(rest), SPACE, rest, 4), SPACE, rest)
        line = Line(rest, float(steps.values(rest[None])[0]))
        found = steps.improved(np.random.default_rng(0), line, [], np.zeros(len(rest)), Round(1, 30, 4, 0.2))
        assert found.pose[at] == pytest.approx(wanted, abs=0.05)


def test_the_penalty_of_attitudes_far_from_rest() -> None:
    problem = NearMarkers(BODY.neutral)
    eased = AtEase.of(problem, SPACE, BODY.neutral, 4)
    bent = pose_with(left_elbow=np.degrees(BODY.neutral[NAMES.index("left_elbow")]) + 77.5)
    joints = np.isfinite(SPACE.upper) & (SPACE.hierarchy.depth > 0)
    expected = 4.0 * (77.5 / 155.0) ** 2 / np.count_nonzero(joints)
    assert eased.penalty(bent[None])[0] == pytest.approx(expected)
    assert eased.penalty(pose_with(heading=90, pelvis_x=4000)[None])[0] == 0.0
    assert eased.log_likelihood(bent[None])[0] == pytest.approx(
        problem.log_likelihood(bent[None])[0] - expected
    )


def test_a_root_that_usually_stays_upright_rolls_only_for_a_reason() -> None:
    spread = np.full(len(NAMES), np.inf)
    spread[[NAMES.index("lean_right"), NAMES.index("left_elbow")]] = np.radians(20.0)
    eased = AtEase.of(NearMarkers(BODY.neutral), SPACE, BODY.neutral, 4, spread)
    alike = AtEase.of(NearMarkers(BODY.neutral), SPACE, BODY.neutral, 4)
    rolled, bent = pose_with(lean_right=40)[None], pose_with(left_elbow=60)[None]
    assert eased.penalty(rolled)[0] == pytest.approx(4.0 * MARGIN_SCALE * 0.5 * 2.0**2)
    assert eased.penalty(bent)[0] == alike.penalty(bent)[0]


def test_confidence_is_one_half_without_a_margin_and_grows_with_it() -> None:
    assert confidence(facing_odds(0.0, 4)) == 0.5
    rising = [confidence(facing_odds(margin, 4)) for margin in (0.0, 0.05, 0.1, 0.3, 1.0, float("inf"))]
    assert rising == sorted(rising)
    assert rising[-1] == 1.0
    assert facing_odds(0.1, 2) > facing_odds(0.1, 4)


def test_candidates_stand_on_the_hull_in_every_heading() -> None:
    made = candidates((400.0, -300.0, 850.0))
    assert len(made.poses) == 40 * (made.family.max() + 1)
    assert made.family.max() + 1 >= HEADINGS
    ends = joint_frames(BODY, made.poses)[..., 3]
    assert np.abs(ends.mean(axis=(0, 1))[:2] - [400.0, -300.0]).max() < 60.0
    ways = facing(BODY, made.poses[made.family < HEADINGS])
    angles = np.sort(np.unique(np.round(np.degrees(np.arctan2(ways[:, 1], ways[:, 0])) % 360.0, 3)))
    assert np.allclose(np.diff(angles), 360.0 / HEADINGS, atol=0.1)
    assert (SPACE.lower <= made.poses).all()
    assert (made.poses <= SPACE.upper).all()


def test_a_person_lying_is_among_the_candidates() -> None:
    hull = column_hull((0.0, 0.0, 150.0), (850.0, 200.0, 150.0))
    made = start_candidates(np.random.default_rng(0), BODY, hull, BOX, 4)
    upright = joint_frames(BODY, made.poses)[:, 0, 2, 2]
    assert upright.min() < 0.3
    assert upright.max() > 0.95


def test_without_a_hull_candidates_stand_all_over_the_middle_of_the_space() -> None:
    made = start_candidates(np.random.default_rng(0), BODY, None, BOX, 40)
    x, y = made.poses[:, NAMES.index("pelvis_x")], made.poses[:, NAMES.index("pelvis_y")]
    for values in (x, y):
        assert values.min() < -700.0
        assert values.max() > 700.0
        assert np.abs(values).max() < 1500.0


def test_prototypes_are_half_of_the_candidates() -> None:
    known = pose_with(left_shoulder_spread=120, right_knee=100)[None]
    made = start_candidates(np.random.default_rng(0), BODY, None, BOX, 40, known)
    knee = made.poses[:, NAMES.index("right_knee")]
    assert 0.35 < np.mean(np.isclose(knee, np.radians(100.0))) < 0.65


def test_a_fixed_body_has_attitudes_only() -> None:
    arm = load_body("planar_arm4")
    made = start_candidates(np.random.default_rng(0), arm, None, BOX, 10)
    assert made.fixed
    assert made.poses.shape == (10 * HEADINGS, 4)
