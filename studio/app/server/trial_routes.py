"""Trials: frames that were annealed again with moved knobs and are not stored, beside the stored result."""

from typing import Literal

import numpy as np
from fastapi import APIRouter
from pydantic import Field

from studio.app.server.app_state import App
from studio.app.server.result_routes import LayerView, layer_view
from studio.app.server.run_routes import RUN, OpenRun
from studio.app.server.schemas import Answer, Number, Numbers
from studio.app.server.session_routes import OpenSession
from studio.body.forward_kinematics import limb_ends
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError
from studio.foundations.knobs import Value
from studio.results.inspection.reading import InspectedRun, TriedFrame
from studio.results.inspection.reference import body_points, by_limb, limb_group, true_points
from studio.search.settings import RunSettings, all_knobs, values
from studio.search.trackers.tracker import FrameResult

router = APIRouter(prefix="/api", tags=["trials"])


class KnobMoved(Answer):
    """A knob that a trial has other than the stored frame."""

    name: str
    label: str
    unit: str
    stored: Value
    tried: Value


class FrameNumbers(Answer):
    """What a result of a frame comes to. error_mm: null without a truth. limbs: in the body's order. sketch: a line of
    each drawn limb, from (x, y) to (x, y) in mm, y up, seen from where the stored body is widest.
    """

    log_weight: Number
    evaluations: int
    milliseconds: Number
    layers: int
    error_mm: Number
    limbs: dict[str, Number]
    pose: Numbers
    sketch: list[list[float]]


class TrialView(FrameNumbers):
    """A trial. name: its frame, and what its settings come to. moved: the knobs that differ from the stored frame's."""

    name: str
    moved: list[KnobMoved]


class TrialList(Answer):
    """What was tried of a frame, the oldest first, and what is stored of it. sides: of the sketches' lines."""

    frame: int
    sides: list[str]
    limbs_by: Literal["mm", "share"] = Field(
        description="What limbs are measured by: mm from the truth, else the share of their area in which silhouettes"
        " and pose disagree."
    )
    stored: FrameNumbers
    trials: list[TrialView]


class TrialLayers(Answer):
    """A trial with its layers, which have the entries of `layer` events. search_layers, searches: as of a frame."""

    trial: TrialView
    frame: int
    search_layers: int
    searches: int
    layers: list[LayerView]


@router.get(RUN + "/frames/{frame}/trials")
def trials(session: OpenSession, run: OpenRun, frame: int, app: App) -> TrialList:
    """All that was tried of a frame and is kept, beside the stored result."""
    inspected = InspectedRun(session, run)
    stored = inspected.frame(frame)
    if stored.result is None:
        raise NotFoundError(f"Frame {frame} is not finished.", "Choose a finished frame.")
    return TrialList(
        frame=frame,
        sides=[limb.side for limb in inspected.body.drawn],
        limbs_by="share" if true_points(inspected, frame) is None else "mm",
        stored=_numbers(inspected, frame, stored.result),
        trials=[_view(inspected, one) for one in app.events.tried.of_frame(run, session.name, frame)],
    )


@router.get(RUN + "/trials/{trial}")
def trial(session: OpenSession, run: OpenRun, trial: str, app: App) -> TrialLayers:
    """A trial by its name, with its layers."""
    found = app.events.tried.tried(run, session.name, trial)
    inspected, camera = InspectedRun(session, run, found), run.cameras()[0]
    frame = inspected.frame(found.number)
    return TrialLayers(
        trial=_view(InspectedRun(session, run), found),
        frame=found.number,
        search_layers=frame.search_layers,
        searches=frame.searches,
        layers=[layer_view(inspected.body, camera, layer) for layer in found.layers],
    )


def _view(run: InspectedRun, tried: TriedFrame) -> TrialView:
    numbers = _numbers(run, tried.number, tried.result)
    return TrialView.of(numbers, name=tried.name, moved=_moved(run.settings(tried.number), tried.settings))


def _moved(stored: RunSettings, tried: RunSettings) -> list[KnobMoved]:
    before, after = values(stored), values(tried)
    return [
        KnobMoved(
            name=knob.name,
            label=knob.label,
            unit=knob.unit,
            stored=before[knob.name],
            tried=after[knob.name],
        )
        for knob in all_knobs(tried)
        if before.get(knob.name) != after[knob.name]
    ]


def _numbers(run: InspectedRun, frame: int, result: FrameResult) -> FrameNumbers:
    estimate, truth = result.estimate, true_points(run, frame)
    error = None
    limbs: dict[str, float | None] = {}
    if truth is not None:
        away: Array = np.linalg.norm(body_points(run.body, estimate.pose[None])[0] - truth, axis=1)
        error = float(np.nanmean(away))
        limbs |= {limb: float(mm) for limb, mm in by_limb(run.body, away).items()}
    else:
        for name, share in result.disagreement.items():
            group = limb_group(run.body, name)
            limbs[group] = max(limbs.get(group) or 0.0, float(share))
    return FrameNumbers(
        log_weight=estimate.log_weight,
        evaluations=result.evaluations,
        milliseconds=result.milliseconds,
        layers=result.layers,
        error_mm=error,
        limbs=limbs,
        pose=estimate.pose.tolist(),
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
