"""The parts of a combined background against NumPy and SciPy, pixel by pixel."""

import numpy as np
import pytest
from scipy import ndimage

from studio.evidence.combined_background import (
    Combination,
    Origin,
    _fewer,
    _goes_on_better,
    _regions,
    agreeing_frames,
    background_nearby,
    combination,
    fewest_of,
    fill_from_most_alike,
)
from studio.evidence.masks import disc

Array = np.ndarray


def test_frames_agree_up_to_the_limits_themselves() -> None:
    rng = np.random.default_rng(5)
    frames = rng.integers(0, 12, (9, 6, 7, 3), dtype=np.uint8)
    low, high = (
        rng.integers(0, 4, (6, 7, 3)).astype(np.float32),
        rng.integers(8, 13, (6, 7, 3)).astype(np.float32),
    )
    mean, deviation, count = agreeing_frames(frames, low, high)
    inside = ((frames >= low) & (frames <= high)).all(axis=-1)
    np.testing.assert_array_equal(count, inside.sum(axis=0))
    assert {0, 1} < set(count.ravel().tolist())
    for y, x in np.ndindex(6, 7):
        chosen = frames[inside[:, y, x], y, x].astype(float) if count[y, x] else np.zeros((1, 3))
        np.testing.assert_allclose(mean[y, x], chosen.mean(axis=0), rtol=1e-6)
        np.testing.assert_allclose(deviation[y, x], chosen.std(axis=0), atol=1e-5)


def crowds(rng: np.random.Generator, count: int, height: int, width: int) -> Array:
    """(K, H, W, 3) frames whose pixels keep to one of three colours each, give or take what still counts as alike."""
    colours = rng.integers(20, 230, (3, height, width, 3))
    chosen = rng.integers(0, 3, (count, height, width))
    own = colours[chosen, *np.indices((height, width))]
    return np.clip(own + rng.integers(-12, 13, own.shape), 0, 255).astype(np.uint8)


def mode_of(values: Array, votes: Array) -> tuple[Array, Array]:
    """Mean and deviation of the rows (K, 3) that differ by 16 at most from the one that the most votes agree with."""
    near = (np.abs(values[:, None] - values[None]) <= 16.0).all(axis=2)
    own = near[int(np.argmax(near @ votes))]
    weights = votes[own] / votes[own].sum()
    mean = weights @ values[own]
    return mean, np.sqrt(np.maximum(weights @ values[own] ** 2 - mean**2, 0.0))


