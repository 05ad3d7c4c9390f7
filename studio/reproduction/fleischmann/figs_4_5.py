"""Figures 4 and 5: limbs that are lost at 20 frames a second and found again.

The same runs as Fig. 3. A limb is lost in a frame when one of its markers is more than 150 mm off; a spell is a row of
such frames, and it ends well when the limb is found again before the footage ends.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from studio.comparison.findings import Chart, Findings, Number, Series, Table
from studio.comparison.statistics import number, overall, ratio_interval
from studio.comparison.tracking_trials import measure_tracking
from studio.comparison.trials import Outcome
from studio.reproduction.experiment import Experiment
from studio.reproduction.fleischmann.fig_3 import group, trials
from studio.reproduction.fleischmann.setting import EVALUATIONS, PRIORS, RATES, SOURCE, SWARM
from studio.reproduction.lost_limbs import Spell, spells
from studio.reproduction.tracking import by_group, claimed_verdict, curves


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """How many limbs are lost at either rate, for how long, and how many come back."""
    groups = by_group(outcomes)
    lost = {fps: [spells(run.lost) for run in groups[group(fps)]] for fps in RATES}
    share = {fps: [100.0 * run.lost_frames / len(run.frames) for run in groups[group(fps)]] for fps in RATES}
    every = {fps: [spell for run in lost[fps] for spell in run] for fps in RATES}
    again = [float(np.mean([spell.found_again for spell in run])) for run in lost[20] if run]
    numbers = [
        number("frames with a limb lost, 20 frames a second", share[20], "%"),
        number("frames with a limb lost, 60 frames a second", share[60], "%"),
        _fewer(share[60], share[20]),
    ]
    if again:
        back = number("spells that end with the limb found again, 20 frames a second", again, "of all")
        verdict = "reproduced" if back.ours > 0.5 else "not reproduced"
        numbers.append(
            Number(back.name, back.ours, back.low, back.high, back.unit, None, "higher", back.seeds, verdict)
        )
    words = " ".join(_words(fps, every[fps], len(lost[fps])) for fps in (20, 60))
    verdict = overall([entry.verdict for entry in numbers])
    tables = (_table(every),)
    charts = (_chart(every, lost), curves("Error at 20 frames a second", {group(20): groups[group(20)]}, 20))
    settings = {"weighting": SWARM.weighting, "evaluations": EVALUATIONS, "lost beyond (mm)": 150, **PRIORS}
    return Findings(verdict, words, tuple(numbers), tables, charts, settings)


def _fewer(fast: list[float], slow: list[float]) -> Number:
    """Lost frames at 60 over those at 20 frames a second."""
    name = "lost frames, 60 over 20 frames a second"
    if not np.any(slow):
        return Number(
            name, float("nan"), float("nan"), float("nan"), "×", None, "lower", len(slow), "not reproduced"
        )
    low, high = ratio_interval(fast, slow)
    ratio = float(np.mean(fast) / np.mean(slow))
    return Number(name, ratio, low, high, "×", None, "lower", len(slow), claimed_verdict(low, high, "lower"))


def _milliseconds(spell: Spell, fps: float) -> float:
    """How long a spell lasts."""
    return 1000.0 * spell.frames / fps


def _words(fps: int, found: list[Spell], runs: int) -> str:
    if not found:
        return f"At {fps} frames a second no limb is lost in {runs} runs."
    back = sum(spell.found_again for spell in found)
    middle = float(np.median([_milliseconds(spell, fps) for spell in found]))
    longest = max(_milliseconds(spell, fps) for spell in found)
    return (
        f"At {fps} frames a second {len(found) / runs:.1f} spells a run, {back} of {len(found)} end with "
        f"the limb found again; half of them last up to {middle:.0f} ms, the longest {longest:.0f} ms."
    )


def _table(every: dict[int, list[Spell]]) -> Table:
    """Spells by limb and rate."""
    rows = []
    for fps, found in every.items():
        for limb, count in sorted(Counter(spell.limb for spell in found).items()):
            of_limb = [spell for spell in found if spell.limb == limb]
            back = sum(spell.found_again for spell in of_limb)
            middle = float(np.median([_milliseconds(spell, fps) for spell in of_limb]))
            rows.append(
                (
                    fps,
                    limb,
                    count,
                    back,
                    round(middle),
                    round(max(_milliseconds(spell, fps) for spell in of_limb)),
                )
            )
    columns = ("frames a second", "limb", "spells, all runs", "found again", "median (ms)", "longest (ms)")
    return Table("Limbs lost", columns, tuple(rows))


def _chart(every: dict[int, list[Spell]], lost: dict[int, list[list[Spell]]]) -> Chart:
    limbs = tuple(sorted({spell.limb for found in every.values() for spell in found}))
    series = tuple(
        Series(
            group(fps),
            tuple(float(index) for index in range(len(limbs))),
            tuple(sum(spell.limb == limb for spell in found) / len(lost[fps]) for limb in limbs),
            group=group(fps),
        )
        for fps, found in every.items()
    )
    return Chart("How often limbs are lost", "bars", "limb", "spells a run", series, categories=limbs)


EXPERIMENT = Experiment(
    name="fleischmann-figs-4-5",
    title="Limbs lost and found again",
    source=f"{SOURCE}, Figs. 4 and 5",
    claim="At 20 frames a second legs and arms are lost for a while and found again after some frames; at "
    "60 tracking is accurate enough.",
    trials=trials,
    measure=measure_tracking,
    conclude=conclude,
    footage=tuple(RATES.values()),
)
