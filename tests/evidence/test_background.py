"""Background models: noise, gain, shadows, ghosts, and masks that depend on nothing but the frame."""

import dataclasses

import cv2
import numpy as np
import pytest

from studio.evidence.background import (
    MIXED,
    GaussianBackground,
    SubtractorBackground,
    differing_pixels,
    drop_shadows,
    gain_ratios,
    gaussian_from_frames,
    gaussian_from_median,
    possible_shadows,
    shadow_brightness,
    shadows_together,
)
from studio.evidence.settings import EvidenceSettings

HEIGHT, WIDTH, NOISE = 96, 128, 3.0
SETTINGS = EvidenceSettings()
ROOM = np.random.default_rng(7).uniform(60.0, 200.0, (HEIGHT, WIDTH, 3))
PERSON = (slice(30, 70), slice(50, 75))
SHADOW = (slice(70, 85), slice(50, 90))


def seen(light: np.ndarray, seed: int) -> np.ndarray:
    """A camera's picture of `light` with noise."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, light.shape)
    return np.clip(np.round(light + noise), 0, 255).astype(np.uint8)


def scene(seed: int, gain: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> tuple[np.ndarray, np.ndarray]:
    """A frame with a person in a colour of their own and a shadow of 70 %, and the person's mask."""
    light = ROOM.copy()
    light[SHADOW] *= 0.7
    light[PERSON] = (30.0, 60.0, 230.0)
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[PERSON] = True
    return seen(light * np.array(gain), seed), mask


def model() -> GaussianBackground:
    return gaussian_from_frames([seen(ROOM, seed) for seed in range(100, 130)])


def test_mean_and_deviation_of_an_empty_clip() -> None:
    frames = [seen(ROOM, seed) for seed in range(40)]
    found = gaussian_from_frames(frames)
    np.testing.assert_allclose(found.mean, np.mean(frames, axis=0), rtol=1e-5)
    np.testing.assert_allclose(np.sqrt(found.variance), np.std(frames, axis=0), atol=2e-2)


def test_person_is_found_and_the_shadow_is_not() -> None:
    frame, mask = scene(1)
    found = model().foreground(frame, SETTINGS).mask > 0
    assert found[mask].mean() > 0.99
    assert found[SHADOW].mean() < 0.03
    assert found[~mask].mean() < 0.002
    without = dataclasses.replace(SETTINGS, mask_shadow_test=False)
    assert (model().foreground(frame, without).mask > 0)[SHADOW].mean() > 0.95


def test_skin_on_a_floor_of_nearly_its_colour_is_no_shadow() -> None:
    """Its colour lies 3 % to 4 % from that of a darker floor, and so does that of single pixels of a noisy shadow."""
    floor = np.broadcast_to((90.0, 120.0, 160.0), ROOM.shape)
    skin, shadow = (slice(20, 70), slice(50, 75)), (slice(70, 85), slice(50, 90))
    light = floor.copy()
    light[skin] = 0.7 * floor[skin] + (-6.0, 0.0, 5.0)
    light[shadow] = 0.7 * floor[shadow]
    background = gaussian_from_frames([seen(floor, seed) for seed in range(100, 130)])
    found = background.foreground(seen(light, 5), SETTINGS).mask > 0
    assert found[skin].mean() > 0.85
    assert found[shadow].mean() < 0.03
    for tolerance in (0.01, 0.02, 0.03, 0.04):
        alone = dataclasses.replace(SETTINGS, mask_shadow_window=1, mask_shadow_colour=tolerance)
        found = background.foreground(seen(light, 5), alone).mask > 0
        assert found[skin].mean() < 0.7 or found[shadow].mean() > 0.1


