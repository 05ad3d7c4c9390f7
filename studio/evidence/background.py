"""Background models: a camera's view without the subject, and the pixels of a frame that differ from it.

`GaussianBackground` keeps a mean and a standard deviation for each pixel and colour (section 4.2.2 uses
thresholded background subtraction). Its shadow test follows Horprasert et al. 1999: a pixel whose
colour is the background's, only darker, is background; unlike there the colour is that of a few changed pixels
together, not of one, whose noise would hide the difference between a shadow and skin. OpenCV's MOG2 and KNN models are
trained on a fixed set of frames and then only applied (learning rate 0), so that a frame's mask does not depend on the
frames processed before.
"""

import threading
from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.cells import cell_size
from studio.evidence.settings import EvidenceSettings
from studio.foundations.arrays import Bytes, Floats
from studio.foundations.numba_in_threads import EXACT, KERNEL, njit

GAIN_STRIDE = 8
GAIN_RANGE = (0.5, 2.0)
GAIN_LEAST_LEVEL, GAIN_MOST_LEVEL = 20.0, 245.0
GAIN_LEAST_PIXELS = 64
GREY_SPREAD = 2.0
"""Grey levels: a background whose colours differ by less on average is grey, and shadows cannot be detected by
colour."""
BACKGROUND_SHARE = 0.7
"""Weight of the mixture's Gaussians that are background; rarer ones are foreground."""
LEAST_VARIANCE = 16.0
"""Least variance of the mixture's Gaussians: from a few still training frames a pixel's noise is underestimated."""
SHADOW_MARK = 127
"""Of OpenCV's models."""
FROZEN = {"mog2": 0.0, "knn": 1e-8}
"""Learning rates that change nothing (0 means "now" to OpenCV's KNN). Both models then see the training
frames twice more, so that updates already due and the order of a mixture's Gaussians are settled."""


class Foreground(NamedTuple):
    """A picture's pixels before any clean-up, each (H, W) uint8, 0 or 255. mask : those that differ from the background
    and are no shadow. shadow : those that differ and pass for a shadow. brightness : (h, w) of the shadows in each of
    `floor_shadows`' cells, as a share of the background's, 0 without any; None: it was not measured.
    """

    mask: Bytes
    shadow: Bytes
    brightness: Floats | None = None


class BackgroundModel(Protocol):
    """One camera's background, fitted."""

    def foreground(self, picture: Bytes, settings: EvidenceSettings) -> Foreground:
        """What of a picture (H, W, 3) differs from the background."""
        ...


