"""What the dead particles of a layer had wrong: every particle with its children, and survivors against dead by
parameter.
"""

import numpy as np
import scipy  # stats, half a second, are loaded once they are used

from studio.foundations.arrays import Mask
from studio.results.inspection.genealogy import children_of
from studio.results.inspection.reading import InspectedFrame, no_value
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table

VIEW = View(
    "survivors",
    "Survivors and dead",
    "What did the dead have wrong?",
    ("layer",),
    (
        table(
            "particles",
            "Particles of the layer",
            "particle",
            ("rank", "Rank"),
            "log_weight",
            ("weight", "Weight"),
            ("children", "Children"),
            ("survives", "Survives"),
            each="parameter",
        ),
        table(
            "difference",
            "Survivors against dead",
            "parameter",
            "limb",
            "unit",
            ("survivors", "Mean of the survivors"),
            ("dead", "Mean of the dead"),
            ("difference", "Difference in deviations"),
            ("p_value", "Kolmogorov-Smirnov p"),
        ),
    ),
)


FEWEST = 2


def surviving(frame: InspectedFrame, layer: int) -> Mask:
    """(N,) which stored particles of a layer were drawn for the next; where none are drawn, or their parents are not
    stored, the heaviest of the share that was reached.
    """
    numbers, record = frame.particles(layer), frame.layers[layer]
    if record.parents.size:
        return children_of(frame, layer)[numbers] > 0
    reached = record.alpha_reached if np.isfinite(record.alpha_reached) else 0.5
    kept = max(1, round(reached * frame.size(layer)))
    heaviest = np.argsort(-frame.log_weights(layer), kind="stable")[:kept]
    survives = np.zeros(len(numbers), dtype=bool)
    survives[heaviest] = True
    return survives


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    run, layer = frame.of, frame.layer(selection)
    record, weights, numbers = frame.layers[layer], frame.weights(layer), frame.particles(layer)
    survives, children = surviving(frame, layer), children_of(frame, layer)[numbers]
    ranks = np.empty(len(weights), dtype=np.int64)
    ranks[np.argsort(-weights, kind="stable")] = np.arange(len(weights))
    drawn = bool(record.parents.size)
    difference: list[Row] = []
    for at, label in enumerate(run.labels):
        alive, dead = record.poses[survives, at], record.poses[~survives, at]
        if min(len(alive), len(dead)) < FEWEST:
            difference.append((*label, None, None, None, None))
            continue
        pooled = float(np.sqrt((alive.var() * len(alive) + dead.var() * len(dead)) / len(survives)))
        apart = float(alive.mean() - dead.mean())
        difference.append(
            (
                *label,
                float(alive.mean()),
                float(dead.mean()),
                apart / pooled if pooled > 0.0 else None,
                no_value(float(scipy.stats.ks_2samp(alive, dead).pvalue)),
            )
        )
    return ViewResult(
        {
            "particles": [
                (
                    int(numbers[at]),
                    int(ranks[at]),
                    float(record.log_weights[at]),
                    float(weights[at]),
                    int(children[at]) if drawn else None,
                    bool(survives[at]),
                    *map(float, record.poses[at]),
                )
                for at in range(len(numbers))
            ],
            "difference": difference,
        },
        ()
        if drawn
        else ("Nothing was drawn from this layer: the heaviest of the share reached count as alive.",),
    )