def test_what_is_unsure_becomes_what_the_most_alike_frames_show() -> None:
    rng = np.random.default_rng(7)
    frames = crowds(rng, 9, 10, 13)
    frames[1:3, 0, 0] = frames[0, 0, 0] // 2 + 16  # alike by the limit itself
    frames[1, 0, 0] += 16
    shares = rng.random((9, 3, 4)).astype(np.float32)
    shares[:, 0, 1] = 0.0
    unsure = rng.random((10, 13)) < 0.7
    unsure[0, 0] = True
    mean, deviation = np.full((10, 13, 3), -1.0, np.float32), np.full((10, 13, 3), -1.0, np.float32)
    fill_from_most_alike(frames, unsure, shares, mean, deviation)
    for y, x in np.ndindex(10, 13):
        if not unsure[y, x]:
            assert (mean[y, x] == -1.0).all()
            assert (deviation[y, x] == -1.0).all()
            continue
        votes = shares[:, y // 4, x // 4].astype(float) ** 8 + 1e-4
        wanted = mode_of(frames[:, y, x].astype(float), votes)
        np.testing.assert_allclose(mean[y, x], wanted[0], rtol=1e-5)
        np.testing.assert_allclose(deviation[y, x], wanted[1], rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("top", [0, 5])
def test_finer_pixels_take_the_plate_the_agreeing_frames_or_the_mode(top: int) -> None:
    """Of decisions that are no whole number of times coarser; where too few agree, the mode is taken."""
    rng = np.random.default_rng(8)
    plate = rng.integers(0, 256, (17, 22, 3), dtype=np.uint8)
    gains, offsets = np.array([1.2, 0.8, 1.0], np.float32), np.array([30.0, -40.0, 2.0], np.float32)
    frames = crowds(rng, 7, 17, 22)
    fitted = plate * gains.astype(float) + offsets
    agreeing = rng.integers(0, 4, (17, 22))
    for k in range(3):
        shown = np.clip(fitted + rng.integers(-4, 5, fitted.shape), 0, 255).astype(np.uint8)
        frames[k] = np.where((agreeing > k)[..., None], shown, frames[k])
    origin = rng.choice([Origin.AGREEING, Origin.MODE, Origin.PLATE], (7, 9)).astype(np.uint8)
    shares = rng.random((7, 3, 4)).astype(np.float32)
    selected = rng.random((17 - top, 22)) < 0.9
    out = np.full((17, 22, 3), 7, np.uint8)
    Combination(origin, shares, gains, offsets).fill(plate, frames[:, top:], top, selected, out)
    modes = 0
    for y, x in np.ndindex(17, 22):
        kind = origin[y * 7 // 17, x * 9 // 22]
        if y < top or not selected[y - top, x]:
            assert (out[y, x] == 7).all()
            continue
        if kind == Origin.PLATE:
            wanted = np.clip(fitted[y, x] + 0.5, 0.0, 255.0)
        else:
            around = plate[max(0, y - 1) : y + 2, max(0, x - 1) : x + 2].reshape(-1, 3)
            low, high = (
                around.min(axis=0) * gains.astype(float) + offsets - 16.0,
                around.max(axis=0) * gains.astype(float) + offsets + 16.0,
            )
            inside = ((frames[:, y, x] >= low) & (frames[:, y, x] <= high)).all(axis=1)
            if kind == Origin.AGREEING and inside.sum() >= 2:
                wanted = frames[inside, y, x].mean(axis=0) + 0.5
            else:
                votes = shares[:, y * 3 // 17, x * 4 // 22].astype(float) ** 8 + 1e-4
                wanted = mode_of(frames[:, y, x].astype(float), votes)[0] + 0.5
                modes += kind == Origin.AGREEING
        np.testing.assert_array_equal(out[y, x], wanted.astype(np.uint8))
    assert modes > 3


def shares_around(values: Array, reach: int) -> Array:
    return ndimage.uniform_filter(values.astype(np.float64), 2 * reach + 1, mode="mirror")


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_the_background_nearby_is_its_share_of_the_smallest_surroundings_that_are_known(
    factor: float,
) -> None:
    """Squares of 8, 16, 32 steps of four pixels to each side, in pictures that are not reduced."""
    rng = np.random.default_rng(9)
    mean = rng.uniform(30.0, 200.0, (310, 402, 3)).astype(np.float32)
    away = rng.choice([0.0, 15.0, 17.0], (3, 310, 402, 1)) * rng.choice([-1.0, 1.0], (3, 310, 402, 3))
    frames = np.rint(mean + away).clip(0, 255).astype(np.uint8)
    unsure = np.zeros((310, 402), np.uint8)
    unsure[20:300, 40:390] = 1
    unsure[100:160, 100:200] = rng.random((60, 100)) < 0.7
    known = unsure[::4, ::4] == 0
    found = background_nearby(frames, mean, unsure, factor)
    assert found.shape == (3, 78, 101)
    for frame, share in zip(frames, found, strict=True):
        empty = known & (np.abs(frame[::4, ::4].astype(np.float32) - mean[::4, ::4]).max(axis=2) <= 16.0)
        expected = np.full(known.shape, 0.5)
        for reach in (32, 16, 8):
            reach = max(1, round(reach / factor))
            near = shares_around(known, reach)
            enough = near > 0.15
            expected[enough] = shares_around(empty, reach)[enough] / near[enough]
        close = np.abs(share - expected) < 1e-4
        # Where exactly so much is known, both ways are right.
        assert close.mean() > 0.99
    assert factor == 1.0 or (found == 0.5).any()


def test_fewer_pixels_and_frames() -> None:
    assert [_fewer(pixels, 4.0) for pixels in (40, 10, 5, 1)] == [10, 2, 1, 1]
    assert [fewest_of(np.zeros((count, 1, 1, 3), np.uint8)) for count in (1, 24, 31, 32, 50, 100)] == [
        2, 2, 2, 3, 4, 8,
    ]  # fmt: skip


def test_regions_are_wide_pieces_of_what_is_unsure_with_what_opening_took_off() -> None:
    unsure = np.zeros((120, 160), np.uint8)
    unsure[30:60, 40:70] = 1
    unsure[40:46, 70:100] = 1  # narrower than the opening
    unsure[30:60, 100:125] = 1
    unsure[90:111, 2:23] = 1  # 441 pixels less the corners, by the left side
    unsure[1:20, 60:80] = 1  # 380 pixels
    unsure[70:72, 30:32] = 1
    for factor, rim, reach, count in ((1.0, 5, 4, 3), (2.0, 2, 2, 3)):
        labels, number = ndimage.label(ndimage.binary_opening(unsure, disc(reach)), np.ones((3, 3)))
        wide = [label for label in range(1, number + 1) if (labels == label).sum() >= 385 / factor**2]
        assert len(wide) == count
        found = _regions(unsure, rim, factor)
        assert len(found) == count
        for (y, x, inside), label in zip(found, wide, strict=True):
            rows, columns = (np.flatnonzero((labels == label).any(axis=axis)) for axis in (1, 0))
            assert (y.start, y.stop) == (max(rows[0] - 2 * rim, 0), rows[-1] + 1 + 2 * rim)
            assert (x.start, x.stop) == (max(columns[0] - 2 * rim, 0), columns[-1] + 1 + 2 * rim)
            grown = ndimage.maximum_filter(labels == label, 2 * reach + 1)
            np.testing.assert_array_equal(inside, (grown & (unsure > 0))[y, x])


def plain_edges(
    plate: Array, footage: Array, inside: Array, unsure: Array, reach: int
) -> tuple[float, float] | None:
    known = (unsure == 0).astype(float)
    near = shares_around(known, reach)
    around = np.stack([shares_around(footage[..., c] * known, reach) for c in range(3)], axis=2)
    around /= np.maximum(near, 1e-6)[..., None]
    core = ndimage.minimum_filter(inside.astype(np.uint8), reach | 1, mode="nearest") > 0
    rim = inside & ~core & (near > 0.1)
    if not rim.any():
        return None
    one, other = (
        float(np.minimum(np.abs(picture[rim] - around[rim]).max(axis=1), 60.0).mean())
        for picture in (plate, footage)
    )
    return one, other


def test_the_plate_goes_on_better_where_its_edge_along_the_border_is_clearly_weaker() -> None:
    rng = np.random.default_rng(10)
    unsure = np.zeros((60, 70), np.uint8)
    unsure[20:40, 22:45] = 1
    unsure[28:34, 45:60] = 1
    y, x = slice(8, 52), slice(10, 66)
    inside = unsure[y, x] > 0
    footage = (100.0 + rng.normal(0.0, 4.0, (60, 70, 3))).astype(np.float32)
    ratios = []
    for strength in np.linspace(2.0, 90.0, 40):
        plate = (footage + rng.normal(0.0, 4.0, footage.shape)).astype(np.float32)
        plate[unsure > 0] += 14.0
        shown = footage.copy()
        shown[unsure > 0] += strength * np.array([0.2, 1.0, -0.4], np.float32)
        for reach in (2, 5):
            edges = plain_edges(plate[y, x], shown[y, x], inside, unsure[y, x], reach)
            assert edges is not None
            ratios.append(edges[0] / edges[1])
            better = _goes_on_better(plate, shown, (y, x, inside), unsure, reach)
            assert better == (edges[0] < 0.75 * edges[1])
    assert min(ratios) < 0.4
    assert sum(0.7 < ratio < 0.8 for ratio in ratios) > 1
    assert not _goes_on_better(plate, shown, (y, x, np.zeros_like(inside)), unsure, 5)
    everywhere = np.ones_like(unsure)
    assert not _goes_on_better(plate, shown, (y, x, inside), everywhere, 5)


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_decisions_say_where_each_pixel_came_from_and_how_far_doubt_reaches(factor: float) -> None:
    """A box that was removed since the plate, and somebody who never leaves; the largest noise is kept down."""
    rng = np.random.default_rng(11)
    empty = np.full((200, 300, 3), 120.0)
    plate = empty.copy()
    plate[80:120, 200:240] = (230.0, 40.0, 200.0)
    frames = np.clip(empty + rng.normal(0.0, 2.0, (12, 200, 300, 3)), 0, 255).astype(np.uint8)
    frames[:, 80:130, 50:90] = (25, 20, 30)
    frames[::2, 150:160, 150:160] = 134
    model, doubtful, made = combination(plate.astype(np.uint8), frames, factor)
    assert set(np.unique(made.origin)) == {0, 1, 2}
    assert (made.origin[90:110, 210:230] == Origin.MODE).all()
    assert (made.origin[90:120, 60:80] == Origin.PLATE).all()
    assert made.origin[20, 20] == Origin.AGREEING
    assert np.abs(model.mean[90:110, 210:230] - 120.0).max() < 4.0
    assert np.abs(model.mean[90:120, 60:80] - 120.0).max() < 3.0
    assert not model.variance[90:120, 60:80].any()
    np.testing.assert_allclose(model.variance[150:160, 150:160].max(), 36.0)
    reach = round(40 / factor)
    row = np.flatnonzero(doubtful[100])
    assert abs(row[0] - (200 - reach)) <= 1
    assert abs(row[-1] - (239 + reach)) <= 1
    assert not doubtful[:, :120].any()
    assert made.shares.shape == (12, 50, 75)
