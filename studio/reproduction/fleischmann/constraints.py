"""Section 2.3: tracking with and without the hard priors (joint limits, no limb inside another)."""

from collections.abc import Sequence
from dataclasses import replace

from studio.comparison.findings import Chart, Findings, Series
from studio.comparison.statistics import overall
from studio.comparison.tracked import Tracked
from studio.comparison.tracking_trials import measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.setting import (
    EQ13,
    EVALUATIONS,
    IMPROVED,
    RATES,
    SOURCE,
    SWARM,
    last_frame,
)
from studio.reproduction.tracking import by_group, error_ratio, sign_words, summary_table

FREE = {"constraints": "ignore", "limbs_apart": False}
CONTENDERS = (SWARM, EQ13, IMPROVED)


def group(name: str, fps: int, kept: bool) -> str:
    """The words for a contender at a frame rate, with or without the priors."""
    return f"{name}, {fps} Hz, {'with' if kept else 'without'} priors"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every contender at both rates, with and without priors, with every seed."""
    return tuple(
        tracking_trial(
            group(contender.name, fps, kept),
            replace(contender, changes=contender.changes if kept else {**contender.changes, **FREE}).attempt(
                footage, seed, EVALUATIONS, last=last_frame(fps, scale.quick)
            ),
        )
        for fps, footage in RATES.items()
        for contender in CONTENDERS
        for kept in (True, False)
        for seed in scale.seeds
    )


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """With over without, for every tracker and rate. The claim is about the swarm."""
    groups = by_group(outcomes)
    pairs = {
        (entry.name, fps): (groups[group(entry.name, fps, True)], groups[group(entry.name, fps, False)])
        for entry in CONTENDERS
        for fps in RATES
    }
    numbers = [
        error_ratio(f"{name}, {fps} Hz: error with over without priors", *pair, "lower")
        for (name, fps), pair in pairs.items()
    ]
    of_swarm = [entry for entry in numbers if entry.name.startswith(SWARM.name)]
    words = " ".join(
        f"{name}, {fps} Hz: {sign_words('with priors it', pair[0], 'without', pair[1])}"
        for (name, fps), pair in pairs.items()
    )
    table = summary_table("1000 evaluations a frame", groups)
    settings = {
        "weighting": SWARM.weighting,
        "evaluations": EVALUATIONS,
        "with": dict(SWARM.changes),
        "without": FREE,
    }
    return Findings(
        overall([entry.verdict for entry in of_swarm]),
        words,
        tuple(numbers),
        (table,),
        (_bars(pairs),),
        settings,
    )


def _bars(pairs: dict[tuple[str, int], tuple[list[Tracked], list[Tracked]]]) -> Chart:
    names = tuple(f"{name}, {fps} Hz" for name, fps in pairs)
    places = tuple(float(index) for index in range(len(names)))
    series = tuple(
        Series(
            word,
            places,
            tuple(sum(run.mean_mm for run in pair[index]) / len(pair[index]) for pair in pairs.values()),
            low=tuple(min(run.mean_mm for run in pair[index]) for pair in pairs.values()),
            high=tuple(max(run.mean_mm for run in pair[index]) for pair in pairs.values()),
            group=word,
        )
        for index, word in enumerate(("with priors", "without"))
    )
    title = "Mean error with and without hard priors (bars: lowest and highest seed)"
    return Chart(title, "bars", "tracker", "mean error (mm)", series, categories=names)


EXPERIMENT = Experiment(
    name="fleischmann-constraints",
    title="With and without hard priors",
    source=f"{SOURCE}, section 2.3 (after Balan et al. 2005)",
    claim="Joint limits and the ban on limbs inside each other improve tracking significantly, because "
    "they reduce the search space.",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=tuple(RATES.values()),
)
