"""A limb that is lost is missed, also where no mask shows it; a shadow on the floor is none."""

import cv2
import numpy as np
import pytest
from drawn_people import drawn_mask, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.projection import project
from studio.runs.limbs_elsewhere import LimbsElsewhere

CAMERAS = ring_of_cameras(4, 480, 360)
BODY = load_body("human31")
TRUTH = standing(BODY, left_shoulder_rx=0.6, right_shoulder_rx=0.6)


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
    assert LimbsElsewhere(BODY, CAMERAS).lost(TRUTH, changed_with_shadow()) == ()


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
    found = LimbsElsewhere(BODY, CAMERAS).lost(pose, changed_with_shadow())
    assert limb in found
    assert len(found) == 1


def test_what_no_limb_can_reach_is_none() -> None:
    seen = changed_with_shadow()
    ball = np.array([[1500.0, 0.0, 1200.0]])
    for camera, mask in zip(CAMERAS, seen, strict=True):
        x, y = np.rint(project(camera, ball)[0][0]).astype(int)
        cv2.circle(mask, (int(x), int(y)), 20, (255,), -1)
    assert LimbsElsewhere(BODY, CAMERAS).lost(TRUTH, seen) == ()
