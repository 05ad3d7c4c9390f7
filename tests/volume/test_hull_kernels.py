"""Classification of voxels by pixels and masks: against plain NumPy and Eq. 6 written out."""

import numpy as np
import pytest
from posed_cones import ring

from studio.evidence.yuv_background import YuvBackground, learn_background
from studio.geometry.camera_table import camera_table, picture_limit
from studio.volume import hull_kernels as kernels
from studio.volume import hull_projection as projection
from studio.volume.chi_square import fitted_thresholds
from studio.volume.hull_kernels import TILE_HEIGHT, TILE_WIDTH, look_at_tile
from studio.volume.hull_octree import summed_areas
from studio.volume.reconstruction import radical_inverses

CAMERA = ring(3)[0]
CAMERAS = camera_table([CAMERA], picture_limit)
STARTS = np.array([[0, 320 * 240], [0, 321 * 241]])
MIDDLE = np.array([0.0, 0.0, 900.0])
POLYNOMIAL = fitted_thresholds(40, 0.99)
NO_FLOATS, NO_SUMS = np.zeros(1, np.float32), np.zeros(1, np.int32)
NO_PICTURE, NO_GAUSSIANS = np.zeros((1, 3), np.uint8), np.zeros((9, 1), np.float32)


def rules(*, last: bool = False, deepest: float = 0.0, share: float = 0.5) -> kernels.Rules:
    polynomial = (*map(float, POLYNOMIAL.coefficients),)
    return kernels.Rules(last, 0, share, 1.0, 0.1, deepest, POLYNOMIAL.single, polynomial)


def sights(
    picture: np.ndarray = NO_PICTURE, gaussians: np.ndarray = NO_GAUSSIANS, distances: np.ndarray = NO_FLOATS
) -> kernels.Sights:
    flat = picture.reshape(-1, 3)
    return kernels.Sights(True, CAMERAS, STARTS, NO_SUMS, flat, gaussians, distances, radical_inverses(512))


def scene(seed: int = 0) -> tuple[YuvBackground, np.ndarray]:
    """A background and a picture of it."""
    rng = np.random.default_rng(seed)
    shade = rng.uniform(50, 200, (240, 320, 3))
    clip = [np.round(shade + rng.normal(0, 3, shade.shape)).astype(np.uint8) for _ in range(60)]
    return learn_background(clip[1:]), clip[0]


