"""Distances to a silhouette's border, against brute force."""

import numpy as np
import pytest

from studio.evidence.distance_maps import (
    box_of,
    distances_of,
    silhouette_distances,
    silhouettes_by_camera,
    slopes_at,
)
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence


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
    for exact in (True, False):
        signed = distances_of(np.full((40, 50), 255, np.uint8), exact=exact).signed
        assert (signed < 0.0).all()
        assert np.isfinite(signed).all()
        assert signed.min() >= -np.hypot(40, 50) - 1.0, "no farther than the picture is wide"


def test_stepped_distances_are_nearly_the_exact_ones() -> None:
    exact, stepped = distances_of(disc()), distances_of(disc(), exact=False)
    assert np.allclose(stepped.signed, exact.signed, atol=0.1 + 0.03 * np.abs(exact.signed).max())
    assert np.array_equal(stepped.border, exact.border)


def test_where_a_mask_says_nothing_there_is_neither_distance_nor_border() -> None:
    mask = disc()
    hidden = np.zeros_like(mask)
    hidden[:, 36:58] = 255
    whole, found = distances_of(mask), distances_of(mask, unknown=hidden)
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
    whole, found = distances_of(disc()), distances_of(disc(), unknown=np.zeros_like(disc()))
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
    found = distances_of(disc(), unknown=hidden)
    x, y = left - found.corner[0], top - found.corner[1]
    assert x >= 0
    assert y >= 0
    assert (found.signed[y : y + 6, x : x + 6] == 0.0).all()
    assert found.signed[y : y + 6, x : x + 6].shape == (6, 6)


def test_a_box_is_around_the_pixels_that_are_bright_enough() -> None:
    rng = np.random.default_rng(1)
    for count in (1, 2, 5):
        for _ in range(30):
            picture = rng.integers(0, 128, (7, 9), dtype=np.uint8)
            picture[rng.integers(0, 7, count), rng.integers(0, 9, count)] = 128
            rows, columns = np.nonzero(picture == 128)
            wanted = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
            assert box_of(picture, np.uint8(128)) == wanted
            assert box_of(picture, np.uint8(129)) == (0, 0, 0, 0)


def test_slopes_are_unit_vectors_upwards_and_none_where_it_is_flat() -> None:
    values = np.random.default_rng(2).normal(size=(8, 9)).astype(np.float32)
    values[5:8, 5:8] = 0.25
    points = np.array([[x, y] for y in range(1, 7) for x in range(1, 8)])
    slopes = slopes_at(points, values)
    for (x, y), slope in zip(points, slopes, strict=True):
        rise = np.array([values[y, x + 1] - values[y, x - 1], values[y + 1, x] - values[y - 1, x]], float)
        np.testing.assert_allclose(slope, rise / max(np.linalg.norm(rise), 1e-9), rtol=1e-6)
    assert (slopes[[*map(tuple, points)].index((6, 6))] == 0.0).all()


@pytest.mark.parametrize("level", [127, 128])
def test_distances_are_kept_up_to_a_sixteenth_of_the_longer_side_from_pixels_half_as_bright(
    level: int,
) -> None:
    mask = np.zeros((90, 160), np.uint8)
    mask[30:40, 50:70] = level
    found = distances_of(mask)
    assert found.size == (160, 90)
    if level < 128:
        assert found.signed.shape == (0, 0)
        assert found.corner == (0, 0)
        return
    assert found.corner == (40, 20)
    assert found.signed.shape == (30, 40)
    y, x = np.mgrid[20:50, 40:80]
    away = np.hypot(np.maximum(np.maximum(50 - x, x - 69), 0), np.maximum(np.maximum(30 - y, y - 39), 0))
    within = np.minimum(np.minimum(x - 49, 70 - x), np.minimum(y - 29, 40 - y))
    np.testing.assert_allclose(found.signed, np.where(away > 0, away - 0.5, 0.5 - within), atol=1e-6)
    border = {(int(px), int(py)) for px, py in found.border}
    inner = (x > 50) & (x < 69) & (y > 30) & (y < 39)
    rim = (away == 0) & ~inner
    assert border == {*zip(x[rim].tolist(), y[rim].tolist(), strict=True)}
    for (px, py), outward in zip(found.border, found.outward, strict=True):
        if 54 < px < 65:
            np.testing.assert_allclose(outward, (0.0, -1.0 if py == 30 else 1.0), atol=0.02)
    cornered = np.zeros((90, 160), np.uint8)
    cornered[:5, :6] = cornered[85:, 150:] = 255
    whole = distances_of(cornered)
    assert (whole.corner, whole.signed.shape) == ((0, 0), (90, 160))
    assert whole.border.min() > 0
    assert (whole.border < (159, 89)).all()
    assert {(5, 1), (1, 4), (150, 88), (158, 85)} <= {(int(px), int(py)) for px, py in whole.border}