@pytest.mark.parametrize("window", [1, 3, 5, 15])
def test_shadows_are_those_of_a_plain_sum_over_the_changed_pixels_around(window: int) -> None:
    frame, _ = scene(4, (0.9, 1.0, 1.1))
    settings = dataclasses.replace(SETTINGS, mask_shadow_window=window)
    background = model()
    changed = background.foreground(frame, dataclasses.replace(settings, mask_shadow_test=False)).mask > 0
    expected = background.mean.astype(np.float64) * background.gain(frame)
    seen_colours, reach = frame.astype(np.float64), window // 2

    def off_colour(value: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        share = (value * wanted).sum(-1, keepdims=True) / (wanted**2).sum(-1, keepdims=True)
        return value - share * wanted

    def limit(wanted: np.ndarray) -> np.ndarray:
        return settings.mask_shadow_colour**2 * (wanted**2).sum(-1)

    share = (seen_colours * expected).sum(-1) / (expected**2).sum(-1)
    near = (off_colour(seen_colours, expected) ** 2).sum(-1) < limit(expected) + 9.0 * settings.mask_noise**2
    possible = changed & (share >= settings.mask_shadow_darkest) & (share < 1.0) & near
    found = changed.copy()
    for y, x in zip(*np.nonzero(possible), strict=True):
        around = (slice(max(y - reach, 0), y + reach + 1), slice(max(x - reach, 0), x + reach + 1))
        chosen = possible[around]
        value, wanted = seen_colours[around][chosen].mean(axis=0), expected[around][chosen].mean(axis=0)
        away = off_colour(value, wanted)
        if away @ away < limit(wanted) + settings.mask_noise**2 / chosen.sum():
            found[y, x] = False
    if reach:
        # A border's pixel decides alone, within a wider tolerance.
        inside = np.pad(found, 1, constant_values=True)
        inside = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
        loose = float(MIXED) ** 2 * limit(expected) + settings.mask_noise**2
        alone = (off_colour(seen_colours, expected) ** 2).sum(-1) < loose
        found &= ~(~inside & alone & (share >= settings.mask_shadow_darkest) & (share < 1.0))
    differing = (background.foreground(frame, settings).mask > 0) != found
    # The background is summed in sixteenths of a grey level.
    assert changed.sum() > 1000
    assert differing.sum() <= 0.002 * changed.sum()


def test_shadows_darker_than_allowed_are_foreground() -> None:
    frame, _ = scene(1)
    strict = dataclasses.replace(SETTINGS, mask_shadow_darkest=0.8)
    assert (model().foreground(frame, strict).mask > 0)[SHADOW].mean() > 0.9


def test_the_threshold_counts_deviations() -> None:
    frame = seen(ROOM, 50)
    plain = dataclasses.replace(SETTINGS, mask_shadow_test=False, mask_gain_fit=False, mask_noise=NOISE)
    background = GaussianBackground(ROOM.astype(np.float32), np.zeros_like(ROOM, np.float32))
    for threshold in (2.0, 3.0):
        chosen = dataclasses.replace(plain, mask_threshold=threshold)
        outside = np.abs(frame - ROOM.astype(np.float32)).max(axis=2) > np.float32(threshold * NOISE)
        np.testing.assert_array_equal(background.foreground(frame, chosen).mask > 0, outside)


def test_another_exposure_is_fitted() -> None:
    gain = (0.85, 1.1, 1.05)
    frame, mask = scene(2, gain)
    np.testing.assert_allclose(model().gain(frame), gain, atol=0.02)
    found = model().foreground(frame, SETTINGS).mask > 0
    assert found[~mask].mean() < 0.01
    unfitted = dataclasses.replace(SETTINGS, mask_gain_fit=False, mask_shadow_test=False)
    assert (model().foreground(frame, unfitted).mask > 0)[~mask].mean() > 0.2


def test_grey_pictures_have_no_shadow_test() -> None:
    grey = np.repeat(ROOM[:, :, :1], 3, axis=2)
    background = gaussian_from_frames([np.round(grey).astype(np.uint8)])
    assert background.is_grey
    dark = np.round(grey * 0.7).astype(np.uint8)
    fixed = dataclasses.replace(SETTINGS, mask_gain_fit=False)
    assert (background.foreground(dark, fixed).mask > 0).mean() > 0.8
    assert not model().is_grey


def walking(frames: int) -> list[np.ndarray]:
    """A person who crosses the room."""
    found = []
    for number in range(frames):
        light = ROOM.copy()
        light[30:70, 4 * number : 4 * number + 20] = (30.0, 60.0, 230.0)
        found.append(seen(light, number))
    return found


def test_the_median_has_no_person_walking_through() -> None:
    background = gaussian_from_median(np.stack(walking(27)))
    assert np.abs(background.mean - ROOM).max() < 4 * NOISE
    assert np.abs(np.median(np.sqrt(background.variance)) - NOISE) < 0.6


def test_median_and_deviation_are_numpys() -> None:
    frames = walking(9)
    background = gaussian_from_median(np.stack(frames))
    median = np.median(frames, axis=0)
    np.testing.assert_allclose(background.mean, median)
    deviation = np.minimum(1.4826 * np.median(np.abs(np.array(frames) - median), axis=0), 20.0)
    np.testing.assert_allclose(np.sqrt(background.variance), deviation, rtol=1e-5)


@pytest.mark.parametrize("kind", ["mog2", "knn"])
def test_opencvs_models_find_the_person(kind: str) -> None:
    background = SubtractorBackground(kind, [seen(ROOM, seed) for seed in range(100, 140)])
    frame, mask = scene(1)
    found = background.foreground(frame, SETTINGS).mask > 0
    assert found[mask].mean() > 0.95
    assert found[~mask].mean() < 0.05


@pytest.mark.parametrize("kind", ["mog2", "knn"])
def test_opencvs_masks_depend_on_the_frame_alone(kind: str) -> None:
    training = walking(20)
    frames = [scene(seed)[0] for seed in range(12)]
    one, other = SubtractorBackground(kind, training), SubtractorBackground(kind, training)
    first = [one.foreground(frame, SETTINGS).mask for frame in frames]
    touched = dataclasses.replace(SETTINGS, mask_threshold=2.0, mask_shadow_test=False)
    for number in (5, 11, 0, 3, 3, 7, 1, 10, 2, 4, 6, 8, 9):
        other.foreground(frames[number], touched)
        np.testing.assert_array_equal(other.foreground(frames[number], SETTINGS).mask, first[number])


@pytest.mark.parametrize(("threshold", "noise"), [(4.0, 4.0), (1.0, 2.0), (0.5, 0.5)])
def test_differences_are_those_of_every_pixel(threshold: float, noise: float) -> None:
    rng = np.random.default_rng(3)
    mean = rng.uniform(20.0, 230.0, (40, 53, 3)).astype(np.float32)
    deviation = rng.uniform(0.0, 6.0, mean.shape).astype(np.float32)
    picture = np.clip(mean + rng.normal(0.0, 8.0, mean.shape), 0.0, 255.0).astype(np.uint8)
    settings = dataclasses.replace(
        EvidenceSettings(), mask_threshold=threshold, mask_noise=noise, mask_gain_fit=False,
        mask_shadow_test=False,
    )  # fmt: skip
    away = picture.astype(np.float32) - mean
    limit = np.float32(threshold**2) * np.maximum(deviation**2, np.float32(noise**2))
    expected = np.where((away * away > limit).any(axis=2), 255, 0)
    assert 0.02 < np.mean(expected > 0) <= 1.0
    np.testing.assert_array_equal(
        GaussianBackground(mean, deviation).foreground(picture, settings).mask, expected
    )


def test_what_never_changes_has_no_deviation() -> None:
    assert (gaussian_from_frames([seen(ROOM, 1)] * 3).variance == 0.0).all()


def shaded(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture (18, 23, 3), its background's mean, and which pixels changed: most of them shadows of some kind."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform(2.0, 230.0, (18, 23, 3)).astype(np.float32)
    share = rng.uniform(0.3, 1.1, (18, 23, 1))
    picture = np.clip(mean * share + rng.normal(0.0, 3.0, mean.shape), 0.0, 255.0).astype(np.uint8)
    changed = np.where(rng.random((18, 23)) < 0.8, np.uint8(255), np.uint8(0))
    changed[:2], changed[:, :3], changed[17], changed[:, 21:] = 0, 0, 0, 0
    return picture, mean, changed


GAIN = np.array([0.9, 1.05, 1.2], np.float32)


def off_colour(value: np.ndarray, wanted: np.ndarray) -> tuple[float, float, float]:
    """The share of the wanted colour in a colour, what is left of it, squared, and the wanted one's square."""
    norm = float(wanted @ wanted)
    share = float(value @ wanted) / max(norm, 1.0)
    return share, float(value @ value) - share * float(value @ wanted), norm


def plainly_possible(picture: np.ndarray, mean: np.ndarray, changed: np.ndarray, noise: float) -> np.ndarray:
    out = np.zeros_like(changed)
    for y, x in np.argwhere(changed):
        share, away, norm = off_colour(picture[y, x].astype(float), (GAIN * mean[y, x]).astype(float))
        if 0.5 <= share < 1.0 and away < 0.05**2 * norm + noise:
            out[y, x] = 255
    return out


def plainly_together(
    picture: np.ndarray, mean: np.ndarray, possible: np.ndarray, noise: float, reach: int
) -> np.ndarray:
    out, sixteenths = np.zeros_like(possible), np.rint(16.0 * GAIN * mean) / 16.0
    for y, x in np.argwhere(possible):
        around = np.s_[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
        chosen = possible[around] > 0
        value, wanted = picture[around][chosen].mean(axis=0), sixteenths[around][chosen].mean(axis=0)
        _, away, norm = off_colour(value, wanted.astype(float))
        if away < 0.05**2 * norm + noise / chosen.sum():
            out[y, x] = 255
    return out


def box_of(mask: np.ndarray) -> tuple[int, int, int, int]:
    rows, columns = np.nonzero(mask)
    return columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1


@pytest.mark.parametrize("seed", range(4))
def test_what_may_be_shadow_is_darker_and_of_the_backgrounds_colour(seed: int) -> None:
    picture, mean, changed = shaded(seed)
    mean[5, 5], picture[5, 5], changed[5, 5] = 0.0, 0, 255  # as black as can be
    limits = np.float32(30.0), np.float32(0.5), np.float32(0.05)
    possible = possible_shadows(changed, box_of(changed), picture, mean, GAIN, *limits)
    np.testing.assert_array_equal(possible, plainly_possible(picture, mean, changed, 30.0))
    assert 0.1 < (possible > 0)[changed > 0].mean() < 0.9
    part = possible_shadows(changed, (4, 3, 9, 7), picture, mean, GAIN, *limits)
    expected = np.zeros_like(possible)
    expected[3:10, 4:13] = possible[3:10, 4:13]
    np.testing.assert_array_equal(part, expected)


@pytest.mark.parametrize("size", [1, 4])
def test_a_cells_shadow_is_as_bright_as_its_pixels_are_beside_the_background(size: int) -> None:
    picture, mean, changed = shaded(5)
    brightness = shadow_brightness(changed, box_of(changed), picture, mean, GAIN, size)
    assert brightness.shape == (-(-18 // size), -(-23 // size))
    for row, column in np.ndindex(*brightness.shape):
        place = np.s_[row * size : (row + 1) * size, column * size : (column + 1) * size]
        pixels = changed[place] > 0
        wanted = (GAIN * mean[place]).astype(float)[pixels]
        share = (picture[place][pixels] * wanted).sum() / (wanted**2).sum() if pixels.any() else 0.0
        assert brightness[row, column] == pytest.approx(share, rel=1e-5)


@pytest.mark.parametrize("reach", [1, 2, 7])
def test_shadows_together_are_those_of_the_mean_colours_around(reach: int) -> None:
    for seed in range(4):
        picture, mean, changed = shaded(seed)
        possible = np.where(changed > 0, plainly_possible(picture, mean, changed, 300.0), 0).astype(np.uint8)
        given = possible, box_of(possible), picture, mean, GAIN, np.float32(9.0), np.float32(0.05), reach
        expected = plainly_together(picture, mean, possible, 9.0, reach)
        np.testing.assert_array_equal(shadows_together(*given), expected)
        assert 0.01 < (expected > 0)[possible > 0].mean() < 0.97


@pytest.mark.parametrize("reach", [0, 2])
def test_shadows_are_dropped_together_and_at_the_border_alone(reach: int) -> None:
    for seed in range(4):
        picture, mean, changed = shaded(seed)
        given = picture, mean, GAIN, np.float32(9.0), np.float32(0.5), np.float32(0.05), reach
        left = drop_shadows(changed, *given)
        if reach:
            possible = plainly_possible(picture, mean, changed, 9.0 * 9.0)
            expected = changed - plainly_together(picture, mean, possible, 9.0, reach)
            inner = cv2.erode(expected, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
            for y, x in np.argwhere(expected - inner):
                wanted = (GAIN * mean[y, x]).astype(float)
                share, away, norm = off_colour(picture[y, x].astype(float), wanted)
                if 0.5 <= share < 1.0 and away < (1.6 * 0.05) ** 2 * norm + 9.0:
                    expected[y, x] = 0
        else:
            expected = changed - plainly_possible(picture, mean, changed, 9.0)
        np.testing.assert_array_equal(left, expected)
        assert 0.1 < (left > 0)[changed > 0].mean() < 0.95


def test_a_gain_is_the_median_ratio_of_every_eighth_pixel_that_is_neither_dark_nor_bright() -> None:
    rng = np.random.default_rng(5)
    mean = rng.integers(0, 256, (180, 181, 3)).astype(np.uint8)
    mean[::8, ::16] = np.array([20, 245, 21], np.uint8)
    picture = np.clip(mean * [0.8, 1.1, 2.5] + rng.normal(0.0, 9.0, mean.shape), 0, 255).astype(np.uint8)
    picture[::8, 8::16, 0] = 245
    background = GaussianBackground(mean)
    samples = mean[::8, ::8].astype(np.float32)
    ratios, counts = gain_ratios(picture, samples)
    gains = background.gain(picture)
    for c, (gain, least, most) in enumerate(zip(gains, (0.5,) * 3, (2.0,) * 3, strict=True)):
        value, behind = picture[::8, ::8, c].astype(np.float32), samples[..., c]
        usable = (behind > 20.0) & (behind < 245.0) & (value < 245.0)
        expected = value[usable] / behind[usable]
        np.testing.assert_array_equal(ratios[c, : counts[c]], expected)
        assert gain == np.float32(np.clip(np.median(expected), least, most) if len(expected) >= 64 else 1.0)
    assert len(set(gains.tolist())) == 3
    bright, dark = np.full((80, 80, 3), 200, np.uint8), np.full((80, 80, 3), 40, np.uint8)
    assert (GaussianBackground(bright).gain(dark) == 0.5).all()


@pytest.mark.parametrize(("count", "gain"), [(63, 1.0), (64, 0.75)])
def test_a_gain_takes_sixty_four_pixels(count: int, gain: float) -> None:
    mean = np.zeros((64, 64, 3), np.uint8)
    for number in range(count):
        mean[8 * (number // 8), 8 * (number % 8)] = 100
    assert GaussianBackground(mean).gain((mean * 0.75).astype(np.uint8)).tolist() == [gain] * 3


def test_a_background_is_grey_where_its_colours_hardly_differ() -> None:
    level = np.full((16, 16, 3), 100, np.uint8)
    for apart, grey in ((1, True), (2, False), (3, False)):
        level[..., 2] = 100 + apart
        assert GaussianBackground(level).is_grey == grey
    settings = dataclasses.replace(SETTINGS, mask_shadow_test=True)
    assert GaussianBackground(level).tests_shadows(settings)
    assert not GaussianBackground(level).tests_shadows(dataclasses.replace(settings, mask_shadow_test=False))
    level[..., 2] = 100
    assert not GaussianBackground(level).tests_shadows(settings)


def test_two_pictures_have_a_mean_and_a_deviation_and_a_plate_none() -> None:
    rng = np.random.default_rng(2)
    one, other = rng.integers(0, 256, (2, 7, 9, 3), dtype=np.uint8)
    background = gaussian_from_frames([one, other])
    np.testing.assert_allclose(background.mean, (one / 2.0 + other / 2.0), rtol=1e-6)
    deviation = np.abs(one.astype(float) - other) / 2.0
    np.testing.assert_allclose(np.sqrt(background.variance), deviation, rtol=1e-4, atol=1e-3)
    plate = gaussian_from_frames([one])
    assert plate.mean.dtype == np.uint8
    assert plate.variance.shape == (1, 9, 3)
    assert not plate.variance.any()


def test_a_mean_between_grey_levels_is_compared_as_it_is() -> None:
    """Rounded means only tell where nothing needs to be looked at: half a level decides here, times the gain."""
    mean = np.full((3, 40, 3), 100.5, np.float32)
    variance = np.zeros((1, 40, 3), np.float32)
    variance[0, 20:] = 25.0
    picture = np.full((3, 40, 3), 201, np.uint8)
    picture[1, :, 1], picture[2, ::3, 2] = 205, 197
    gain, rough = np.full(3, 2.0, np.float32), np.rint(mean).astype(np.uint8)
    for threshold in (0.99, 1.01):
        given = gain, np.float32(threshold), np.float32(16.0)
        found = differing_pixels(picture, mean, rough, variance, *given)
        expected = np.zeros((3, 40), np.uint8)
        if threshold < 1.0:
            expected[1, :20], expected[2, :20:3] = 255, 255
        np.testing.assert_array_equal(found, expected)
    exactly = differing_pixels(picture, mean, rough, variance, gain, np.float32(1.0), np.float32(16.0))
    assert not exactly.any()


@pytest.mark.parametrize("kind", ["mog2", "knn"])
def test_opencvs_models_mark_the_shadow(kind: str) -> None:
    frame, mask = scene(1)
    background = SubtractorBackground(kind, [seen(ROOM, seed) for seed in range(100, 140)])
    given = dataclasses.replace(SETTINGS, mask_shadow_darkest=0.5)
    found = background.foreground(frame, given)
    assert set(np.unique(found.shadow)) == {0, 255} == set(np.unique(found.mask))
    assert (found.shadow > 0)[SHADOW].mean() > 0.6
    assert (found.shadow > 0)[mask].mean() < 0.05
    assert not (found.shadow & found.mask).any()
    stricter = background.foreground(frame, dataclasses.replace(given, mask_shadow_darkest=0.9))
    assert (stricter.shadow > 0)[SHADOW].mean() < 0.05
    higher = background.foreground(
        frame, dataclasses.replace(given, mask_threshold=3.0 * SETTINGS.mask_threshold)
    )
    assert 0.0 < (higher.mask > 0).mean() < (found.mask > 0).mean() + 0.01
