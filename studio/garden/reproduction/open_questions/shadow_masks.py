"""The shadow test against true masks: how much of a body it takes for shadow, how much of a shadow for body; each
camera alone, and with what the others see of the floor.

The clips of the half that chooses defaults are drawn anew, a few frames of each, for their exact masks, as they are and
with clothes of the room's own colours; the two clips of others bring theirs.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.background import GaussianBackground, gaussian_from_frames
from studio.evidence.floor_shadows import cells_of, floor_shadows
from studio.evidence.masks import disc
from studio.evidence.pipeline import RawMask, finished, with_shadows_decided
from studio.evidence.settings import EvidenceSettings
from studio.footage.capture.pictures import read_picture
from studio.footage.capture.video import VideoReader, measure_video
from studio.foundations.arrays import Bytes, evenly_spread
from studio.foundations.geometry.camera import Camera
from studio.garden.drawn_recipes import CHOOSING, KINDS, POORLY_SEEN, clip_name, poorly_seen
from studio.garden.reproduction.drawing import heat_chart
from studio.garden.reproduction.experiment import Part, listed
from studio.garden.reproduction.open_questions.other_people import ELSEWHERE, imported
from studio.results.comparison.findings import Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.real_data import PREFIX, located, real_data_folder
from studio.results.drawing_footage.recipe_file import Recipe, find_recipe, read_recipe
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
    "5 pixels, 0.025, on the floor": {"mask_shadow_alike": 0.0},
    "5 pixels, 0.025, on the floor and as dark": {"mask_shadow_doubt": False},
    "5 pixels, 0.025, on the floor and as dark, or doubted": {},
    "5 pixels, 0.025, on the floor and as dark within 0.05, or doubted": {"mask_shadow_alike": 0.05},
    "5 pixels, 0.04, on the floor and as dark, or doubted": {"mask_shadow_colour": 0.04},
    "no shadow test": {"mask_shadow_test": False},
}
FRAMES, EMPTY_FRAMES = 5, 10
RIM = 1, 3
"""Pixels along the true border that count as neither: inside and outside of it. A border is never sharp."""

LEFT_OF_LIGHT = 0.95
"""Share of the light that a shadow leaves at most, where it counts as one."""
PLAIN, POOR, OTHERS = "as drawn", "poorly seen", "of others"

View = tuple[Bytes, Bytes, NDArray[np.bool_], GaussianBackground]
"""A picture (H, W, 3), its true mask (H, W), where the floor lies in shadow (H, W), and its camera's background. Whose
shadows are not known has none."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """A trial a clip; no seed changes a mask. A clip that shares another's draw, or is poorly seen as it is,
    is left out."""
    drawn = [clip_name(CHOOSING, kind) for kind, made in KINDS.items() if not (made.like or made.worn)]
    others = [PREFIX + place for place in ELSEWHERE.values() if (real_data_folder() / place).is_dir()]
    if scale.quick:
        drawn, others = drawn[:2], []
    return tuple(
        [Trial(clip, {"clip": clip, "set": OTHERS}) for clip in others]
        + [Trial(clip, {"clip": clip, "set": PLAIN}) for clip in drawn]
        + [
            Trial(
                f"{clip}, {POOR}",
                {"clip": clip, "set": POOR, "worn": dict(POORLY_SEEN[number % len(POORLY_SEEN)])},
            )
            for number, clip in enumerate(drawn)
        ]
    )


@kept_as("open_questions.shadow_masks.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of every choice: pixels of the body called background; pixels beside it called body; the body's; pixels of its
    shadow called body; the shadow's; pixels of the body, and of its shadow, that are called neither.
    """
    clip = str(arguments["clip"])
    if clip.startswith(PREFIX):
        cameras, frames = _frames_of_others(clip, cache)
    else:
        path = find_recipe(clip)
        recipe = read_recipe(path)
        if arguments["set"] == POOR:
            recipe = poorly_seen(recipe, arguments["worn"])
        cameras, frames = _drawn_frames(recipe, path.parent)
    counted = {name: np.zeros(7, np.int64) for name in CHOICES}
    tells = floor_shadows(cameras)
    for views in frames:
        parts = [(*_without_rim(truth), dark) for _, truth, dark, _ in views]
        for name, knobs in CHOICES.items():
            settings = dataclasses.replace(EvidenceSettings(), **knobs)
            found = [background.foreground(picture, settings) for picture, _, _, background in views]
            raw = {
                camera.name: RawMask(one.mask, True, one.shadow, one.brightness)
                for camera, one in zip(cameras, found, strict=True)
            }
            if settings.mask_shadow_test and settings.mask_shadow_floor:
                seen = {camera.name: cells_of(*one) for camera, one in zip(cameras, found, strict=True)}
                raw = with_shadows_decided(raw, seen, tells, settings)
            for one, (body, beside, dark) in zip(raw.values(), parts, strict=True):
                mask, unknown = finished(one, settings)
                final, shadow = mask > 0, dark & beside
                either = np.zeros_like(final) if unknown is None else unknown > 0
                counts = body & ~(final | either), beside & final, body, shadow & final, shadow
                counted[name] += [part.sum() for part in (*counts, body & either, shadow & either)]
    return {name: [int(value) for value in values] for name, values in counted.items()}


