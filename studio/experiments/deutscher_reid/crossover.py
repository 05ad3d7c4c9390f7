"""Section 6.2: crossover halves the particles again where there are branches (Fig. 15), not on a chain (Fig. 11)."""

from collections.abc import Sequence

from studio.experiments.deutscher_reid import arm_sequences
from studio.experiments.deutscher_reid.adaptive_diffusion import CHAIN, SETTINGS
from studio.experiments.deutscher_reid.arm_sequences import RATE, found_by_group, group
from studio.experiments.deutscher_reid.fewest_particles import (
    Fewest,
    bars,
    censored_in_words,
    needed,
    per_seed,
    saving,
    successes,
)
from studio.experiments.deutscher_reid.setting import ADAPTIVE, BY_LIMBS, EQ18_WORDS, IMPROVED, SOURCE
from studio.experiments.experiment import Experiment, Findings, Outcome, Scale, Trial
from studio.experiments.statistics import overall

BRANCHED = "branched_arms6"
PAPER_BRANCHED, PAPER_CHAIN = 2.0, 1.0
WITHOUT, PARAMETERS, LIMBS = "adaptive", "with crossover", "with crossover by limbs"
# A chain is one limb: cut by limbs nothing is ever exchanged.
FILTERS = {
    CHAIN: {WITHOUT: ADAPTIVE, PARAMETERS: IMPROVED},
    BRANCHED: {WITHOUT: ADAPTIVE, PARAMETERS: IMPROVED, LIMBS: BY_LIMBS},
}


def trials(scale: Scale) -> tuple[Trial, ...]:
    """All filters on both bodies."""
    return tuple(
        trial
        for body, filters in FILTERS.items()
        for trial in arm_sequences.trials(scale, filters, body, RATE)
    )


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """The ratios. The verdict is on Eq. 19 as it is printed: branched and chain together."""
    groups = found_by_group(outcomes)

    def of(body: str, name: str) -> list[Fewest]:
        return groups[group(name, body, RATE)]

    branched = saving(
        "particles saved on the branched arms",
        of(BRANCHED, WITHOUT),
        of(BRANCHED, PARAMETERS),
        PAPER_BRANCHED,
    )
    chain = saving("particles saved on the chain", of(CHAIN, WITHOUT), of(CHAIN, PARAMETERS), PAPER_CHAIN)
    limbs = saving(
        "particles saved on the branched arms, cut by limbs",
        of(BRANCHED, WITHOUT),
        of(BRANCHED, LIMBS),
        PAPER_BRANCHED,
    )
    verdict = overall((branched.verdict, chain.verdict))
    words = (
        f"Half of the particles made by crossover as Eq. 19 has it saves {branched.ours:.2f} times on "
        "the branched arms "
        f"({branched.low:.2f} to {branched.high:.2f}; the paper says 2) and {chain.ours:.2f} times on the chain "
        f"({chain.low:.2f} to {chain.high:.2f}; the paper says no difference). Cut between whole limbs only, as the "
        f"studio does by default, the branched arms save {limbs.ours:.2f} times ({limbs.low:.2f} to {limbs.high:.2f}): "
        f"{limbs.verdict}. The paper does not print its share of children. {censored_in_words(groups)} {EQ18_WORDS}"
    )
    numbers = (
        branched,
        chain,
        limbs,
        *(needed(f"particles needed: {name}", found) for name, found in groups.items()),
    )
    charts = (
        bars("Particles needed over 40 pictures, with and without crossover", groups),
        successes("Runs that succeed, by particles", groups),
    )
    table = per_seed("Fewest particles with which most runs succeed", groups)
    settings = {**SETTINGS, "crossover": IMPROVED["crossover"], "pictures a second": RATE}
    return Findings(verdict, words, numbers, (table,), charts, settings)


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
