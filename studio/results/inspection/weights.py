"""Whether the estimate is one lucky particle: sorted weights, and the Pareto k̂ of their tail.

k̂ is the shape of a generalised Pareto distribution fitted to the largest weights: above 0.7 the weighted mean of any
practical number of particles is not to be trusted (Vehtari, Simpson, Gelman, Yao & Gabry 2024, "Pareto smoothed
importance sampling", JMLR 25(72)). The fit is the quasi-Bayesian one of Zhang & Stephens 2009 ("A new and efficient
estimation method for the generalized Pareto distribution", Technometrics 51(3)), with the weak prior towards k = 0.5
of Vehtari et al., appendix G.
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.results.inspection.reading import InspectedFrame, no_value
from studio.results.inspection.schedule import effective_number
from studio.results.inspection.tables import Row, Selection, View, table

VIEW = View(
    "weights",
    "Weight concentration",
    "Is the estimate one lucky particle?",
    ("layer",),
    (
        table(
            "sorted",
            "Weights of a layer, largest first",
            "layer",
            ("rank", "Rank"),
            "particle",
            ("weight", "Weight"),
            ("cumulated", "Cumulated"),
            "log_weight",
        ),
        table(
            "layers",
            "Concentration by layer",
            "layer",
            ("largest", "Largest weight"),
            ("k_hat", "Pareto k̂"),
            ("effective", "Effective number"),
            ("particles", "Particles"),
            ("for_90", "Particles that hold 90 %"),
        ),
    ),
)


LEAST_TAIL = 5
PRIOR_WEIGHT, PRIOR_SHAPE = 10.0, 0.5
TAIL_SHARE, TAIL_ROOTS = 0.2, 3.0
"""The tail holds the smaller of a fifth of the weights and three times the root of their number."""
CONCENTRATED = 0.9
QUARTILES = 3.0
"""Times the first quartile: scale of the grid's prior (Zhang & Stephens 2009, Eq. 7)."""


def pareto_k(log_weights: Array) -> float:
    """k̂ of weights given by logs (N,), with any offset; NaN where fewer than five differ in the tail."""
    known = np.sort(log_weights[np.isfinite(log_weights)])
    tail = int(min(TAIL_SHARE * len(known), TAIL_ROOTS * np.sqrt(len(known))))
    if tail < LEAST_TAIL or len(known) <= tail:
        return float("nan")
    weights = np.exp(known - known[-1])
    beyond = weights[-tail:] - weights[-tail - 1]
    if np.unique(beyond[beyond > 0.0]).size < LEAST_TAIL:
        return float("nan")
    shape = fitted_shape(np.maximum(beyond, np.finfo(float).tiny))
    return (tail * shape + PRIOR_WEIGHT * PRIOR_SHAPE) / (tail + PRIOR_WEIGHT)


def fitted_shape(beyond: Array) -> float:
    """Shape k (k > 0: a heavy tail) of a generalised Pareto distribution of positive exceedances (n,), ascending: the
    mean of the profile likelihood's parameter b over a grid of quantiles (Zhang & Stephens 2009, section 2.2).
    """
    count = len(beyond)
    points = 30 + int(np.sqrt(count))
    quartile = beyond[int(count / 4 + 0.5) - 1]
    grid = 1.0 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))
    grid = grid / (QUARTILES * quartile) + 1.0 / beyond[-1]
    shapes = np.log1p(-grid[:, None] * beyond).mean(axis=1)
    likelihood = count * (np.log(-grid / shapes) - shapes - 1.0)
    share = np.exp(likelihood - np.max(likelihood))
    best = float(np.sum(grid * share) / np.sum(share))
    return float(np.log1p(-best * beyond).mean())


def rows(frame: InspectedFrame, selection: Selection) -> dict[str, list[Row]]:
    """The tables of view `weights`."""
    chosen = frame.layer(selection)
    weights, numbers = frame.weights(chosen), frame.particles(chosen)
    order = np.argsort(-weights, kind="stable")
    cumulated = np.cumsum(weights[order])
    raw = frame.layers[chosen].log_weights
    by_layer: list[Row] = []
    for layer in range(len(frame.layers)):
        log_weights = frame.log_weights(layer)
        held = np.cumsum(np.sort(np.exp(log_weights))[::-1])
        by_layer.append(
            (
                layer,
                float(np.exp(log_weights.max())),
                no_value(pareto_k(log_weights)) if frame.is_weighted else None,
                effective_number(log_weights),
                frame.size(layer),
                int(np.searchsorted(held, CONCENTRATED) + 1),
            )
        )
    return {
        "sorted": [
            (chosen, rank, int(numbers[at]), float(weights[at]), float(cumulated[rank]), float(raw[at]))
            for rank, at in enumerate(order)
        ],
        "layers": by_layer,
    }