def _without_rim(truth: Bytes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    inside, outside = RIM
    return cv2.erode(truth, disc(inside)) > 0, cv2.dilate(truth, disc(outside)) == 0


def _drawn_frames(recipe: Recipe, folder: Path) -> tuple[tuple[Camera, ...], Iterator[Sequence[View]]]:
    renderer, cameras, frame_count = person_renderer(recipe, folder)
    empty = [
        gaussian_from_frames([renderer.empty(camera, frame) for frame in range(EMPTY_FRAMES)])
        for camera in range(len(cameras))
    ]

    def views(frame: int) -> Sequence[View]:
        shadow = renderer.shadow(frame)
        return [
            (
                *renderer.picture(camera, frame, shadow),
                renderer.shaded(camera, shadow) < LEFT_OF_LIGHT,
                background,
            )
            for camera, background in enumerate(empty)
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
        made: list[View] = []
        for camera, pictures, background in zip(cameras, clips, empty, strict=True):
            frame, picture = pictures[at]
            truth = read_picture(folder / "masks_truth" / camera.name / f"{frame:06d}.png")
            mask = np.ascontiguousarray(truth[:, :, 0])
            made.append((picture, mask, np.zeros(mask.shape, np.bool_), background))
        return made

    return cameras, (views(at) for at in range(FRAMES))


def _frames(video: Path, most: int) -> list[tuple[int, Bytes]]:
    count = measure_video(video).frame_count
    reader = VideoReader(video, count)
    try:
        return [(int(frame), reader.read(int(frame))) for frame in evenly_spread(count, most)]
    finally:
        reader.close()


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Of each choice and set of clips: share of the body called background, of the body's area called body beside it,
    of its shadow called body, and of both called neither, mean and worst clip.
    """
    wrong = dict[str, dict[str, float]]()
    for kind in (PLAIN, OTHERS, POOR):
        chosen = [outcome for outcome in outcomes if outcome.trial.arguments["set"] == kind]
        if not chosen:
            continue
        names = tuple(outcome.trial.label for outcome in chosen)
        rows = list[tuple[str, ...]]()
        for choice in CHOICES:
            counts = np.array([outcome.measured[choice] for outcome in chosen], dtype=np.float64)
            missed, added = 100.0 * counts[:, 0] / counts[:, 2], 100.0 * counts[:, 1] / counts[:, 2]
            shadow = 100.0 * counts[:, 3] / np.maximum(counts[:, 4], 1.0)
            shares = {"body called background": missed, "beside it called body": added}
            shares["body called neither"] = 100.0 * counts[:, 5] / counts[:, 2]
            if kind != OTHERS:
                shares["its shadow called body"] = shadow
                shares["its shadow called neither"] = 100.0 * counts[:, 6] / np.maximum(counts[:, 4], 1.0)
            for what, values in shares.items():
                yield number(f"{what}, {kind}, {choice}", [float(values.mean())], "%", better="lower")
                yield number(
                    f"{what}, worst clip, {kind}, {choice}", [float(values.max())], "%", better="lower"
                )
            rows.append(
                (choice, *(f"{one:.1f} / {other:.1f}" for one, other in zip(missed, added, strict=True)))
            )
            for clip, both in zip(names, missed + added, strict=True):
                wrong.setdefault(choice, {})[clip] = float(both)
        yield Table(
            f"body called background / beside it called body, both as a share of the body (%), {kind}",
            ("choice", *names),
            tuple(rows),
        )
    clips = tuple(next(iter(wrong.values())))
    cells = {choice: [values[clip] for clip in clips] for choice, values in wrong.items()}
    yield heat_chart("wrong pixels, as a share of the body (%)", "clip", "choice", clips, cells)
    yield {"frames a clip": FRAMES, "masks": "cleaned, the other knobs at their defaults"}


EXPERIMENTS = (listed("shadow-test", trials, measure, shown),)
