"""Whether annealing proceeded as asked: β, survival rate and effective number of every layer (Deutscher & Reid 2005,
section 3.1, Eq. 11 and 12); of a sampled posterior the exponent that each set is a sample with, the moves taken, and
the evidence.
"""

import math

import numpy as np

from studio.results.inspection.reading import InspectedFrame, no_value
from studio.results.inspection.tables import Row, Selection, View, table

VIEW = View(
    "schedule",
    "Schedule",
    "Did annealing proceed as asked?",
    ("layer",),
    (
        table(
            "layers",
            "Exponent and survival of every layer",
            "layer",
            ("beta", "β"),
            ("alpha_wanted", "α wanted"),
            ("alpha_reached", "α reached"),
            ("effective", "Effective number"),
            ("particles", "Particles"),
            ("largest", "Largest weight"),
            ("best_log_weight", "Best log weight", "nats"),
            ("milliseconds", "Time", "ms"),
            ("settings_version", "Settings version"),
            ("temper", "Exponent of the set"),
            ("acceptance", "Moves taken"),
            ("log_evidence", "Log evidence", "nats"),
            ("alarm", "Alarm"),
        ),
        table(
            "frames",
            "Schedule by frame",
            "frame",
            ("beta_first", "β of the first layer"),
            ("beta_last", "β of the last layer"),
            ("least_alpha", "Least α reached"),
            ("least_effective", "Least effective number"),
            ("alarms", "Layers with an alarm"),
            ("log_evidence", "Log evidence", "nats"),
            of_run=True,
        ),
    ),
)


SATURATED = 0.02
"""Difference of α asked and reached beyond which no β reaches what was asked (`annealing.anneal`)."""
ALONE = 0.5
"""Largest weight beyond which one particle holds all that matters."""


def effective_number(log_weights: np.ndarray) -> float:
    """D = 1 / Σ π² of normalised log weights (Eq. 11)."""
    return float(1.0 / np.sum(np.exp(2.0 * log_weights)))


def alarm_of(frame: InspectedFrame, layer: int) -> str:
    """What is wrong with a layer's annealing, "" for nothing."""
    record = frame.layers[layer]
    if not math.isfinite(record.beta):
        return ""
    weights = frame.weights(layer)
    alarms: list[str] = []
    if math.isfinite(record.alpha_wanted) and abs(record.alpha_wanted - record.alpha_reached) > SATURATED:
        alarms.append("no β reaches the survival that was asked")
    if len(weights) and float(weights.max()) > ALONE:
        alarms.append("one particle holds more than half of the weight")
    return "; ".join(alarms)


def rows(frame: InspectedFrame, selection: Selection) -> dict[str, list[Row]]:
    """The tables of view `schedule`."""
    lines: list[Row] = []
    for layer, record in enumerate(frame.layers):
        log_weights, weighted = frame.log_weights(layer), math.isfinite(record.beta)
        lines.append(
            (
                layer,
                no_value(record.beta),
                no_value(record.alpha_wanted),
                no_value(record.alpha_reached),
                effective_number(log_weights) if weighted else None,
                frame.size(layer),
                float(np.exp(log_weights.max())) if weighted else None,
                record.best_log_weight,
                record.milliseconds,
                record.settings_version,
                no_value(record.temper),
                no_value(record.acceptance),
                no_value(record.log_evidence),
                alarm_of(frame, layer),
            )
        )
    return {"layers": lines}
