"""What may be the subject's or not counts as neither, in every user of a frame's evidence."""

import dataclasses

import numpy as np
import pytest

from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence, half_mask, open_mask
from studio.evidence.pipeline import RawMask, finished
from studio.evidence.settings import EvidenceSettings
from studio.search.likelihood.silhouette_areas import FULL, HALF, Silhouettes


def view_of(mask: np.ndarray, unknown: np.ndarray | None) -> ViewEvidence:
    return ViewEvidence("a", np.zeros((*mask.shape, 3), np.uint8), mask, mask, unknown=unknown)


def square(rows: slice, columns: slice) -> np.ndarray:
    picture = np.zeros((120, 160), np.uint8)
    picture[rows, columns] = 255
    return picture


BODY, UNKNOWN = square(slice(20, 100), slice(40, 80)), square(slice(20, 100), slice(80, 100))


@pytest.mark.parametrize(("resolution", "pixels"), [(FULL, 80 * 40 + 80 * 10), (HALF, 40 * 20 + 40 * 5)])
def test_half_of_an_unknown_area_is_silhouette(resolution: str, pixels: int) -> None:
    silhouettes = Silhouettes(FrameEvidence(0, (view_of(BODY, UNKNOWN),)), resolution)
    assert silhouettes.pixels.tolist() == [pixels]


def test_what_the_mask_calls_body_stays_so_and_nothing_beyond_the_unknown_changes() -> None:
    """Of several subjects, where one is in front of the other, both have the pixels in their masks."""
    view = view_of(BODY, BODY | UNKNOWN)
    half = half_mask(view)
    assert (half[BODY > 0] == 255).all()
    assert not half[(BODY | UNKNOWN) == 0].any()
    assert half[UNKNOWN > 0].mean() == 127.5
    np.testing.assert_array_equal(open_mask(view), BODY | UNKNOWN)
    assert half_mask(view_of(BODY, None)) is BODY


def test_a_border_at_the_unknown_is_none() -> None:
    """The body's right side ends at the unknown; left, top and bottom remain."""
    (seen,) = silhouette_distances(FrameEvidence(0, (view_of(BODY, UNKNOWN),)))
    assert seen.border[:, 0].max() < 78
    assert {seen.border[:, 0].min(), seen.border[:, 1].min(), seen.border[:, 1].max()} == {40.0, 20.0, 99.0}
    row, column = 60 - seen.corner[1], 90 - seen.corner[0]
    assert seen.signed[row, column] == 0.0


def test_a_border_at_a_doubted_shadow_counts_half() -> None:
    """The same, where the picture of what changed shows that the unknown looks like a shadow."""
    view = dataclasses.replace(view_of(BODY, UNKNOWN), shadow=UNKNOWN)
    (plain,) = silhouette_distances(FrameEvidence(0, (view_of(BODY, None),)))
    (seen,) = silhouette_distances(FrameEvidence(0, (view,)))
    counts = [int((one.border[:, 0] >= 78).sum()) for one in (plain, seen)]
    assert counts[1] == counts[0] // 2
    assert len(plain.border) - len(seen.border) == counts[0] - counts[1]
    row, column = 60 - seen.corner[1], 90 - seen.corner[0]
    # From the border between columns 79 and 80 to the middle of column 90.
    assert seen.signed[row, column] == 0.5 * 10.5


def test_the_unknown_holds_a_hand_that_it_parts_from_the_body() -> None:
    """By itself the hand is the smaller piece, which the clean-up drops; the unknown is no part of the mask."""
    hand, forearm = square(slice(50, 60), slice(110, 120)), square(slice(50, 60), slice(80, 110))
    settings = EvidenceSettings(mask_keep_components=1, mask_opening=0, mask_closing=0)
    alone, none = finished(RawMask(BODY | hand, True), settings)
    np.testing.assert_array_equal(alone, BODY)
    assert none is None
    mask, unknown = finished(RawMask(BODY | hand, True, forearm, None, forearm), settings)
    np.testing.assert_array_equal(mask, BODY | hand)
    np.testing.assert_array_equal(unknown, forearm)


def test_unknown_pixels_apart_from_the_body_are_background() -> None:
    apart = square(slice(5, 15), slice(120, 150))
    mask, unknown = finished(
        RawMask(BODY, True, apart, None, apart), EvidenceSettings(mask_keep_components=1)
    )
    assert unknown is None
    assert not mask[:, 110:].any()


def test_the_clean_up_makes_no_body_of_the_unknown() -> None:
    """A closing would fill the slit between body and unknown."""
    beside = square(slice(20, 100), slice(82, 100))
    settings = EvidenceSettings(mask_closing=7, mask_opening=0)
    mask, unknown = finished(RawMask(BODY, True, beside, None, beside), settings)
    assert unknown is not None
    np.testing.assert_array_equal(mask, finished(RawMask(BODY, True), settings)[0])
    assert (unknown[30:90, 80:82] == 255).all()


def test_excluded_areas_are_not_even_unknown() -> None:
    excluded = square(slice(0, 120), slice(90, 160))
    mask, unknown = finished(RawMask(BODY, True, UNKNOWN, None, UNKNOWN), EvidenceSettings(), excluded)
    assert unknown is not None
    assert not (mask | unknown)[excluded > 0].any()
    assert (unknown[30:90, 82:88] == 255).all()
