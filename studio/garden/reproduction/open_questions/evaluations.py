"""Who is best where: error against the number of poses that a tracker weighs in a frame, from 100 to 100 000.

Every tracker with the studio's defaults, searching alone (refined frames hide what the search found) and with the same
likelihood, on three clips of the half that defaults are chosen by. The behaviour tracker, which needs a model, takes
part where its model, learnt from walks, fits.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from studio.garden.reproduction.drawing import intervals
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.garden.reproduction.open_questions.generalisation import TRAINING, measure
from studio.garden.reproduction.tracking import Candidate, by_group, lost_percent, mean_errors
from studio.results.comparison.findings import Chart, Plain, Series, Table
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked
from studio.results.comparison.trials import Outcome, Scale, Trial
from studio.search.trackers.catalogue import TRACKERS

CLIPS = {"walk": "walk", "turns": "choosing-turns", "kick": "choosing-kick"}
WALKS = ("walk", "turns")
COUNTS = (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
QUICK_COUNTS = (100, 1000, 10_000)
FRAMES, QUICK_FRAMES = 60, 30
SEEDS, MANY, SEEDS_OF_MANY = 5, 10_000, 2
"""Seeds; more evaluations than MANY take most of the time, scatter least, and have fewer."""
LAYERS = 10
WEIGHTING = "edge-region-silhouette"
GUIDED = "guided by behaviour"
CANDIDATES = (
    Candidate("annealed, improved", "annealed", WEIGHTING),
    Candidate("annealed, Eq. 13", "annealed", WEIGHTING, {"adaptive_diffusion": False, "crossover": 0.0}),
    Candidate("swarm", "swarm", WEIGHTING),
    Candidate("Condensation", "condensation", WEIGHTING),
    Candidate(GUIDED, "behaviour", WEIGHTING),
)


def _label(name: str, clip: str, count: int) -> str:
    return f"{name}, {clip}, {count}"


def _with(one: Candidate, clip: str) -> bool:
    return one.name != GUIDED or clip in WALKS


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every tracker with every number of evaluations, clip by clip so that a clip's evidence is computed once."""
    last = QUICK_FRAMES if scale.quick else FRAMES
    planned: list[Trial] = []
    for clip, footage in CLIPS.items():
        for one in (one for one in CANDIDATES if _with(one, clip)):
            for count in QUICK_COUNTS if scale.quick else COUNTS:
                arguments = partial(_arguments, one, footage, count, last)
                seeds = scale.seeds[: SEEDS if count <= MANY else SEEDS_OF_MANY]
                planned += each_seed(_label(one.name, clip, count), seeds, arguments)
    return tuple(planned)


def _arguments(one: Candidate, footage: str, count: int, last: int, seed: int) -> dict[str, Any]:
    # A swarm needs two members in every iteration: 120 evaluations instead of 100.
    enough = max(count, TRACKERS[one.tracker].least_evaluations(LAYERS))
    attempt = {"attempt": one.attempt(footage, seed, enough, last=last).plain()}
    return attempt | ({"training": TRAINING.plain()} if one.name == GUIDED else {})


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """A chart a clip, error over evaluations; who is nearest with how many; the table of all."""
    groups = by_group(outcomes)
    counts = sorted({int(name.rpartition(" ")[2]) for name in groups})

    def runs_of(name: str, clip: str, count: int) -> list[Tracked]:
        return groups[_label(name, clip, count)]

    rows: list[tuple[Plain, ...]] = []
    for clip in CLIPS:
        here = [one.name for one in CANDIDATES if _with(one, clip)]
        for name in here:
            for count in (counts[0], counts[-1]):
                label = f"mean error, {name}, {clip}, {count} evaluations"
                yield number(label, mean_errors(runs_of(name, clip, count)), "mm")
            cells = [
                f"{np.mean(mean_errors(runs_of(name, clip, count))):.1f} / "
                f"{np.mean([lost_percent(run) for run in runs_of(name, clip, count)]):.0f}"
                for count in counts
            ]
            rows.append((clip, name, *cells))
        best = [
            min(here, key=lambda name, count=count: float(np.mean(mean_errors(runs_of(name, clip, count)))))
            for count in counts
        ]
        yield (
            f"On the {clip} the nearest: "
            + ", ".join(f"{name} with {count}" for count, name in zip(counts, best, strict=True))
            + "."
        )
        places = tuple(map(float, counts))
        series: list[Series] = [
            intervals(name, places, [mean_errors(runs_of(name, clip, count)) for count in counts], group=name)
            for name in here
        ]
        axes = ("evaluations a frame", "mean error (mm)")
        title = f"Error over evaluations, {clip} (bars: 95 % intervals over seeds)"
        yield Chart(title, "lines", *axes, tuple(series), log_x=True, log_y=True)
    if counts[-1] > MANY:
        yield f"More than {MANY} evaluations a frame are measured with {SEEDS_OF_MANY} seeds, all else with {SEEDS}."
    yield (
        f"The tracker {GUIDED} was learnt from {', '.join(TRAINING.sources)}: the motion of the walk is among them, "
        "that of the turns is not."
    )
    heads = ("clip", "tracker", *(f"{count} evaluations" for count in counts))
    yield Table("Mean error (mm) / frames with a limb lost (%)", heads, tuple(rows))
    yield {
        "clips": ", ".join(CLIPS.values()),
        "weighting": WEIGHTING,
        "layers": LAYERS,
        "behaviour learnt from": ", ".join(TRAINING.sources),
        "frames": len(groups[next(iter(groups))][0].frames),
    }


EXPERIMENTS = (listed("evaluations", trials, measure, shown, footage=tuple(CLIPS.values())),)
