"""What a reproduced figure or table is: trials that are run and kept one by one, and what follows from them.

An experiment says which trials it needs (each a few plain values, so that it can be run in any process and
found again after the program was killed), how one trial is measured, and what all measurements say beside the
paper's claim. Running, keeping and showing them is the same for all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from studio.experiments.charts import Chart
from studio.experiments.footage_shelf import FootageShelf

# Numbers, words, lists and dictionaries: what JSON can hold.
Plain = Any
Measure = Callable[[Mapping[str, Plain], FootageShelf], dict[str, Plain]]
M = TypeVar("M", bound=Callable[..., Any])

NAMED_BELOW = "studio.experiments"

VERDICTS = ("reproduced", "better", "not reproduced", "answered")
# What stands in a verdict's place where a trial failed or the conclusion could not be drawn.
FAILED = "failed"
# A verdict is firm with so many seeds or more.
FIRM_SEEDS = 10


@dataclass(frozen=True, slots=True)
class Scale:
    """How much of an experiment is run. seeds : of the trials. quick : a look at it, in minutes for all."""

    seeds: tuple[int, ...]
    quick: bool = False


@dataclass(frozen=True, slots=True)
class Trial:
    """One piece of work. label : words for the progress. arguments : all that its outcome depends on, plain;
    the same arguments always give the same outcome, so a kept outcome is used again.
    """

    label: str
    arguments: Mapping[str, Plain]


@dataclass(frozen=True, slots=True)
class Outcome:
    """A trial and what was measured: plain values."""

    trial: Trial
    measured: Mapping[str, Plain]


@dataclass(frozen=True, slots=True)
class Number:
    """One of our numbers beside the paper's.

    ours : over all seeds; low, high : its bootstrap 95 % interval over seeds. paper : None where the paper
    prints none. better : "lower" or "higher" if a difference to that side is an improvement, "" if not. seeds :
    how many went into it. verdict : "reproduced" where the interval contains the paper's value, "better" where
    it lies wholly on the better side, else "not reproduced"; "answered" without a paper's value.
    """

    name: str
    ours: float
    low: float
    high: float
    unit: str = ""
    paper: float | None = None
    better: str = ""
    seeds: int = 0
    verdict: str = "answered"


@dataclass(frozen=True, slots=True)
class Table:
    """columns : heads with units. rows : one list of words and numbers each."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Plain, ...], ...]


@dataclass(frozen=True, slots=True)
class Findings:
    """What an experiment found.

    verdict : of the whole, one of VERDICTS. words : what was seen, in a sentence or three, with the deviations from
    the paper that matter. settings : knobs and sizes that the numbers belong to.
    """

    verdict: str
    words: str
    numbers: tuple[Number, ...] = ()
    tables: tuple[Table, ...] = ()
    charts: tuple[Chart, ...] = ()
    settings: Mapping[str, Plain] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Experiment:
    """A figure, a table or a claim.

    name : as typed on the command line. source : paper and figure. claim : the paper's, in our words. footage :
    recipes whose sessions must be rendered first. trials : all that are needed at a scale. measure : one trial's
    plain measurements (a module-level function: it runs in other processes). conclude : from all outcomes, in the
    order of the trials. alone : the trials measure time: they run one after the other when nothing else does, in a
    process that may use all cores (every other trial has one core and shares the memory's bandwidth).
    """

    name: str
    title: str
    source: str
    claim: str
    trials: Callable[[Scale], tuple[Trial, ...]]
    measure: Measure
    conclude: Callable[[Sequence[Outcome]], Findings]
    footage: tuple[str, ...] = ()
    alone: bool = False


def kept_as(name: str) -> Callable[[M], M]:
    """Give a measure the name that its outcomes are kept under, wherever its code moves to.

    The names are those of the modules in which outcomes were first measured, below NAMED_BELOW: another name is
    another trial, and everything is measured again.
    """

    def named(measure: M) -> M:
        measure.kept_as = f"{NAMED_BELOW}.{name}"  # pyright: ignore[reportFunctionMemberAccess]
        return measure

    return named


def measure_name(measure: Measure) -> str:
    """The name that a measure's outcomes are kept under: that of `kept_as`, else where it stands."""
    return getattr(measure, "kept_as", f"{measure.__module__}.{measure.__qualname__}")
