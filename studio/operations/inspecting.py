"""Looking into a run: views of its search, why a frame failed, other seeds, runs side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from studio.foundations.csv_text import as_csv
from studio.foundations.declaring import LARGEST, Terminal, Web, operation, taking
from studio.foundations.errors import RunError
from studio.operations.opening import RunName, keeping_in_place, open_run, session_of
from studio.operations.progress import Reporting, reporting
from studio.results.inspection.comparing import RunsCompared, compare_stored
from studio.results.inspection.error_parts import ErrorSplit, split_of
from studio.results.inspection.limbs import disagreements_of, errors_of
from studio.results.inspection.long_search import EVALUATIONS, frames_to_split, search_frames
from studio.results.inspection.reading import InspectedRun, TriedFrame
from studio.results.inspection.seeds import search_seeds
from studio.results.inspection.tables import FrameFinding, Remedy, Selection, Table, View, Viewed
from studio.results.inspection.views import VIEWS, look, look_over, view_named
from studio.results.uncertainty.half_widths import RunUncertainty, frames_of_twin, measure_uncertainty
from studio.sessions.atomic_files import write_bytes

ViewName = Annotated[
    str, Field(description=f"Which: {', '.join(VIEWS)}."), Terminal("--view", metavar="NAME")
]
Frame = Annotated[int, Field(ge=0, le=LARGEST, description="The frame."), Terminal("--frame")]


@dataclass(frozen=True, slots=True)
class ViewList:
    """All views, in the order in which to read them."""

    views: tuple[View, ...]


@dataclass(frozen=True, slots=True)
class ViewAnswer:
    """A view's tables, and the sentences and remedies of `why`.

    frame : null in the answer for a whole run.
    search_layers, searches : layers of one search of the frame, and how many searches it has; 0 for a whole run.
    """

    view: str
    title: str
    question: str
    caption: str
    session: str
    run: str
    frame: int | None
    search_layers: int
    searches: int
    notes: tuple[str, ...]
    tables: tuple[Table, ...]
    findings: tuple[FrameFinding, ...] = ()
    remedies: tuple[Remedy, ...] = ()


def inspected(run: RunName, tried: TriedFrame | None = None) -> InspectedRun:
    """A run that can be looked into.

    tried : a trial, in place of the stored frame of its number.

    Raises RunError, NotFoundError.
    """
    stored = open_run(run)
    return InspectedRun(session_of(stored), stored, tried)


@operation
@taking(Selection)
@keeping_in_place
def view(
    run: RunName,
    name: ViewName,
    frame: Annotated[
        int | None, Field(ge=0, le=LARGEST, description="The frame; default: the tables of the whole run.")
    ] = None,
    **selected: Any,  # noqa: ANN401 - of the types that are declared
) -> Viewed:
    """Show the inside of a run's search: the tables of a view, of a frame or of the whole run.

    Raises NotFoundError for an unknown view, frame, layer or name.
    """
    return _look(inspected(run), name, frame, Selection(**selected))


def _look(run: InspectedRun, name: str, frame: int | None, selection: Selection) -> Viewed:
    return look_over(run, name, selection) if frame is None else look(run, frame, name, selection)


def view_answer(run: InspectedRun, name: str, selection: Selection, frame: int | None = None) -> ViewAnswer:
    """A view with what a page writes beside it: its question, and a caption of run and frame. Raises NotFoundError."""
    shown, entry = _look(run, name, frame, selection), view_named(name)
    return ViewAnswer(
        view=name,
        title=entry.title,
        question=entry.question,
        caption=run.caption(frame),
        session=run.session.name,
        run=run.run.name,
        frame=frame,
        search_layers=shown.search_layers,
        searches=shown.searches,
        notes=shown.notes,
        tables=shown.tables,
        findings=shown.findings,
        remedies=shown.remedies,
    )


@operation
@keeping_in_place
def why(
    run: RunName,
    frame: Annotated[
        int | None, Field(ge=0, le=LARGEST, description="The frame; default: the run's worst one.")
    ] = None,
    *,
    track: Annotated[
        str, Field(description="The track whose pose is explained; default: raw, the search's own.")
    ] = "",
) -> Viewed:
    """Say why a frame failed and what may help: findings and remedies, from measurements.

    Raises RunError for a run without frames.
    """
    opened = inspected(run)
    return look(opened, worst_frame(opened) if frame is None else frame, "why", Selection(track=track))


def worst_frame(run: InspectedRun) -> int:
    """The frame whose worst limb is farthest off; without a truth the one that disagrees most with the silhouettes.

    Raises RunError for a run without frames.
    """
    known = errors_of(run) or disagreements_of(run)
    if not known:
        raise RunError(f"Run '{run.run.name}' has no finished frame.", "Track it first.")
    return max(known, key=lambda number: max(known[number].values(), default=0.0))


@operation
@keeping_in_place
def seeds(
    run: RunName,
    frame: Frame,
    *,
    count: Annotated[int, Field(ge=2, le=64, description="Number of other seeds.")] = 8,
    tried: Annotated[
        TriedFrame | None,
        Field(description="A trial of the frame, instead of the stored result."),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None,
    progress: Reporting = None,
) -> Viewed:
    """Search a stored frame again with other seeds: spread within and between them. The run is not changed.

    Raises NotFoundError for a frame that is not finished.
    """
    opened = inspected(run, tried)
    with reporting(progress, f"{opened.session.name} / {opened.run.name}: seeds") as report:
        search_seeds(opened, frame, count, report)
    return look(opened, frame, "seeds", Selection())


@operation
@keeping_in_place
def split_error(
    run: RunName,
    *,
    frame: Annotated[
        int | None,
        Field(ge=0, le=LARGEST, description="This frame alone; default: some, evenly spread."),
        Terminal("--frame"),
    ] = None,
    count: Annotated[int, Field(ge=1, le=1000, description="Number of frames, evenly spread.")] = 8,
    evaluations: Annotated[
        int, Field(ge=1000, le=10_000_000, description="Poses that each climb of a frame weighs.")
    ] = EVALUATIONS,
    again: Annotated[
        bool, Field(description="Also search frames whose long search is kept, as after a change of knobs.")
    ] = False,
    progress: Reporting = None,
) -> ErrorSplit:
    """Say whose fault the error is: the search's, the likelihood's, or the body's.

    Frames are searched far longer than the run searched them, some seconds each. That is kept with the run, whose
    result is not changed; frames that were searched as long before are not searched again. With a truth the parts are
    in mm and add up to the error; without one only the search's part is known. Ctrl-C ends it, and frames that are
    done are kept.

    Raises RunError for a run without frames, NotFoundError for a frame that is not finished.
    """
    opened = inspected(run)
    chosen = frames_to_split(opened, count) if frame is None else [frame]
    with reporting(progress, f"{opened.session.name} / {opened.run.name}: searching for long") as report:
        search_frames(opened, chosen, evaluations, report, again=again)
    return split_of(opened)


@operation
@keeping_in_place
def uncertainty(
    run: RunName,
    *,
    again: Annotated[
        bool, Field(description="Also where it was measured before and the run has not changed.")
    ] = False,
    progress: Reporting = None,
) -> RunUncertainty:
    """Say how far off each joint may be: half widths of 50, 80 and 95 %.

    The run is drawn again, with masks as wrong as its own, and tracked as it was, which takes about twice as long as
    the run took. There the truth is known, and the errors give the half widths. They are kept with the run, and
    exported with its points. Ctrl-C ends it.

    Raises RunError for a run of which too much would be promised, and says why.
    """
    opened = inspected(run)
    with reporting(progress, f"{opened.session.name} / {opened.run.name}: drawn again") as report:
        return measure_uncertainty(opened, report, again=again)


def check_uncertainty(run: RunName) -> None:
    """Raise RunError for a run whose joints' half widths cannot be promised."""
    frames_of_twin(inspected(run))


@operation
def compare_runs(
    runs: Annotated[
        Sequence[str],
        Field(description="Two to six stored runs, as SESSION/RUN."),
        Terminal(metavar="SESSION/RUN..."),
        Web(left_out=True),
    ],
) -> RunsCompared:
    """Put two to six stored runs side by side: curves over frames, settings that differ, the worst frame of each.

    Raises RunError for fewer or more runs, or for one without frames.
    """
    return compare_stored([inspected(run) for run in runs])


def write_tables(tables: Sequence[Table], caption: str, file: Path) -> None:
    """Write tables to a CSV file. Raises SessionError where that fails."""
    write_bytes(file, tables_csv(tables, caption).encode())


def tables_csv(tables: Sequence[Table], caption: str) -> str:
    """The tables one after the other: caption and titles as comments, units in the head."""
    # A line break within, of a run's record, would begin a cell.
    parts = [f"# {' '.join(caption.split())}\n"]
    for table in tables:
        heads = [f"{one.key} [{one.unit}]" if one.unit else one.key for one in table.columns]
        rows = [["" if cell is None else cell for cell in row] for row in table.for_readers()]
        parts.append(f"# {table.name}: {table.title}\n{as_csv([heads, *rows])}")
    return "".join(parts)