class GaussianBackground:
    """A mean and a standard deviation for each pixel and colour.

    mean : (H, W, 3) grey levels, BGR, uint8 where a picture was given, else float32. variance : (H, W, 3) float32, or
    (1, W, 3) where all rows have the same, as of a plate's zeros: a full-HD plate holds 6 MB so, not 50.
    """

    def __init__(self, mean: Bytes | Floats, deviation: Floats | None = None) -> None:
        """mean, deviation : (H, W, 3) grey levels, BGR; no deviation: 0, the noise knob rules."""
        self.mean: NDArray[np.uint8 | np.float32] = np.ascontiguousarray(
            mean, dtype=np.uint8 if mean.dtype == np.uint8 else np.float32
        )
        if deviation is None:
            self.variance = np.zeros((1, *self.mean.shape[1:]), np.float32)
        else:
            self.variance = np.ascontiguousarray(deviation, dtype=np.float32) ** 2
        # A picture's own bytes, not another array of them.
        self._rough: Bytes = (
            np.rint(self.mean).astype(np.uint8) if mean.dtype != np.uint8 else self.mean.view(np.uint8)
        )
        self._samples = self.mean[::GAIN_STRIDE, ::GAIN_STRIDE].astype(np.float32)
        self.is_grey = float(np.ptp(self._samples, axis=2).mean()) < GREY_SPREAD

    @property
    def picture(self) -> Bytes:
        """(H, W, 3) BGR: the mean, in whole grey levels."""
        return self._rough

    def foreground(self, picture: Bytes, settings: EvidenceSettings) -> Foreground:
        """What of a picture (H, W, 3) differs from the background."""
        gain = self.gain(picture) if settings.mask_gain_fit else np.ones(3, np.float32)
        picture, noise = np.ascontiguousarray(picture), np.float32(settings.mask_noise**2)
        threshold = np.float32(settings.mask_threshold**2)
        changed = differing_pixels(picture, self.mean, self._rough, self.variance, gain, threshold, noise)
        if not self.tests_shadows(settings):
            return Foreground(changed, np.zeros_like(changed))
        mask = drop_shadows(
            changed,
            picture,
            self.mean,
            gain,
            noise,
            np.float32(settings.mask_shadow_darkest),
            np.float32(settings.mask_shadow_colour),
            settings.mask_shadow_window // 2,
        )
        shadow = changed - mask
        if not settings.mask_shadow_floor or not settings.mask_shadow_alike:
            return Foreground(mask, shadow)
        size = cell_size(*shadow.shape)
        return Foreground(
            mask,
            shadow,
            shadow_brightness(shadow, cv2.boundingRect(shadow), picture, self.mean, gain, size),
        )

    def tests_shadows(self, settings: EvidenceSettings) -> bool:
        """Whether darker pixels may count as background: a grey picture has no colour to compare."""
        return settings.mask_shadow_test and not self.is_grey

    def gain(self, picture: Bytes) -> Floats:
        """(3,) factor on each colour of the background, from the median pixel (people cover less than half)."""
        ratios, counts = gain_ratios(picture, self._samples)
        gains, (least, most) = np.ones(3, np.float32), GAIN_RANGE
        for channel, count in enumerate(counts):
            if count >= GAIN_LEAST_PIXELS:
                gains[channel] = min(max(_median(ratios[channel, :count]), least), most)
        return gains


def _median(values: Floats) -> np.float32:
    """`np.median` of (K,) numbers in a tenth of its time: it is needed for every colour of every picture."""
    middle = len(values) // 2
    # Asked for two places NumPy takes another way, six times as quick where many values are equal.
    low, high = np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1]
    return high if len(values) % 2 else (low + high) / np.float32(2.0)


class SubtractorBackground:
    """OpenCV's MOG2 or KNN, trained once and then frozen."""

    def __init__(self, kind: Literal["mog2", "knn"], training: Sequence[Bytes]) -> None:
        """training : (H, W, 3) BGR pictures, in the order in which they are learned."""
        count = len(training)
        if kind == "mog2":
            self._model = cv2.createBackgroundSubtractorMOG2(count, 16.0, True)
            self._model.setBackgroundRatio(BACKGROUND_SHARE)
            self._model.setVarMin(LEAST_VARIANCE)
            self._model.setVarInit(LEAST_VARIANCE)
        else:
            self._model = cv2.createBackgroundSubtractorKNN(count, 400.0, True)
        cv2.setRNGSeed(0)
        for picture in training:
            self._model.apply(picture)
        self._rate = FROZEN[kind]
        for picture in (*training, *training):
            self._model.apply(picture, learningRate=self._rate)
        self._lock = threading.Lock()

    def foreground(self, picture: Bytes, settings: EvidenceSettings) -> Foreground:
        """What of a picture (H, W, 3) differs from the background; shadows by OpenCV's own test alone."""
        with self._lock:
            if isinstance(self._model, cv2.BackgroundSubtractorMOG2):
                self._model.setVarThreshold(settings.mask_threshold**2)
            else:
                self._model.setDist2Threshold((settings.mask_threshold * settings.mask_noise) ** 2)
            self._model.setDetectShadows(settings.mask_shadow_test)
            self._model.setShadowThreshold(settings.mask_shadow_darkest)
            marked = self._model.apply(picture, learningRate=self._rate)
        mask = np.asarray(cv2.threshold(marked, 200, 255, cv2.THRESH_BINARY)[1], dtype=np.uint8)
        return Foreground(mask, np.where(marked == SHADOW_MARK, np.uint8(255), np.uint8(0)))


