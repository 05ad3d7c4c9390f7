"""Section 6.3: adaptive diffusion and crossover together track a whole body with a quarter of the particles."""

from collections.abc import Sequence

from studio.comparison.findings import Findings
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.deutscher_reid import body_sequences
from studio.reproduction.deutscher_reid.fewest_particles import (
    bars,
    censored_in_words,
    found_by_group,
    needed,
    per_seed,
    saving,
    successes,
)
from studio.reproduction.deutscher_reid.setting import (
    ADAPTIVE,
    BODY,
    BY_LIMBS,
    CIRCLE,
    EQ17_WORDS,
    EQ18_WORDS,
    IMPROVED,
    LIMIT_MM,
    PLAIN,
    SOURCE,
    WEIGHTING,
)
from studio.reproduction.experiment import Experiment

PAPER = 4.0
LAYERS = 10
EQ13, WITH_ADAPTIVE, BOTH, LIMBS = (
    "Eq. 13",
    "adaptive",
    "adaptive and crossover",
    "adaptive and half crossed by limbs",
)
FILTERS = {
    EQ13: {**PLAIN, "layers": LAYERS},
    WITH_ADAPTIVE: {**ADAPTIVE, "layers": LAYERS},
    BOTH: {**IMPROVED, "layers": LAYERS},
    LIMBS: {**BY_LIMBS, "layers": LAYERS},
}


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One bisection a filter and seed."""
    return body_sequences.trials(scale, FILTERS)


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Both together over Eq. 13, and each step for itself."""
    groups = found_by_group(outcomes)
    together = saving("particles saved by both together", groups[EQ13], groups[BOTH], PAPER)
    by_limbs = saving(
        "particles saved by both, half of them crossed by limbs", groups[EQ13], groups[LIMBS], PAPER
    )
    adaptive = saving("particles saved by adaptive diffusion", groups[EQ13], groups[WITH_ADAPTIVE], None)
    crossing = saving("particles saved by crossover on top of it", groups[WITH_ADAPTIVE], groups[BOTH], None)
    limbs = saving(
        "particles saved by half crossed by limbs on top of it", groups[WITH_ADAPTIVE], groups[LIMBS], None
    )
    words = (
        f"Over 40 frames of the circle both improvements together need {together.ours:.1f} times fewer particles "
        f"than the filter of Eq. 13 ({together.low:.1f} to {together.high:.1f}; the paper says 4): adaptive diffusion "
        f"{adaptive.ours:.1f} times ({adaptive.low:.1f} to {adaptive.high:.1f}), crossover {crossing.ours:.1f} times "
        f"on top of it ({crossing.low:.1f} to {crossing.high:.1f}), half of the particles crossed by "
        f"limbs {limbs.ours:.1f} ({limbs.low:.1f} to "
        f"{limbs.high:.1f}). {censored_in_words(groups)} Deviations: the paper judges success by eye and does not name "
        f"the footage; here three cameras, 29 parameters, every frame below {LIMIT_MM:g} mm and no limb lost. "
        f"Every particle is crossed, as 6.2.1 has it. {EQ17_WORDS} {EQ18_WORDS}"
    )
    numbers = (
        together,
        by_limbs,
        adaptive,
        crossing,
        limbs,
        *(needed(f"particles needed: {name}", found) for name, found in groups.items()),
    )
    charts = (
        bars("Particles in each of ten layers needed over 40 frames", groups),
        successes("Runs that succeed, by particles", groups),
    )
    table = per_seed("Fewest particles with which most runs succeed", groups)
    return Findings(together.verdict, words, numbers, (table,), charts, SETTINGS)


SETTINGS = {
    "footage": CIRCLE,
    "body": BODY,
    "frames": body_sequences.FRAMES,
    "layers": LAYERS,
    "survival": PLAIN["survival"],
    "crossover": IMPROVED["crossover"],
    "weighting": WEIGHTING,
    "runs a size": body_sequences.RUNS,
    "sizes tried": f"{body_sequences.FEWEST} to {body_sequences.MOST}, two a doubling",
}

EXPERIMENT = Experiment(
    name="deutscher-full-body",
    title="What both improvements save on a whole body",
    source=f"{SOURCE}, section 6.3",
    claim="Adaptive diffusion and crossover together track a whole body with one quarter of the particles.",
    trials=trials,
    measure=body_sequences.measure,
    conclude=conclude,
    footage=(CIRCLE,),
)
