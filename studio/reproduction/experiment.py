"""What a reproduced figure or table is: trials that are run and kept one by one, and what follows from them.

An experiment says which trials it needs (each a few plain values, so that it can be run in any process and
found again after the program was killed), how one trial is measured, and what all measurements say beside the
paper's claim. Running, keeping and showing them is the same for all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from studio.comparison.findings import Findings, Heading
from studio.comparison.trials import Measure, Outcome, Scale, Trial


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
