"""Series and tables common to the experiments: rows of seeds."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from studio.foundations.arrays import Array
from studio.results.comparison.findings import Chart, Heat, Series, Table
from studio.results.comparison.statistics import Statistic, bootstrap_interval

Values = Mapping[str, Sequence[float]]
T = TypeVar("T")


def places(count: int, first: int = 0) -> tuple[float, ...]:
    """0, 1, 2, … along an axis, or from `first` on."""
    return tuple(float(first + index) for index in range(count))


def floats(values: ArrayLike) -> tuple[float, ...]:
    """The values as plain numbers."""
    return tuple(np.asarray(values, dtype=np.float64).tolist())


def line(name: str, x: Iterable[float], y: ArrayLike, *, dashed: bool = False) -> Series:
    """A line in its own colour."""
    return Series(name, tuple(map(float, x)), floats(y), group=name, dashed=dashed)


def seeds_and_mean(name: str, x: Sequence[float], rows: Array, mean: ArrayLike | None = None) -> list[Series]:
    """Every seed's row of (S, X) thin, the mean over the seeds (or another one) thick."""
    thin = [
        Series(f"{name}, seed {seed}", floats(x), floats(row), group=name, thin=True)
        for seed, row in enumerate(rows)
    ]
    return [*thin, line(name, x, rows.mean(axis=0) if mean is None else mean)]


def seed_range(name: str, x: Sequence[float], rows: Iterable[Sequence[float]], group: str = "") -> Series:
    """The mean over the seeds at every place, with the lowest and the highest seed. rows : a place's seeds."""
    values = list(rows)
    return Series(
        name,
        tuple(x),
        tuple(float(np.mean(row)) for row in values),
        low=tuple(min(row) for row in values),
        high=tuple(max(row) for row in values),
        group=group,
    )


def intervals(
    name: str,
    x: Sequence[float],
    rows: Iterable[Sequence[float]],
    statistic: Statistic = np.mean,
    group: str = "",
) -> Series:
    """A statistic over the seeds at every place with its bootstrap interval. rows : a place's seeds."""
    values = [list(row) for row in rows]
    ends = [bootstrap_interval(row, statistic) for row in values]
    return Series(
        name,
        tuple(x),
        tuple(float(np.asarray(statistic(np.array(row)))) for row in values),
        low=tuple(low for low, _ in ends),
        high=tuple(high for _, high in ends),
        group=group,
    )


def bar_chart(title: str, x: str, y: str, series: Sequence[Series], names: Iterable[str]) -> Chart:
    """Bars beside one another, named along x."""
    return Chart(title, "bars", x, y, tuple(series), categories=tuple(names))


def line_chart(title: str, x: str, y: str, series: Iterable[Series], *, log_y: bool = False) -> Chart:
    """Lines over an axis."""
    return Chart(title, "lines", x, y, tuple(series), log_y=log_y)


def table_over(
    title: str,
    head: str,
    columns: Mapping[str, Callable[[Sequence[T]], Any]],
    groups: Mapping[str, Sequence[T]],
) -> Table:
    """A line a group, a column a reading of its seeds. head : of the groups' names."""

    def cell(value: Any) -> Any:  # noqa: ANN401
        return round(value, 1) if isinstance(value, float) else value

    rows = ((name, *(cell(of(entries)) for of in columns.values())) for name, entries in groups.items())
    return Table(title, (head, *columns), tuple(rows))


def heat_chart(title: str, x: str, y: str, columns: Iterable[str], rows: Values, digits: int = 2) -> Chart:
    """A heat map: a row of cells by name."""
    cells = tuple(tuple(round(value, digits) for value in row) for row in rows.values())
    return Chart(title, "heat", x, y, heat=Heat(tuple(columns), tuple(rows), cells))


def layer_table(title: str, names: Sequence[str], rows: Array, digits: int = 1) -> Table:
    """A line a layer (from 1), a column a name: the values (L, N)."""
    lines = tuple(
        (layer, *(round(float(value), digits) for value in row)) for layer, row in enumerate(rows, 1)
    )
    return Table(title, ("layer", *names), lines)
