"""A view's tables for a frame or for a whole run."""

from collections.abc import Callable, Sequence

from studio.errors import NotFoundError
from studio.inspection import (
    blame,
    clouds,
    coupling,
    coverage,
    genealogy,
    landscape,
    limbs,
    modes,
    over_frames,
    schedule,
    seeds,
    survivors,
    variance,
    weights,
    why,
)
from studio.inspection.catalogue import View, view_named
from studio.inspection.reading import InspectedFrame, InspectedRun
from studio.inspection.tables import Column, Found, Rows, Selection, Table, TableKind, Viewed

OfFrame = Callable[[InspectedFrame, Selection], Found | Rows]
OfRun = Callable[[InspectedRun, Selection], Found | Rows]

_OF_FRAME: dict[str, OfFrame] = {
    "variance": variance.rows,
    "schedule": schedule.rows,
    "genealogy": genealogy.rows,
    "weights": weights.rows,
    "clouds": clouds.rows,
    "coupling": coupling.rows,
    "survivors": survivors.rows,
    "modes": modes.rows,
    "coverage": coverage.of_frame,
    "landscape": landscape.rows,
    "blame": blame.rows,
    "seeds": seeds.rows,
    "why": why.rows,
}
_OF_RUN: dict[str, OfRun] = {
    "variance": over_frames.variance_rows,
    "schedule": over_frames.schedule_rows,
    "modes": modes.over_run,
    "coverage": coverage.over_run,
    "why": limbs.limb_rows,
}


def look(run: InspectedRun, frame: int, name: str, selection: Selection) -> Viewed:
    """A view's tables of a frame. Raises NotFoundError for a frame, layer, parameter … that is none."""
    view = view_named(name)
    if name not in _OF_FRAME:
        raise NotFoundError(f"View '{name}' shows whole runs, not frames.", "Ask for it without a frame.")
    opened = run.frame(frame)
    found = _OF_FRAME[name](opened, selection)
    return _viewed(run, view, view.frame_tables, found, opened.notes())


def look_over(run: InspectedRun, name: str, selection: Selection) -> Viewed:
    """A view's tables of the whole run; none for a view that shows single frames only."""
    view = view_named(name)
    found = _OF_RUN[name](run, selection) if name in _OF_RUN else Found({})
    return _viewed(run, view, view.run_tables, found, ())


def _viewed(
    run: InspectedRun, view: View, kinds: Sequence[TableKind], found: Found | Rows, notes: tuple[str, ...]
) -> Viewed:
    given = found if isinstance(found, Found) else Found(found)
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
