"""Figure 3: the error of single runs over the walk at 60 and at 20 frames a second, 1000 evaluations a "
"frame."""

from collections.abc import Sequence

import numpy as np

from studio.comparison.findings import Findings, Number
from studio.comparison.statistics import overall, ratio_interval
from studio.comparison.tracked import Tracked
from studio.comparison.tracking_trials import measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.setting import (
    EVALUATIONS,
    PRIORS,
    RATES,
    SOURCE,
    STANDING,
    SWARM,
    last_frame,
)
from studio.reproduction.tracking import (
    by_group,
    claimed_verdict,
    curves,
    error_ratio,
    mean_number,
    summary_table,
)


def group(fps: int) -> str:
    """The words for a frame rate."""
    return f"{fps} frames a second"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Both frame rates with every seed."""
    return tuple(
        tracking_trial(
            group(fps), SWARM.attempt(footage, seed, EVALUATIONS, last=last_frame(fps, scale.quick))
        )
        for fps, footage in RATES.items()
        for seed in scale.seeds
    )


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """60 against 20 frames a second, and the error while the person stands still."""
    groups = by_group(outcomes)
    slow, fast = groups[group(20)], groups[group(60)]
    numbers = [
        mean_number("mean error, 60 frames a second", fast, 38.0),
        mean_number("mean error, 20 frames a second", slow),
        error_ratio("error at 60 over error at 20 frames a second", fast, slow, "lower"),
    ]
    still = {fps: [_while_standing(run, fps) for run in groups[group(fps)]] for fps in RATES}
    stood = all(np.isfinite(values).all() for values in still.values())
    if stood:
        numbers += [_standing_number(fps, values, groups[group(fps)]) for fps, values in still.items()]
    words = (
        f"Mean error {numbers[0].ours:.1f} mm at 60 and {numbers[1].ours:.1f} mm at 20 frames a second; "
        f"the worst frames are {np.mean([run.worst_mm for run in fast]):.0f} and "
        f"{np.mean([run.worst_mm for run in slow]):.0f} mm. "
    )
    if stood:
        words += (
            f"While the person stands still (frames 330 to 430) the error is {np.mean(still[60]):.1f} and "
            f"{np.mean(still[20]):.1f} mm."
        )
    charts = tuple(
        curves(f"Error at {group(fps)}", {group(fps): groups[group(fps)]}, fps, (STANDING,) if stood else ())
        for fps in RATES
    )
    table = summary_table("Swarm, 1000 evaluations a frame", groups)
    verdict = overall([entry.verdict for entry in numbers if entry.verdict != "answered"])
    settings = {"weighting": SWARM.weighting, "evaluations": EVALUATIONS, **PRIORS}
    return Findings(verdict, words, tuple(numbers), (table,), charts, settings)


def _while_standing(run: Tracked, fps: int) -> float:
    """Mean error of the frames in which the person stands, mm; NaN where they were not tracked."""
    at = np.array(run.frames) * 60.0 / fps
    inside = (at >= STANDING[0]) & (at < STANDING[1])
    return float(np.array(run.per_frame_mm)[inside].mean()) if inside.any() else float("nan")


def _standing_number(fps: int, values: list[float], runs: list[Tracked]) -> Number:
    """The error while standing over that of the whole run: below 1, as the paper expects."""
    whole = [run.mean_mm for run in runs]
    low, high = ratio_interval(values, whole)
    name = f"error while standing over the whole walk's, {group(fps)}"
    ratio = float(np.mean(values) / np.mean(whole))
    return Number(name, ratio, low, high, "×", None, "lower", len(runs), claimed_verdict(low, high, "lower"))


EXPERIMENT = Experiment(
    name="fleischmann-fig-3",
    title="Error of single runs at 60 and 20 frames a second",
    source=f"{SOURCE}, Fig. 3",
    claim="The mean error is a little smaller at 60 frames a second and tracking more stable; at 20 the "
    "largest errors are much higher. Tracking is always very good while the person stands still (frames "
    "330 to 430).",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=tuple(RATES.values()),
)
