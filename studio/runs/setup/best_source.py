"""Which source of masks suits a session, and each of its cameras, without ground truth.

All sources are tried in the same few frames. Two things are measured of each camera's masks: how far they agree with
the other views in the hull, and how much the picture changes along their border. The second sees what agreement cannot:
a shadow that all masks hold, or a part that all of them lack (a subject's own border is an edge of the picture; that of
its shadow, and one through its middle, is none). A camera's score is their product, that of a source its worst
camera's. The best source is taken; then camera by camera the others' masks are put in place of its own, and stay where
the worst score rises.
"""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress
from studio.runs.setup.mask_quality import count_frame, summed
from studio.runs.setup.person_hull import ROUGH

COMPARING = "comparing the sources"
GAIN = 0.01
"""By how much another source for one camera must raise the worst score."""
MOST_CHANGES = 4
MOST_FILLED, MOST_BORDER = 0.5, 0.35
"""Shares of a picture, and of its border, that a subject's mask may fill: what is everywhere agrees in all views."""


@dataclass(frozen=True, slots=True, eq=False)
class SampledMasks:
    """One camera's masks of the tried frames by one source.

    masks : (h, w) 0 or 255, of the size of its reduced camera. border : their mean `border_support`.
    """

    masks: tuple[Bytes, ...]
    border: float


@dataclass(frozen=True, slots=True)
class SourceTried:
    """A source in the tried frames. agreements, borders : by camera, 0 to 1; 0 where a mask is empty. litres : median
    volume of the hull. note : why it cannot be.
    """

    source: str
    agreements: dict[str, float]
    borders: dict[str, float]
    litres: float
    note: str = ""

    @property
    def scores(self) -> Annotated[dict[str, float], Field()]:
        """Agreement times border by camera, 0 to 1."""
        return {name: round(share * self.borders[name], 4) for name, share in self.agreements.items()}

    @property
    def worst(self) -> Annotated[float, Field()]:
        return min(self.scores.values(), default=0.0)

    def in_words(self) -> str:
        least, border = min(self.agreements.values()), min(self.borders.values())
        words = (
            f"least agreement {least:.2f}, least edge along the border {border:.2f}, score {self.worst:.2f}"
        )
        return f"{words}. {self.note}".rstrip()


@dataclass(frozen=True, slots=True)
class SourceChoice:
    """tried : all sources. by_camera : the source that each camera's masks come from. mixed : of these masks."""

    tried: tuple[SourceTried, ...]
    by_camera: dict[str, str]
    mixed: SourceTried


def choose_sources(
    cameras: Sequence[Camera],
    frames: Sequence[int],
    sampled: Mapping[str, Mapping[str, SampledMasks]],
    progress: Progress,
    scale: float = 1.0,
) -> SourceChoice:
    """The source of each camera's masks. cameras : of the size of the masks. sampled : by source and camera.
    scale : of the body beside a person (`scale_of`).

    Raises FootageError where no source has masks that agree at all.
    """
    lenses, names = tuple(cameras), [camera.name for camera in cameras]
    most = len(sampled) + MOST_CHANGES * len(names) * max(0, len(sampled) - 1)
    done = 0

    def evaluate(choice: Mapping[str, str], called: str) -> SourceTried:
        nonlocal done
        progress(COMPARING, done, most)
        done += 1
        chosen_masks = {name: sampled[choice[name]][name] for name in names}
        borders = {name: round(one.border, 4) for name, one in chosen_masks.items()}
        if not all(can_be_subject(mask) for one in chosen_masks.values() for mask in one.masks):
            nothing = dict.fromkeys(names, 0.0)
            return SourceTried(called, nothing, borders, 0.0, "It includes the surroundings of the subject.")
        counted = [
            count_frame(
                [one.masks[k] for one in chosen_masks.values()],
                lenses,
                blame=False,
                fineness=ROUGH,
                scale=scale,
            )
            for k in range(len(frames))
        ]
        quality = summed(tuple(frames), tuple(names), counted)
        agreements = {view.camera: round(float(np.nan_to_num(view.agreement)), 4) for view in quality.views}
        return SourceTried(called, agreements, borders, round(statistics.median(quality.hull_litres), 3))

    tried = [evaluate(dict.fromkeys(names, source), source) for source in sampled]
    best = max(tried, key=lambda one: one.worst, default=None)
    if best is None or best.worst <= 0.0:
        raise FootageError(
            "The views agree with no source of masks.",
            "Look at the masks of each; paint strokes, or check the calibration.",
        )
    choice = dict.fromkeys(names, best.source)
    for _ in range(MOST_CHANGES):
        changes = [{**choice, name: source} for name in names for source in sampled if source != choice[name]]
        changed = [(evaluate(change, ""), change) for change in changes]
        better, change = max(changed, key=lambda pair: pair[0].worst, default=(best, choice))
        if better.worst < best.worst + GAIN:
            break
        best, choice = better, change
    progress(COMPARING, most, most)
    return SourceChoice(tuple(tried), choice, best)


def can_be_subject(mask: Bytes) -> bool:
    """Whether a mask (h, w) is of something in the picture, not of all that lies around it."""
    border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
    return bool((mask > 0).mean() <= MOST_FILLED and (border > 0).mean() <= MOST_BORDER)
