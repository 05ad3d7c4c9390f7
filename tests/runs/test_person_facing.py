"""Which way a person faces: by the network's points, and what that makes of a start pose and its rival."""

import math

import numpy as np
import pytest
from rendered_people import FPS, rendered_walk
from sized_people import drawn_and_seen

from studio.body.catalogue import load_body
from studio.foundations.arrays import Array
from studio.results.drawing_footage.motions import make_motion
from studio.runs.setup.initialising import facing_as_said
from studio.runs.setup.person_facing import facing_agreement
from studio.search.trackers.initialisation import FoundStart, confidence, facing_odds

SEED, CAMERAS = 3, 4


def walking_pose(turned: float) -> Array:
    """Somebody upright where the rendered walker is in his first frame, turned from where he walks to."""
    body = load_body("human31")
    skeleton, _, _ = drawn_and_seen(np.random.default_rng(SEED))
    root = make_motion("walk", skeleton, 30, FPS, {}).root
    ahead = root[-1] - root[0]
    known = {f"pelvis_{axis}": float(value) for axis, value in zip("xyz", root[0], strict=True)}
    known["pelvis_rz"] = math.atan2(ahead[1], ahead[0]) + turned
    names = [parameter.name for parameter in body.parameters]
    pose = body.neutral.copy()
    for name, value in known.items():
        pose[names.index(name)] = value
    return pose


@pytest.mark.slow
def test_the_network_knows_which_way_somebody_walks() -> None:
    walk, body = rendered_walk(1, seed=SEED), load_body("human31")
    pictures = {camera.name: walk.pictures[camera.name, 0] for camera in walk.cameras}
    right, wrong = (
        facing_agreement(body, walk.cameras, pictures, walking_pose(turned)) for turned in (0.0, math.pi)
    )
    assert right > 0.8
    assert wrong < -0.8
    empty = {camera.name: walk.empty[camera.name] for camera in walk.cameras}
    assert facing_agreement(body, walk.cameras, empty, walking_pose(0.0)) == 0.0
    arm = load_body("planar_arm4")
    assert facing_agreement(arm, walk.cameras, pictures, arm.neutral) == 0.0


def start(margin: float, rival: bool = True) -> FoundStart:
    return FoundStart(
        pose=np.zeros(3), log_weight=5.0, confidence=confidence(facing_odds(margin, CAMERAS)), margin=margin,
        rival=np.ones(3) if rival else None, agreement=0.75, evaluations=9,
    )  # fmt: skip


def test_the_pictures_decide_between_a_start_pose_and_a_rival_that_weighs_nearly_as_much() -> None:
    doubtful = start(0.1)
    assert doubtful.confidence < 0.8
    kept = facing_as_said(doubtful, CAMERAS, 0.95)
    assert kept.confidence > 0.99
    assert kept.pose is doubtful.pose
    turned = facing_as_said(doubtful, CAMERAS, -0.95)
    assert turned.pose is doubtful.rival
    assert turned.rival is doubtful.pose
    assert turned.margin == -0.1
    assert turned.agreement == 0.25
    assert turned.log_weight == pytest.approx(4.9)
    assert 0.97 < turned.confidence < kept.confidence


def test_a_clear_weight_stands_against_the_pictures_and_silence_changes_nothing() -> None:
    clear = start(2.0)
    assert facing_as_said(clear, CAMERAS, -0.95).pose is clear.pose
    assert facing_as_said(clear, CAMERAS, 0.0).confidence == clear.confidence
    alone = facing_as_said(start(math.inf, rival=False), CAMERAS, -0.9)
    assert alone.confidence < 0.01
    assert alone.rival is None
