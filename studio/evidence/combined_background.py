"""A background from two imperfect ones: a plate with objects that were removed, and footage with a person in it.

A plate shows the room behind a person who stays in one place, but also bystanders of that moment; the footage's frames
show the present bystanders, but perhaps never the room behind the person. Pixel by pixel:

1. The plate is fitted to the footage, colour by colour (`colour_fit`).
2. Where some frames agree with the plate, it is right: the background is these frames' own mean and deviation, which
match the footage's exposure and noise better than the plate.
3. Elsewhere no frame agrees with the plate: either it shows something that was removed, or a person hides the place in
all frames. The footage's estimate is its mode, the mean of the frames that most others agree with; a frame's weight is
the share of background in the known surroundings, as a person there also covers these.
4. Which of the two is right is decided region by region: the right one continues the known background across the
region's border; the wrong one has an edge there. In doubt the footage is taken: what never moves is no person.

One camera alone cannot distinguish a person from the same person in the plate; `runs.setup.clean_plates` uses the other
cameras. The method is this project's own, made of standard parts: the mode over time as background, and edges along the
border of a still region to distinguish abandoned from removed objects.
"""

from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.background import GaussianBackground
from studio.evidence.colour_fit import fitted_line
from studio.evidence.masks import disc
from studio.foundations.arrays import Array, Bytes, Floats
from studio.foundations.numba_in_threads import KERNEL, njit

AGREES = 16.0
"""Grey levels in any colour: within this a frame agrees with the plate."""
LEAST_SHARE, LEAST_FRAMES = 0.08, 2
"""Share of the frames that must agree with the plate: fewer may be clothes of the wall's colour passing by."""
STRIDE = 4
REACHES = (8, 16, 32)
"""Half sides of the squares of surroundings, in units of STRIDE pixels."""
ENOUGH_KNOWN = 0.15
"""Share of the surroundings that must be known."""
VOTE = 8
SMALLEST_REGION = 400
"""Pixels: smaller regions are specks along edges, which take the footage."""
OPENED = 4
"""Pixels: narrower connections do not join regions."""
RIM = 5
"""Pixels: width compared inside and outside a region's border."""
PLATE_MUST_BEAT = 0.75
"""The plate's edge along the border must be this much weaker than the footage's."""
MOST_EDGE = 60.0
"""Grey levels: no stronger edge counts for more."""
DOUBT = 40
"""Pixels around removed objects: the same skin or shirt in plate and footage hides their true extent."""
MOST_DEVIATION = 6.0
"""Grey levels: larger variation is not noise but people passing by."""


class Origin(IntEnum):
    """Source of a pixel's background."""

    AGREEING = 0
    MODE = 1
    PLATE = 2


@dataclass(frozen=True, slots=True, eq=False)
class Combination:
    """The decisions behind a combined background, which can be applied to the same pictures at a higher resolution.

    origin : (H, W) uint8, of Origin. shares :
    (K, h, w) of `background_nearby`. gains, offsets : (3,) of the plate's colours.
    """

    origin: Bytes
    shares: Floats
    gains: Floats
    offsets: Floats

    def fill(self, plate: Bytes, frames: Bytes, top: int, selected: NDArray[np.bool_], out: Bytes) -> None:
        """Fill a band of rows, from `top` on, of the background at a higher resolution.

        plate, out : (H, W, 3), frames : (K, rows, W, 3) of the band. selected : (rows, W) pixels to fill.
        """
        fill_finely(
            plate,
            frames,
            top,
            selected,
            self.origin,
            self.shares,
            self.gains,
            self.offsets,
            fewest_of(frames),
            out,
        )


def combine(plate: Bytes, frames: Bytes) -> tuple[GaussianBackground, NDArray[np.bool_]]:
    """The combined background, and a mask (H, W) of doubtful pixels: on and around objects removed since the plate.

    plate : (H, W, 3). frames : (K, H, W, 3).
    """
    model, doubtful, _ = combination(plate, frames)
    return model, doubtful


