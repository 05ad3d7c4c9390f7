"""What a reproduced figure or table is: trials that are run and kept one by one, and what follows from them.

An experiment says which trials it needs (each a few plain values, so that it can be run in any process and
found again after the program was killed), how one trial is measured, and what all measurements say beside the
paper's claim. Running, keeping and showing them is the same for all.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.comparison.findings import Chart, Findings, Heading, Number, Table
from studio.comparison.statistics import overall
from studio.comparison.trials import Measure, Outcome, Scale, Trial

T = TypeVar("T")
Part = Number | Table | Chart | Mapping[str, Any] | str
Verdict = Callable[[Sequence[Number]], str]


def verdict_on(*parts: str) -> Verdict:
    """The verdict is that of the numbers whose names have one of these parts; without any, of all numbers."""
    return lambda numbers: overall(
        number.verdict for number in numbers if not parts or any(part in number.name for part in parts)
    )


ON_ALL = verdict_on()


@dataclass(frozen=True, slots=True)
class Experiment(Heading):
    """A figure, a table or a claim.

    name : as typed on the command line. source : paper and figure. claim : the paper's, in our words. trials : all
    that are needed at a scale. measure : one trial's plain measurements (a module-level function: it runs in other
    processes). shown : what all outcomes, in the order of the trials, say: numbers with their verdicts, tables,
    charts, notes (words) and settings (mappings). verdict : of the whole, from the numbers. footage : recipes whose
    sessions must be rendered first. alone : the trials measure time: they run one after the other when nothing else
    does, in a process that may use all cores (every other trial has one core and shares the memory's bandwidth).
    """

    trials: Callable[[Scale], tuple[Trial, ...]]
    measure: Measure
    shown: Callable[[Sequence[Outcome]], Iterable[Part]]
    verdict: Verdict = ON_ALL
    footage: tuple[str, ...] = ()
    alone: bool = False

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
                    numbers.append(part)
                case Table():
                    tables.append(part)
                case Chart():
                    charts.append(part)
                case str():
                    notes.append(part)
                case _:
                    settings.update(part)
        return Findings(
            self.verdict(numbers), " ".join(notes), tuple(numbers), tuple(tables), tuple(charts), settings
        )


def each_seed(
    label: str, seeds: Iterable[int], arguments: Callable[[int], Mapping[str, Any]]
) -> Iterator[Trial]:
    """A trial a seed. label : contender and setting in words, the same for all. arguments : of a seed's trial."""
    return (Trial(f"{label}, seed {seed}", arguments(seed)) for seed in seeds)


def group_of(trial: Trial) -> str:
    """The contender and setting of a trial of `each_seed`."""
    return trial.label.rpartition(", seed ")[0]


def grouped(outcomes: Iterable[Outcome], made: Callable[..., T] = dict) -> dict[str, list[T]]:
    """What was measured, by the label of `each_seed` in the order of the trials, seeds in order. made : from the
    measured fields.
    """
    found: dict[str, list[T]] = {}
    for outcome in outcomes:
        found.setdefault(group_of(outcome.trial), []).append(made(**outcome.measured))
    return found


def measured(outcomes: Iterable[Outcome], name: str) -> NDArray[np.float64]:
    """(S, …) one of the measurements, of every outcome."""
    return np.array([outcome.measured[name] for outcome in outcomes])
