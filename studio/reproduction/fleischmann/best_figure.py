"""How accurately the twin can be tracked, and what it takes: one choice of ours after another.

No figure of the paper, but the question behind its Table 2 ("the minimal obtainable tracking error"). All lines but
the first use a body with hands and feet.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from studio.comparison.findings import Chart, Findings, Series
from studio.comparison.tracking_trials import measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.setting import (
    IMPROVED,
    PRIORS,
    SOURCE,
    SWARM,
    TEN_CONES,
    TWIN,
    last_frame,
)
from studio.reproduction.tracking import Contender, by_group, curves, mean_number, summary_table

ALL_TERMS = "edge-region-silhouette"
FINE = {"silhouette_resolution": "full", "silhouette_weight": 3.0, "occlusion_aware": True}
SWARM_3 = replace(SWARM, weighting=ALL_TERMS)
FILTER_3 = replace(IMPROVED, weighting=ALL_TERMS)


@dataclass(frozen=True, slots=True)
class Line:
    """A setting. words : what it is. wanted : other fields of the attempt."""

    words: str
    contender: Contender
    evaluations: int
    wanted: dict[str, Any] = field(default_factory=dict)


LINES = (
    Line("swarm, paper's fitness, ten cones", SWARM, 1000, {"subject": TEN_CONES}),
    Line("swarm, paper's fitness", SWARM, 1000),
    Line("swarm, all three terms", SWARM_3, 1000),
    Line("improved filter, paper's fitness", IMPROVED, 1000),
    Line("improved filter, all three terms", FILTER_3, 1000),
    Line("improved filter, all three terms, 2000", FILTER_3, 2000),
    Line(
        "the same, exact silhouettes weighted 3, visible edges",
        replace(FILTER_3, changes={**PRIORS, **FINE}),
        2000,
    ),
)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every line with every seed."""
    last = last_frame(60, scale.quick)
    return tuple(
        tracking_trial(
            line.words, line.contender.attempt(TWIN, seed, line.evaluations, last=last, **line.wanted)
        )
        for line in LINES
        for seed in scale.seeds
    )


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """The lines in turn, and the best of them."""
    groups = by_group(outcomes)
    numbers = tuple(mean_number(f"mean error, {line.words}", groups[line.words]) for line in LINES)
    best = min(numbers, key=lambda entry: entry.ours)
    runs = groups[best.name.removeprefix("mean error, ")]
    unharmed = sum(not run.lost_limbs for run in runs)
    words = (
        f"The best mean is {best.ours:.1f} mm ({best.name.removeprefix('mean error, ')}), without a lost "
        f"limb in {unharmed} of {len(runs)} runs. In order: "
        + "; ".join(f"{line.words} {entry.ours:.1f} mm" for line, entry in zip(LINES, numbers, strict=True))
        + "."
    )
    places = tuple(float(index) for index in range(len(LINES)))
    bars = Series(
        "mean error",
        places,
        tuple(entry.ours for entry in numbers),
        low=tuple(min(run.mean_mm for run in groups[line.words]) for line in LINES),
        high=tuple(max(run.mean_mm for run in groups[line.words]) for line in LINES),
    )
    chart = Chart(
        "Mean error, one choice after another (bars: lowest and highest seed)",
        "bars",
        "setting",
        "mean error (mm)",
        (bars,),
        categories=tuple(line.words for line in LINES),
    )
    ends = (LINES[0].words, LINES[1].words, best.name.removeprefix("mean error, "))
    shown = {name: groups[name] for name in dict.fromkeys(ends)}
    table = summary_table("Lee-walk twin at 60 frames a second", groups)
    settings = {line.words: {"evaluations": line.evaluations, **line.contender.changes} for line in LINES}
    return Findings(
        "answered", words, numbers, (table,), (chart, curves("Error over the walk", shown)), settings
    )


EXPERIMENT = Experiment(
    name="fleischmann-best-figure",
    title="The smallest error that can be had",
    source=f"{SOURCE}, section 3",
    claim="The minimal obtainable error is about 35 mm, limited by the truth's accuracy and the coarse "
    "body model.",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=(TWIN,),
)