def fewest_of(frames: Bytes) -> int:
    """Number of frames that must agree with the plate."""
    return max(LEAST_FRAMES, round(LEAST_SHARE * len(frames)))


def combination(
    plate: Bytes, frames: Bytes, factor: float = 1.0
) -> tuple[GaussianBackground, NDArray[np.bool_], Combination]:
    """`combine`, with its decisions. factor : by which these pictures were reduced."""
    gains, offsets = fitted_line(plate, frames)
    fitted = np.asarray(plate * gains + offsets, dtype=np.float32)
    square = np.ones((3, 3), np.uint8)
    low = np.asarray(cv2.erode(fitted, square), dtype=np.float32) - np.float32(AGREES)
    high = np.asarray(cv2.dilate(fitted, square), dtype=np.float32) + np.float32(AGREES)
    mean, deviation, count = agreeing_frames(frames, low, high)
    unsure = np.where(count >= fewest_of(frames), np.uint8(0), np.uint8(1))
    shares = background_nearby(frames, mean, unsure, factor)
    fill_from_most_alike(frames, unsure, shares, mean, deviation)
    removed, origin = np.zeros_like(unsure), unsure.copy()
    rim = _fewer(RIM, factor)
    for region in _regions(unsure, rim, factor):
        y, x, inside = region
        if not _goes_on_better(fitted, mean, region, unsure, rim):
            removed[y, x][inside] = 1
        else:
            mean[y, x][inside] = fitted[y, x][inside]
            deviation[y, x][inside] = 0.0
            origin[y, x][inside] = Origin.PLATE
    doubtful = np.asarray(cv2.dilate(removed, disc(_fewer(DOUBT, factor)))) > 0
    model = GaussianBackground(mean, np.minimum(deviation, MOST_DEVIATION))
    return model, doubtful, Combination(origin, shares, gains, offsets)


Region = tuple[slice, slice, NDArray[np.bool_]]
"""Rows and columns of a rectangle and which of its pixels belong to the region."""


def _fewer(pixels: int, factor: float) -> int:
    """Pixels of pictures reduced by a factor, at least one."""
    return max(1, round(pixels / factor))


def _regions(unsure: Bytes, rim: int, factor: float) -> list[Region]:
    """The connected regions of a map above the least size, each in a rectangle with a rim around it."""
    reach = _fewer(OPENED, factor)
    opened = cv2.morphologyEx(unsure, cv2.MORPH_OPEN, disc(reach))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(opened)
    regions: list[Region] = []
    for label in range(1, count):
        left, top, width, height, area = (int(value) for value in boxes[label])
        if area >= SMALLEST_REGION / factor**2:
            y = slice(max(0, top - 2 * rim), top + height + 2 * rim)
            x = slice(max(0, left - 2 * rim), left + width + 2 * rim)
            # Opening rounds corners off: unsure pixels within its reach belong to the region too.
            square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
            grown = cv2.dilate((labels[y, x] == label).astype(np.uint8), square)
            regions.append((y, x, (grown > 0) & (unsure[y, x] > 0)))
    return regions


def _goes_on_better(plate: Floats, footage: Floats, region: Region, unsure: Bytes, reach: int) -> bool:
    """Whether the plate continues the known surroundings of a region clearly better than the footage does."""
    y, x, inside = region
    known = (unsure[y, x] == 0).astype(np.float32)
    window = (2 * reach + 1, 2 * reach + 1)
    near = np.asarray(cv2.boxFilter(known, -1, window), dtype=np.float32)
    seen = np.asarray(cv2.boxFilter(footage[y, x] * known[..., None], -1, window), dtype=np.float32)
    around = seen / np.maximum(near, 1e-6)[..., None]
    core = cv2.erode(inside.astype(np.uint8), np.ones((reach | 1, reach | 1), np.uint8)) > 0
    rim = inside & ~core & (near > 0.1)
    if not rim.any():
        return False
    edges = [
        float(np.minimum(np.abs(picture[y, x][rim] - around[rim]).max(axis=1), MOST_EDGE).mean())
        for picture in (plate, footage)
    ]
    return edges[0] < PLATE_MUST_BEAT * edges[1]


