"""Charts as plain values: what is drawn, not how. The report and the studio's pages draw them alike."""

from dataclasses import dataclass

KINDS = ("lines", "bars", "points", "heat")


@dataclass(frozen=True, slots=True)
class Series:
    """One line, set of bars or cloud of points.

    x, y : the same length, y NaN for gaps. low, high : an interval around each y, or empty. group : series of one
    group share a colour (every seed of a tracker, say). thin : drawn faintly behind the others (single seeds);
    only the thick one of a group stands in the legend. dashed : for what the paper printed.
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
    along x that are shaded, with a word each.
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