def test_border_points_are_every_so_manieth_and_none_within_two_pixels_of_what_is_hidden() -> None:
    mask = np.zeros((90, 160), np.uint8)
    mask[30:40, 50:70] = 255
    everything = distances_of(mask).border
    assert len(everything) == 56
    for most, kept in ((56, 56), (55, 28), (28, 28), (27, 19), (1, 1)):
        np.testing.assert_array_equal(distances_of(mask, most).border, everything[:: -(-56 // most)])
        assert len(distances_of(mask, most).border) == kept
    hidden = np.zeros_like(mask)
    hidden[35, 60] = hidden[32, 73] = 1
    left = {(int(x), int(y)) for x, y in distances_of(mask, unknown=hidden).border}
    gone = {(int(x), int(y)) for x, y in everything} - left
    assert gone == set()
    hidden[32, 72] = 1
    hidden[38, 60] = 1
    left = {(int(x), int(y)) for x, y in distances_of(mask, unknown=hidden).border}
    gone = {(int(x), int(y)) for x, y in everything} - left
    assert gone == {*((x, 39) for x in range(58, 63))}
    hidden[32, 71] = 1
    left = {(int(x), int(y)) for x, y in distances_of(mask, unknown=hidden).border}
    assert {(int(x), int(y)) for x, y in everything} - left - gone == {(69, y) for y in range(30, 35)}


def test_every_views_distances_are_kept_as_long_as_the_evidence() -> None:
    hidden = np.zeros_like(disc())
    hidden[:, 36:58] = 255
    views = [
        ViewEvidence("a", np.zeros((61, 61, 3), np.uint8), disc(), disc()),
        ViewEvidence("b", np.zeros((61, 61, 3), np.uint8), disc(), disc(), unknown=hidden),
    ]
    evidence = FrameEvidence(3, tuple(views))
    exact, stepped = silhouette_distances(evidence, 20), silhouettes_by_camera(evidence, 20)
    for view, one in zip(views, exact, strict=True):
        for found, wanted in (
            (one, distances_of(view.mask, 20, unknown=view.unknown)),
            (stepped[view.camera], distances_of(view.mask, 20, exact=False, unknown=view.unknown)),
        ):
            np.testing.assert_array_equal(found.signed, wanted.signed)
            np.testing.assert_array_equal(found.border, wanted.border)
    assert silhouettes_by_camera(evidence, 20) is stepped
    assert len(silhouettes_by_camera(evidence)["a"].border) > 20
    assert (stepped["a"].signed != exact[0].signed).any()


def test_near_some_pixels_a_mask_has_what_passed_for_shadow_or_cannot_be_told() -> None:
    nothing = np.zeros((40, 60), np.uint8)
    mask, shadow, unknown = nothing.copy(), nothing.copy(), nothing.copy()
    mask[10:20, 5:15] = shadow[10:20, 15:40] = unknown[10:15, 40:50] = 255
    picture = np.zeros((40, 60, 3), np.uint8)
    views = [
        ViewEvidence("a", picture, mask, nothing, unknown=unknown, shadow=shadow),
        ViewEvidence("b", picture, mask, nothing),
    ]
    evidence, spot = FrameEvidence(3, tuple(views)), (np.array([[22, 14], [44, 12]]), 7.0)
    kept = silhouettes_by_camera(evidence, 20)
    shown = silhouettes_by_camera(evidence, 20, {"a": spot, "b": spot})
    assert silhouettes_by_camera(evidence, 20) is kept
    rows, columns = np.mgrid[:40, :60]
    near = np.minimum(np.hypot(columns - 22, rows - 14), np.hypot(columns - 44, rows - 12))
    for name, view in zip("ab", views, strict=True):
        left, top = shown[name].corner
        inside = np.zeros(mask.shape, np.bool_)
        signed = shown[name].signed
        inside[top : top + signed.shape[0], left : left + signed.shape[1]] = signed < 0.0
        doubted = (shadow | unknown) > 0 if view.shadow is not None else nothing > 0
        # A disc of pixels is round within a pixel.
        assert inside[(mask > 0) | (doubted & (near <= 6.0))].all()
        assert not inside[(mask == 0) & ~(doubted & (near <= 8.0))].any()
    np.testing.assert_array_equal(shown["b"].signed, kept["b"].signed)