def look(
    picture: np.ndarray, distances: np.ndarray, half: float, row: kernels.Rules, at: np.ndarray = MIDDLE
) -> int:
    place = np.empty(projection.PLACE)
    assert projection.place_voxel(CAMERAS, 0, *at, half, place)
    empty = np.zeros((9, picture.size // 3), np.float32)
    return kernels.look_at_pixels(sights(picture, empty, distances), 0, row, place)


@pytest.mark.parametrize("deepest", [0.0, 0.4])
def test_tiles_hold_the_distances_of_the_background(deepest: float) -> None:
    background, picture = scene()
    picture = np.random.default_rng(5).integers(0, 256, picture.shape, dtype=np.uint8)
    expected = background.squared_distances(picture, 0.1, deepest).ravel()
    distances = np.full(320 * 240, np.nan, np.float32)
    seen = sights(picture, background.packed(), distances)
    look_at_tile(seen, 0, 40, 9, rules(deepest=deepest))
    assert np.isfinite(distances).sum() == TILE_WIDTH * TILE_HEIGHT
    for y in range(0, 240, TILE_HEIGHT):
        for x in range(0, 320, TILE_WIDTH):
            look_at_tile(seen, 0, x, y, rules(deepest=deepest))
    np.testing.assert_allclose(distances, expected, rtol=2e-3, atol=0.05)


def test_equation_6() -> None:
    """All of the sum small: background; every sample far: foreground; else edge, decided by share at the last depth."""
    picture = np.zeros((240, 320, 3), np.uint8)
    near, far = np.full(320 * 240, 1.0, np.float32), np.full(320 * 240, 400.0, np.float32)
    assert look(picture, near, 100.0, rules()) == kernels.BACKGROUND
    assert look(picture, far, 100.0, rules()) == kernels.FOREGROUND
    left = np.where(np.arange(320) < 160, 400.0, 1.0).astype(np.float32)
    half = np.tile(left, 240)
    assert look(picture, half, 100.0, rules()) == kernels.EDGE
    assert look(picture, half, 100.0, rules(last=True, share=0.3)) == kernels.FOREGROUND
    assert look(picture, half, 100.0, rules(last=True, share=0.7)) == kernels.BACKGROUND


def test_many_slightly_odd_samples_are_no_background_and_none_is_foreground() -> None:
    """9 a sample is below T_1 = 11.3, but the sum of many is above T_k: an edge."""
    picture = np.zeros((240, 320, 3), np.uint8)
    odd = np.full(320 * 240, 9.0, np.float32)
    assert look(picture, odd, 100.0, rules()) == kernels.EDGE
    assert look(picture, odd, 100.0, rules(last=True)) == kernels.BACKGROUND
    assert look(picture, odd, 2.0, rules()) == kernels.BACKGROUND


@pytest.mark.parametrize("half", [6.0, 25.0, 90.0])
def test_background_is_classified_at_the_given_confidence(half: float) -> None:
    rng = np.random.default_rng(11)
    picture = np.zeros((240, 320, 3), np.uint8)
    answers = []
    for _ in range(30):
        distances = (rng.normal(size=(3, 320 * 240)) ** 2).sum(axis=0).astype(np.float32)
        places = MIDDLE + rng.uniform(-500, 500, (100, 3))
        answers.extend(look(picture, distances, half, rules(), at) for at in places)
    assert np.mean(np.array(answers) == kernels.BACKGROUND) == pytest.approx(0.99, abs=0.012)


def test_only_tiles_with_samples_are_computed() -> None:
    background, picture = scene()
    place, distances = np.empty(projection.PLACE), np.full(320 * 240, np.nan, np.float32)
    assert projection.place_voxel(CAMERAS, 0, *MIDDLE, 20.0, place)
    seen = sights(picture, background.packed(), distances)
    answer = kernels.look_at_pixels(seen, 0, rules(), place)
    assert answer == kernels.BACKGROUND
    assert np.isfinite(distances).sum() <= 4 * TILE_WIDTH * TILE_HEIGHT


def test_voxels_partly_outside_the_picture_are_not_carved() -> None:
    picture, near = np.zeros((240, 320, 3), np.uint8), np.full(320 * 240, 1.0, np.float32)
    edge_of_picture = CAMERA.centre + CAMERA.rotation.T @ np.array([0.0, 0.415, 1.0]) * 3000.0
    assert look(picture, near, 90.0, rules(), edge_of_picture) == kernels.EDGE
    outside = CAMERA.centre + CAMERA.rotation.T @ np.array([0.0, 0.5, 1.0]) * 3000.0
    assert look(picture, near, 20.0, rules(), outside) == kernels.UNSEEN


def test_summed_areas_count_mask_pixels() -> None:
    mask = np.where(np.random.default_rng(0).random((240, 320)) < 0.3, np.uint8(255), np.uint8(0))
    sums = np.empty(321 * 241, np.int32)
    summed_areas(mask, sums)
    expected = np.pad((mask > 0).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    np.testing.assert_array_equal(sums.reshape(241, 321), expected)


def test_a_mask_carves_only_what_covers_none_of_its_pixels() -> None:
    place = np.empty(projection.PLACE)
    assert projection.place_voxel(CAMERAS, 0, *MIDDLE, 60.0, place)
    u, v = (int(np.floor(place[k] + 0.5)) for k in (projection.U, projection.V))
    reach = place[projection.BOUND_X]
    for offset, expected in ((0.8 * reach, kernels.EDGE), (1.3 * reach + 1, kernels.BACKGROUND)):
        mask, sums = np.zeros((240, 320), np.uint8), np.empty(321 * 241, np.int32)
        mask[v, int(u + offset)] = 255
        summed_areas(mask, sums)
        assert kernels.look_at_mask(sights()._replace(sums=sums), 0, rules(), place) == expected
    summed_areas(np.full((240, 320), 255, np.uint8), sums)
    assert kernels.look_at_mask(sights()._replace(sums=sums), 0, rules(), place) == kernels.FOREGROUND
