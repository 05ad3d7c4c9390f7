"""Section 2.4: soft partitioning against hard, global–local and global search, at equal evaluations."""

from collections.abc import Sequence
from dataclasses import replace

from studio.comparison.findings import Chart, Findings, Number, Series
from studio.comparison.statistics import overall
from studio.comparison.tracked import Tracked
from studio.comparison.tracking_trials import measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.setting import EVALUATIONS, PRIORS, RATES, SOURCE, SWARM, last_frame
from studio.reproduction.tracking import Contender, by_group, curves, error_ratio, sign_words, summary_table

SOFT, THREE = "soft", "soft-three"
PARTITIONS = {
    SOFT: "soft, two stages",
    THREE: "soft, three stages",
    "hard-two": "hard, two stages",
    "hard-twelve": "hard, twelve subspaces",
    "global-local": "global, then local",
    "global": "global",
}
# What the paper says of soft partitioning against each: better, or as good.
CLAIMS = {
    "hard-two": "lower",
    "hard-twelve": "lower",
    "global-local": "lower",
    "global": "lower",
    THREE: "equal",
}


def contender(partition: str) -> Contender:
    """The swarm with a partition."""
    return replace(SWARM, name=PARTITIONS[partition], changes={**SWARM.changes, "partition": partition})


def group(partition: str, fps: int) -> str:
    """The words for a partition at a frame rate."""
    return f"{PARTITIONS[partition]}, {fps} Hz"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every partition at both rates with every seed."""
    return tuple(
        tracking_trial(
            group(partition, fps),
            contender(partition).attempt(footage, seed, EVALUATIONS, last=last_frame(fps, scale.quick)),
        )
        for fps, footage in RATES.items()
        for partition in PARTITIONS
        for seed in scale.seeds
    )


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Soft against every other at both rates."""
    groups = by_group(outcomes)
    runs = {(name, fps): groups[group(name, fps)] for name in PARTITIONS for fps in RATES}
    numbers = [_against(runs, other, fps) for fps in RATES for other in CLAIMS]
    order = {fps: sorted(PARTITIONS, key=lambda name, fps=fps: _mean(runs[name, fps])) for fps in RATES}
    words = " ".join(
        f"Best to worst at {fps} Hz: "
        + ", ".join(f"{PARTITIONS[name]} ({_mean(runs[name, fps]):.1f} mm)" for name in order[fps])
        + "."
        for fps in RATES
    )
    words += " " + " ".join(
        f"{fps} Hz: {sign_words('Soft', runs[SOFT, fps], PARTITIONS[other], runs[other, fps])}"
        for fps in RATES
        for other in ("hard-two", "global-local", "global")
    )
    charts = (_bars(runs), *(_curves(runs, fps) for fps in RATES))
    table = summary_table("1000 evaluations a frame", groups)
    settings = {"weighting": SWARM.weighting, "evaluations": EVALUATIONS, **PRIORS}
    return Findings(
        overall([entry.verdict for entry in numbers]), words, tuple(numbers), (table,), charts, settings
    )


def _against(runs: dict[tuple[str, int], list[Tracked]], other: str, fps: int) -> Number:
    name = f"soft over {PARTITIONS[other]}, {fps} Hz"
    if CLAIMS[other] == "lower":
        return error_ratio(name, runs[SOFT, fps], runs[other, fps], "lower")
    # "Not significantly increased": three stages may be as good as two, or worse.
    return error_ratio(name, runs[SOFT, fps], runs[other, fps], "equal")


def _mean(runs: list[Tracked]) -> float:
    return sum(run.mean_mm for run in runs) / len(runs)


def _bars(runs: dict[tuple[str, int], list[Tracked]]) -> Chart:
    places = tuple(float(index) for index in range(len(PARTITIONS)))
    series = tuple(
        Series(
            f"{fps} frames a second",
            places,
            tuple(_mean(runs[name, fps]) for name in PARTITIONS),
            low=tuple(min(run.mean_mm for run in runs[name, fps]) for name in PARTITIONS),
            high=tuple(max(run.mean_mm for run in runs[name, fps]) for name in PARTITIONS),
            group=f"{fps} Hz",
        )
        for fps in RATES
    )
    title = "Mean error by partition (bars: lowest and highest seed)"
    return Chart(title, "bars", "partition", "mean error (mm)", series, categories=tuple(PARTITIONS.values()))


def _curves(runs: dict[tuple[str, int], list[Tracked]], fps: int) -> Chart:
    return curves(
        f"Error at {fps} frames a second", {PARTITIONS[name]: runs[name, fps] for name in PARTITIONS}, fps
    )


EXPERIMENT = Experiment(
    name="fleischmann-partitions",
    title="Soft, hard, global–local and global partitions",
    source=f"{SOURCE}, section 2.4 and Fig. 2",
    claim="Soft partitioning performs much better than global search or hard partitioning; three soft "
    "stages bring no significant gain over two.",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=tuple(RATES.values()),
)
