"""Views of a run's search, as OpenAPI shows them."""

from typing import Annotated

from pydantic import BeforeValidator, Field

from studio.jobs.job_runner import NumberedJob
from studio.server.schemas import Answer, Value, finite

Cell = Annotated[bool | int | float | str | None, BeforeValidator(finite)]


class ColumnView(Answer):
    """A column. unit: mm, rad, nats, …; empty for a number without one, or where the table has a column "unit"."""

    key: str
    label: str
    unit: str


class TableKindView(Answer):
    """A table that a view has. of_run: it is in the answer for the whole run, else in that of a frame. each: what there
    is one further column of ("parameter"), or empty.
    """

    name: str
    title: str
    columns: list[ColumnView]
    of_run: bool
    each: str


class ViewLine(Answer):
    """A view. uses: what of the selection it reads. evaluates: it evaluates the likelihood again. is_job: its numbers
    come from a job; before one has ended its tables are empty.
    """

    name: str
    title: str
    question: str
    uses: list[str]
    tables: list[TableKindView]
    evaluates: bool
    is_job: bool


class ViewList(Answer):
    """All views, in the order in which a person looks at them."""

    views: list[ViewLine]


class TableView(Answer):
    """A table; each row has a cell a column."""

    name: str
    title: str
    columns: list[ColumnView]
    rows: list[list[Cell]]


class FindingView(Answer):
    """One thing that was found about a frame. kind: see the view `why`. numbers: what it rests on. is_cause: it is the
    main cause. layer: its index. frame: to look at, where that is another one.
    """

    kind: str
    words: str
    limb: str = ""
    layer: int | None = None
    camera: str = ""
    term: str = ""
    numbers: dict[str, Cell] = Field(default_factory=dict)
    is_cause: bool = False
    frame: int | None = None


class RemedyView(Answer):
    """What may help. settings: knobs to change, for a re-annealing or a new run. action: what else to do; empty where
    the knobs are all.
    """

    title: str
    words: str
    settings: dict[str, Value] = Field(default_factory=dict)
    action: str = ""


class ViewAnswer(Answer):
    """A view's tables, and the sentences and remedies of `why`. frame: null in the answer for a whole run."""

    view: str
    title: str
    question: str
    caption: str
    session: str
    run: str
    frame: int | None
    notes: list[str]
    tables: list[TableView]
    findings: list[FindingView] = Field(default_factory=list[FindingView])
    remedies: list[RemedyView] = Field(default_factory=list[RemedyView])


class RunsComparedView(Answer):
    """Runs side by side. runs: as SESSION/RUN. tables: curves (a row a run and frame), settings (what differs, a column
    a run), worst (the worst frame of each).
    """

    runs: list[str]
    tables: list[TableView]


class SeedsState(NumberedJob):
    """How a search with other seeds stands. Once it is done, the view `seeds` of that frame has its numbers."""

    run: str
    frame: int
