"""Plate and footage combined, on made-up rooms whose empty view is known."""

import numpy as np
import pytest

from studio.evidence.colour_fit import colour_line, fitted_line
from studio.evidence.combined_background import (
    AGREES,
    Combination,
    Origin,
    agreeing_frames,
    background_nearby,
    combine,
)

HEIGHT, WIDTH, COUNT = 160, 240, 24


def room(rng: np.random.Generator) -> np.ndarray:
    """A room of patches in different colours, (H, W, 3)."""
    patches = rng.integers(60, 200, (HEIGHT // 40, WIDTH // 40, 3))
    return np.kron(patches, np.ones((40, 40, 1))).astype(np.float64)


def frames_of(empty: np.ndarray, rng: np.random.Generator, width: int = 40) -> np.ndarray:
    """A dark person walking back and forth in the left half, with noise."""
    out = []
    for k in range(COUNT):
        picture = empty.copy()
        left = 20 + int(50 * (1 + np.sin(2 * np.pi * k / COUNT)) / 2 * 1.4)
        picture[30:150, left : left + width] = (25, 20, 30)
        out.append(np.clip(picture + rng.normal(0, 2.0, picture.shape), 0, 255).astype(np.uint8))
    return np.stack(out)


def test_a_person_in_the_plate_is_replaced_by_the_footage() -> None:
    rng = np.random.default_rng(1)
    empty = room(rng)
    plate = empty.copy()
    plate[40:140, 180:210] = (230, 30, 220)
    model, doubtful = combine(plate.astype(np.uint8), frames_of(empty, rng))
    assert np.abs(model.mean - empty).max(axis=2)[:, 150:].max() < 6.0
    assert np.mean(np.abs(model.mean - empty).max(axis=2) < 8.0) > 0.995
    assert doubtful[90, 195]
    assert not doubtful[90, 60]


def test_where_a_person_never_leaves_the_plate_is_right() -> None:
    rng = np.random.default_rng(2)
    empty = np.full((HEIGHT, WIDTH, 3), 150.0)
    seen = frames_of(empty, rng)
    seen[:, 60:140, 180:220] = (25, 20, 30)
    model, doubtful = combine(empty.astype(np.uint8), seen)
    assert np.abs(model.mean - empty)[60:140, 180:220].max() < 8.0
    assert not doubtful[100, 200]


def test_the_plate_is_made_the_footages_colours() -> None:
    rng = np.random.default_rng(3)
    empty = room(rng)
    plate = np.clip((empty - [4.0, -6.0, 9.0]) / [1.1, 0.9, 1.05], 0, 255)
    gains, offsets = fitted_line(plate.astype(np.uint8), frames_of(empty, rng))
    fitted = plate.astype(np.uint8) * gains + offsets
    assert np.median(np.abs(fitted - empty)) < 1.5


def test_a_line_through_most_pixels_is_found() -> None:
    rng = np.random.default_rng(4)
    x = rng.uniform(20, 200, (80, 80, 3)).astype(np.float32)
    y = np.clip(1.15 * x + 7.0 + rng.normal(0, 1.0, x.shape), 0, 255).astype(np.float32)
    y[:30] = 20.0
    gains, offsets = colour_line(x, y)
    assert gains == pytest.approx(1.15, abs=0.02)
    assert offsets == pytest.approx(7.0, abs=2.0)


def test_no_background_is_nearby_where_one_channel_is_another() -> None:
    empty = room(np.random.default_rng(4)).astype(np.float32)
    tinted = empty + np.array([0.0, 0.0, 2.0 * AGREES])
    frames = np.stack([empty, tinted]).astype(np.uint8)
    shares = background_nearby(frames, empty, np.zeros((HEIGHT, WIDTH), np.uint8))
    assert (shares[0] == 1.0).all()
    assert (shares[1] == 0.0).all()


def test_a_background_of_one_colour_keeps_its_ratio() -> None:
    gains, offsets = colour_line(
        np.full((40, 40, 3), 100.0, np.float32), np.full((40, 40, 3), 110.0, np.float32)
    )
    assert gains == pytest.approx(1.1)
    assert offsets == pytest.approx(0.0)


def test_counts_and_means_of_agreeing_frames_are_numpys() -> None:
    rng = np.random.default_rng(5)
    frames = rng.integers(0, 255, (9, 6, 7, 3), dtype=np.uint8)
    low, high = np.full((6, 7, 3), 60.0, np.float32), np.full((6, 7, 3), 220.0, np.float32)
    mean, deviation, count = agreeing_frames(frames, low, high)
    inside = np.asarray(((frames >= 60) & (frames <= 220)).all(axis=-1))
    assert (count == inside.sum(axis=0)).all()
    y, x = np.argwhere(count >= 2)[0]
    chosen = frames[inside[:, y, x], y, x].astype(float)
    assert mean[y, x] == pytest.approx(chosen.mean(axis=0), abs=1e-3)
    assert deviation[y, x] == pytest.approx(chosen.std(axis=0), abs=1e-2)


def test_coarse_decisions_are_applied_to_the_pixels_of_their_places() -> None:
    """Of the plate the fitted colour is taken, elsewhere the mean of the frames that agree with the plate around."""
    rng = np.random.default_rng(6)
    plate = rng.integers(60, 180, (16, 24, 3), dtype=np.uint8)
    gains, offsets = np.array([1.1, 0.95, 1.0], np.float32), np.array([3.0, -4.0, 0.0], np.float32)
    fitted = plate * gains + offsets
    frames = np.clip(fitted + rng.integers(-3, 4, (6, 16, 24, 3)), 0, 255).astype(np.uint8)
    frames[2, 10:] = 255  # somebody walks by
    origin = rng.choice([Origin.AGREEING, Origin.PLATE], (4, 6)).astype(np.uint8)
    top, selected = 4, rng.random((12, 24)) < 0.7
    out = np.full((16, 24, 3), 7, np.uint8)
    shares = np.ones((6, 4, 6), np.float32)
    Combination(origin, shares, gains, offsets).fill(plate, frames[:, top:], top, selected, out)
    for y, x in np.ndindex(16, 24):
        if y < top or not selected[y - top, x]:
            assert (out[y, x] == 7).all()
        elif origin[y // 4, x // 4] == Origin.PLATE:
            np.testing.assert_array_equal(out[y, x], np.uint8(fitted[y, x] + 0.5))
        else:
            around = plate[max(0, y - 1) : y + 2, max(0, x - 1) : x + 2].reshape(-1, 3)
            low, high = (
                around.min(axis=0) * gains + offsets - AGREES,
                around.max(axis=0) * gains + offsets + AGREES,
            )
            agreeing = ((frames[:, y, x] >= low) & (frames[:, y, x] <= high)).all(axis=1)
            np.testing.assert_array_equal(out[y, x], np.uint8(frames[agreeing, y, x].mean(axis=0) + 0.5))


@pytest.mark.parametrize("turns", range(4))
def test_only_the_plates_colours_beside_a_pixel_count(turns: int) -> None:
    """A stripe along one side of the plate, and two frames of its colour."""
    plate = np.full((5, 5, 3), 100, np.uint8)
    plate[0] = 200
    plate = np.ascontiguousarray(np.rot90(plate, turns))
    frames = np.full((6, 5, 5, 3), 100, np.uint8)
    frames[:2] = 200
    decisions = np.zeros((5, 5), np.uint8), np.ones((6, 5, 5), np.float32)
    out = np.zeros((5, 5, 3), np.uint8)
    agreeing = Combination(*decisions, np.ones(3, np.float32), np.zeros(3, np.float32))
    agreeing.fill(plate, frames, 0, np.ones((5, 5), np.bool_), out)
    rows = np.rot90(out, -turns)
    assert (rows[2:] == 100).all()
    assert (rows[1] == round((2 * 200 + 4 * 100) / 6)).all()
