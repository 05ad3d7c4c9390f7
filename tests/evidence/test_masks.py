"""Clean-up of masks, against SciPy's labelling."""

import dataclasses

import cv2
import numpy as np
import pytest
from scipy import ndimage
from toy_footage import looking_at

from studio.evidence.masks import (
    PackedMask,
    PackedMasks,
    cleaned,
    disc,
    reduced,
    reduced_cleaning,
    uncleaned,
)
from studio.evidence.settings import EvidenceSettings

OFF = dataclasses.replace(
    EvidenceSettings(), mask_opening=0, mask_closing=0, mask_fill_holes=0, mask_min_component=0
)
EIGHT = np.ones((3, 3))


def blobs(seed: int) -> np.ndarray:
    """Random pieces with holes and pieces inside holes."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(120, 160)), 3.0)
    return np.where(field > 0.02, np.uint8(255), np.uint8(0))


def test_a_pixel_of_a_reduced_mask_is_foreground_where_half_of_its_area_was() -> None:
    mask = blobs(1)
    camera = looking_at("whole", (3000.0, 0.0, 1500.0), (0.0, 0.0, 1000.0)).resized(160, 120)
    assert reduced(mask, camera) is mask
    half = reduced(mask, camera.resized(80, 60))
    share = (mask > 0).reshape(60, 2, 80, 2).mean(axis=(1, 3))
    np.testing.assert_array_equal(half, np.where(share >= 0.5, 255, 0))


def test_nothing_on_changes_nothing() -> None:
    mask = blobs(0)
    np.testing.assert_array_equal(cleaned(mask, OFF), mask)


def test_small_pieces_are_dropped() -> None:
    for seed in range(5):
        mask = blobs(seed)
        labels, count = ndimage.label(mask, EIGHT)
        sizes = ndimage.sum_labels(mask > 0, labels, np.arange(1, count + 1))
        least = int(np.median(sizes))
        expected = np.isin(labels, 1 + np.flatnonzero(sizes >= least))
        found = cleaned(mask, dataclasses.replace(OFF, mask_min_component=least))
        np.testing.assert_array_equal(found > 0, expected)


def test_the_largest_pieces_are_kept() -> None:
    for seed in range(5):
        mask = blobs(seed)
        labels, count = ndimage.label(mask, EIGHT)
        sizes = ndimage.sum_labels(mask > 0, labels, np.arange(1, count + 1))
        expected = np.isin(labels, 1 + np.argsort(-sizes, kind="stable")[:2])
        found = cleaned(mask, dataclasses.replace(OFF, mask_keep_components=2))
        np.testing.assert_array_equal(found > 0, expected)


def test_small_holes_are_filled() -> None:
    mask = np.zeros((60, 60), np.uint8)
    mask[5:55, 5:55] = 255
    mask[10:14, 10:14] = 0
    mask[30:45, 30:45] = 0
    found = cleaned(mask, dataclasses.replace(OFF, mask_fill_holes=17))
    assert found[10:14, 10:14].min() == 255
    np.testing.assert_array_equal(found[20:], mask[20:])
    kept = cleaned(mask, dataclasses.replace(OFF, mask_fill_holes=16))
    np.testing.assert_array_equal(kept, mask)


def test_opening_removes_specks_and_closing_closes_gaps() -> None:
    mask = np.zeros((60, 60), np.uint8)
    mask[20:40, 10:28] = 255
    mask[20:40, 31:50] = 255
    mask[5, 5] = mask[6, 50] = 255
    found = cleaned(mask, dataclasses.replace(OFF, mask_opening=3, mask_closing=5))
    assert found[:15].max() == 0
    assert found[25:35, 28:31].min() == 255


@pytest.mark.parametrize("closing", [1, 4, 9])
def test_a_closing_reaches_as_far_beside_the_picture_as_within(closing: int) -> None:
    rng = np.random.default_rng(closing)
    for _ in range(40):
        mask = np.zeros((40, 50), np.uint8)
        left, top = rng.integers(0, 40, 2)
        part = mask[top : top + 12, left : left + 12]
        part[rng.random(part.shape) < 0.4] = 255
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (closing | 1, closing | 1))
        whole = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
        np.testing.assert_array_equal(cleaned(mask, dataclasses.replace(OFF, mask_closing=closing)), whole)


def test_a_mask_that_is_not_cleaned_stays_as_it_is() -> None:
    mask = np.where(np.random.default_rng(0).random((60, 80)) < 0.3, np.uint8(255), np.uint8(0))
    strict = EvidenceSettings(
        mask_opening=2, mask_closing=3, mask_fill_holes=20, mask_min_component=30, mask_keep_components=1
    )
    assert (cleaned(mask, strict) != mask).any()
    np.testing.assert_array_equal(cleaned(mask, uncleaned(strict)), mask)


def test_two_pixels_open_and_close_as_three_do() -> None:
    """Only odd kernels have a middle; one pixel changes nothing."""
    mask = blobs(3)
    mask[::7, ::5] ^= 255
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    for knob, operation in (("mask_opening", cv2.MORPH_OPEN), ("mask_closing", cv2.MORPH_CLOSE)):
        expected = cv2.morphologyEx(mask, operation, kernel)
        assert (expected != mask).any()
        np.testing.assert_array_equal(cleaned(mask, dataclasses.replace(OFF, **{knob: 2})), expected)
        np.testing.assert_array_equal(cleaned(mask, dataclasses.replace(OFF, **{knob: 1})), mask)


@pytest.mark.parametrize("turned", [False, True])
def test_holes_are_no_pieces_and_none_of_a_pieces_area(turned: bool) -> None:
    """A frame of 84 pixels around 16, which is more than the smaller piece beside it has."""
    mask = np.zeros((30, 30), np.uint8)
    mask[3:13, 3:13], mask[6:10, 6:10], mask[20:23, 20:24] = 255, 0, 255
    mask = np.ascontiguousarray(mask[::-1] if turned else mask)
    solid = mask.copy()
    cv2.floodFill(solid, None, (7, 22 if turned else 7), 255)

    def kept(**knobs: int) -> np.ndarray:
        return cleaned(mask, dataclasses.replace(OFF, **knobs))

    np.testing.assert_array_equal(kept(mask_keep_components=2), mask)
    np.testing.assert_array_equal(kept(mask_fill_holes=17), solid)
    np.testing.assert_array_equal(kept(mask_min_component=12), mask)
    frame = np.where(np.arange(30) < 15, mask, 0)
    np.testing.assert_array_equal(kept(mask_min_component=84), frame)
    assert not kept(mask_min_component=85).any()


def test_the_clean_up_of_smaller_pictures_is_smaller() -> None:
    settings = dataclasses.replace(
        OFF,
        mask_opening=12, mask_closing=7, mask_fill_holes=90, mask_min_component=184, mask_keep_components=2,
    )  # fmt: skip
    expected = dataclasses.replace(
        settings, mask_opening=4, mask_closing=2, mask_fill_holes=10, mask_min_component=20
    )
    assert reduced_cleaning(settings, 3.0) == expected
    nothing = dataclasses.replace(OFF, mask_keep_components=0)
    assert uncleaned(settings) == nothing


def test_packed_masks_come_out_as_they_were() -> None:
    masks, packed = {"a": blobs(1)[:, :157], "b": blobs(2)}, PackedMasks()
    for camera, mask in masks.items():
        packed.put(camera, mask)
    assert list(packed) == ["a", "b"]
    assert len(packed) == 2
    for camera, mask in masks.items():
        np.testing.assert_array_equal(packed[camera], mask)
    assert PackedMask(masks["b"]).nbytes == 120 * 160 // 8


def test_a_disc_reaches_as_far_as_it_says() -> None:
    assert disc(2).tolist() == [[0, 0, 1, 0, 0], [1] * 5, [1] * 5, [1] * 5, [0, 0, 1, 0, 0]]
