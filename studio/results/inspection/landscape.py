"""What the likelihood looks like about a frame's pose: along one parameter, over two, or on the line to another pose.

Places are the parameter's value (rad, mm), or 0 at the estimate and 1 at the other pose. Each layer saw the density w^β
(Deutscher & Reid 2005, Eq. 3), here scaled to a greatest value of 1 on the line.
"""

import math
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError
from studio.results.inspection.likelihoods import (
    NATS_SCALE,
    FrameEvaluation,
    evaluation_of,
    named_pose,
    nats_scale,
)
from studio.results.inspection.modes import modes_of
from studio.results.inspection.reading import InspectedFrame, no_value
from studio.results.inspection.reference import true_pose
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table

VIEW = View(
    "landscape",
    "Landscape",
    "What does the likelihood look like here?",
    ("layer", "parameter", "second", "towards", "particle", "track"),
    (
        table(
            "slice",
            "Log weight along the line",
            ("at", "Place"),
            "unit",
            "log_weight",
            ("possible", "Within the limits"),
        ),
        table(
            "terms",
            "Terms along the line",
            ("at", "Place"),
            "camera",
            "term",
            ("value", "Log-likelihood", "nats"),
        ),
        table(
            "tempered",
            "Density at each layer's β",
            "layer",
            ("beta", "β"),
            ("at", "Place"),
            ("density", "Density"),
        ),
        table(
            "plane",
            "Log weight over two parameters",
            ("at", "Place"),
            ("second", "Second parameter"),
            "log_weight",
        ),
        table(
            "rug",
            "Particles on the line",
            "layer",
            "particle",
            ("at", "Place"),
            ("second", "Second parameter"),
            "log_weight",
        ),
        table(
            "marks",
            "Estimate, truth and best particle",
            ("name", "Name"),
            ("at", "Place"),
            ("second", "Second parameter"),
            "log_weight",
        ),
        table(
            "ends",
            "Poses at the line's ends (place 0 and 1, or the first and last value)",
            "parameter",
            "unit",
            ("from", "First"),
            ("to", "Last"),
        ),
        NATS_SCALE,
    ),
    evaluates=True,
)


PLACES, PLANE = 81, 33
BEFORE, AFTER = -0.5, 1.5
REACH = 1.25
"""Times the first cloud's half width: how far a slice reaches to either side."""
TRUTH, SECOND_MODE = "truth", "second mode"


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line of poses. places : (P,). poses : (P, D). unit : of the places, "" for shares of a way. parameter : its
    index, None for a way. base, away : poses at place 0 of a way, and from it to place 1.
    """

    places: Array
    poses: Array
    unit: str
    parameter: int | None
    base: Array
    away: Array

    def place_of(self, poses: Array, scale: Array) -> Array:
        """(N,) where poses (N, D) lie on the line; on a way the nearest place, parameters counted in `scale` (D,)."""
        if self.parameter is not None:
            return poses[:, self.parameter]
        along = self.away / scale
        return ((poses - self.base) / scale) @ along / float(along @ along)


def parameter_range(frame: InspectedFrame, parameter: int, *others: Array) -> tuple[float, float]:
    """Lowest and highest value of a slice: the first cloud, the last and other poses, within the limits."""
    first = frame.layers[0].poses[:, parameter]
    known = np.array([first.min(), first.max(), *(pose[parameter] for pose in others)])
    middle, half = 0.5 * (known.min() + known.max()), 0.5 * REACH * (known.max() - known.min())
    half = half or float(frame.of.run.record.sigma[parameter]) or 1.0
    entry = frame.of.body.parameters[parameter]
    return float(max(middle - half, entry.lower)), float(min(middle + half, entry.upper))


def line_of(frame: InspectedFrame, selection: Selection) -> Line:
    """The line that is selected; without a choice the way to the truth, else the parameter that settled least."""
    run, layer = frame.of, frame.layer(selection)
    base, truth = frame.estimate(selection.track), true_pose(run, frame.number)
    towards = selection.towards
    if not towards and not selection.parameter and truth is not None:
        towards = TRUTH
    if towards:
        away = _end(frame, towards, selection, layer) - base
        places = np.linspace(BEFORE, AFTER, PLACES)
        return Line(places, base + places[:, None] * away, "", None, base, away)
    chosen = run.parameter(selection.parameter) if selection.parameter else _least_settled(frame)
    others = [base, frame.searched()] + ([] if truth is None else [truth.pose])
    places = np.linspace(*parameter_range(frame, chosen, *others), PLACES)
    poses = np.repeat(base[None], PLACES, axis=0)
    poses[:, chosen] = places
    return Line(places, poses, run.units[chosen], chosen, base, np.zeros(len(base)))


def _end(frame: InspectedFrame, towards: str, selection: Selection, layer: int) -> Array:
    """(D,) the pose at a way's end. Raises NotFoundError."""
    if towards == TRUTH:
        truth = true_pose(frame.of, frame.number)
        if truth is None:
            raise NotFoundError(f"Frame {frame.number} has no truth.", "Select a parameter or another pose.")
        return truth.pose
    if towards == SECOND_MODE:
        modes = modes_of(frame.of.body, frame.layers[layer].poses, frame.weights(layer))
        if len(modes) < 2:
            raise NotFoundError(
                f"Layer {layer + 1} of frame {frame.number} has one mode.", "Select another layer."
            )
        return modes[1].pose
    return named_pose(frame, towards, selection.particle, layer)


