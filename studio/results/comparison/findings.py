"""The findings of trials as plain values: numbers with verdicts, tables, and charts as data.

The report and the studio's pages draw them in the same way.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from studio.results.comparison.trials import Plain

VERDICTS = ("reproduced", "better", "undecided", "not reproduced", "answered")
# In place of a verdict where a trial failed or no conclusion could be drawn.
FAILED = "failed"
# Least seeds of a firm verdict.
FIRM_SEEDS = 10

KINDS = ("lines", "bars", "points", "heat")


@dataclass(frozen=True, slots=True)
class Series:
    """One line, set of bars or cloud of points.

    x, y : the same length, y NaN for gaps. low, high : an interval around each y, or empty. group : series of one
    group share a colour (every seed of a tracker, say). thin : drawn faintly behind the others (single seeds);
    only the thick one of a group stands in the legend. dashed : for the paper's values.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    group: str = ""
    thin: bool = False
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Heat:
    """A heat map's cells. values : rows of columns, NaN where nothing was measured."""

    columns: tuple[str, ...]
    rows: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class Chart:
    """kind : one of KINDS. Axes carry their units: "error (mm)". categories : names along x for bars, whose x
    are 0, 1, 2, …. paper : a horizontal line at the paper's value. log_x, log_y : logarithmic axes. bands : spans
    along x that are shaded, with a word each. stacked : bars stand on one another instead of side by side.
    """

    title: str
    kind: str
    x: str
    y: str
    series: tuple[Series, ...] = ()
    heat: Heat | None = None
    categories: tuple[str, ...] = ()
    paper: float | None = None
    log_x: bool = False
    log_y: bool = False
    bands: tuple[tuple[float, float, str], ...] = ()
    stacked: bool = False


@dataclass(frozen=True, slots=True)
class Number:
    """One of our numbers compared with the paper's.

    ours : over all seeds; low, high : its bootstrap 95 % interval over seeds. paper : None where the paper
    prints none. better : "lower" or "higher" if a difference to that side is an improvement, "" if not. seeds :
    their number. verdict : one of VERDICTS, by the rule of `results.comparison.statistics`; "answered" where no claim
    rests on the number. refuted : what would make it "not reproduced", a clause; "" where nothing does.
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
    refuted: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """columns : heads with units. rows : one list of words and numbers each."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Plain, ...], ...]


@dataclass(frozen=True, slots=True)
class Heading:
    """The subject of findings. name : a word. source, claim : of the claim, and its text."""

    name: str
    title: str
    source: str
    claim: str


@dataclass(frozen=True, slots=True)
class Findings:
    """The findings of an experiment.

    verdict : of the whole, one of VERDICTS. words : summary in one to three sentences, with the
    relevant deviations from the paper. settings : knobs and sizes that the numbers belong to.
    """

    verdict: str
    words: str
    numbers: tuple[Number, ...] = ()
    tables: tuple[Table, ...] = ()
    charts: tuple[Chart, ...] = ()
    settings: Mapping[str, Plain] = field(default_factory=dict[str, Plain])
