"""Section 6.2: crossover halves the particles again where there are branches (Fig. 15), not on a chain (Fig. 11).

Section 6.2.1 makes every particle from two, so the share is 100 %. What crossover saves depends on what it is added
to and on how fast the filter anneals, neither of which the paper says of this test: measured are the filter with the
diffusion of section 6.1 ("noise is then added … as detailed in Section 6.1") and the one of Eq. 13, each with the
survival rate of section 3.1 and with the one that anneals as much in six layers as that does in ten.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from studio.comparison.findings import Findings, Number
from studio.comparison.statistics import overall
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.deutscher_reid import arm_sequences
from studio.reproduction.deutscher_reid.arm_sequences import (
    BODY_WORDS,
    BRANCHED,
    CHAIN,
    RATE,
    SETTINGS,
    SURVIVALS,
    group,
)
from studio.reproduction.deutscher_reid.fewest_particles import (
    Fewest,
    bars,
    censored_in_words,
    found_by_group,
    needed,
    per_seed,
    saving,
    successes,
)
from studio.reproduction.deutscher_reid.setting import ADAPTIVE, EQ18_WORDS, PLAIN, SOURCE
from studio.reproduction.experiment import Experiment

PAPER = {BRANCHED: 2.0, CHAIN: 1.0}
SHARE = 1.0
BASES: Mapping[str, Mapping[str, Any]] = {"adaptive": ADAPTIVE, "Eq. 13": PLAIN}
# A chain is one limb: cut by limbs nothing is ever exchanged.
CUTS = {BRANCHED: ("parameters", "limbs"), CHAIN: ("parameters",)}


@dataclass(frozen=True, slots=True)
class Setting:
    """What crossover is added to. base : of BASES. survival : α."""

    base: str
    survival: float

    def name(self, cut: str = "") -> str:
        """In words, with a way to cut or without crossover."""
        words = f"{self.base}, α {self.survival:g}"
        return f"{words}, crossed by {cut}" if cut else words

    def knobs(self, cut: str = "") -> dict[str, Any]:
        """The filter's."""
        crossed = {"crossover": SHARE, "crossover_by": cut} if cut else {}
        return {**BASES[self.base], "survival": self.survival, **crossed}


# The first is the paper's, as far as it can be told.
WITH = tuple(Setting(base, survival) for base in BASES for survival in SURVIVALS)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """All filters on both bodies; a quick look takes the paper's setting only."""
    found: list[Trial] = []
    for body, cuts in CUTS.items():
        filters = {
            setting.name(cut): setting.knobs(cut)
            for setting in (WITH[:1] if scale.quick else WITH)
            for cut in ("", *cuts)
        }
        found += arm_sequences.trials(scale, filters, body, RATE)
    return tuple(found)


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """The ratios. The verdict is on Eq. 19 as it is printed, with the first setting: branched and chain together."""
    groups = found_by_group(outcomes)
    measured = [setting for setting in WITH if group(setting.name(), CHAIN, RATE) in groups]
    numbers = {
        (setting, body, cut): _saving(groups, setting, body, cut)
        for setting in measured
        for body, cuts in CUTS.items()
        for cut in cuts
    }
    first = WITH[0]
    verdict = overall(numbers[first, body, "parameters"].verdict for body in CUTS)
    told = " ".join(
        f"{setting.name()}: {_told(numbers[setting, BRANCHED, 'parameters'])} on the branched arms (cut by limbs "
        f"{_told(numbers[setting, BRANCHED, 'limbs'])}), {_told(numbers[setting, CHAIN, 'parameters'])} on the chain."
        for setting in measured
    )
    words = (
        "The paper says that crossover saves 2 times on the branched arms and makes no difference on "
        f"the chain. {told} "
        f"The verdict is on Eq. 19 (cut by parameters) added to {first.name()}. With a survival rate of "
        f"{SURVIVALS[1]:g} six layers anneal as much as the paper's ten of {SURVIVALS[0]:g}. "
        f"{censored_in_words(groups)} {EQ18_WORDS}"
    )
    charts = (
        bars("Particles needed over 40 pictures, with and without crossover", groups),
        successes("Runs that succeed, by particles", groups),
    )
    table = per_seed("Fewest particles with which most runs succeed", groups)
    settings = {**SETTINGS, "crossover": SHARE, "pictures a second": RATE}
    every = (
        *numbers.values(),
        *(needed(f"particles needed: {name}", found) for name, found in groups.items()),
    )
    return Findings(verdict, words, every, (table,), charts, settings)


def _saving(groups: Mapping[str, Sequence[Fewest]], setting: Setting, body: str, cut: str) -> Number:
    name = f"particles saved, {BODY_WORDS[body]}: {setting.name()}, cut by {cut}"
    without, crossed = (groups[group(words, body, RATE)] for words in (setting.name(), setting.name(cut)))
    return saving(name, without, crossed, PAPER[body])


def _told(found: Number) -> str:
    return f"{found.ours:.2f} times ({found.low:.2f} to {found.high:.2f})"


EXPERIMENT = Experiment(
    name="deutscher-crossover",
    title="What crossover saves on branched arms and on a chain",
    source=f"{SOURCE}, section 6.2.2",
    claim="Crossover halves the particles needed once more for branched arms, and makes no difference for an arm "
    "without branches.",
    trials=trials,
    measure=arm_sequences.measure,
    conclude=conclude,
)
