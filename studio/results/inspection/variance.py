"""Which parameter each layer settled (Deutscher & Reid 2005, Fig. 12: variances as weighed, after resampling and after
noise).
"""

import numpy as np

from studio.results.inspection.reading import InspectedFrame
from studio.results.inspection.tables import Row, Selection, View, table

VIEW = View(
    "variance",
    "Variance reduction",
    "Which parameter did which layer settle?",
    ("parameter",),
    (
        table(
            "layers",
            "Variance of every parameter in every layer",
            "parameter",
            "limb",
            "unit",
            ("search", "Search of the frame"),
            "layer",
            ("weighed", "As weighed"),
            ("before", "Before noise"),
            ("after", "After noise"),
        ),
        table(
            "settled",
            "Layer that settled each parameter",
            "parameter",
            "limb",
            "unit",
            "layer",
            ("first", "First variance"),
            ("last", "Last variance"),
            ("reduction", "First / last"),
        ),
        table("first", "Variance of the first set, by frame", "frame", of_run=True, each="parameter"),
        table("last", "Variance of the last set, by frame", "frame", of_run=True, each="parameter"),
        table(
            "parameter",
            "One parameter by layer and frame",
            "frame",
            ("search", "Search of the frame"),
            "layer",
            ("weighed", "As weighed"),
            ("before", "Before noise"),
            ("after", "After noise"),
            of_run=True,
        ),
    ),
)


def settling(frame: InspectedFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(D,) the layer whose selection reduced each parameter's variance by the largest factor; (D,) the variance of the
    first set as weighed; (D,) that of the last set after weighing.
    """
    weighed = np.stack([record.variance_weighed for record in frame.layers])
    selected = np.stack([record.variance_resampled for record in frame.layers])
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(weighed > 0.0, np.where(selected > 0.0, weighed / selected, np.inf), 1.0)
    return np.argmax(factor, axis=0), weighed[0], selected[-1]


def rows(frame: InspectedFrame, selection: Selection) -> dict[str, list[Row]]:
    """The tables of view `variance`."""
    run, layers, search_layers = frame.of, frame.layers, frame.search_layers
    settled, first, last = settling(frame)
    return {
        "layers": [
            (
                *label,
                1 + layer // search_layers,
                layer,
                float(record.variance_weighed[at]),
                float(record.variance_resampled[at]),
                float(record.variance_diffused[at]),
            )
            for at, label in enumerate(run.labels)
            for layer, record in enumerate(layers)
        ],
        "settled": [
            (
                *label,
                int(settled[at]),
                float(first[at]),
                float(last[at]),
                float(first[at] / last[at]) if last[at] > 0.0 else None,
            )
            for at, label in enumerate(run.labels)
        ],
    }
