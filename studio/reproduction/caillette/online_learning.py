"""Online learning, the paper's second future work: a run adds to its model what it tracked well, and a second pass over
the same clip, never learnt before, is compared with the first.

The tracker is the guided one with 1000 particles and a model-free share, without which nothing new would be tracked
that could be learnt. Blobs are fitted from the true pose, so that only the dynamics differ between the passes.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from studio.comparison.findings import Findings
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.caillette.comparing import (
    angle,
    curves,
    error_number,
    mean_of,
    position,
    ratio,
    summary_table,
)
from studio.reproduction.caillette.following import Follow, Followed, followed, way_of
from studio.reproduction.caillette.setting import (
    BLOBS,
    GUIDED,
    MEMORY,
    SIGMA,
    UNSEEN,
    last_frame,
    training,
    training_words,
)
from studio.reproduction.caillette.training_set import learnt
from studio.reproduction.caillette.true_motion import true_motion
from studio.reproduction.experiment import Experiment

PARTICLES, INTERVAL = 1000, 30
PLAIN, FIRST, SECOND = "not learning", "first pass, learning", "second pass, with what the first learnt"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """All three passes with every seed."""
    taught = dataclasses.replace(training(scale.quick), memory=MEMORY)
    last = last_frame(UNSEEN, scale.quick)
    knobs = {
        "particles": PARTICLES,
        "model_free_share": 0.1,
        "estimate": "mode",
        "learning_interval": INTERVAL,
        **SIGMA,
    }
    return tuple(
        Trial(
            f"online learning, seed {seed}",
            Follow(UNSEEN, GUIDED, BLOBS, seed, last, knobs, from_truth=True, training=taught).plain(),
        )
        for seed in scale.seeds
    )


@kept_as("caillette.online_learning.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """The passes, each the fields of `Followed`; clusters and states before and after."""
    wanted = Follow.of_plain(arguments)
    assert wanted.training is not None
    learning = dataclasses.replace(wanted, changes={**wanted.changes, "online_learning": True})
    model = learnt(shelf, wanted.training).model
    session = shelf.session(wanted.footage)
    truth = true_motion(shelf, session, wanted.last)
    plain = way_of(shelf, session, truth, wanted, model)
    first = way_of(shelf, session, truth, learning, model)
    assert first.model is not None
    second = way_of(shelf, session, truth, wanted, first.model)
    passes = {PLAIN: plain, FIRST: first, SECOND: second}
    return {
        "passes": {name: asdict(followed(session, truth, way)) for name, way in passes.items()},
        "clusters": [model.clusters, first.model.clusters],
        "states": [model.states, first.model.states],
    }


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Whether the second pass is better than one that learnt nothing."""
    groups = {
        name: [Followed(**outcome.measured["passes"][name]) for outcome in outcomes]
        for name in (PLAIN, FIRST, SECOND)
    }
    claim = ratio("second pass over one that learnt nothing", groups[SECOND], groups[PLAIN], "lower")
    shares = {
        name: 100.0 * float(np.mean([np.mean(run.free) for run in runs])) for name, runs in groups.items()
    }
    numbers = (
        claim,
        ratio("the same, joint angle", groups[SECOND], groups[PLAIN], "", angle),
        ratio("the same, joint position", groups[SECOND], groups[PLAIN], "", position),
        ratio("learning while tracking over not learning", groups[FIRST], groups[PLAIN], ""),
        *(error_number(f"limb direction, RMS: {name}", runs) for name, runs in groups.items()),
        *(
            number(
                f"{what} learnt",
                [entry.measured[what][1] - entry.measured[what][0] for entry in outcomes],
                "",
            )
            for what in ("clusters", "states")
        ),
    )
    words = (
        f"On a clip never learnt the RMS error of limb directions is {mean_of(groups[PLAIN]):.1f}° without online "
        f"learning, {mean_of(groups[FIRST]):.1f}° while the run learns (a lesson every {INTERVAL} frames) and "
        f"{mean_of(groups[SECOND]):.1f}° in a second pass with what the first has learnt; joint positions "
        f"{mean_of(groups[PLAIN], position):.0f}, {mean_of(groups[FIRST], position):.0f} and "
        f"{mean_of(groups[SECOND], position):.0f} mm RMS. Particles that go their own way are {shares[PLAIN]:.0f} %, "
        f"{shares[FIRST]:.0f} % and {shares[SECOND]:.0f} % of all. What is learnt is what was tracked, its errors "
        "included."
    )
    quick = len(outcomes[0].trial.arguments["training"]["sources"]) == 1
    return Findings(
        claim.verdict,
        words,
        numbers,
        (summary_table("Passes over the clip", groups),),
        (curves("RMS limb direction error", groups),),
        {"footage": UNSEEN, "particles": PARTICLES, "memory": MEMORY, "training": training_words(quick)},
    )


EXPERIMENT = Experiment(
    name="caillette-online-learning",
    title="A second pass with what the first has learnt",
    source="beyond the paper (its section 8)",
    claim="Online learning, where unseen sequences are added to the model, would be worthwhile: a second pass over a "
    "clip is more accurate than one whose model learnt nothing.",
    trials=trials,
    measure=measure,
    conclude=conclude,
    footage=(UNSEEN,),
)
