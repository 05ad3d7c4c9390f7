"""A start pose of a body that is no person: a mouse that rears or walks, drawn with its tail, in both facings."""

import dataclasses

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import marker_points
from studio.foundations.arrays import Array
from studio.runs.search_space import default_sigma, search_space
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
from studio.search.trackers.frame_refinement import has_tail, turned_pose
from studio.search.trackers.initialisation import QUICK, FoundStart

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
    stands = limbs_put_right(MOUSE, CAMERAS, evidence, start.pose, 0)
    if start.rival is not None:
        other = limbs_put_right(MOUSE, CAMERAS, evidence, start.rival, 0)
        start, stands = better_facing(problem, 3, start, stands, other)
    print({name: round(off(stands.pose, truth, name), 1) for name in ("Nose", "TTI", "TailTip")})
    assert off(stands.pose, truth, "Nose") < 12.0
    assert off(stands.pose, truth, "TTI") < 12.0
    assert off(stands.pose, truth, "TailTip") < 12.0
    assert start.confidence > 0.9


def test_a_start_that_faces_the_other_way_gives_way_where_its_limbs_fit_less() -> None:
    evidence = drawn_evidence(MOUSE, WALKING, CAMERAS)
    problem = whole_problem(MOUSE, CAMERAS, SETTINGS, evidence)
    turned = turned_pose(MOUSE, WALKING)
    assert turned is not None
    wrong = limbs_put_right(MOUSE, CAMERAS, evidence, turned, 0, draw=False)
    right = limbs_put_right(MOUSE, CAMERAS, evidence, WALKING, 0, draw=False)
    start = FoundStart(wrong.pose, 0.0, 0.9, 1.0, right.pose, 0.8, 1)
    better, stands = better_facing(problem, 3, start, wrong, right)
    assert stands is right
    assert better.pose is right.pose
    assert better.rival is wrong.pose
    assert better.agreement == pytest.approx(0.2)
    assert better.margin > 0.0
    again, stands = better_facing(problem, 3, better, right, wrong)
    assert stands is right
    assert again.agreement == pytest.approx(0.2)
    assert contradicted_share(MOUSE, right) < contradicted_share(MOUSE, wrong)
    # Drawing its limbs again turns it round, too: the tail is on the other side.
    found = limbs_put_right(MOUSE, CAMERAS, evidence, turned, 0)
    assert off(found.pose, WALKING, "Nose") < 12.0


def test_what_has_no_tail_or_may_lie_on_its_back_starts_as_before() -> None:
    assert [name for name in list_bodies() if has_tail(load_body(name))] == ["mouse31"]
