"""Backgrounds in YUV: against plain NumPy, one pixel at a time, and OpenCV's colour conversion."""

import cv2
import numpy as np
import pytest

from studio.evidence.yuv_background import YUV_OF_BGR, YuvBackground, independent_background, learn_background


def clip(rng: np.random.Generator, frames: int = 400) -> np.ndarray:
    """(F, 4, 5, 3) pictures whose colours are correlated, differently at each pixel."""
    mean = rng.uniform(60, 190, (4, 5, 3))
    mixing = rng.normal(0.0, 3.0, (4, 5, 3, 3)) + 4.0 * np.eye(3)
    noise = np.einsum("hwij,fhwj->fhwi", mixing, rng.normal(size=(frames, 4, 5, 3)))
    return np.clip(np.round(mean + noise), 0, 255).astype(np.uint8)


def test_yuv_is_that_of_opencv() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    expected = cv2.cvtColor(picture, cv2.COLOR_BGR2YUV).astype(np.float64) - [0.0, 128.0, 128.0]
    found = picture @ YUV_OF_BGR.T
    unclipped = (np.abs(found[..., 1:]) < 127).all(axis=-1)
    assert np.abs(found - expected)[unclipped].max() < 1.0


def test_mean_and_precision_are_those_of_the_clip() -> None:
    pictures = clip(np.random.default_rng(1))
    background = learn_background(list(pictures), least_noise=0.5)
    for y, x in ((0, 0), (3, 4), (2, 1)):
        colours = pictures[:, y, x].astype(np.float64) @ YUV_OF_BGR.T
        np.testing.assert_allclose(background.mean[y, x], colours.mean(axis=0), atol=1e-3)
        expected = np.linalg.inv(np.cov(colours.T, bias=True) * (1.0 + 1.0 / len(pictures)))
        np.testing.assert_allclose(background.precision[y, x], expected, rtol=2e-3, atol=1e-4)


def test_a_still_plate_has_even_noise_in_all_colours() -> None:
    """Twice the variance of one picture's: the plate's own noise and the next picture's."""
    plate = np.random.default_rng(2).integers(0, 256, (6, 7, 3), dtype=np.uint8)
    background = learn_background([plate], least_noise=3.0)
    assert np.isfinite(background.precision).all()
    for change in ([3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0], [-1.7320508] * 3):
        moved = YUV_OF_BGR @ np.array(change)
        found = np.einsum("i,hwij,j->hw", moved, background.precision, moved)
        np.testing.assert_allclose(found, 0.5, rtol=1e-4)


def test_the_distances_of_background_pixels_follow_chi_square() -> None:
    rng = np.random.default_rng(3)
    background = learn_background(list(clip(rng, 2000)), least_noise=0.05)
    rng = np.random.default_rng(3)
    found = np.stack([background.squared_distances(picture, shadow=0.0) for picture in clip(rng, 2000)])
    assert found.mean() == pytest.approx(3.0, rel=0.01)
    assert np.mean(found > 11.345) == pytest.approx(0.01, abs=0.004)


def slow_distance(
    background: YuvBackground, pixel: np.ndarray, y: int, x: int, shadow: float, deepest: float
) -> float:
    seen = YUV_OF_BGR @ pixel.astype(np.float64)
    mean, precision = background.mean[y, x].astype(np.float64), background.precision[y, x].astype(np.float64)
    lit, shaded = mean.copy(), mean - np.array([shadow * mean[0], 0.0, 0.0])
    nearer_shadow = abs(seen[0] - shaded[0]) < abs(seen[0] - lit[0]) and shadow > 0.0
    chosen = shaded if nearer_shadow else lit
    found = (seen - chosen) @ precision @ (seen - chosen)
    if deepest > 0.0 and nearer_shadow:
        left = max(seen[0] / max(mean[0], 1.0), 1.0 - deepest)
        found = min(found, (seen - left * mean) @ precision @ (seen - left * mean))
    return float(found)


@pytest.mark.parametrize("deepest", [0.0, 0.4])
def test_shadow_and_background_are_distinguished_by_luminance(deepest: float) -> None:
    rng = np.random.default_rng(4)
    pictures = clip(rng)
    background = learn_background(list(pictures), least_noise=2.5)
    for factor in (1.0, 0.93, 0.9, 0.7, 0.4):
        picture = np.round(pictures[0] * factor).astype(np.uint8)
        found = background.squared_distances(picture, 0.1, deepest)
        slow = [
            [slow_distance(background, picture[y, x], y, x, 0.1, deepest) for x in range(5)] for y in range(4)
        ]
        np.testing.assert_allclose(found, slow, rtol=1e-5)


def test_a_tenth_less_luminance_is_background_and_more_is_not() -> None:
    plate = np.full((2, 2, 3), 150, np.uint8)
    background = learn_background([plate])
    shaded, dark = np.full((2, 2, 3), 135, np.uint8), np.full((2, 2, 3), 105, np.uint8)
    assert background.squared_distances(shaded).max() < 0.1
    assert background.squared_distances(dark).min() > 50.0
    assert background.squared_distances(dark, deepest=0.4).max() < 0.1
    assert background.squared_distances(np.full((2, 2, 3), 60, np.uint8), deepest=0.4).min() > 50.0


def test_independent_variances_make_diagonal_gaussians_in_bgr() -> None:
    mean, variance = np.full((2, 3, 3), 100.0, np.float32), np.full((2, 3, 3), 25.0, np.float32)
    background = independent_background(mean, variance, 2.0, pictures=4)
    away = YUV_OF_BGR @ np.array([5.0, -5.0, 5.0])
    np.testing.assert_allclose(
        np.einsum("i,hwij,j->hw", away, background.precision, away), 3.0 / 1.25, rtol=1e-4
    )


def test_a_plate_has_a_noise_of_two_and_a_half_grey_levels_unless_it_is_said() -> None:
    plate = np.full((1, 1, 3), 100, np.uint8)
    seen = np.full((1, 1, 3), 110, np.uint8)
    # Twice the noise: of the plate and of the picture.
    expected = 3 * 10.0**2 / (2.0 * 2.5**2)
    assert learn_background([plate]).squared_distances(seen)[0, 0] == pytest.approx(expected, rel=1e-5)
    given = plate.astype(np.float32), np.zeros((1, 1, 3), np.float32)
    assert independent_background(*given).squared_distances(seen)[0, 0] == pytest.approx(expected, rel=1e-5)


def test_packed_rows_are_the_mean_and_the_precisions_diagonal_and_upper_triangle() -> None:
    background = learn_background(list(clip(np.random.default_rng(7), 20)))
    rows = background.packed().reshape(9, 4, 5)
    np.testing.assert_array_equal(rows[:3], np.moveaxis(background.mean, 2, 0))
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    np.testing.assert_array_equal(rows[3:], [background.precision[..., i, j] for i, j in places])
