"""The shadow test against true masks: how much of a body it takes for shadow, how much of a shadow for body; each
camera alone, and with what the others see of the floor.

The clips of the half that chooses defaults are drawn anew, a few frames of each, for their exact masks; the two clips
of others bring theirs.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.background import GaussianBackground, gaussian_from_frames
from studio.evidence.floor_shadows import cells_of, floor_shadows, with_cells
from studio.evidence.masks import cleaned, disc
from studio.evidence.settings import EvidenceSettings
from studio.footage.capture.pictures import read_picture
from studio.footage.capture.video import VideoReader, measure_video
from studio.foundations.arrays import Bytes, evenly_spread
from studio.foundations.geometry.camera import Camera
from studio.garden.drawn_recipes import CHOOSING, KINDS, clip_name
from studio.garden.reproduction.drawing import heat_chart
from studio.garden.reproduction.experiment import Part, listed
from studio.garden.reproduction.open_questions.other_people import ELSEWHERE, imported
from studio.results.comparison.findings import Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.real_data import PREFIX, located, real_data_folder
from studio.results.drawing_footage.recipes import person_renderer

ALONE: Mapping[str, Any] = {"mask_shadow_floor": False}
CHOICES: Mapping[str, Mapping[str, Any]] = {
    "each pixel alone, 0.04": {"mask_shadow_window": 1, "mask_shadow_colour": 0.04, **ALONE},
    "each pixel alone, 0.015": {"mask_shadow_window": 1, "mask_shadow_colour": 0.015, **ALONE},
    "5 pixels, 0.015": {"mask_shadow_colour": 0.015, **ALONE},
    "5 pixels, 0.02": {"mask_shadow_colour": 0.02, **ALONE},
    "5 pixels, 0.025": ALONE,
    "5 pixels, 0.03": {"mask_shadow_colour": 0.03, **ALONE},
    "7 pixels, 0.025": {"mask_shadow_window": 7, **ALONE},
    "5 pixels, 0.025, on the floor": {},
    "5 pixels, 0.04, on the floor": {"mask_shadow_colour": 0.04},
    "no shadow test": {"mask_shadow_test": False},
}
FRAMES, EMPTY_FRAMES = 5, 10
RIM = 1, 3
"""Pixels along the true border that count as neither: inside and outside of it. A border is never sharp."""

View = tuple[Bytes, Bytes, GaussianBackground]
"""A picture (H, W, 3), its true mask (H, W) and its camera's background."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """A trial a clip; no seed changes a mask."""
    drawn = [clip_name(CHOOSING, kind) for kind in KINDS]
    others = [PREFIX + place for place in ELSEWHERE.values() if (real_data_folder() / place).is_dir()]
    chosen = drawn[:2] if scale.quick else [*others, *drawn]
    return tuple(Trial(clip, {"clip": clip}) for clip in chosen)


