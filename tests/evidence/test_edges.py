"""Edge maps against plain NumPy and SciPy."""

import math

import cv2
import numpy as np
import pytest
from scipy import ndimage, special

from studio.evidence.edges import EDGE_WIDTH, blurred, bodytrack_edges, grey, proximity_edges, whole_taps

RNG = np.random.default_rng(4)


def picture_of(level: np.ndarray) -> np.ndarray:
    return np.repeat(level.astype(np.uint8)[:, :, None], 3, axis=2)


SCENE = picture_of(
    np.clip(ndimage.gaussian_filter(RNG.normal(0.0, 1.0, (70, 90)), 4.0) * 600.0 + 120.0, 0.0, 255.0)
)


def plain_bodytrack(level: np.ndarray) -> np.ndarray:
    """The Lee-walk README's words, one operation after the other."""
    values = level.astype(np.float64)
    across = ndimage.correlate(values, np.outer([1, 2, 1], [-1, 0, 1])) / 8.0
    along = ndimage.correlate(values, np.outer([-1, 0, 1], [1, 2, 1])) / 8.0
    edges = np.where(across**2 + along**2 < 16.0, 0, 255)
    edges[[0, -1]] = 0
    edges[:, [0, -1]] = 0
    taps = np.exp(-0.5 * (np.arange(-3, 4) / 4.0) ** 2)
    taps = (taps / taps.sum()).astype(np.float32)
    for axis in (1, 0):
        total = np.zeros(edges.shape, np.float32)
        for offset, tap in enumerate(taps, -3):
            total = total + np.roll(edges, -offset, axis).astype(np.float32) * tap
        edges = np.trunc(total).astype(int)
        border = [slice(None)] * 2
        for end in (slice(0, 3), slice(-3, None)):
            border[axis] = end
            edges[tuple(border)] = 0
    return edges


def test_bodytrack_map_is_the_description_pixel_for_pixel() -> None:
    found = bodytrack_edges(SCENE).astype(int)
    expected = plain_bodytrack(SCENE[:, :, 0])
    inner = (slice(3, -3), slice(3, -3))
    difference = np.abs(found - expected)[inner]
    # Sums of float32 may be cut off to the other side of a whole number where the order of adding differs.
    assert difference.max() <= 1
    assert np.mean(difference > 0) < 0.02
    assert found[:3].max() == found[-3:].max() == found[:, :3].max() == found[:, -3:].max() == 0
    assert expected.max() > 150


def test_grey_of_a_grey_picture_is_its_own_level() -> None:
    every = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    np.testing.assert_array_equal(grey(picture_of(every)), every)


@pytest.mark.parametrize("smoothing", [2.0, 3.0, 5.0])
def test_a_straight_edge_reaches_one_and_falls_off_as_a_gaussian(smoothing: float) -> None:
    # A ramp of 36 grey levels over three pixels: the Sobel operator sees it on four.
    ramp = np.full((61, 101), 60)
    ramp[:, 50:53] = [72, 84, 96]
    ramp[:, 53:] = 96
    row = proximity_edges(picture_of(ramp), 5.5, smoothing)[30].astype(float) / 255.0
    # Closed form: the integral of the Gaussian over the four pixels, relative to its middle.
    distance = np.arange(101) - 50.5
    profile = special.erf((distance + 2) / (smoothing * 2**0.5)) - special.erf(
        (distance - 2) / (smoothing * 2**0.5)
    )
    expected = profile / (2.0 * special.erf(2 / (smoothing * 2**0.5)))
    near = np.abs(distance) < 1.5 * smoothing
    np.testing.assert_allclose(row[near], np.minimum(expected, 1.0)[near], atol=0.07)
    assert row.max() > 0.93
    assert row[np.abs(distance) > 2.0 * smoothing + 3.0].max() == 0.0


def test_weak_gradients_are_no_edges() -> None:
    ramp = np.tile(np.arange(0, 160, 2), (30, 1))
    # 2 grey levels a pixel: |Sobel| / 8 is 2.
    assert proximity_edges(picture_of(ramp), 2.5, 2.0).max() == 0
    assert proximity_edges(picture_of(ramp), 1.5, 2.0).max() == 255


def test_edges_far_from_the_mask_are_forgotten() -> None:
    scene = np.full((60, 100), 50)
    scene[20:40, 10:20] = 200
    scene[20:40, 70:80] = 200
    mask = np.zeros((60, 100), np.uint8)
    mask[20:40, 10:20] = 255
    found = proximity_edges(picture_of(scene), 5.0, 2.0, mask, 5)
    everything = proximity_edges(picture_of(scene), 5.0, 2.0)
    np.testing.assert_array_equal(found[:, :40], everything[:, :40])
    assert found[:, 50:].max() == 0
    assert everything[:, 50:].max() > 140


@pytest.mark.parametrize("smoothing", [0.5, 1.3, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("share", [0.02, 0.5])
def test_the_blur_is_opencvs_followed_by_a_table(smoothing: float, share: float) -> None:
    edges = np.where(RNG.random((61, 83)) < share, np.uint8(255), np.uint8(0))
    count = 2 * round(2.0 * smoothing) + 1
    factor = 1.0 / math.erf(0.5 * EDGE_WIDTH / (smoothing * math.sqrt(2.0)))
    table = np.minimum(255.0, np.round(np.arange(256) * factor)).astype(np.uint8)
    smooth = cv2.GaussianBlur(edges, (count, count), smoothing, borderType=cv2.BORDER_CONSTANT)
    np.testing.assert_array_equal(
        blurred(edges, whole_taps(smoothing, count), factor), table[np.asarray(smooth)]
    )