def background_nearby(frames: Bytes, mean: Floats, unsure: Bytes, factor: float = 1.0) -> Floats:
    """(K, h, w) share of background in the known surroundings, by frame, 0 to 1, at every STRIDE-th pixel.

    frames : (K, H, W, 3). mean : (H, W, 3), right where unsure (H, W) is 0. The surroundings are the smallest of
    REACHES in which enough is known.
    """
    known = (unsure[::STRIDE, ::STRIDE] == 0).astype(np.float32)
    small = mean[::STRIDE, ::STRIDE]
    shares = np.empty((len(frames), *known.shape), np.float32)
    for index, frame in enumerate(frames):
        share = shares[index]
        away = np.abs(frame[::STRIDE, ::STRIDE] - small).max(axis=2)
        empty = known * (away <= AGREES)
        share[:] = 0.5
        for reach in (_fewer(reach, factor) for reach in reversed(REACHES)):
            window = (2 * reach + 1, 2 * reach + 1)
            near = np.asarray(cv2.boxFilter(known, -1, window), dtype=np.float32)
            blurred = np.asarray(cv2.boxFilter(empty, -1, window), dtype=np.float32) / np.maximum(near, 1e-6)
            np.copyto(share, blurred, where=near > ENOUGH_KNOWN)
    return shares


