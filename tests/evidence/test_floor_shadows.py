"""What looks like a shadow is one only where every camera that sees that place of the floor sees it changed."""

import cv2
import numpy as np
import pytest
from drawn_people import ring_of_cameras

from studio.evidence.floor_shadows import Cells, FloorShadows, cells_of, with_cells
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

CAMERAS = ring_of_cameras(4, 640, 480)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    """(8, 3) corners, mm."""
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T


TRUNK = box((-150.0, -150.0, 0.0), (150.0, 150.0, 1700.0))
ARM = box((150.0, -40.0, 1300.0), (650.0, 40.0, 1380.0))
SHADOW = box((-900.0, 100.0, 0.0), (-200.0, 700.0, 0.0))


def drawn(camera: Camera, corners: np.ndarray) -> np.ndarray:
    """(H, W) 255 inside the projection of a convex thing."""
    picture = np.zeros((camera.height, camera.width), np.uint8)
    hull = cv2.convexHull(np.rint(project(camera, corners)[0]).astype(np.int32))
    return cv2.fillConvexPoly(picture, hull, 255)


def told(raised: float = 0.0, cameras: tuple[Camera, ...] = CAMERAS) -> tuple[float, float]:
    """Shares of an arm and of a shadow that count as the subject, where both look like shadows. raised : mm of all."""
    up = np.array((0.0, 0.0, raised))
    trunks, arms, shadows = (
        [drawn(camera, thing + up) for camera in cameras] for thing in (TRUNK, ARM, SHADOW)
    )
    arms = [arm & ~trunk for arm, trunk in zip(arms, trunks, strict=True)]
    shadows = [shadow & ~trunk & ~arm for shadow, trunk, arm in zip(shadows, trunks, arms, strict=True)]
    like = [arm | shadow for arm, shadow in zip(arms, shadows, strict=True)]
    seen = [cells_of(trunk, one) for trunk, one in zip(trunks, like, strict=True)]
    tells = FloorShadows(cameras)
    assert tells.usable
    chosen = tells.unexplained(seen)
    masks = [
        with_cells(trunk, one, own, cells.size)
        for trunk, one, own, cells in zip(trunks, like, chosen, seen, strict=True)
    ]
    assert all((mask >= trunk).all() for mask, trunk in zip(masks, trunks, strict=True))

    def share(wanted: list[np.ndarray]) -> float:
        return sum(int((m & w).sum()) for m, w in zip(masks, wanted, strict=True)) / sum(
            int(w.sum()) for w in wanted
        )

    return share(arms), share(shadows)


def test_an_arm_is_the_subjects_and_a_shadow_is_not() -> None:
    arm, shadow = told()
    assert arm > 0.75
    assert shadow < 0.01


def test_a_floor_that_is_not_at_zero_is_found() -> None:
    """Else the shadow on a table would lie well above the floor, and be taken for the subject."""
    arm, shadow = told(raised=500.0)
    assert arm > 0.75
    assert shadow < 0.02


def test_two_cameras_tell_too() -> None:
    arm, shadow = told(cameras=CAMERAS[:2])
    assert arm > 0.4
    assert shadow < 0.05


def test_nothing_changes_without_anything_like_a_shadow() -> None:
    seen = [cells_of(drawn(camera, TRUNK), None) for camera in CAMERAS]
    assert not any(one.any() for one in FloorShadows(CAMERAS).unexplained(seen))


def test_cells_say_what_most_of_their_pixels_are() -> None:
    mask, shadow = np.zeros((480, 640), np.uint8), np.zeros((480, 640), np.uint8)
    mask[100:120, 100:120], shadow[100:120, 120:140] = 255, 255
    shadow[200, 200] = 255  # a speck
    cells = cells_of(mask, shadow)
    assert cells.kinds.shape == (240, 320)
    wanted = np.zeros((240, 320), np.uint8)
    wanted[50:60, 50:60], wanted[50:60, 60:70] = 1, 2
    np.testing.assert_array_equal(cells.kinds, wanted)
    chosen = np.zeros_like(wanted)
    chosen[50:60, 60:65] = 1
    grown = with_cells(mask, shadow, chosen, cells.size)
    np.testing.assert_array_equal(grown - mask, np.where(np.arange(640) < 130, shadow, 0) * (grown > 0))


@pytest.mark.parametrize("size", [(640, 480), (650, 487)])
def test_pictures_that_are_no_whole_number_of_cells(size: tuple[int, int]) -> None:
    full = np.full(size[::-1], 255, np.uint8)
    cells = cells_of(full, np.zeros_like(full))
    assert (cells.kinds[:-1, :-1] == 1).all()
    everything = with_cells(np.zeros_like(full), full, np.ones_like(cells.kinds), cells.size)
    np.testing.assert_array_equal(everything, full)


def test_cameras_that_all_look_one_way_or_lie_on_the_floor_tell_nothing() -> None:
    assert not FloorShadows(CAMERAS[:1]).usable
    stereo = (CAMERAS[0], CAMERAS[0])
    assert not FloorShadows(stereo).usable
    sunk = [Camera(**{**fields(camera), "translation": lowered(camera)}) for camera in CAMERAS]
    assert not FloorShadows(sunk).usable


def fields(camera: Camera) -> dict[str, object]:
    return {name: getattr(camera, name) for name in Camera.__dataclass_fields__}


def lowered(camera: Camera) -> np.ndarray:
    """The translation of a camera at z = 0."""
    centre = camera.centre * (1.0, 1.0, 0.0)
    return -camera.rotation @ centre


def test_a_shadow_that_only_one_camera_films_stays_one() -> None:
    """No other camera can deny it."""
    alone = [Cells(np.zeros((240, 320), np.uint8), 2) for _ in CAMERAS]
    alone[0].kinds[200:210, 5:15] = 2
    assert not any(one.any() for one in FloorShadows(CAMERAS).unexplained(alone))
