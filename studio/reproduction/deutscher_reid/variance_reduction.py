"""How the variance of each joint falls over the layers of one search: what Figs. 12, 13, 14 and 17 are drawn from.

With adaptive diffusion (Eq. 18) a joint that is localised stays so, and the joints follow one another from the root
outwards: a soft partition of the search. With the planned noise of Eq. 13 every joint gets the same noise, and what
was gained for the first is lost again (Fig. 12c).

Figs. 13 and 14 show six layers and print neither particles nor survival rate. At the 0.5 of section 3.1 six layers
are too few for the last joint to fall at all; at 0.1 it falls in the sixth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.comparison.findings import Chart, Series, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.arms import TemplateArm, localise, template_arm

Array = NDArray[np.float64]

FALLEN = 0.1
"""A parameter counts as localised when its variance is below this share of the first cloud's."""
SETTINGS: Mapping[str, Any] = {"layers": 6, "particles": 1000, "survival": 0.1, "crossover": 0.0}
ADAPTIVE: Mapping[str, Any] = {"adaptive_diffusion": True}
PLANNED: Mapping[str, Any] = {"adaptive_diffusion": False}
# Noise that outweighs selection in every joint.
LOUD: Mapping[str, Any] = {"adaptive_diffusion": False, "diffusion_scale": 5.0, "constraints": "ignore"}


@dataclass(frozen=True, slots=True)
class Reduction:
    """How the variances fell, over some seeds.

    crossings : (S, D) the layer (from 0) whose cloud is the first with a variance below FALLEN of the first cloud's;
    the number of layers where none is. strictly_rising : (S,) whether every parameter falls, and later than the one
    before; even : (S,) whether all fall within one layer. shares : (S, M, D) variance over that of the first cloud.
    drawn, noisy : (S, D) the same of the first layer after drawing (Fig. 12 b, e) and after noise (c, f). errors :
    (S, D) of the reported pose, rad.
    """

    crossings: NDArray[np.int64]
    strictly_rising: NDArray[np.bool_]
    even: NDArray[np.bool_]
    shares: Array
    drawn: Array
    noisy: Array
    errors: Array

    @property
    def mean_shares(self) -> Array:
        """(M, D) mean over the seeds."""
        return self.shares.mean(axis=0)


def trials(
    scale: Scale,
    kinds: Mapping[str, Mapping[str, Any]],
    body: str,
    **changes: Any,  # noqa: ANN401
) -> tuple[Trial, ...]:
    """One search a kind and seed. kinds : knobs by name. changes : knobs beside SETTINGS."""
    return tuple(
        Trial(
            f"{name}, {body}, seed {seed}",
            {"body": body, "seed": seed, "knobs": {**SETTINGS, **changes, **knobs}},
        )
        for name, knobs in kinds.items()
        for seed in scale.seeds
    )


@kept_as("deutscher_reid.variance_reduction.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Variances per layer and parameter of one search, over those of the first cloud."""
    del shelf
    result, records, truth = localise(scene(arguments["body"]), int(arguments["seed"]), **arguments["knobs"])
    first = records[0].variance_weighed
    return {
        "shares": [(record.variance_weighed / first).tolist() for record in records],
        "drawn": (records[0].variance_resampled / first).tolist(),
        "noisy": (records[0].variance_diffused / first).tolist(),
        "errors": np.abs(result.estimate.pose - truth).tolist(),
    }


@cache
def scene(body: str) -> TemplateArm:
    """The body before its camera."""
    return template_arm(body)


def reductions(outcomes: Sequence[Outcome]) -> dict[str, Reduction]:
    """By kind, in the order of the trials."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        found.setdefault(outcome.trial.label.partition(", ")[0], []).append(outcome.measured)
    return {name: reduction(measured) for name, measured in found.items()}


def reduction(measured: Sequence[Mapping[str, Any]]) -> Reduction:
    """The summary of some searches of equal length."""
    shares, drawn, noisy, errors = (
        np.array([entry[name] for entry in measured]) for name in ("shares", "drawn", "noisy", "errors")
    )
    crossings, layers = crossing_layers(shares), shares.shape[1]
    fallen = crossings.max(axis=1) < layers
    return Reduction(
        crossings,
        np.asarray(np.all(np.diff(crossings, axis=1) > 0, axis=1) & fallen),
        np.asarray(fallen & (np.ptp(crossings, axis=1) <= 1)),
        shares,
        drawn,
        noisy,
        errors,
    )


def crossing_layers(values: Array, limit: float = FALLEN) -> NDArray[np.int64]:
    """(S, D) first layer below the limit, of values (S, M, D); M where there is none."""
    below = values < limit
    return np.where(below.any(axis=1), below.argmax(axis=1), values.shape[1])


def reduction_chart(title: str, found: Reduction, names: Sequence[str]) -> Chart:
    """Variance of each parameter over the layers: every seed thin, the mean over seeds thick."""
    layers = tuple(float(layer) for layer in range(1, found.shares.shape[1] + 1))
    series: list[Series] = []
    for column, name in enumerate(names):
        series += [
            Series(f"{name}, seed {seed}", layers, tuple(rows[:, column]), group=name, thin=True)
            for seed, rows in enumerate(found.shares)
        ]
        series.append(Series(name, layers, tuple(found.mean_shares[:, column]), group=name))
    return Chart(title, "lines", "layer", "variance over the first cloud's", tuple(series), log_y=True)


def crossing_table(groups: Mapping[str, Reduction], names: Sequence[str]) -> Table:
    """The mean layer, counted from 1, in which each parameter falls."""
    rows = tuple(
        (name, *(round(float(value) + 1.0, 1) for value in found.crossings.mean(axis=0)))
        for name, found in groups.items()
    )
    return Table(f"Mean layer in which the variance falls below {FALLEN:.0%}", ("filter", *names), rows)


def listed(values: Sequence[float], digits: int = 1) -> str:
    """ "2.0, 3.1, 4.2"."""
    return ", ".join(f"{value:.{digits}f}" for value in values)