@kept_as("open_questions.shadow_masks.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of every choice: pixels of the body called background, of all it has; pixels beside it called body."""
    clip = str(arguments["clip"])
    cameras, frames = _frames_of_others(clip, cache) if clip.startswith(PREFIX) else _drawn_frames(clip)
    counted = {name: np.zeros(3, np.int64) for name in CHOICES}
    tells = floor_shadows(cameras)
    for views in frames:
        parts = [_without_rim(truth) for _, truth, _ in views]
        for name, knobs in CHOICES.items():
            settings = dataclasses.replace(EvidenceSettings(), **knobs)
            seen = [background.foreground(picture, settings) for picture, _, background in views]
            masks = [one.mask for one in seen]
            if settings.mask_shadow_test and settings.mask_shadow_floor:
                cells = [cells_of(*one) for one in seen]
                masks = [
                    with_cells(*one, chosen, own.size)
                    for one, chosen, own in zip(seen, tells.unexplained(cells), cells, strict=True)
                ]
            for mask, (body, beside) in zip(masks, parts, strict=True):
                final = cleaned(mask, settings) > 0
                counted[name] += [(body & ~final).sum(), (beside & final).sum(), body.sum()]
    return {name: [int(value) for value in values] for name, values in counted.items()}


def _without_rim(truth: Bytes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    inside, outside = RIM
    return cv2.erode(truth, disc(inside)) > 0, cv2.dilate(truth, disc(outside)) == 0


def _drawn_frames(clip: str) -> tuple[tuple[Camera, ...], Iterator[Sequence[View]]]:
    renderer, cameras, frame_count = person_renderer(clip)
    empty = [
        gaussian_from_frames([renderer.empty(camera, frame) for frame in range(EMPTY_FRAMES)])
        for camera in range(len(cameras))
    ]

    def views(frame: int) -> Sequence[View]:
        shadow = renderer.shadow(frame)
        return [
            (*renderer.picture(camera, frame, shadow), background) for camera, background in enumerate(empty)
        ]

    return cameras, (views(int(frame)) for frame in evenly_spread(frame_count, FRAMES))


def _frames_of_others(clip: str, cache: FootageCache) -> tuple[tuple[Camera, ...], Iterator[Sequence[View]]]:
    """Raises StudioError where the clip is not there."""
    folder = located(clip, real_data_folder())
    cameras = cache.session(str(imported(clip, cache))).cameras()
    empty = [
        gaussian_from_frames(
            [picture for _, picture in _frames(folder / "background" / f"{camera.name}.mp4", EMPTY_FRAMES)]
        )
        for camera in cameras
    ]
    clips = [_frames(folder / "videos" / f"{camera.name}.mp4", FRAMES) for camera in cameras]

    def views(at: int) -> Sequence[View]:
        found: list[View] = []
        for camera, pictures, background in zip(cameras, clips, empty, strict=True):
            frame, picture = pictures[at]
            truth = read_picture(folder / "masks_truth" / camera.name / f"{frame:06d}.png")
            found.append((picture, np.ascontiguousarray(truth[:, :, 0]), background))
        return found

    return cameras, (views(at) for at in range(FRAMES))


def _frames(video: Path, most: int) -> list[tuple[int, Bytes]]:
    count = measure_video(video).frame_count
    reader = VideoReader(video, count)
    try:
        return [(int(frame), reader.read(int(frame))) for frame in evenly_spread(count, most)]
    finally:
        reader.close()


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Of each choice, over the clips: share of the body called background and of the body's area called body beside
    it, mean and worst clip.
    """
    missed, added = dict[str, list[float]](), dict[str, list[float]]()
    for choice in CHOICES:
        counts = np.array([outcome.measured[choice] for outcome in outcomes], dtype=np.float64)
        missed[choice] = [float(value) for value in 100.0 * counts[:, 0] / counts[:, 2]]
        added[choice] = [float(value) for value in 100.0 * counts[:, 1] / counts[:, 2]]
        for what, shares in (
            ("body called background", missed[choice]),
            ("beside it called body", added[choice]),
        ):
            yield number(f"{what}, {choice}", [float(np.mean(shares))], "%", better="lower")
            yield number(f"{what}, worst clip, {choice}", [max(shares)], "%", better="lower")
    names = tuple(outcome.trial.label for outcome in outcomes)
    yield Table(
        "body called background / beside it called body, both as a share of the body (%)",
        ("choice", *names),
        tuple(
            (
                choice,
                *(
                    f"{one:.1f} / {other:.1f}"
                    for one, other in zip(missed[choice], added[choice], strict=True)
                ),
            )
            for choice in CHOICES
        ),
    )
    cells = {
        choice: [a + b for a, b in zip(missed[choice], added[choice], strict=True)] for choice in CHOICES
    }
    yield heat_chart("wrong pixels, as a share of the body (%)", "clip", "choice", names, cells)
    yield {"frames a clip": FRAMES, "masks": "cleaned, the other knobs at their defaults"}


EXPERIMENTS = (listed("shadow-test", trials, measure, shown),)
