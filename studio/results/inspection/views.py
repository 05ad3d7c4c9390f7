"""The views by name, and their tables for a frame or for a whole run: what each shows is declared in its module."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from studio.foundations.errors import NotFoundError
from studio.results.inspection import (
    blame,
    clouds,
    coupling,
    coverage,
    genealogy,
    landscape,
    modes,
    over_frames,
    schedule,
    seeds,
    survivors,
    variance,
    weights,
    why,
)
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.tables import (
    Column,
    Rows,
    Selection,
    Table,
    TableKind,
    View,
    Viewed,
    ViewResult,
)
from studio.results.uncertainty import view as uncertainty

OfFrame = Callable[[InspectedFrame, Selection], ViewResult | Rows]
OfRun = Callable[[InspectedRun, Selection], ViewResult | Rows]


class _Entry(NamedTuple):
    """A view with what finds its rows in a frame, and in the whole run; None where it has no tables of it."""

    view: View
    of_frame: OfFrame
    of_run: OfRun | None = None


_ENTRIES = {
    entry.view.name: entry
    for entry in (
        _Entry(variance.VIEW, variance.rows, over_frames.variance_rows),
        _Entry(schedule.VIEW, schedule.rows, over_frames.schedule_rows),
        _Entry(genealogy.VIEW, genealogy.rows),
        _Entry(weights.VIEW, weights.rows),
        _Entry(clouds.VIEW, clouds.rows),
        _Entry(coupling.VIEW, coupling.rows),
        _Entry(survivors.VIEW, survivors.rows),
        _Entry(landscape.VIEW, landscape.rows),
        _Entry(blame.VIEW, blame.rows),
        _Entry(modes.VIEW, modes.rows, modes.over_run),
        _Entry(seeds.VIEW, seeds.rows),
        _Entry(coverage.VIEW, coverage.of_frame, coverage.over_run),
        _Entry(uncertainty.VIEW, uncertainty.of_frame, uncertainty.over_run),
        _Entry(why.VIEW, why.rows, why.run_rows),
    )
}
VIEWS = {name: entry.view for name, entry in _ENTRIES.items()}


def look(run: InspectedRun, frame: int, name: str, selection: Selection) -> Viewed:
    """A view's tables of a frame. Raises NotFoundError for a frame, layer, parameter … that is none."""
    entry, opened = _entry(name), run.frame(frame)
    answer = entry.of_frame(opened, selection)
    viewed = _fill_view(run, entry.view, entry.view.frame_tables, answer, opened.notes())
    return replace(viewed, search_layers=opened.search_layers, searches=opened.searches)


def look_over(run: InspectedRun, name: str, selection: Selection) -> Viewed:
    """A view's tables of the whole run; none for a view that shows single frames only."""
    entry = _entry(name)
    answer = entry.of_run(run, selection) if entry.of_run else ViewResult({})
    return _fill_view(run, entry.view, entry.view.run_tables, answer, ())


def view_named(name: str) -> View:
    """A view. Raises NotFoundError."""
    return _entry(name).view


def _entry(name: str) -> _Entry:
    if name not in _ENTRIES:
        raise NotFoundError(f"There is no view '{name[:40]}'.", f"There are: {', '.join(_ENTRIES)}.")
    return _ENTRIES[name]


def _fill_view(
    run: InspectedRun,
    view: View,
    kinds: Sequence[TableKind],
    answer: ViewResult | Rows,
    notes: tuple[str, ...],
) -> Viewed:
    given = answer if isinstance(answer, ViewResult) else ViewResult(answer)
    tables = [
        Table(kind.name, kind.title, _columns(run, kind), given.rows.get(kind.name, ())) for kind in kinds
    ]
    return Viewed(tuple(tables), (*notes, *given.notes), given.findings, given.remedies)


def _columns(run: InspectedRun, kind: TableKind) -> tuple[Column, ...]:
    if kind.each != "parameter":
        return kind.columns
    return (
        *kind.columns,
        *(Column(name, name, unit) for name, unit in zip(run.names, run.units, strict=True)),
    )
