"""A limb that is lost is missed, also where no mask shows it; a shadow on the floor is none."""

import cv2
import numpy as np
import pytest
from drawn_people import drawn_mask, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.evidence.frame_evidence import ViewEvidence
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.projection import project
from studio.search.trackers.limbs_elsewhere import (
    Change,
    LimbsElsewhere,
    change_of,
    none_missed,
)
from studio.search.trackers.tracker import HIDDEN

CAMERAS = ring_of_cameras(4, 480, 360)
BODY = load_body("human31")
TRUTH = standing(BODY, left_shoulder_rx=0.6, right_shoulder_rx=0.6)


def changes(seen: list[Bytes]) -> list[Change]:
    """Of masks, one a camera."""
    nothing = [np.zeros_like(mask) for mask in seen]
    return [
        change_of(ViewEvidence(camera.name, none, mask, none))
        for camera, mask, none in zip(CAMERAS, seen, nothing, strict=True)
    ]


def changed_with_shadow() -> list[Bytes]:
    """What changed in every view: the person in its true pose, and a shadow on the floor, a metre and a half long."""
    around = np.linspace(0.0, 2.0 * np.pi, 40)
    shadow = np.stack([600.0 + 750.0 * np.cos(around), 300.0 * np.sin(around), np.zeros(40)], axis=1)
    seen: list[Bytes] = []
    for camera in CAMERAS:
        mask = drawn_mask(BODY, TRUTH, camera)
        cv2.fillPoly(mask, [np.rint(project(camera, shadow)[0]).astype(np.int32)], (255,))
        seen.append(mask)
    return seen


def test_no_limb_of_the_true_pose_is_elsewhere() -> None:
    assert LimbsElsewhere(BODY, CAMERAS).lost(TRUTH, changes(changed_with_shadow())) == ()


@pytest.mark.parametrize(
    ("wrong", "limb"),
    [
        ({"left_shoulder_rx": -0.5}, "left arm"),
        ({"right_shoulder_rx": 1.2}, "right arm"),
        ({"left_hip_ry": -1.2}, "left leg"),
    ],
)
def test_a_limb_that_is_elsewhere_is_named(wrong: dict[str, float], limb: str) -> None:
    pose = standing(BODY, **{"left_shoulder_rx": 0.6, "right_shoulder_rx": 0.6, **wrong})
    found = LimbsElsewhere(BODY, CAMERAS).lost(pose, changes(changed_with_shadow()))
    assert limb in found
    assert len(found) == 1


def test_what_no_limb_can_reach_is_none() -> None:
    seen = changed_with_shadow()
    ball = np.array([[1500.0, 0.0, 1200.0]])
    for camera, mask in zip(CAMERAS, seen, strict=True):
        x, y = np.rint(project(camera, ball)[0][0]).astype(int)
        cv2.circle(mask, (int(x), int(y)), 20, (255,), -1)
    assert LimbsElsewhere(BODY, CAMERAS).lost(TRUTH, changes(seen)) == ()


def test_an_arm_that_every_mask_took_for_a_shadow_is_missed() -> None:
    lowered = standing(BODY, left_shoulder_rx=-0.5, right_shoulder_rx=0.6)
    seen: list[Change] = []
    for camera, whole in zip(CAMERAS, changed_with_shadow(), strict=True):
        mask = drawn_mask(BODY, lowered, camera)
        shadow = np.where(mask > 0, np.uint8(0), whole)
        seen.append(change_of(ViewEvidence(camera.name, mask, mask, mask, shadow=shadow)))
    assert LimbsElsewhere(BODY, CAMERAS).lost(lowered, seen) == ("left arm",)
    without = [change_of(ViewEvidence("", mask, mask, mask)) for mask in masks_of(lowered)]
    assert LimbsElsewhere(BODY, CAMERAS).lost(lowered, without) == ()


def test_what_lies_beside_a_body_whose_limbs_all_show_is_no_limb() -> None:
    witness, seen = LimbsElsewhere(BODY, CAMERAS), masks_of(TRUTH)
    ball = np.array([[350.0, 0.0, 900.0]])
    for camera, mask in zip(CAMERAS, seen, strict=True):
        x, y = np.rint(project(camera, ball)[0][0]).astype(int)
        cv2.circle(mask, (int(x), int(y)), 20, (255,), -1)
    found = witness.of(TRUTH, changes(seen))
    assert max(one.unexplained for one in found.values()) > 0.15
    assert none_missed(found)
    assert not none_missed(witness.of(standing(BODY, left_shoulder_rx=-0.5), changes(seen)))


def test_an_arm_behind_a_box_that_is_known_is_not_missed() -> None:
    seen, memory = masks_of(TRUTH), dict[str, Array]()
    arm = standing(BODY, left_shoulder_rx=0.6, right_shoulder_rx=-0.2)
    gone = drawn_mask(BODY, TRUTH, CAMERAS[0]) & ~drawn_mask(BODY, arm, CAMERAS[0])
    seen[0] = np.where(gone > 0, np.uint8(0), seen[0])
    counts = np.zeros((120, 160))
    counts[:] = 9.0 * (cv2.resize(gone, (160, 120), interpolation=cv2.INTER_AREA) > 0)
    memory[HIDDEN + CAMERAS[0].name] = counts
    witness = LimbsElsewhere(BODY, CAMERAS)
    blind, knowing = (witness.of(TRUTH, changes(seen), known)["right arm"] for known in (None, memory))
    assert blind.explained < knowing.explained
    assert knowing.explained > 0.9


def masks_of(pose: Array) -> list[Bytes]:
    return [drawn_mask(BODY, pose, camera) for camera in CAMERAS]