def gaussian_from_frames(frames: Sequence[Bytes]) -> GaussianBackground:
    """Mean and standard deviation of an empty clip; a single picture gives a deviation of 0 (the noise knob rules)."""
    if len(frames) == 1:
        return GaussianBackground(frames[0])
    total = np.zeros(frames[0].shape, np.float64)
    squares = np.zeros(frames[0].shape, np.float64)
    for frame in frames:
        total += frame
        squares += np.square(frame, dtype=np.float64)
    mean = total / len(frames)
    variance = np.maximum(squares / len(frames) - mean * mean, 0.0)
    return GaussianBackground(mean.astype(np.float32), np.sqrt(variance).astype(np.float32))


def gaussian_from_median(frames: Bytes) -> GaussianBackground:
    """Median over time and its robust deviation (1.4826 times the median distance from the median).

    frames : (K, H, W, 3).
    """
    median, distance = median_and_distance(frames.reshape(len(frames), -1))
    shape = frames.shape[1:]
    deviation = np.minimum(np.float32(1.4826) * distance, np.float32(20.0))
    return GaussianBackground(median.reshape(shape), deviation.reshape(shape))


@njit(**KERNEL)
def median_and_distance(values: Bytes) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Median of each column and the median distance from it. values : (K, P) uint8. Returns two (P,) float32."""
    count, pixels = values.shape
    median = np.empty(pixels, np.float32)
    distance = np.empty(pixels, np.float32)
    column = np.empty(count, np.float32)
    for p in range(pixels):
        for k in range(count):
            column[k] = values[k, p]
        median[p] = np.median(column)
        for k in range(count):
            column[k] = abs(values[k, p] - median[p])
        distance[p] = np.median(column)
    return median, distance


@njit(**EXACT)
def gain_ratios(
    picture: Bytes, samples: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Ratios (3, K) of every GAIN_STRIDE-th pixel of a picture (H, W, 3) to the background's samples (h, w, 3), each
    colour's first `counts` (3,): those of neither too dark nor too bright a background.
    """
    rows, columns = samples.shape[:2]
    ratios, counts = np.empty((3, rows * columns), np.float32), np.zeros(3, np.int64)
    for y in range(rows):
        for x in range(columns):
            for c in range(3):
                value, background = picture[GAIN_STRIDE * y, GAIN_STRIDE * x, c], samples[y, x, c]
                if GAIN_LEAST_LEVEL < background < GAIN_MOST_LEVEL and value < GAIN_MOST_LEVEL:
                    ratios[c, counts[c]] = np.float32(value) / background
                    counts[c] += 1
    return ratios, counts


PART, WORDS = 16, 6
"""Pixels of a row that are decided together, and 64-bit words of their flags, a byte a colour."""
ROUGH = np.float32(0.501)
"""Grey levels by which a rounded mean is off at most."""
UNSURE = np.float32(3.0)
"""Deviations of the noise by which a shadow's colour may seem another one."""
MIXED = np.float32(1.6)
"""Times the tolerance within which a pixel of the border passes for shadow. By exact masks of six clips the border lies
0.02 to 0.2 pixels further in than without; a walk with dark trousers is tracked 0.9 mm nearer so."""
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
FINE = np.float32(16.0)
"""Steps of a grey level in which the background is summed: whole numbers add up alike in any order."""
BITS_SEEN, BITS_WANTED = np.uint64(16), np.uint64(21)
"""Of a sum over the largest window, 15 x 15 pixels, of grey levels, and of their sixteenths, twice as bright."""
MOST_SEEN, MOST_WANTED = np.uint64(2**16 - 1), np.uint64(2**21 - 1)


