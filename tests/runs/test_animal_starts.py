"""A start pose of a body that is no person: a mouse that rears or walks, drawn with its tail, in both facings."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import marker_points
from studio.foundations.arrays import Array
from studio.runs.search_space import default_sigma, search_space
from studio.runs.setup import initialising
from studio.runs.setup.initial_limbs import limbs_put_right
from studio.runs.setup.initialising import (
    BY_SILHOUETTES,
    SILHOUETTES,
    better_facing,
    contradicted_share,
    hull_of,
    seek,
    whole_problem,
)
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.initialisation import QUICK, FoundStart
from studio.search.trackers.limb_resampling import Hypothesis, has_tail, turned_pose
from studio.search.trackers.start_candidates import facing

CAMERAS = tuple(
    dataclasses.replace(camera, translation=camera.translation / 10.0)
    for camera in ring_of_cameras(3, 640, 480)
)
MOUSE = load_body("mouse31")
SETTINGS = changed_settings(default_settings("annealed", SILHOUETTES), BY_SILHOUETTES)


def pose_of(**changed: float) -> Array:
    names = [entry.name for entry in MOUSE.parameters]
    pose = MOUSE.neutral
    for name, value in changed.items():
        pose[names.index(name)] = value
    return pose


REARED = pose_of(
    heading=0.8, pitch=-1.2, pelvis_z=40.0, left_haunch_swing=-1.2, right_haunch_swing=-1.2, tail_lift=1.2,
    tail_2_wag=0.5, tail_3_wag=0.5,
)  # fmt: skip
WALKING = pose_of(heading=-2.0, pitch=-0.2, loin_bend=0.5, tail_wag=0.3, tail_3_wag=0.6)


def off(pose: Array, truth: Array, marker: str) -> float:
    number = [entry.name for entry in MOUSE.markers].index(marker)
    apart = marker_points(MOUSE, np.stack([pose, truth]))[:, number]
    return float(np.linalg.norm(apart[0] - apart[1]))


@pytest.mark.slow
@pytest.mark.parametrize("truth", [REARED, WALKING])
def test_both_ends_are_told_apart_from_nothing(truth: Array) -> None:
    evidence = drawn_evidence(MOUSE, truth, CAMERAS)
    hull, box, _ = hull_of(MOUSE, CAMERAS, evidence)
    problem = whole_problem(MOUSE, CAMERAS, SETTINGS, evidence)
    space = search_space(MOUSE, default_sigma(MOUSE, 120.0))
    start = seek(problem, space, MOUSE, hull, box, cameras=3, seed=0, effort=QUICK)
    assert start.rival is not None
    start, stands = better_facing(problem, MOUSE, CAMERAS, evidence, start, 0, draw=True)
    print({name: round(off(stands.pose, truth, name), 1) for name in ("Nose", "TTI", "TailTip")})
    assert off(stands.pose, truth, "Nose") < 12.0
    assert off(stands.pose, truth, "TTI") < 12.0
    assert off(stands.pose, truth, "TailTip") < 12.0
    assert start.confidence > 0.9


@pytest.mark.parametrize("draw", [False, True])
def test_both_facings_are_weighed_and_keep_their_facing_while_their_limbs_are_put_right(draw: bool) -> None:
    evidence = drawn_evidence(MOUSE, WALKING, CAMERAS)
    problem = whole_problem(MOUSE, CAMERAS, SETTINGS, evidence)
    turned = turned_pose(MOUSE, WALKING)
    assert turned is not None
    started = FoundStart(turned, 0.0, 0.9, 1.0, WALKING, 0.8, 1)
    better, stands = better_facing(problem, MOUSE, CAMERAS, evidence, started, 0, draw=draw)
    assert better.rival is not None
    ahead = facing(MOUSE, np.stack([WALKING, better.pose, better.rival]))
    assert ahead[1] @ ahead[0] > 0.9
    assert ahead[2] @ ahead[0] < -0.8
    assert better.pose is stands.pose
    assert better.agreement == pytest.approx(0.2)
    # Between the two that face differently, not between two that face alike: by areas, and by borders beside them.
    weights = problem.log_likelihood(np.stack([better.pose, better.rival]))
    losses = [
        limbs_put_right(MOUSE, CAMERAS, evidence, pose, 0, draw=False).loss
        for pose in (better.pose, better.rival)
    ]
    assert weights[0] - weights[1] > 0.5
    assert better.margin == pytest.approx(weights[0] - weights[1] + np.log(losses[1] / losses[0]))
    assert better.confidence > 0.9
    again, _ = better_facing(problem, MOUSE, CAMERAS, evidence, better, 0, draw=draw)
    assert again.agreement == pytest.approx(0.2)
    assert facing(MOUSE, again.pose[None])[0] @ ahead[0] > 0.9


@pytest.mark.parametrize(("losses", "turned"), [((3.0, 2.0), True), ((3.0, 2.9), False)])
def test_borders_decide_where_areas_hardly_do(
    losses: tuple[float, float], turned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    areas = {0.0: -2.0, 1.0: -2.1}
    poses = [np.full(len(MOUSE.parameters), value) for value in areas]

    def put_right(
        body: object, cameras: object, masks: object, pose: Array, seed: int, **asked: bool
    ) -> Hypothesis:
        assert asked == {"draw": True, "turn": False}
        return Hypothesis(pose, losses[int(pose[0])], None)

    monkeypatch.setattr(initialising, "limbs_put_right", put_right)
    problem = SimpleNamespace(log_likelihood=lambda given: np.array([areas[pose[0]] for pose in given]))
    started = FoundStart(poses[0], 0.0, 0.9, 1.0, poses[1], 0.75, 1)
    found, stands = better_facing(problem, MOUSE, CAMERAS, None, started, 0, draw=True)
    assert found.pose is stands.pose is poses[int(turned)]
    assert found.rival is poses[1 - int(turned)]
    assert found.log_weight == areas[float(turned)]
    assert found.agreement == (0.25 if turned else 0.75)
    # ln(3 / 2) - 0.1, or 0.1 - ln(3 / 2.9); a camera's share of either is weighed by 0.03 to odds.
    assert found.margin == pytest.approx(0.3054651 if turned else 0.0660984)
    assert found.confidence == pytest.approx(0.9675 if turned else 0.6758, abs=1e-4)


def test_drawing_the_limbs_again_turns_a_start_round_unless_it_is_to_keep_its_facing() -> None:
    evidence = drawn_evidence(MOUSE, WALKING, CAMERAS)
    turned = turned_pose(MOUSE, WALKING)
    assert turned is not None
    found = limbs_put_right(MOUSE, CAMERAS, evidence, turned, 0)
    assert off(found.pose, WALKING, "Nose") < 12.0
    kept = limbs_put_right(MOUSE, CAMERAS, evidence, turned, 0, turn=False)
    ahead = facing(MOUSE, np.stack([kept.pose, WALKING]))
    assert ahead[0] @ ahead[1] < -0.8
    assert contradicted_share(MOUSE, found) < contradicted_share(MOUSE, kept)


def test_what_has_no_tail_or_may_lie_on_its_back_starts_as_before() -> None:
    assert [name for name in list_bodies() if has_tail(load_body(name))] == ["mouse31"]
