"""Offsets between cameras in frames, estimated from motion in their pictures.

A movement begins and ends in all views at once, so the motion energy (mean absolute difference of successive pictures,
reduced and grey) rises and falls together. For each two cameras the correlation of both courses is taken at every lag;
the peak against the next best one shows its reliability, its breadth its accuracy: a slow movement looks fastest
at different moments from different sides. Cameras are then put in order along the most trusted pairs, and other trusted
pairs must agree. An estimate is shown to a person; nothing here applies it.
"""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from studio.footage.capture.footage_source import FootageSource
from studio.footage.capture.naming import listed
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import FootageError
from studio.foundations.progress import Progress

WIDTH = 96
MOST_FRAMES = 3000
MOST_SECONDS = 5.0
FEWEST_FRAMES = 12
FLAT_GREY_LEVELS = 0.03
"""Courses whose spread (5 to 95 %) is below this are of sensor noise or a still picture."""
LEAST_OVERLAP = 0.5
SURE_PEAK, SURE_RATIO, SURE_WITHIN = 0.5, 1.2, 2
STILL_PEAK = 0.85
"""Lags around the best one whose correlation is above this share of its own may be the right ones."""
MOST_RATIO = 99.0
AGREE = 1


@dataclass(frozen=True, slots=True)
class PairLag:
    """How two cameras lie in time: frame f of `first` was taken with frame f + lag of `second`.

    peak : correlation at that lag, -1 to 1. ratio : peak over the next best one (99 where there is none). within : so
    many frames to either side are nearly as good.
    """

    first: str
    second: str
    lag: int
    peak: float
    ratio: float
    within: int

    @property
    def sure(self) -> Annotated[bool, Field()]:
        """Whether the peak stands out and is narrow."""
        return self.peak >= SURE_PEAK and self.ratio >= SURE_RATIO and self.within <= SURE_WITHIN


@dataclass(frozen=True, slots=True)
class Synchrony:
    """By how many frames cameras began apart, estimated from motion.

    offsets : each camera's frame that belongs to frame 0, the smallest being 0.
    confidence : peak over second peak on the weakest link that a camera's offset rests on.
    within : how many frames the offset may be off.
    sure : whether every link stands out and no trusted pair contradicts.
    notes : what speaks against it, sentences.
    """

    offsets: dict[str, int]
    confidence: dict[str, float]
    within: dict[str, int]
    pairs: tuple[PairLag, ...]
    sure: bool
    notes: tuple[str, ...]


def motion_energy(
    read: Callable[[int], Bytes], count: int, report: Callable[[int], None] | None = None
) -> Array:
    """(count - 1,) mean absolute difference of each picture to the one before it, grey levels.

    read(k) : (H, W, 3) uint8 BGR of frame k; report : called with the frames done.
    """
    energy = np.zeros(max(0, count - 1))
    before: NDArray[np.float32] | None = None
    for index in range(count):
        grey = cv2.cvtColor(read(index), cv2.COLOR_BGR2GRAY)
        height = max(1, round(grey.shape[0] * WIDTH / grey.shape[1]))
        small = cv2.resize(grey, (WIDTH, height), interpolation=cv2.INTER_AREA).astype(np.float32)
        if before is not None:
            energy[index - 1] = float(np.abs(small - before).mean())
        before = small
        if report is not None:
            report(index + 1)
    return energy


def estimate_offsets(
    energies: Mapping[str, Array], fps: float, most_seconds: float = MOST_SECONDS
) -> Synchrony:
    """Offsets from the motion energies of cameras with the same frame rate.

    most_seconds : the largest offset that is looked for. Raises FootageError naming a camera that shows too few frames
    or no motion.
    """
    if len(energies) < 2:
        raise FootageError(
            "One camera alone has nothing to be synchronised with.", "Give two cameras or more."
        )
    courses = {name: _course(name, energy) for name, energy in energies.items()}
    pairs = tuple(
        pair_lag(first, second, courses[first], courses[second], round(most_seconds * fps))
        for first, second in itertools.combinations(courses, 2)
    )
    placed, confidence, within, links = _along_best_pairs(tuple(courses), pairs)
    least = min(placed.values())
    offsets = {name: placed[name] - least for name in courses}
    against = [
        pair for pair in pairs
        if pair.sure and abs(offsets[pair.second] - offsets[pair.first] - pair.lag) > AGREE
    ]  # fmt: skip
    weak = [f"{link.first} and {link.second}" for link in links if not link.sure]
    notes = (
        *((f"The motion of {'; '.join(weak)} does not determine their offset reliably.",) if weak else ()),
        *(
            f"{pair.first} and {pair.second} alone are {pair.lag:+d} frames apart, which contradicts the others."
            for pair in against
        ),
    )
    return Synchrony(
        offsets,
        {name: confidence[name] for name in courses},
        {name: within[name] for name in courses},
        pairs,
        not (weak or against),
        notes,
    )