@njit(**EXACT, fastmath=True)
def differing_pixels(
    picture: Bytes,
    mean: NDArray[np.uint8 | np.float32],
    rough: Bytes,
    variance: NDArray[np.float32],
    gain: NDArray[np.float32],
    threshold: np.float32,
    noise: np.float32,
) -> Bytes:
    """255 where a colour differs by more than sqrt(threshold) deviations.

    picture : (H, W, 3) uint8. mean : (H, W, 3) uint8 or float32. rough : (H, W, 3) uint8, the mean rounded. variance :
    (H or 1, W, 3) float32. noise : least variance.
    The first loop of a row vectorises over all its colours: nearer to the rounded mean than the least noise allows
    nothing differs. Most of a picture is decided so, at a quarter of the bytes; only the rest is compared exactly.
    """
    height, width = picture.shape[:2]
    out = np.zeros((height, width), np.uint8)
    gains, slack = np.empty(3 * width, np.float32), ROUGH * max(gain[0], gain[1], gain[2])
    for k in range(3 * width):
        gains[k] = gain[k % 3]
    least = np.sqrt(threshold * noise) * np.float32(0.999) - slack
    parts = (width + PART - 1) // PART
    far = np.zeros(3 * PART * parts, np.uint8)
    words = far.view(np.uint64)
    flat, means = picture.reshape(height, 3 * width), mean.reshape(height, 3 * width)
    roughly, variances = rough.reshape(height, 3 * width), variance.reshape(len(variance), 3 * width)
    for y in range(height):
        seen, expected, about, row = flat[y], means[y], roughly[y], out[y]
        spread = variances[min(y, len(variances) - 1)]
        for k in range(3 * width):
            far[k] = np.uint8(abs(np.float32(seen[k]) - gains[k] * np.float32(about[k])) >= least)
        for part in range(parts):
            flags = np.uint64(0)
            for i in range(WORDS):
                flags |= words[WORDS * part + i]
            if flags == 0:
                continue
            for x in range(part * PART, min(part * PART + PART, width)):
                k = 3 * x
                if not far[k] | far[k + 1] | far[k + 2]:
                    continue
                differs = False
                for c in range(3):
                    away = np.float32(seen[k + c]) - gains[k + c] * np.float32(expected[k + c])
                    differs |= away * away > threshold * max(spread[k + c], noise)
                if differs:
                    row[x] = np.uint8(255)
    return out


def drop_shadows(
    changed: Bytes,
    picture: Bytes,
    mean: NDArray[np.uint8 | np.float32],
    gain: NDArray[np.float32],
    noise: np.float32,
    darkest: np.float32,
    colour: np.float32,
    reach: int,
) -> Bytes:
    """Changed pixels (H, W) without the shadows among them.

    A pixel may be shadow if darkest <= brightness / background < 1 and its colour, allowing for UNSURE deviations of
    noise, lies within `colour` of the background's, as a share of its brightness. It is one if the mean colour of all
    that may be shadow at most `reach` pixels away along each axis lies so near, allowing for a deviation of that mean.
    One pixel's colour is mostly noise: a tolerance that lets a noisy shadow through lets skin on a floor of wood
    through, too. Pixels of the border of what is left are mixtures, of a colour of their own: each decides alone,
    within MIXED times the tolerance and a deviation. Of no reach all decide alone. picture, mean, gain, noise : as in
    `differing_pixels`.
    """
    unsure = UNSURE * UNSURE if reach else np.float32(1.0)
    possible = possible_shadows(
        changed, cv2.boundingRect(changed), picture, mean, gain, unsure * noise, darkest, colour
    )
    if not reach:
        return changed - possible
    place = cv2.boundingRect(possible)
    left = changed - shadows_together(possible, place, picture, mean, gain, noise, colour, reach)
    rim = left - np.asarray(cv2.erode(left, CROSS), np.uint8)
    return left - possible_shadows(
        rim, cv2.boundingRect(rim), picture, mean, gain, noise, darkest, MIXED * colour
    )


@njit(**EXACT, fastmath=True)
def possible_shadows(
    changed: Bytes,
    place: Sequence[int],
    picture: Bytes,
    mean: NDArray[np.uint8 | np.float32],
    gain: NDArray[np.float32],
    noise: np.float32,
    darkest: np.float32,
    colour: np.float32,
) -> Bytes:
    """(H, W) 255 where a changed pixel is darker than the background, in its colour but for the noise. place : left,
    top, width and height of what is changed.
    """
    left, top, wide, high = place
    possible = np.zeros_like(changed)
    for y in range(top, top + high):
        for x in range(left, left + wide):
            if not changed[y, x]:
                continue
            dot, norm, square = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            for c in range(3):
                value, background = np.float32(picture[y, x, c]), gain[c] * np.float32(mean[y, x, c])
                dot += value * background
                norm += background * background
                square += value * value
            share = dot / max(norm, np.float32(1.0))
            off_colour = square - share * dot
            same_colour = off_colour < colour * colour * norm + noise
            if darkest <= share and share < np.float32(1.0) and same_colour:
                possible[y, x] = np.uint8(255)
    return possible


