"""Conclusions of experiments on outcomes that tests make up."""

import json
from collections.abc import Callable, Mapping

from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.results.comparison.findings import Findings
from studio.results.comparison.trials import Outcome, Scale, Trial

FIVE = Scale(seeds=(0, 1, 2, 3, 4))


def concluded(name: str, made: Callable[[Trial], Mapping[str, object]], scale: Scale = FIVE) -> Findings:
    """The findings of an experiment whose trials measured what `made` gives, as read from JSON."""
    experiment = EXPERIMENTS[name]
    outcomes = [Outcome(trial, json.loads(json.dumps(made(trial)))) for trial in experiment.trials(scale)]
    return experiment.conclude(outcomes)
