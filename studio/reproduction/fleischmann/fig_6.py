"""Figure 6: the swarm against the annealed particle filter, with the same body, fitness, Σ, constraints and 1000
evaluations a frame, at 60 and 20 frames a second.

The paper's filter is HumanEva's, whose noise follows a plan (Eq. 13 of Deutscher & Reid). The improved filter (Eq. 18
and 19) is run beside it, and the paper makes no claim about it.
"""

from collections.abc import Sequence

from studio.comparison.findings import Findings
from studio.comparison.statistics import overall
from studio.comparison.tracking_trials import measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.setting import (
    EQ13,
    EVALUATIONS,
    IMPROVED,
    PRIORS,
    RATES,
    SOURCE,
    SWARM,
    last_frame,
)
from studio.reproduction.tracking import by_group, curves, error_ratio, mean_number, sign_words, summary_table

CONTENDERS = (SWARM, EQ13, IMPROVED)


def group(name: str, fps: int) -> str:
    """The words for a contender at a frame rate."""
    return f"{name}, {fps} Hz"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every contender at both rates with every seed."""
    return tuple(
        tracking_trial(
            group(contender.name, fps),
            contender.attempt(footage, seed, EVALUATIONS, last=last_frame(fps, scale.quick)),
        )
        for fps, footage in RATES.items()
        for contender in CONTENDERS
        for seed in scale.seeds
    )


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Who wins at which rate."""
    groups = by_group(outcomes)
    runs = {(entry.name, fps): groups[group(entry.name, fps)] for entry in CONTENDERS for fps in RATES}
    numbers = [
        error_ratio(
            "swarm over the filter with Eq. 13, 20 Hz", runs[SWARM.name, 20], runs[EQ13.name, 20], "lower"
        ),
        error_ratio(
            "swarm over the filter with Eq. 13, 60 Hz", runs[SWARM.name, 60], runs[EQ13.name, 60], "equal"
        ),
        *(
            mean_number(f"mean error, {group(entry.name, fps)}", runs[entry.name, fps])
            for fps in RATES
            for entry in CONTENDERS
        ),
    ]
    words = " ".join(
        f"At {fps} Hz: "
        f"{sign_words(SWARM.name, runs[SWARM.name, fps], f'the filter ({other.name})', runs[other.name, fps])}"
        for fps in (20, 60)
        for other in (EQ13, IMPROVED)
    )
    charts = tuple(
        curves(
            f"Error at {fps} frames a second",
            {entry.name: runs[entry.name, fps] for entry in CONTENDERS},
            fps,
        )
        for fps in RATES
    )
    table = summary_table("1000 evaluations a frame, same body, fitness, Σ and constraints", groups)
    verdict = overall([entry.verdict for entry in numbers])
    settings = {
        "weighting": SWARM.weighting,
        "evaluations": EVALUATIONS,
        "Eq. 13": dict(EQ13.changes),
        **PRIORS,
    }
    return Findings(verdict, words, tuple(numbers), (table,), charts, settings)


EXPERIMENT = Experiment(
    name="fleischmann-fig-6",
    title="Swarm against annealed particle filter",
    source=f"{SOURCE}, Fig. 6",
    claim="With the same body, fitness, Σ and 1000 evaluations the swarm is significantly better at 20 "
    "frames a second and equally good at 60.",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=tuple(RATES.values()),
)