def _least_settled(frame: InspectedFrame) -> int:
    sigma = np.array(frame.of.run.record.sigma)
    left = frame.layers[-1].variance_resampled / np.where(sigma > 0.0, sigma, np.inf) ** 2
    return int(np.argmax(left))


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    run, evaluation = frame.of, evaluation_of(frame)
    line = line_of(frame, selection)
    shares = evaluation.shares(line.poses)
    values = shares.values.sum(axis=(1, 2))
    held = run.priors.hold(line.poses)
    tempered: list[Row] = []
    for layer, record in enumerate(frame.layers):
        if math.isfinite(record.beta):
            heights = np.exp(record.beta * (values - values.max()))
            tempered += [
                (layer, record.beta, float(place), float(height))
                for place, height in zip(line.places, heights, strict=True)
            ]
    second = run.parameter(selection.second) if selection.second and line.parameter is not None else None
    layer, marks = frame.layer(selection), _marks(frame, selection)
    record, sigma = frame.layers[layer], np.array(run.run.record.sigma)
    scale = np.where(sigma > 0.0, sigma, 1.0)
    across = None if second is None else record.poses[:, second]
    ends = line.poses[[0, -1]] if line.parameter is not None else np.stack([line.base, line.base + line.away])
    return ViewResult(
        {
            "slice": [
                (float(place), line.unit, float(value), bool(inside))
                for place, value, inside in zip(line.places, values, held, strict=True)
            ],
            "terms": [
                (float(place), camera, term, float(shares.values[at, view, number]))
                for view, camera in enumerate(shares.cameras)
                for number, term in enumerate(shares.terms)
                for at, place in enumerate(line.places)
            ],
            "tempered": tempered,
            "plane": [] if second is None else _plane(frame, evaluation, line, second, list(marks.values())),
            "rug": [
                (
                    layer,
                    int(number),
                    float(place),
                    None if across is None else float(across[at]),
                    float(weight),
                )
                for at, (number, place, weight) in enumerate(
                    zip(
                        frame.particles(layer),
                        line.place_of(record.poses, scale),
                        record.log_weights,
                        strict=True,
                    )
                )
            ],
            "marks": [
                (
                    name,
                    float(line.place_of(pose[None], scale)[0]),
                    None if second is None else float(pose[second]),
                    no_value(float(weight)),
                )
                for (name, pose), weight in zip(
                    marks.items(), evaluation.log_weights(np.stack(list(marks.values()))), strict=True
                )
            ],
            "scale": [nats_scale(run)],
            "ends": [
                (name, unit, float(first), float(last))
                for name, unit, first, last in zip(run.names, run.units, *ends, strict=True)
            ],
        }
    )


def _marks(frame: InspectedFrame, selection: Selection) -> dict[str, Array]:
    marks = {
        "estimate": frame.estimate(selection.track),
        "searched": frame.searched(),
        "best particle": frame.layers[-1].best,
    }
    truth = true_pose(frame.of, frame.number)
    return marks if truth is None else marks | {"truth": truth.pose}


def _plane(
    frame: InspectedFrame, evaluation: FrameEvaluation, line: Line, second: int, others: list[Array]
) -> list[Row]:
    """Log weights over the line's parameter and another."""
    first = np.linspace(float(line.places[0]), float(line.places[-1]), PLANE)
    across = np.linspace(*parameter_range(frame, second, *others), PLANE)
    assert line.parameter is not None
    poses = np.repeat(line.base[None], PLANE * PLANE, axis=0)
    grid = np.stack(np.meshgrid(first, across, indexing="ij"), axis=2).reshape(-1, 2)
    poses[:, line.parameter], poses[:, second] = grid[:, 0], grid[:, 1]
    values = evaluation.log_weights(poses)
    return [
        (float(one), float(other), float(value)) for (one, other), value in zip(grid, values, strict=True)
    ]
