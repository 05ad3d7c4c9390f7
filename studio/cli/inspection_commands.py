"""What shows the inside of runs: `view`, `why`, `seeds`, `uncertainty`, `rig`, `compare-runs`."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table as Drawn

from studio.cli.deriving import Call, command_of
from studio.operations.inspecting import (
    compare_runs,
    inspected,
    seeds,
    split_error,
    uncertainty,
    view,
    why,
    worst_frame,
    write_tables,
)
from studio.operations.rigs import rig
from studio.results.inspection.comparing import RunsCompared
from studio.results.inspection.error_parts import ErrorSplit
from studio.results.inspection.tables import Cell, Table, Viewed
from studio.results.rig.study import RunRig
from studio.results.uncertainty.half_widths import RunUncertainty

MOST_ROWS = 40
CSV = click.option(
    "--csv", "file", type=click.Path(path_type=Path), metavar="FILE", help="Write the tables to a CSV file."
)

LAYER = click.option(
    "--layer",
    type=click.IntRange(1),
    help="The layer, counted from 1 as in the tables; default: the last one. --json has its index, from 0.",
)


@command_of(view, LAYER, CSV, without=("layer",))
def view_command(call: Call, layer: int | None, file: Path | None) -> dict[str, object]:
    shown: Viewed = call(**({} if layer is None else {"layer": layer - 1}))
    caption = inspected(call.given["run"]).caption(call.given.get("frame"))
    return _answer(shown.tables, shown.notes, caption, file)


@command_of(why)
def why_command(call: Call) -> dict[str, object]:
    opened = inspected(call.given["run"])
    frame = call.given.get("frame")
    frame = worst_frame(opened) if frame is None else frame
    shown: Viewed = call(frame=frame)
    lines = [opened.caption(frame), *shown.notes, *(f"- {finding.words}" for finding in shown.findings)]
    lines += [f"May help: {remedy.title}. {remedy.words}{_set(remedy.settings)}" for remedy in shown.remedies]
    return {
        "frame": frame,
        "findings": list(shown.findings),
        "remedies": list(shown.remedies),
        "notes": list(shown.notes),
        "text": "\n".join(lines),
    }


def _set(settings: Mapping[str, object]) -> str:
    pairs = [f"--set {name}={value}" for name, value in settings.items()]
    return f" ({' '.join(pairs)})" if pairs else ""


@command_of(seeds)
def seeds_command(call: Call) -> dict[str, object]:
    shown: Viewed = call()
    kept = [table for table in shown.tables if table.name in ("limbs", "seeds")]
    caption = inspected(call.given["run"]).caption(call.given["frame"])
    return _answer(kept, shown.notes, caption, None)


@command_of(split_error, CSV)
def split_error_command(call: Call, file: Path | None) -> dict[str, object]:
    split: ErrorSplit = call()
    parts = view(call.given["run"], "why").table("parts")
    caption = inspected(call.given["run"]).caption()
    return _answer([parts], (split.words,), caption, file) | {"mean": split.mean}


@command_of(uncertainty, CSV)
def uncertainty_command(call: Call, file: Path | None) -> dict[str, object]:
    known: RunUncertainty = call()
    shown = view(call.given["run"], "uncertainty")
    return _answer(shown.tables, known.words, inspected(call.given["run"]).caption(), file)


@command_of(rig, CSV)
def rig_command(call: Call, file: Path | None) -> dict[str, object]:
    known: RunRig = call()
    assert known.study is not None
    caption = inspected(call.given["run"]).caption()
    tables = {one.name: one for one in known.study.tables()}
    present = known.study.present.name
    own = [row for row in tables["joints"].rows if row[0] == present]
    best = sorted(tables["places"].rows, key=lambda row: row[-1] or len(tables["places"].rows))
    shown = {
        **tables,
        "joints": replace(tables["joints"], title="By joint, as the rig is", rows=own),
        "places": replace(tables["places"], rows=[row for row in best if row[-1]]),
    }
    text = _answer([*shown.values()], known.words, caption, file)["text"]
    return _answer([*tables.values()], known.words, caption, file) | {"text": text}


@command_of(compare_runs, CSV)
def compare_runs_command(call: Call, file: Path | None) -> dict[str, object]:
    compared: RunsCompared = call()
    return _answer(compared.tables, (), f"Runs {', '.join(compared.runs)}.", file)


def _answer(
    tables: Sequence[Table], notes: Sequence[str], caption: str, file: Path | None
) -> dict[str, object]:
    if file is not None:
        write_tables(tables, caption, file)
    shown = [_draw(table) for table in tables if table.rows] if file is None else [f"{file}"]
    return {
        "caption": caption,
        "notes": list(notes),
        "tables": {table.name: table.records() for table in tables},
        "text": "\n".join([caption, *notes, *shown]),
    }


def _draw(table: Table) -> str:
    """A table for a terminal, its first rows."""
    drawn = Drawn(title=table.title, title_justify="left")
    for column in table.columns:
        drawn.add_column(f"{column.label} ({column.unit})" if column.unit else column.label)
    for row in table.for_readers()[:MOST_ROWS]:
        drawn.add_row(*(_word(cell) for cell in row))
    out = io.StringIO()
    Console(file=out, width=160, highlight=False).print(drawn)
    left = len(table.rows) - MOST_ROWS
    return out.getvalue() + (f"… {left} rows more: --json or --csv FILE has them all.\n" if left > 0 else "")


def _word(cell: Cell) -> str:
    return "" if cell is None else f"{cell:.4g}" if isinstance(cell, float) else str(cell)
