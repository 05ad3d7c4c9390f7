"""Which parameters trade off: weighted correlations of a layer's particles, in the order in which they were settled."""

import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.results.inspection.reading import InspectedFrame
from studio.results.inspection.tables import Row, Selection, View, table
from studio.results.inspection.variance import settling

VIEW = View(
    "coupling",
    "Coupling",
    "Which parameters trade off?",
    ("layer", "parameter"),
    (
        table(
            "matrix",
            "Correlations, in the order of settling",
            ("first", "Parameter"),
            ("second", "Other parameter"),
            ("correlation", "Correlation"),
        ),
        table(
            "order",
            "Order of settling",
            ("place", "Place"),
            "parameter",
            "limb",
            "unit",
            "layer",
            ("deviation", "Deviation in this layer"),
        ),
        table("particles", "Particles of the layer", "particle", ("weight", "Weight"), each="parameter"),
    ),
)


def correlations(poses: Array, weights: Array) -> Array:
    """(D, D) weighted correlation; NaN for a parameter that does not vary."""
    away = poses - weights @ poses
    covariance = (away * weights[:, None]).T @ away
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        return covariance / deviation[:, None] / deviation


def settling_order(frame: InspectedFrame) -> Indices:
    """(D,) the parameters, those first that an earlier layer settled; of one layer, the most reduced first."""
    settled, first, last = settling(frame)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.where(first > 0.0, last / first, 1.0)
    return np.lexsort((left, settled))


def rows(frame: InspectedFrame, selection: Selection) -> dict[str, list[Row]]:
    """The tables of view `coupling`."""
    run, chosen = frame.of, frame.layer(selection)
    poses, weights = frame.layers[chosen].poses, frame.weights(chosen)
    matrix, order = correlations(poses, weights), settling_order(frame)
    if selection.parameter:
        order = np.array(
            [run.parameter(selection.parameter), *order[order != run.parameter(selection.parameter)]]
        )
    deviation = np.sqrt(np.maximum(weights @ (poses - weights @ poses) ** 2, 0.0))
    settled, labels = settling(frame)[0], run.labels
    return {
        "matrix": [
            (run.names[one], run.names[other], float(matrix[one, other])) for one in order for other in order
        ],
        "order": [
            (place, *labels[at], int(settled[at]), float(deviation[at])) for place, at in enumerate(order)
        ],
        "particles": [
            (int(number), float(weight), *map(float, pose))
            for number, weight, pose in zip(frame.particles(chosen), weights, poses, strict=True)
        ],
    }