def pair_lag(first: str, second: str, a: Array, b: Array, most: int) -> PairLag:
    """The lag at which course b (K,) repeats course a (J,) best, of at most `most` frames either way."""
    fewest = max(FEWEST_FRAMES - 1, round(LEAST_OVERLAP * min(len(a), len(b))))
    lags = [lag for lag in range(-most, most + 1) if _overlap(len(a), len(b), lag) >= fewest]
    scores = np.array([_correlation(a, b, lag) for lag in lags])
    best = int(np.argmax(scores))
    left, right = best, best
    while left > 0 and scores[left - 1] < scores[left]:
        left -= 1
    while right < len(scores) - 1 and scores[right + 1] < scores[right]:
        right += 1
    others = np.concatenate([scores[:left], scores[right + 1 :]])
    second_peak = float(others.max()) if len(others) else 0.0
    peak = float(scores[best])
    ratio = min(MOST_RATIO, peak / second_peak) if second_peak > 0.0 else MOST_RATIO
    alike = np.flatnonzero(scores[left : right + 1] > STILL_PEAK * peak) + left
    within = int(np.abs(alike - best).max()) if peak > 0.0 else most
    return PairLag(first, second, lags[best], peak, ratio if peak > 0.0 else 0.0, within)


def estimate_synchrony(
    source: FootageSource,
    reader: Callable[[int], Callable[[int], Bytes]],
    progress: Progress | None = None,
    most_seconds: float = MOST_SECONDS,
) -> Synchrony:
    """Offsets of a session's cameras, whatever offsets it has now, from the first frames of every file.

    reader(k) : what reads camera k's pictures by the file's own frame numbers. progress(step, done, total).
    Raises FootageError.
    """
    energies: dict[str, Array] = {}
    for index, camera in enumerate(source.cameras):
        count = min(camera.frame_count, MOST_FRAMES)

        def report(done: int, name: str = camera.name, total: int = count) -> None:
            if progress is not None:
                progress(f"motion in {name}", done, total)

        energies[camera.name] = motion_energy(reader(index), count, report)
    return estimate_offsets(energies, source.fps, most_seconds)


def _course(name: str, energy: Array) -> Array:
    """The energy's logarithm above its own quiet level, without the single spikes that a codec's key frames make.

    Raises FootageError if it is too even.
    """
    if len(energy) < FEWEST_FRAMES - 1:
        raise FootageError(
            f"Camera {name} has {len(energy) + 1} frames, too few to see when things move.",
            f"Give at least {FEWEST_FRAMES} frames, or the offsets by hand.",
        )
    padded = np.pad(energy, 1, mode="edge")
    calm = np.median([padded[:-2], energy, padded[2:]], axis=0)
    low, high = np.percentile(calm, [5.0, 95.0])
    if high - low < FLAT_GREY_LEVELS:
        raise FootageError(
            f"The motion in camera {name} is the same all the time (from {low:.2f} to {high:.2f} grey levels), so"
            " its pictures do not show when they were taken.",
            "Give the offsets by hand, or footage in which movements begin and end.",
        )
    return np.log(np.maximum(calm, 0.5 * low) + 0.1 * (high - low))


def _overlap(a: int, b: int, lag: int) -> int:
    return min(a, b - lag) - max(0, -lag)


def _correlation(a: Array, b: Array, lag: int) -> float:
    """Pearson's r of a[f] and b[f + lag] over the frames that both have; 0 where one of them is flat there."""
    first, last = max(0, -lag), min(len(a), len(b) - lag)
    x, y = a[first:last], b[first + lag : last + lag]
    x, y = x - x.mean(), y - y.mean()
    length = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / length if length > 1e-12 else 0.0


def _along_best_pairs(
    names: tuple[str, ...], pairs: tuple[PairLag, ...]
) -> tuple[dict[str, int], dict[str, float], dict[str, int], list[PairLag]]:
    """Places in time, weakest ratio and widest breadth on each camera's way, and the most trusted spanning tree."""
    ranked = sorted(pairs, key=lambda pair: (pair.sure, pair.peak * min(pair.ratio, 3.0)), reverse=True)
    root = ranked[0]
    placed, confidence, within = {root.first: 0}, {root.first: root.ratio}, {root.first: root.within}
    links: list[PairLag] = []
    while len(placed) < len(names):
        link = next(pair for pair in ranked if (pair.first in placed) != (pair.second in placed))
        if link.first in placed:
            known, new, step = link.first, link.second, link.lag
        else:
            known, new, step = link.second, link.first, -link.lag
        placed[new] = placed[known] + step
        confidence[new] = min(link.ratio, confidence[known])
        within[new] = max(link.within, within[known])
        links.append(link)
    return placed, confidence, within, links


def in_words(synchrony: Synchrony) -> str:
    """One line a camera: its offset and reliability; then the notes."""
    lines = [
        f"{name}: {offset:+d} frames, give or take {synchrony.within[name]}"
        f" (peak {synchrony.confidence[name]:.2f} times the next best)"
        for name, offset in synchrony.offsets.items()
    ]
    if not synchrony.sure:
        lines.append(f"Not reliable for {listed(synchrony.offsets)}: check by eye before you apply it.")
    return "\n".join([*lines, *synchrony.notes])
