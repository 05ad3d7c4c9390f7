"""What a reproduced figure or table is: trials that are run and kept one by one, and what follows from them.

An experiment says which trials it needs (each a few plain values, so that it can be run in any process and
found again after the program was killed), how one trial is measured, and what all measurements say beside the
paper's claim. Running, keeping and showing them is the same for all.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from studio.comparison.findings import Chart, Findings, Heading, Number, Table
from studio.comparison.statistics import overall
from studio.comparison.trials import Measure, Outcome, Scale, Trial

G = TypeVar("G")


@dataclass(frozen=True, slots=True)
class Experiment(Heading):
    """A figure, a table or a claim.

    name : as typed on the command line. source : paper and figure. claim : the paper's, in our words. footage :
    recipes whose sessions must be rendered first. trials : all that are needed at a scale. measure : one trial's
    plain measurements (a module-level function: it runs in other processes). conclude : from all outcomes, in the
    order of the trials. alone : the trials measure time: they run one after the other when nothing else does, in a
    process that may use all cores (every other trial has one core and shares the memory's bandwidth).
    """

    trials: Callable[[Scale], tuple[Trial, ...]]
    measure: Measure
    conclude: Callable[[Sequence[Outcome]], Findings]
    footage: tuple[str, ...] = ()
    alone: bool = False


def concluding(
    read: Callable[[Sequence[Outcome]], G],
    *,
    claims: Iterable[Callable[[G], Number | None]],
    words: Callable[[G, Sequence[Number]], str],
    tables: Iterable[Callable[[G], Table]],
    charts: Iterable[Callable[[G], Chart]],
    settings: Mapping[str, Any] | Callable[[Sequence[Outcome]], Mapping[str, Any]],
    judged: Callable[[Number], bool] = lambda number: True,
) -> Callable[[Sequence[Outcome]], Findings]:
    """A conclusion that is a table of claims.

    read : what all outcomes say together. claims : each makes a number of that, None where it does not say it.
    judged : the numbers that the verdict is on, among those with a verdict of their own.
    """

    def conclude(outcomes: Sequence[Outcome]) -> Findings:
        found = read(outcomes)
        numbers = tuple(number for claim in claims if (number := claim(found)) is not None)
        return Findings(
            overall(number.verdict for number in numbers if judged(number)),
            words(found, numbers),
            numbers,
            tuple(made(found) for made in tables),
            tuple(made(found) for made in charts),
            settings(outcomes) if callable(settings) else settings,
        )

    return conclude
