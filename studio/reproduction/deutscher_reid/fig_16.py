"""Fig. 16: what a growing share of crossover gains on the arm without branches (a) and on the branched arms (b).

The match is the paper's SSD: the mean squared difference between the template of the reported pose and the
silhouette, which is minus the log of the template weighting. A search takes milliseconds, so a seed here stands for
PICTURES pictures with a pose each, and its SSD is their mean.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studio.comparison.findings import Chart, Findings, Number, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import ratio_number, sign_test
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.arms import localise
from studio.reproduction.deutscher_reid.localisation import BRANCHED, CHAIN, scene
from studio.reproduction.deutscher_reid.setting import EQ18_WORDS, SOURCE
from studio.reproduction.drawing import intervals, line_chart
from studio.reproduction.experiment import Experiment

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
# Eight layers as in Fig. 18.
SETTINGS: Mapping[str, Any] = {"layers": 8, "particles": 100, "survival": 0.3}
PICTURES, QUICK_PICTURES = 10, 4
# Eq. 19 cuts anywhere; the paper does not say whether Fig. 16 was drawn with the diffusion of Eq. 13 or 18.
CUTS: Mapping[str, Mapping[str, Any]] = {
    "cut by parameters, planned noise": {"crossover_by": "parameters", "adaptive_diffusion": False},
    "cut by parameters, adaptive noise": {"crossover_by": "parameters", "adaptive_diffusion": True},
    "cut by limbs, adaptive noise": {"crossover_by": "limbs", "adaptive_diffusion": True},
}
# On a chain, which is one limb, cutting by limbs exchanges nothing: not a trial.
PAIRS = tuple(
    (body, cut) for cut in CUTS for body in (CHAIN, BRANCHED) if (body, "limbs" in cut) != (CHAIN, True)
)
EQ19 = "cut by parameters, adaptive noise"
NO_HARM = 1.05


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One for every body, cut and seed: all shares on the same pictures."""
    pictures = QUICK_PICTURES if scale.quick else PICTURES
    return tuple(
        Trial(
            f"{body}, {cut}, seed {seed}",
            {
                "body": body,
                "cut": cut,
                "knobs": {**SETTINGS, **CUTS[cut]},
                "shares": list(SHARES),
                "pictures": [seed * pictures + index for index in range(pictures)],
            },
        )
        for body, cut in PAIRS
        for seed in scale.seeds
    )


@kept_as("deutscher_reid.fig_16.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """The mean SSD of the reported poses, per share."""
    del shelf
    arm = scene(arguments["body"])
    ssd = []
    for share in arguments["shares"]:
        found = []
        for picture in arguments["pictures"]:
            result, _, truth = localise(arm, int(picture), **arguments["knobs"], crossover=float(share))
            found.append(float(-arm.observed(truth).weigh(result.estimate.pose[None])[0]))
        ssd.append(float(np.mean(found)))
    return {"ssd": ssd}


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """SSD with crossover over that without, per body. The verdict is on Eq. 19 with the diffusion of section 6."""
    groups = _groups(outcomes)
    ratios = {key: _ratio(key, rows) for key, rows in groups.items()}
    chain, branched = ratios[(CHAIN, EQ19)], ratios[(BRANCHED, EQ19)]
    verdict = "reproduced" if chain.low <= NO_HARM and branched.high < 1.0 else "not reproduced"
    told = []
    for (body, cut), rows in groups.items():
        test = sign_test(rows[:, -1].tolist(), rows[:, 0].tolist())
        entry = ratios[(body, cut)]
        told.append(
            f"{body}, {cut}: with all particles crossed the SSD is {entry.ours:.2f} times that without "
            f"({entry.low:.2f} to {entry.high:.2f}; smaller in {test.better} of {len(rows)} seeds, sign test p = "
            f"{test.p:.2g})."
        )
    words = (
        "Fig. 16 says: no difference on the chain, a steady gain on the branched arms. "
        + " ".join(told)
        + " The verdict "
        f"is on {EQ19}: no harm on the chain (a ratio of {NO_HARM} or less is possible) and a gain on "
        "the branched arms "
        f"(the whole interval below 1). {EQ18_WORDS}"
    )
    numbers = tuple(ratios.values())
    settings = {**SETTINGS, "pictures a seed": len(outcomes[0].trial.arguments["pictures"])}
    charts = (_chart(CHAIN, groups), _chart(BRANCHED, groups))
    return Findings(verdict, words, numbers, (_table(groups),), charts, settings)


Groups = dict[tuple[str, str], np.ndarray]


def _groups(outcomes: Sequence[Outcome]) -> Groups:
    """(S, shares) SSD by body and cut."""
    found: dict[tuple[str, str], list[list[float]]] = {}
    for outcome in outcomes:
        arguments = outcome.trial.arguments
        found.setdefault((arguments["body"], arguments["cut"]), []).append(outcome.measured["ssd"])
    return {key: np.array(rows) for key, rows in found.items()}


def _ratio(key: tuple[str, str], rows: np.ndarray) -> Number:
    """On the chain the paper sees no difference: 1."""
    body, cut = key
    paper = 1.0 if body == CHAIN else None
    name = f"SSD with over without crossover: {body}, {cut}"
    return ratio_number(name, rows[:, -1].tolist(), rows[:, 0].tolist(), "×", paper=paper, better="lower")


def _chart(body: str, groups: Groups) -> Chart:
    """The paper's graph: SSD over the share of crossover."""
    percent = tuple(100.0 * share for share in SHARES)
    series = [
        intervals(cut, percent, rows.T.tolist(), group=cut)
        for (owner, cut), rows in groups.items()
        if owner == body
    ]
    panel = "a: no branches" if body == CHAIN else "b: branched"
    return line_chart(f"Match over crossover ({panel})", "crossover (%)", "SSD", series)


def _table(groups: Groups) -> Table:
    rows = tuple(
        (body, cut, *(f"{value:.5f}" for value in ssd.mean(axis=0))) for (body, cut), ssd in groups.items()
    )
    heads = tuple(f"{share:.0%} crossed" for share in SHARES)
    return Table("Mean SSD after the last layer", ("body", "crossover", *heads), rows)


EXPERIMENT = Experiment(
    name="deutscher-fig-16",
    title="Crossover on the arm and on the branched arms",
    source=f"{SOURCE}, Fig. 16",
    claim="The match does not get worse with the share of crossover on an arm without branches, and gets steadily "
    "better on branched arms.",
    trials=trials,
    measure=measure,
    conclude=conclude,
)
