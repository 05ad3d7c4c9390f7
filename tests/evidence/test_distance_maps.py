"""Distances to a silhouette's border, against brute force."""

import numpy as np
import pytest

from studio.evidence.distance_maps import distances_of


def disc(size: int = 61, radius: float = 17.0) -> np.ndarray:
    rows, columns = np.mgrid[:size, :size]
    return np.where(np.hypot(columns - 30, rows - 28) <= radius, 255, 0).astype(np.uint8)


def test_signed_distances_are_those_of_brute_force() -> None:
    mask = disc()
    inside, outside = np.argwhere(mask > 0), np.argwhere(mask == 0)
    found = distances_of(mask)
    left, top = found.corner
    for row, column in [(28, 30), (28, 46), (28, 48), (9, 14), (47, 12), (15, 31)]:
        others = outside if mask[row, column] else inside
        away = np.hypot(*(others - [row, column]).T).min() - 0.5
        assert found.signed[row - top, column - left] == pytest.approx(
            -away if mask[row, column] else away, abs=1e-4
        )


def test_border_points_lie_on_the_border_and_point_away() -> None:
    found = distances_of(disc())
    middle = found.border - [30.0, 28.0]
    radii = np.linalg.norm(middle, axis=1)
    assert len(radii) > 60
    assert radii.min() > 15.5
    assert radii.max() <= 17.0
    assert np.all((found.outward * middle / radii[:, None]).sum(axis=1) > 0.95)


def test_points_are_at_most_the_given_number_and_spread_around() -> None:
    found = distances_of(disc(), most=20)
    assert 10 <= len(found.border) <= 20
    angles = np.sort(np.arctan2(*(found.border - [30.0, 28.0]).T))
    assert np.diff(angles).max() < 1.0


def test_the_pictures_own_border_and_empty_masks_have_no_points() -> None:
    mask = np.zeros((40, 50), np.uint8)
    mask[10:30, :20] = 255
    assert distances_of(mask).border[:, 0].min() > 0
    for empty in (np.zeros((40, 50), np.uint8), np.full((40, 50), 255, np.uint8)):
        assert distances_of(empty).border.shape == (0, 2)


def test_stepped_distances_are_nearly_the_exact_ones() -> None:
    exact, stepped = distances_of(disc()), distances_of(disc(), exact=False)
    assert np.allclose(stepped.signed, exact.signed, atol=0.1 + 0.03 * np.abs(exact.signed).max())
    assert np.array_equal(stepped.border, exact.border)


def test_where_a_mask_says_nothing_there_is_neither_distance_nor_border() -> None:
    mask = disc()
    hidden = np.zeros_like(mask)
    hidden[:, 36:58] = 255
    whole, found = distances_of(mask), distances_of(mask, hidden=hidden)
    (left, top), (begin, first) = whole.corner, found.corner
    assert begin + found.signed.shape[1] >= 58
    assert not found.signed[:, 36 - begin : 58 - begin].any()
    known = whole.signed[:, : 36 - left]
    rows, columns = slice(top - first, top - first + len(known)), slice(left - begin, 36 - begin)
    assert np.array_equal(found.signed[rows, columns], known)
    assert len(found.border) > 30
    assert found.border[:, 0].max() < 34
    assert whole.border[:, 0].max() > 40


def test_a_mask_that_is_known_everywhere_has_the_same_distances() -> None:
    whole, found = distances_of(disc()), distances_of(disc(), hidden=np.zeros_like(disc()))
    assert found.corner == whole.corner
    assert np.array_equal(found.signed, whole.signed)
    assert np.array_equal(found.border, whole.border)


@pytest.mark.parametrize("exact", [True, False])
def test_distances_do_not_depend_on_where_the_mask_lies(exact: bool) -> None:
    """OpenCV's own do, by 3e-5 pixels, and a descent amplifies that to millimetres: runs must be reproducible."""
    mask = np.zeros((480, 640), np.uint8)
    mask[150:300, 250:330] = mask[200:220, 200:400] = 255
    first = distances_of(mask, exact=exact).signed
    room = np.zeros(mask.size + 64, np.uint8)
    for offset in range(0, 64, 3):
        moved = room[offset : offset + mask.size].reshape(mask.shape)
        moved[:] = mask
        assert (distances_of(moved, exact=exact).signed == first).all()


@pytest.mark.parametrize(("left", "top"), [(2, 50), (50, 2)])
def test_distances_cover_what_is_hidden_far_from_the_mask(left: int, top: int) -> None:
    hidden = np.zeros_like(disc())
    hidden[top : top + 6, left : left + 6] = 1
    found = distances_of(disc(), hidden=hidden)
    x, y = left - found.corner[0], top - found.corner[1]
    assert x >= 0
    assert y >= 0
    assert (found.signed[y : y + 6, x : x + 6] == 0.0).all()
    assert found.signed[y : y + 6, x : x + 6].shape == (6, 6)
