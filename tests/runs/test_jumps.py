"""Leaps planted in a smooth motion are found with their limb, and quick but smooth movement is none."""

import numpy as np
import pytest
from numpy.typing import NDArray

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.runs.jumps import WHOLE, jumps_of, marker_limbs
from studio.runs.tracks import Track

FRAMES = 120


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("human31")


def column(body: BodyModel, name: str) -> int:
    return [entry.name for entry in body.parameters].index(name)


def swinging(body: BodyModel) -> NDArray[np.float64]:
    """(F, D) arms and legs that swing once a second at 60 Hz, with the noise of a search."""
    poses = np.tile(body.neutral, (FRAMES, 1))
    time = np.arange(FRAMES) / 60.0
    for at, entry in enumerate(body.parameters):
        if entry.limb in ("left arm", "right arm", "left leg", "right leg"):
            poses[:, at] += 0.4 * np.sin(2.0 * np.pi * time + at)
    return poses + np.random.default_rng(3).normal(0.0, 0.002, poses.shape)


def track_of(poses: NDArray[np.float64], frames: NDArray[np.int64] | None = None) -> Track:
    count = len(poses)
    numbers = np.arange(count) if frames is None else frames
    return Track("raw", numbers, poses, np.full(count, 0.9), ("tracked",) * count)


def test_a_smooth_motion_has_none(body: BodyModel) -> None:
    assert jumps_of(body, track_of(swinging(body))) == ()


def test_a_limb_that_is_elsewhere_from_a_frame_on(body: BodyModel) -> None:
    poses = swinging(body)
    arm = [at for at, entry in enumerate(body.parameters) if entry.limb == "left arm"]
    poses[41:, arm[0]] += 0.9
    found = jumps_of(body, track_of(poses))
    assert [(jump.frame, jump.limb) for jump in found] == [(41, "left arm")]
    assert found[0].mm > 100.0 > 10.0 > found[0].usual_mm
    assert found[0].in_words() == "frame 41, left arm"


def test_a_limb_that_is_elsewhere_for_a_frame(body: BodyModel) -> None:
    poses = swinging(body)
    leg = [at for at, entry in enumerate(body.parameters) if entry.limb == "right leg"]
    poses[70, leg[0]] += 0.8
    found = jumps_of(body, track_of(poses))
    assert {jump.limb for jump in found} == {"right leg"}
    assert {jump.frame for jump in found} == {70}


def test_a_body_that_is_elsewhere_leaps_as_a_whole(body: BodyModel) -> None:
    poses = swinging(body)
    poses[30:, column(body, "pelvis_x")] += 250.0
    found = jumps_of(body, track_of(poses))
    assert [(jump.frame, jump.limb) for jump in found] == [(30, WHOLE)]


def test_frames_that_were_dropped_are_no_leap(body: BodyModel) -> None:
    poses = swinging(body)
    poses[60:, column(body, "pelvis_x")] += 250.0
    numbers = np.concatenate([np.arange(60), np.arange(75, 75 + FRAMES - 60)])
    assert jumps_of(body, track_of(poses, numbers)) == ()


def test_a_punch_is_none(body: BodyModel) -> None:
    """A quick movement bends for several frames: half a turn of the shoulder in a fifth of a second."""
    poses = swinging(body)
    arm = next(at for at, entry in enumerate(body.parameters) if entry.limb == "right arm")
    step = np.clip((np.arange(FRAMES) - 50) / 14.0, 0.0, 1.0)
    poses[:, arm] += 1.2 * (3.0 * step**2 - 2.0 * step**3)
    assert jumps_of(body, track_of(poses)) == ()


def test_every_marker_has_a_limb(body: BodyModel) -> None:
    limbs = dict(zip([marker.name for marker in body.markers], marker_limbs(body), strict=True))
    assert (limbs["LWrist"], limbs["RAnkle"]) == ("left arm", "right leg")
    assert all(limbs.values())