@njit(**KERNEL)
def agreeing_frames(
    frames: Bytes, low: Floats, high: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    """Mean and deviation (H, W, 3) float32 over the frames between low and high, and their number (H, W).

    frames : (K, H, W, 3) uint8. Zeros where none agrees.
    """
    count, height, width = frames.shape[:3]
    mean = np.zeros((height, width, 3), np.float32)
    deviation = np.zeros((height, width, 3), np.float32)
    agreeing = np.zeros((height, width), np.int32)
    total, squares = np.empty(3), np.empty(3)
    for y in range(height):
        for x in range(width):
            agreeing_count = 0
            total[:] = 0.0
            squares[:] = 0.0
            for k in range(count):
                agrees = True
                for c in range(3):
                    agrees &= low[y, x, c] <= frames[k, y, x, c] <= high[y, x, c]
                if agrees:
                    agreeing_count += 1
                    for c in range(3):
                        value = float(frames[k, y, x, c])
                        total[c] += value
                        squares[c] += value * value
            agreeing[y, x] = agreeing_count
            for c in range(3 if agreeing_count else 0):
                middle = total[c] / agreeing_count
                mean[y, x, c] = middle
                deviation[y, x, c] = np.sqrt(max(squares[c] / agreeing_count - middle * middle, 0.0))
    return mean, deviation, agreeing


@njit(**KERNEL)
def fill_from_most_alike(
    frames: Bytes,
    unsure: NDArray[np.bool_],
    shares: NDArray[np.float32],
    mean: NDArray[np.float32],
    deviation: NDArray[np.float32],
) -> None:
    """Fill mean and deviation (H, W, 3) where unsure (H, W) from the frames that agree with the best one.

    frames : (K, H, W, 3) uint8. shares : (K, h, w) of `background_nearby`; a frame's vote is its VOTE-th power: few
    frames of an empty place outvote many in which a person stands next to it. The best frame is the one that the most
    votes agree with.
    """
    count, height, width = frames.shape[:3]
    values, votes = np.empty((count, 3)), np.empty(count)
    for y in range(height):
        for x in range(width):
            if not unsure[y, x]:
                continue
            for k in range(count):
                votes[k] = shares[k, y // STRIDE, x // STRIDE] ** VOTE + 1e-4
                for c in range(3):
                    values[k, c] = frames[k, y, x, c]
            most, best = most_alike(values, votes)
            for c in range(3):
                total, squares = 0.0, 0.0
                for j in range(count):
                    if is_near(values, best, j):
                        total += votes[j] * values[j, c]
                        squares += votes[j] * values[j, c] ** 2
                mean[y, x, c] = total / most
                deviation[y, x, c] = np.sqrt(max(squares / most - (total / most) ** 2, 0.0))


@njit(**KERNEL)
def fill_finely(
    plate: Bytes,
    frames: Bytes,
    top: int,
    selected: NDArray[np.bool_],
    origin: Bytes,
    shares: NDArray[np.float32],
    gains: Floats,
    offsets: Floats,
    fewest: int,
    out: Bytes,
) -> None:
    """`Combination.fill`: apply the decisions of coarse pictures to each pixel of finer ones."""
    count, rows, width = frames.shape[:3]
    height = len(out)
    values, votes, fitted, total = np.empty((count, 3)), np.empty(count), np.empty((3, 3)), np.empty(3)
    for row in range(rows):
        y = top + row
        for x in range(width):
            if not selected[row, x]:
                continue
            kind = origin[y * origin.shape[0] // height, x * origin.shape[1] // width]
            # The plate's fitted colours there, and the least and greatest of the neighbours'.
            for c in range(3):
                least, most = 255, 0
                for v in range(max(0, y - 1), min(height, y + 2)):
                    for u in range(max(0, x - 1), min(width, x + 2)):
                        least, most = min(least, int(plate[v, u, c])), max(most, int(plate[v, u, c]))
                fitted[0, c] = least * gains[c] + offsets[c] - AGREES
                fitted[1, c] = plate[y, x, c] * gains[c] + offsets[c]
                fitted[2, c] = most * gains[c] + offsets[c] + AGREES
            for k in range(count):
                for c in range(3):
                    values[k, c] = frames[k, row, x, c]
            if kind == 0:
                taken = 0
                total[:] = 0.0
                for k in range(count):
                    agrees = True
                    for c in range(3):
                        agrees &= fitted[0, c] <= values[k, c] <= fitted[2, c]
                    if agrees:
                        taken += 1
                        for c in range(3):
                            total[c] += values[k, c]
                if taken >= fewest:
                    for c in range(3):
                        out[y, x, c] = np.uint8(total[c] / taken + 0.5)
                    continue
            if kind == 2:
                for c in range(3):
                    out[y, x, c] = np.uint8(min(max(fitted[1, c] + 0.5, 0.0), 255.0))
                continue
            for k in range(count):
                share = shares[k, y * shares.shape[1] // height, x * shares.shape[2] // width]
                votes[k] = share**VOTE + 1e-4
            most_votes, best = most_alike(values, votes)
            for c in range(3):
                mode = 0.0
                for j in range(count):
                    if is_near(values, best, j):
                        mode += votes[j] * values[j, c]
                out[y, x, c] = np.uint8(mode / most_votes + 0.5)


@njit(**KERNEL, inline="always")
def most_alike(values: Array, votes: Array) -> tuple[float, int]:
    """The votes (K,) for the row of values (K, 3) that the most votes are near to, and which row that is."""
    most, best = 0.0, 0
    for k in range(len(votes)):
        alike = 0.0
        for j in range(len(votes)):
            if is_near(values, k, j):
                alike += votes[j]
        if alike > most:
            most, best = alike, k
    return most, best


@njit(**KERNEL, inline="always")
def is_near(values: Array, k: int, j: int) -> bool:
    """Whether rows k and j of values (K, 3) differ by at most AGREES in each colour."""
    return (
        abs(values[k, 0] - values[j, 0]) <= AGREES
        and abs(values[k, 1] - values[j, 1]) <= AGREES
        and abs(values[k, 2] - values[j, 2]) <= AGREES
    )
