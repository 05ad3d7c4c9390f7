"""Fig. 8: Condensation against the annealed filter, with the same number of evaluations and with ten times as many.

The paper's Condensation has the edge likelihood of Blake & Isard with a silhouette; here every tracker weighs alike,
and Condensation chooses the scale of its likelihood on the first frames. The one-layer search propagates the mode,
as the paper's does, and reports it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from studio.comparison.findings import Chart, Findings, Series
from studio.comparison.statistics import number, overall
from studio.comparison.tracked import Attempt, Tracked
from studio.comparison.tracking_trials import measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.deutscher_reid.setting import (
    BODY,
    CIRCLE,
    EQ17_WORDS,
    LIMIT_MM,
    PLAIN,
    QUICK_FRAMES,
    SOURCE,
    STUDIO,
    STUDIO_WEIGHTING,
    WEIGHTING,
    succeeded,
    success_number,
    times_in_words,
)
from studio.reproduction.experiment import Experiment
from studio.reproduction.tracking import by_group, curves, summary_table

FPS = 60.0
FRAMES = 240
CONDENSATION, LARGE = "Condensation, 4000", "Condensation, 40 000"
ONE_LAYER, TEN_LAYERS, FEW = (
    "annealed, 1 × 4000, the mode carried",
    "annealed, 10 × 400",
    "annealed, 10 × 100",
)
OWN, OWN_FEW = "studio's choice, 10 × 400", "studio's choice, 10 × 100"
# Tracker, weighting and knobs.
CONTENDERS: Mapping[str, tuple[str, str, Mapping[str, Any]]] = {
    CONDENSATION: ("condensation", WEIGHTING, {"particles": 4000}),
    LARGE: ("condensation", WEIGHTING, {"particles": 40000}),
    ONE_LAYER: (
        "annealed",
        WEIGHTING,
        {**PLAIN, "layers": 1, "particles": 4000, "carry": "mode", "estimate": "mode"},
    ),
    TEN_LAYERS: ("annealed", WEIGHTING, {**PLAIN, "layers": 10, "particles": 400}),
    FEW: ("annealed", WEIGHTING, {**PLAIN, "layers": 10, "particles": 100}),
    OWN: ("annealed", STUDIO_WEIGHTING, {**STUDIO, "layers": 10, "particles": 400}),
    OWN_FEW: ("annealed", STUDIO_WEIGHTING, {**STUDIO, "layers": 10, "particles": 100}),
}
# What the paper saw of each: 1, it tracks; 0, it fails.
PAPER = {CONDENSATION: 0.0, LARGE: 0.0, ONE_LAYER: 0.0, TEN_LAYERS: 1.0, FEW: 1.0}
# "Terminal failure after 1.2 seconds".
PAPER_SECONDS = 1.2
# 40 000 particles take as long as all others together, and are left out of a quick look.
SLOW = (LARGE,)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """All contenders with every seed."""
    return tuple(
        tracking_trial(
            name,
            Attempt(CIRCLE, tracker, weighting, seed, changes, last=QUICK_FRAMES if scale.quick else FRAMES),
        )
        for name, (tracker, weighting, changes) in CONTENDERS.items()
        if not (scale.quick and name in SLOW)
        for seed in scale.seeds
    )


def terminal_failure(found: Tracked) -> float:
    """Seconds from the first frame to the failure that never ends: a frame's mean is LIMIT_MM or more, or a limb is
    lost, in every frame from there on. The footage's length where the last frame is good: it fails later, if ever.
    """
    good = [error < LIMIT_MM and not lost for error, lost in zip(found.per_frame_mm, found.lost, strict=True)]
    if good[-1]:
        return len(good) / FPS
    since = len(good) - good[::-1].index(True) if True in good else 0
    return (found.frames[since] - found.frames[0]) / FPS


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Who tracks and who fails, and when."""
    groups = by_group(outcomes)
    successes = [
        success_number(f"{name}: seeds that track", runs, PAPER.get(name)) for name, runs in groups.items()
    ]
    failures = []
    for name in (CONDENSATION, ONE_LAYER):
        seconds = [terminal_failure(run) for run in groups[name]]
        failures.append(number(f"{name}: terminal failure after", seconds, "s", PAPER_SECONDS))
    errors = [
        number(f"{name}: mean error", [run.mean_mm for run in runs], "mm") for name, runs in groups.items()
    ]
    told = "; ".join(
        f"{name}: {times_in_words([succeeded(run) for run in runs])}, "
        f"{sum(run.mean_mm for run in runs) / len(runs):.0f} mm"
        for name, runs in groups.items()
    )
    lasts = sum(
        run.per_frame_mm[-1] < LIMIT_MM and not run.lost[-1]
        for name in (CONDENSATION, ONE_LAYER)
        for run in groups[name]
    )
    seconds_told = "; ".join(f"{entry.name} {entry.ours:.1f} s on average" for entry in failures)
    seconds_told += f" ({lasts} of these runs end well and count with their whole length; the paper: 1.2 s)"
    words = (
        f"Seeds that track (every frame below {LIMIT_MM:g} mm, no limb ever lost) and mean errors: {told}. "
        f"{seconds_told}. The verdict is on who tracks and who does not. The "
        "studio's choice (all three terms, Eq. 18, crossover by limbs, limbs kept apart) is not in the paper; it says "
        "what the footage allows. Deviations: the paper names no frame rate (60 a second here), its Condensation has a "
        "likelihood of its own, and its judgement is by eye. "
        f"{EQ17_WORDS}"
    )
    left_out = " 40 000 particles are left out of a quick look." if LARGE not in groups else ""
    frames = len(outcomes[0].measured["frames"])
    settings = {"footage": CIRCLE, "frames": frames, "body": BODY, "weighting": WEIGHTING} | {
        f"{name}: {knob}": value
        for name, (_, _, knobs) in CONTENDERS.items()
        for knob, value in knobs.items()
    }
    return Findings(
        overall(entry.verdict for entry in successes),
        words + left_out,
        (*successes, *failures, *errors),
        (summary_table("Trackers of Fig. 8", groups),),
        (curves("Error over frames", groups, FPS), _kept_chart(groups)),
        settings,
    )


def _kept_chart(groups: Mapping[str, Sequence[Tracked]]) -> Chart:
    """In how many frames all limbs are held."""
    shares = tuple(
        sum(1.0 - run.lost_frames / len(run.frames) for run in runs) / len(runs) for runs in groups.values()
    )
    series = Series("all limbs held", tuple(float(index) for index in range(len(shares))), shares)
    title = "Frames in which no limb is lost"
    return Chart(title, "bars", "tracker", "share of the frames", (series,), categories=tuple(groups))


EXPERIMENT = Experiment(
    name="deutscher-fig-8",
    title="Condensation against annealed particle filtering",
    source=f"{SOURCE}, Fig. 8",
    claim="Condensation with 4000 particles fails after 1.2 s and with 40 000, too, as does a search of one layer; the "
    "annealed filter with 10 layers of 400 particles tracks very well, and of as few as 100.",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=(CIRCLE,),
)
