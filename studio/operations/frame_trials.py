"""Trials of a frame: annealed again with other knobs and not stored, beside the stored result."""

from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from studio.body.forward_kinematics import limb_ends
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError
from studio.foundations.knobs import Value
from studio.operations.jobs.tried_frames import TriedFrames
from studio.operations.stored_frames import LayerView, layer_view
from studio.results.inspection.reading import InspectedRun, TriedFrame
from studio.results.inspection.reference import body_points, by_limb, limb_group, true_points
from studio.search.settings import RunSettings, all_knobs, values
from studio.search.trackers.tracker import FrameResult


@dataclass(frozen=True, slots=True)
class KnobMoved:
    """A knob that a trial has other than the stored frame."""

    name: str
    label: str
    unit: str
    stored: Value
    tried: Value


@dataclass(frozen=True, slots=True, eq=False)
class FrameNumbers:
    """The numbers of a frame's result.

    error_mm : null without a truth.
    limbs : in the body's order.
    sketch : a line of each drawn limb, from (x, y) to (x, y) in mm, y up, seen from where the stored body is widest.
    """

    log_weight: float
    evaluations: int
    milliseconds: float
    layers: int
    error_mm: float | None
    limbs: dict[str, float]
    pose: Array
    sketch: list[list[float]]


@dataclass(frozen=True, slots=True, eq=False)
class TrialView(FrameNumbers):
    """A trial.

    name : made from its frame and settings.
    moved : the knobs that differ from the stored frame's.
    """

    name: str
    moved: tuple[KnobMoved, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TrialList:
    """The trials of a frame, the oldest first, and the stored result. sides : of the sketches' lines."""

    frame: int
    sides: tuple[str, ...]
    limbs_by: Annotated[
        Literal["mm", "share"],
        Field(
            description="What limbs are measured by: mm from the truth, else the share of their area in which"
            " silhouettes and pose disagree."
        ),
    ]
    stored: FrameNumbers
    trials: tuple[TrialView, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TrialLayers:
    """A trial with its layers, which have the entries of `layer` events. search_layers, searches : as of a frame."""

    trial: TrialView
    frame: int
    search_layers: int
    searches: int
    layers: tuple[LayerView, ...]


def trials_of_frame(run: InspectedRun, kept: TriedFrames, frame: int) -> TrialList:
    """All trials of a frame that are kept, beside the stored result. Raises NotFoundError."""
    stored = run.frame(frame)
    if stored.result is None:
        raise NotFoundError(f"Frame {frame} is not finished.", "Choose a finished frame.")
    return TrialList(
        frame=frame,
        sides=tuple(limb.side for limb in run.body.drawn),
        limbs_by="share" if true_points(run, frame) is None else "mm",
        stored=_numbers(run, frame, stored.result),
        trials=tuple(_view(run, one) for one in kept.of_frame(run.run, run.session.name, frame)),
    )


def trial_layers(run: InspectedRun, kept: TriedFrames, name: str) -> TrialLayers:
    """A trial by its name, with its layers. Raises NotFoundError."""
    trial = kept.tried(run.run, run.session.name, name)
    frame, camera = InspectedRun(run.session, run.run, trial).frame(trial.number), run.run.cameras()[0]
    return TrialLayers(
        trial=_view(run, trial),
        frame=trial.number,
        search_layers=frame.search_layers,
        searches=frame.searches,
        layers=tuple(layer_view(run.body, camera, layer) for layer in trial.layers),
    )


def _view(run: InspectedRun, tried: TriedFrame) -> TrialView:
    numbers = _numbers(run, tried.number, tried.result)
    moved = _moved_knobs(run.settings(tried.number), tried.settings)
    same: dict[str, Any] = {entry.name: getattr(numbers, entry.name) for entry in fields(numbers)}
    return TrialView(**same, name=tried.name, moved=moved)


def _moved_knobs(stored: RunSettings, tried: RunSettings) -> tuple[KnobMoved, ...]:
    before, after = values(stored), values(tried)
    return tuple(
        KnobMoved(knob.name, knob.label, knob.unit, before[knob.name], after[knob.name])
        for knob in all_knobs(tried)
        if before.get(knob.name) != after[knob.name]
    )


def _numbers(run: InspectedRun, frame: int, result: FrameResult) -> FrameNumbers:
    estimate, truth = result.estimate, true_points(run, frame)
    error = None
    limbs: dict[str, float] = {}
    if truth is not None:
        away: Array = np.linalg.norm(body_points(run.body, estimate.pose[None])[0] - truth, axis=1)
        error = float(np.nanmean(away))
        limbs |= {limb: float(mm) for limb, mm in by_limb(run.body, away).items()}
    else:
        for name, share in result.disagreement.items():
            group = limb_group(run.body, name)
            limbs[group] = max(limbs.get(group, 0.0), float(share))
    return FrameNumbers(
        log_weight=estimate.log_weight,
        evaluations=result.evaluations,
        milliseconds=result.milliseconds,
        layers=result.layers,
        error_mm=error,
        limbs=limbs,
        pose=estimate.pose,
        sketch=_sketch(run, frame, estimate.pose),
    )


def _sketch(run: InspectedRun, frame: int, pose: Array) -> list[list[float]]:
    """A pose's limbs as lines, see `FrameNumbers`."""
    with run.run.results() as results:
        stored = results.result(frame).estimate.pose
    ground = limb_ends(run.body, stored[None])[0, :, :, :2].reshape(-1, 2)
    widest = np.linalg.svd(ground - ground.mean(axis=0))[2][0]
    ends = limb_ends(run.body, pose[None])[0]
    flat = np.stack([(ends[:, :, :2] - ground.mean(axis=0)) @ widest, ends[:, :, 2]], axis=2)
    return [[round(float(number), 1) for number in line.reshape(-1)] for line in flat]
