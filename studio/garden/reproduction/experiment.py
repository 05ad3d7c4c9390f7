"""A reproduced figure or table: trials that are run and stored one by one, and their conclusion.

What each is called and claims is in one table, `experiments.toml`. Beside it an experiment declares its trials (each a
few plain values, so that it can run in any process and be found again after the program was killed), the measurement of
a trial, and the conclusion on the claim. Running, storing and showing them is the same for all.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.foundations.typed_decoding import decode_toml
from studio.garden.reproduction.claims import of_enough_seeds
from studio.results.comparison.findings import Chart, Findings, Heading, Number, Table
from studio.results.comparison.statistics import overall
from studio.results.comparison.trials import Measure, Outcome, Scale, Trial

T = TypeVar("T")
Part = Number | Table | Chart | Mapping[str, Any] | str
TABLE = decode_toml((Path(__file__).parent / "experiments.toml").read_bytes(), dict[str, dict[str, str]])
"""Title, source and claim of every experiment by its name, in the order of the report."""


@dataclass(frozen=True, slots=True)
class Experiment(Heading):
    """A figure, a table or a claim.

    name : as typed on the command line. source : paper and figure. claim : the paper's, in our words. trials : all
    at a scale. measure : one trial's plain measurements (a module-level function: it runs in other
    processes). shown : the results of all outcomes, in the order of the trials: numbers with their verdicts,
    tables, charts, notes (text) and settings (mappings). footage : recipes whose sessions must be rendered first. alone
    : the trials measure time: they run one after the other when nothing else runs, in a process that may use all cores
    (every other trial has one core and shares the memory's bandwidth). long : why all seeds take hours here, "" where
    they do not. The verdict is that of the hardest claim, in every experiment.
    """

    trials: Callable[[Scale], tuple[Trial, ...]]
    measure: Measure
    shown: Callable[[Sequence[Outcome]], Iterable[Part]]
    footage: tuple[str, ...] = ()
    alone: bool = False
    long: str = ""

    def conclude(self, outcomes: Sequence[Outcome]) -> Findings:
        """The findings. Raises what reading the outcomes raises."""
        numbers: list[Number] = []
        tables: list[Table] = []
        charts: list[Chart] = []
        notes: list[str] = []
        settings: dict[str, Any] = {}
        for part in self.shown(outcomes):
            match part:
                case Number():
                    numbers.append(of_enough_seeds(part))
                case Table():
                    tables.append(part)
                case Chart():
                    charts.append(part)
                case str():
                    notes.append(part)
                case _:
                    settings.update(part)
        return Findings(
            overall(number.verdict for number in numbers),
            " ".join(notes),
            tuple(numbers),
            tuple(tables),
            tuple(charts),
            settings,
        )


def listed(
    name: str,
    trials: Callable[[Scale], tuple[Trial, ...]],
    measure: Measure,
    shown: Callable[[Sequence[Outcome]], Iterable[Part]],
    *,
    footage: tuple[str, ...] = (),
    alone: bool = False,
) -> Experiment:
    """The experiment that the table lists under a name."""
    return Experiment(
        **TABLE[name], name=name, trials=trials, measure=measure, shown=shown, footage=footage, alone=alone
    )


def each_seed(
    label: str, seeds: Iterable[int], arguments: Callable[[int], Mapping[str, Any]]
) -> Iterator[Trial]:
    """A trial a seed. label : candidate and setting as text, the same for all. arguments : of a seed's trial."""
    return (Trial(f"{label}, seed {seed}", arguments(seed)) for seed in seeds)


def group_of(trial: Trial) -> str:
    """The candidate and setting of a trial of `each_seed`."""
    return trial.label.rpartition(", seed ")[0]


def grouped(outcomes: Iterable[Outcome], made: Callable[..., T] = dict) -> dict[str, list[T]]:
    """The measurements by the label of `each_seed` in the order of the trials, seeds in order. made : type made from
    the measured fields.
    """
    groups: dict[str, list[T]] = {}
    for outcome in outcomes:
        groups.setdefault(group_of(outcome.trial), []).append(made(**outcome.measured))
    return groups


def measured(outcomes: Iterable[Outcome], name: str) -> NDArray[np.float64]:
    """(S, …) one of the measurements, of every outcome."""
    return np.array([outcome.measured[name] for outcome in outcomes])