@njit(**EXACT)
def shadows_together(
    possible: Bytes,
    place: Sequence[int],
    picture: Bytes,
    mean: NDArray[np.uint8 | np.float32],
    gain: NDArray[np.float32],
    noise: np.float32,
    colour: np.float32,
    reach: int,
) -> Bytes:
    """(H, W) 255 where the mean colour of what may be shadow around is the background's. place : of what may.

    Sums over a column's rows and then over a row's columns move with the pixel; those of the picture's three colours
    and of the pixels share one number, 16 bits each, those of the background's three another, 21 bits each.
    """
    left, top, wide, high = place
    right, bottom = left + wide - 1, top + high - 1
    shadow, rows = np.zeros_like(possible), 2 * reach + 1
    recent = np.zeros((rows, 2, right + 1), np.uint64)
    columns = np.zeros((2, right + 1 + rows), np.uint64)
    for y in range(top, bottom + reach + 1):
        before = recent[y % rows]
        for x in range(left, right + 1):
            seen, wanted = np.uint64(0), np.uint64(0)
            if y <= bottom and possible[y, x]:
                seen = np.uint64(1)
                for c in range(3):
                    seen = seen << BITS_SEEN | np.uint64(picture[y, x, c])
                    wanted = wanted << BITS_WANTED | np.uint64(
                        np.rint(FINE * gain[c] * np.float32(mean[y, x, c]))
                    )
            columns[0, x + reach] += seen - before[0, x]
            columns[1, x + reach] += wanted - before[1, x]
            before[0, x], before[1, x] = seen, wanted
        middle = y - reach
        if middle < top:
            continue
        seen, wanted = np.uint64(0), np.uint64(0)
        for x in range(left - reach, right + 1):
            # `columns` begins `reach` before the picture: this is the column `reach` after x.
            seen += columns[0, x + 2 * reach]
            wanted += columns[1, x + 2 * reach]
            if x < left:
                continue
            if possible[middle, x]:
                dot, norm, square = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                each = np.float32(1.0) / np.float32(seen >> np.uint64(3) * BITS_SEEN)
                for c in range(3):
                    shift = np.uint64(2 - c)
                    value = each * np.float32(seen >> shift * BITS_SEEN & MOST_SEEN)
                    background = each / FINE * np.float32(wanted >> shift * BITS_WANTED & MOST_WANTED)
                    dot += value * background
                    norm += background * background
                    square += value * value
                off_colour = square - dot * dot / max(norm, np.float32(1.0))
                if off_colour < colour * colour * norm + noise * each:
                    shadow[middle, x] = np.uint8(255)
            seen -= columns[0, x]
            wanted -= columns[1, x]
    return shadow


@njit(**EXACT)
def shadow_brightness(
    shadow: Bytes,
    place: Sequence[int],
    picture: Bytes,
    mean: NDArray[np.uint8 | np.float32],
    gain: NDArray[np.float32],
    size: int,
) -> Floats:
    """(h, w) brightness of the shadow's pixels in each cell of `size` pixels a side, as a share of the background's; 0
    without any. shadow : (H, W) above 0, inside `place`. picture, mean, gain : as in `differing_pixels`.
    """
    left, top, wide, high = place
    rows, columns = -(-shadow.shape[0] // size), -(-shadow.shape[1] // size)
    dots, norms = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
    for y in range(top, top + high):
        for x in range(left, left + wide):
            if shadow[y, x]:
                for c in range(3):
                    background = gain[c] * np.float32(mean[y, x, c])
                    dots[y // size, x // size] += np.float32(picture[y, x, c]) * background
                    norms[y // size, x // size] += background * background
    for row in range(rows):
        for column in range(columns):
            dots[row, column] /= max(norms[row, column], np.float32(1.0))
    return dots
