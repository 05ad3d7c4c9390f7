"""What a frame learned: each parameter's first cloud, as drawn, beside the weighted cloud of every layer.

Densities are Gaussian kernel estimates with Silverman's bandwidth (Silverman 1986, Eq. 3.31) at the effective number of
particles.
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.results.inspection.reading import InspectedFrame, no_value
from studio.results.inspection.reference import true_pose
from studio.results.inspection.schedule import effective_number
from studio.results.inspection.tables import Row, Selection, View, table

VIEW = View(
    "clouds",
    "First and last cloud",
    "What did the frame learn?",
    ("parameter", "limb", "track"),
    (
        table(
            "summary",
            "Clouds by parameter and layer",
            "parameter",
            "limb",
            "unit",
            "layer",
            ("weighted", "Weighted (else as drawn)"),
            ("mean", "Mean"),
            ("deviation", "Deviation"),
            ("q05", "5 %"),
            ("q25", "25 %"),
            ("median", "Median"),
            ("q75", "75 %"),
            ("q95", "95 %"),
        ),
        table(
            "ridges",
            "Densities by parameter and layer",
            "parameter",
            "layer",
            ("weighted", "Weighted (else as drawn)"),
            ("value", "Value"),
            ("density", "Density"),
        ),
        table(
            "marks",
            "Limits, estimate and truth",
            "parameter",
            "limb",
            "unit",
            ("lower", "Lower limit"),
            ("upper", "Upper limit"),
            ("estimate", "Estimate"),
            ("truth", "Truth"),
        ),
    ),
)


POINTS = 49
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
BEYOND = 3.0
"""Bandwidths that a density is drawn beyond the outermost particles."""


def weighted_quantiles(values: Array, weights: Array, at: tuple[float, ...]) -> Array:
    """Quantiles of weighted values (N,): the smallest value at which the cumulated weight reaches each share."""
    order = np.argsort(values, kind="stable")
    cumulated = np.cumsum(weights[order])
    places = np.searchsorted(cumulated / cumulated[-1], np.array(at) - 1e-12)
    return values[order][np.minimum(places, len(values) - 1)]


def density(values: Array, weights: Array, effective: float) -> tuple[Array, Array]:
    """(POINTS,) places and the weighted values' kernel density there; all mass in one place where they are equal."""
    mean = weights @ values
    deviation = float(np.sqrt(weights @ (values - mean) ** 2))
    low, high = weighted_quantiles(values, weights, (0.25, 0.75))
    spread = min(deviation, float(high - low) / 1.349) or deviation
    width = 0.9 * spread * effective**-0.2
    if width <= 0.0 or not np.isfinite(width):
        return np.full(1, mean), np.full(1, np.inf)
    drawn = values[weights > 1e-9]
    low, high = float(drawn.min()) - BEYOND * width, float(drawn.max()) + BEYOND * width
    places = low + (high - low) * np.arange(POINTS) / (POINTS - 1)
    kernels = np.exp(-0.5 * ((places[:, None] - values) / width) ** 2)
    return places, kernels @ weights / (width * np.sqrt(2.0 * np.pi))


def rows(frame: InspectedFrame, selection: Selection) -> dict[str, list[Row]]:
    """The tables of view `clouds`: all layers of the selected parameter or limb, else first and last of all."""
    run, last = frame.of, len(frame.layers) - 1
    chosen = list(range(len(run.names)))
    if selection.parameter:
        chosen = [run.parameter(selection.parameter)]
    elif selection.limb:
        chosen = [at for at in chosen if run.limbs[at] == selection.limb]
    whole = bool(selection.parameter or selection.limb)
    # The first set as drawn, then the layers after weighing.
    clouds = [(0, False, np.full(len(frame.layers[0].poses), 1.0 / max(len(frame.layers[0].poses), 1)))]
    clouds += [(layer, True, frame.weights(layer)) for layer in range(last + 1) if whole or layer == last]
    estimate, truth = frame.estimate(selection.track), true_pose(run, frame.number)
    labels = run.labels
    summary: list[Row] = []
    ridges: list[Row] = []
    for layer, weighted, weights in clouds:
        poses, effective = frame.layers[layer].poses, effective_number(np.log(np.maximum(weights, 1e-300)))
        for at in chosen if len(poses) else ():
            values = poses[:, at]
            mean = float(weights @ values)
            deviation = float(np.sqrt(weights @ (values - mean) ** 2))
            quantiles = weighted_quantiles(values, weights, QUANTILES)
            summary.append((*labels[at], layer, weighted, mean, deviation, *map(float, quantiles)))
            for place, height in zip(*density(values, weights, effective), strict=True):
                ridges.append((run.names[at], layer, weighted, float(place), no_value(float(height))))
    parameters = run.body.parameters
    return {
        "summary": summary,
        "ridges": ridges,
        "marks": [
            (
                *labels[at],
                no_value(parameters[at].lower),
                no_value(parameters[at].upper),
                float(estimate[at]),
                None if truth is None else float(truth.pose[at]),
            )
            for at in chosen
        ],
    }
