"""Rendered frames: the mask is the person, the plate is the room, nothing depends on threads."""

import numba
import numpy as np
import pytest

from studio.body.person import joint_points
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import corner_rig
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.renderer import Renderer
from studio.results.drawing_footage.rooms import room_called

SIZE = (160, 120)


@pytest.fixture(scope="module")
def motion():
    return make_motion("walk", skeleton_of_height(1760.0, np.random.default_rng(1)), 20, 60.0, {})


@pytest.fixture(scope="module")
def renderer(motion) -> Renderer:
    cameras = corner_rig(SIZE, np.random.default_rng(1))
    return Renderer(room_called("furnished"), cameras, motion, noise=2.0, samples=1, seed=3)


@pytest.mark.parametrize("frame", [0, 19])
def test_joints_lie_inside_the_mask(renderer: Renderer, motion, frame: int) -> None:
    cameras = corner_rig(SIZE, np.random.default_rng(1))
    points = joint_points(motion)
    inner = [
        points[name][frame]
        for name in ("pelvis", "left_shin", "right_shin", "left_upper_arm", "right_upper_arm")
    ]
    inner.append(0.5 * (points["head"][frame] + points["head_top"][frame]))
    for index, camera in enumerate(cameras):
        _, mask = renderer.picture(index, frame, renderer.shadow(frame))
        pixels = np.rint(project(camera, np.array(inner))[0]).astype(int)
        assert np.all(mask[pixels[:, 1], pixels[:, 0]] == 255)
        assert 250 < np.count_nonzero(mask) < 3000
        assert set(np.unique(mask)) == {0, 255}


def test_outside_mask_and_shadow_the_picture_is_the_plate(renderer: Renderer) -> None:
    shadow = renderer.shadow(5)
    picture, mask = renderer.picture(1, 5, shadow)
    plate = np.mean([renderer.empty(1, index) for index in range(8)], axis=0)
    difference = np.abs(picture.astype(float) - plate).mean(axis=2)
    assert difference[mask > 0].mean() > 25.0
    assert np.median(difference[mask == 0]) < 2.5
    assert (plate - picture)[mask == 0].max() > 12.0  # somewhere there is a shadow


def test_frames_repeat_bit_for_bit_on_any_number_of_threads(renderer: Renderer) -> None:
    picture, mask = renderer.picture(2, 7, renderer.shadow(7))
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        again, same = renderer.picture(2, 7, renderer.shadow(7))
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(picture, again)
    np.testing.assert_array_equal(mask, same)


def test_noise_differs_between_frames_and_cameras(renderer: Renderer) -> None:
    noise = [
        renderer.empty(0, 0).astype(int) - renderer.empty(0, 1),
        renderer.empty(0, 2).astype(int) - renderer.empty(0, 3),
    ]
    assert np.std(noise[0]) == pytest.approx(2.0 * np.sqrt(2.0), rel=0.3)
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.02


def test_objects_in_front_hide_the_person() -> None:
    motion = make_motion("box", skeleton_of_height(1760.0, np.random.default_rng(1)), 180, 60.0, {})
    frame = int(np.argmin(np.abs(motion.root[:, 0])))
    counts = []
    for height in (0.0, 700.0):
        cameras = corner_rig(SIZE, np.random.default_rng(1))
        renderer = Renderer(room_called("furnished", height), cameras, motion, noise=0.0, samples=1, seed=3)
        _, mask = renderer.picture(0, frame, renderer.shadow(frame))
        counts.append(np.count_nonzero(mask))
    assert counts[1] < 0.95 * counts[0]
