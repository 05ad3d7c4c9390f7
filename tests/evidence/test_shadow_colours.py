"""The colours of a room's shadows are learnt where no body can be; skin on a floor of its colour is none of them."""

from dataclasses import replace

import cv2
import numpy as np
from toy_footage import looking_at

from studio.evidence.background import GaussianBackground
from studio.evidence.settings import EvidenceSettings
from studio.evidence.shadow_colours import (
    DARKNESS_BINS,
    TINT_BINS,
    Changed,
    cells_of,
    learn_shadow_colours,
    table_of,
)
from studio.geometry.camera import Camera
from studio.geometry.projection import project

FLOOR = np.array([110.0, 150.0, 200.0])
"""BGR, of skin's colour."""
SHADOW, SKIN = 0.8 * FLOOR, 0.55 * FLOOR + np.array([0.0, 0.0, 6.0])
PLACES = ((3000.0, 3000.0), (-3000.0, 3000.0), (-3000.0, -3000.0), (3000.0, -3000.0))
CAMERAS = tuple(
    looking_at(f"cam{k}", (*place, 2200.0), (0.0, 0.0, 800.0)).resized(640, 480)
    for k, place in enumerate(PLACES)
)
SETTINGS = EvidenceSettings()


def drawn(camera: Camera, points: np.ndarray) -> np.ndarray:
    """(H, W) bool: where a camera sees the convex hull of points (N, 3)."""
    pixels = project(camera, points)[0]
    mask = np.zeros((camera.height, camera.width), np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(pixels.round().astype(np.int32)), 255)
    return mask > 0


def box(middle: tuple[float, float, float], sides: tuple[float, float, float]) -> np.ndarray:
    corners = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]), axis=-1).reshape(-1, 3)
    return np.array(middle) + corners * np.array(sides)


def picture_of(camera: Camera, at: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A frame: a dark body, its bare arm beside it, its shadow on the floor; masks of shadow and arm."""
    light = np.tile(FLOOR, (camera.height, camera.width, 1))
    shadow = drawn(camera, box((at + 500.0, 0.0, 0.0), (1000.0, 500.0, 1.0)))
    arm = drawn(camera, box((at, 330.0, 1150.0), (90.0, 90.0, 500.0)))
    body = drawn(camera, box((at, 0.0, 850.0), (300.0, 450.0, 1500.0)))
    light[shadow], light[arm], light[body] = SHADOW, SKIN, (60.0, 20.0, 20.0)
    noise = np.random.default_rng(int(at) % 97).normal(0.0, 2.0, light.shape)
    taken = np.clip(np.round(light + noise), 0, 255).astype(np.uint8)
    return taken, shadow & ~arm & ~body, arm & ~body


def model(camera: Camera) -> GaussianBackground:
    return GaussianBackground(np.tile(FLOOR, (camera.height, camera.width, 1)).astype(np.float32))


def frames_of(cameras: tuple[Camera, ...]) -> list[dict[str, Changed]]:
    return [
        {one.name: model(one).changed(picture_of(one, at)[0], SETTINGS) for one in cameras}
        for at in np.linspace(-700.0, 700.0, 8)
    ]


def test_a_bare_arm_on_a_floor_of_its_colour_is_kept_and_the_shadow_is_not() -> None:
    table = learn_shadow_colours(CAMERAS, frames_of(CAMERAS))
    assert table is not None
    for camera in CAMERAS:
        taken, shadow, arm = picture_of(camera, 130.0)
        by_tolerances = model(camera).foreground(taken, SETTINGS) > 0
        learnt = model(camera).foreground(taken, SETTINGS, table) > 0
        assert arm.sum() > 50
        assert by_tolerances[arm].mean() < 0.1
        assert learnt[arm].mean() > 0.97
        assert learnt[shadow].mean() < 0.03


def test_too_few_cameras_or_no_floor_below_them_leave_it_to_the_tolerances() -> None:
    assert learn_shadow_colours(CAMERAS[:2], frames_of(CAMERAS[:2])) is None
    assert learn_shadow_colours(CAMERAS, []) is None
    low = tuple(looking_at(f"low{k}", (*place, 50.0), (0.0, 0.0, 800.0)) for k, place in enumerate(PLACES))
    assert learn_shadow_colours(low, frames_of(low)) is None
    same = tuple(looking_at(f"same{k}", (3000.0, k, 1500.0), (0.0, k, 1500.0)) for k in range(3))
    assert learn_shadow_colours(same, frames_of(same)) is None


def test_a_view_in_which_nothing_may_be_shadow_says_nothing() -> None:
    empty = np.zeros((CAMERAS[0].height, CAMERAS[0].width), np.bool_)
    frames = frames_of(CAMERAS)
    nothing = {name: replace(view, changed=empty, alike=empty) for name, view in frames[0].items()}
    assert np.array_equal(
        learn_shadow_colours(CAMERAS, [nothing, *frames]), learn_shadow_colours(CAMERAS, frames)
    )


def test_colours_that_only_shadows_have_stay_shadow_and_those_never_seen_too() -> None:
    shape = (DARKNESS_BINS, TINT_BINS, TINT_BINS)
    shadows, mixed = np.zeros(shape), np.zeros(shape)
    shadows[20, 8, 8], mixed[20, 8, 8], mixed[12, 8, 10] = 4000.0, 2000.0, 600.0
    table = table_of(shadows, mixed)
    assert (table[20, 8, 8], table[12, 8, 10], table[2, 2, 2]) == (1, 0, 1)


def test_the_mask_reads_the_cell_that_learning_counts() -> None:
    camera = CAMERAS[0]
    background = model(camera)
    values = np.random.default_rng(5).uniform(0.45, 0.95, (camera.height, camera.width, 1)) * FLOOR
    taken = np.clip(values + np.random.default_rng(6).normal(0.0, 2.0, values.shape), 0, 255).astype(np.uint8)
    plain = background.changed(taken, SETTINGS)
    cells = cells_of(taken[plain.alike], plain.background[plain.alike])
    table = np.ones((DARKNESS_BINS, TINT_BINS, TINT_BINS), np.uint8)
    table[:, :8] = 0
    learnt = background.foreground(taken, SETTINGS, table) > 0
    # Rounding of single precision may put a pixel at the border of a cell into the next one.
    assert np.mean(learnt[plain.alike] == (cells[:, 1] < 8)) > 0.999
    assert not np.any(learnt[~plain.alike & ~plain.changed])
