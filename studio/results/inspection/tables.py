"""What a view of a run answers: tables of exact numbers, which the page draws, reads aloud and writes as CSV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Annotated, Any

from pydantic import Field

from studio.foundations.declaring import LARGEST

Cell = bool | int | float | str | None
"""NaN and infinities are None in an answer."""
Row = Sequence[Cell]


SHOWN_ROWS = 40
"""In a notebook."""


LAYER = "layer"
"""Key of the columns that hold a layer's index, from 0 as in the arrays of Python and in addresses."""


def _word(cell: Cell) -> str:
    return "" if cell is None else f"{cell:.4g}" if isinstance(cell, float) else str(cell)


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table. key : its name in files. unit : "mm", "rad", "nats", …, "" for a number without one;
    of a column whose rows differ, "" as well: then the table has a column "unit".
    """

    key: str
    label: str
    unit: str = ""


COMMON = {
    column.key: column
    for column in (
        Column("frame", "Frame"),
        Column(LAYER, "Layer"),
        Column("parameter", "Parameter"),
        Column("limb", "Limb"),
        Column("unit", "Unit"),
        Column("particle", "Particle"),
        Column("camera", "Camera"),
        Column("term", "Term"),
        Column("log_weight", "Log weight", "nats"),
    )
}
"""Columns that many tables have, by key."""


@dataclass(frozen=True, slots=True)
class TableKind:
    """A table that a view has. of_run : it belongs to the run, not to one frame. each : what further columns there is
    one of: "parameter" or "" for none.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    of_run: bool = False
    each: str = ""


def table(
    name: str, title: str, *columns: str | tuple[str, ...], of_run: bool = False, each: str = ""
) -> TableKind:
    """A table of a view. columns : common ones by key, others as (key, label) or (key, label, unit)."""
    made = tuple(COMMON[entry] if isinstance(entry, str) else Column(*entry) for entry in columns)
    return TableKind(name, title, made, of_run, each)


@dataclass(frozen=True, slots=True)
class View:
    """One way of looking into a run. question : what it answers. uses : entries of the selection that it reads.

    tables : those of a frame and, `of_run`, those of the whole run. evaluates : it evaluates the likelihood again.
    is_job : its numbers are computed by a job (verb `seeds`); until one has ended its tables are empty.
    """

    name: str
    title: str
    question: str
    uses: tuple[str, ...]
    tables: tuple[TableKind, ...]
    evaluates: bool = False
    is_job: bool = False

    @property
    def frame_tables(self) -> tuple[TableKind, ...]:
        return tuple(kind for kind in self.tables if not kind.of_run)

    @property
    def run_tables(self) -> tuple[TableKind, ...]:
        return tuple(kind for kind in self.tables if kind.of_run)


@dataclass(frozen=True, slots=True)
class Table:
    """A table with its rows, each as long as its columns."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Row]

    def column(self, key: str) -> list[Cell]:
        """The cells of a column. Raises ValueError for a key that is none."""
        place = [entry.key for entry in self.columns].index(key)
        return [row[place] for row in self.rows]

    def for_readers(self) -> list[list[Cell]]:
        """The rows as people read them: layers, whose numbers are indices here, are counted from 1."""
        layers = {at for at, entry in enumerate(self.columns) if entry.key == LAYER}
        return [
            [cell + 1 if at in layers and isinstance(cell, int) else cell for at, cell in enumerate(row)]
            for row in self.rows
        ]

    def as_html(self) -> str:
        """The table, its first rows."""
        head = "".join(
            f"<th>{escape(one.label)}{f' ({one.unit})' if one.unit else ''}</th>" for one in self.columns
        )
        body = "".join(
            f"<tr>{''.join(f'<td>{escape(_word(cell))}</td>' for cell in row)}</tr>"
            for row in self.for_readers()[:SHOWN_ROWS]
        )
        left = len(self.rows) - SHOWN_ROWS
        more = f"<caption>{left} rows more</caption>" if left > 0 else ""
        return f"<h4>{escape(self.title)}</h4><table>{more}<tr>{head}</tr>{body}</table>"

    _repr_html_ = as_html

    def records(self) -> list[dict[str, Cell]]:
        return [dict(zip((entry.key for entry in self.columns), row, strict=True)) for row in self.rows]


Name = Annotated[str, Field(max_length=64)]


@dataclass(frozen=True, slots=True)
class Selection:
    """What is selected in a run's search; each view uses a part of it. "" and None: nothing."""

    layer: Annotated[
        int | None, Field(ge=0, le=LARGEST, description="Its index, from 0; default: the last one.")
    ] = None
    parameter: Annotated[Name, Field(description="A parameter of the body.")] = ""
    limb: Annotated[Name, Field(description="A limb of the body.")] = ""
    particle: Annotated[int | None, Field(ge=0, le=LARGEST, description="A particle of the layer.")] = None
    camera: Annotated[Name, Field(description="A camera.")] = ""
    track: Annotated[
        Name, Field(description="The track whose pose is shown; default: raw, the search's own.")
    ] = ""
    second: Annotated[Name, Field(description="Another parameter, for a plane of the landscape.")] = ""
    towards: Annotated[
        Name,
        Field(description="End of a line in the landscape: truth, mean, mode, searched, particle, a track."),
    ] = ""


@dataclass(frozen=True, slots=True)
class Remedy:
    """Something that may help.

    title : for a button.
    words : why.
    settings : knobs to change, by name.
    action : what else to do, as a machine reads it ("start pose", "calibrate", "masks", "correct sides"); "" where the
        knobs are all.
    frame : the first frame of the trial, where that is not the frame in question.
    """

    title: str
    words: str
    settings: Mapping[str, bool | int | float | str] = field(default_factory=dict[str, Any])
    action: str = ""
    frame: int | None = None


@dataclass(frozen=True, slots=True)
class FrameFinding:
    """One finding about a frame.

    kind : see `why`.
    words : a sentence.
    numbers : that it rests on.
    is_cause : whether it is the main cause.
    layer : its index.
    frame : to look at, where that is another one.
    """

    kind: str
    words: str
    limb: str = ""
    layer: int | None = None
    camera: str = ""
    term: str = ""
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])
    is_cause: bool = False
    frame: int | None = None


@dataclass(frozen=True, slots=True)
class Viewed:
    """A view's content.

    notes : what a reader has to know of the numbers.
    findings, remedies : of `why` only.
    search_layers, searches : layers of one search of the frame, and how many searches it has; 0 for a whole run.
    """

    tables: tuple[Table, ...]
    notes: tuple[str, ...] = ()
    findings: tuple[FrameFinding, ...] = ()
    remedies: tuple[Remedy, ...] = ()
    search_layers: int = 0
    searches: int = 0

    def table(self, name: str) -> Table:
        """A table by its name. Raises ValueError."""
        return self.tables[[entry.name for entry in self.tables].index(name)]

    def _repr_html_(self) -> str:
        """What was found, as a notebook shows it."""
        words = [entry.words for entry in self.findings] + [
            f"May help: {entry.title}." for entry in self.remedies
        ]
        lines = "".join(f"<p>{escape(line)}</p>" for line in (*self.notes, *words))
        return lines + "".join(table.as_html() for table in self.tables)


Rows = Mapping[str, Sequence[Row]]
"""Rows by table."""


@dataclass(frozen=True, slots=True)
class ViewResult:
    """What a view's function found: rows by table, and the notes beside them."""

    rows: Rows
    notes: tuple[str, ...] = ()
    findings: tuple[FrameFinding, ...] = ()
    remedies: tuple[Remedy, ...] = ()
