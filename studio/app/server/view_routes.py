"""Views of a run's search: the registry, a frame's tables, a run's tables."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response
from pydantic import BeforeValidator, Field

from studio.app.server import files
from studio.app.server.app_state import App
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.run_routes import RUN, OpenRun
from studio.app.server.schemas import Answer, finite
from studio.app.server.session_routes import OpenSession
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import RunError
from studio.operations.inspecting import seeds, worst_frame
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.results.inspection.comparing import compare_stored
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.seeds import search_seeds
from studio.results.inspection.shared_page import shared_page
from studio.results.inspection.tables import Column, Remedy, Selection, View, Viewed
from studio.results.inspection.views import VIEWS, look, look_over, view_named

router = APIRouter(prefix="/api", tags=["views"])


Cell = Annotated[bool | int | float | str | None, BeforeValidator(finite)]


class ViewList(Answer):
    """All views, in the order in which a person looks at them."""

    views: list[View]


class TableView(Answer):
    """A table; each row has a cell a column."""

    name: str
    title: str
    columns: tuple[Column, ...]
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


class ViewAnswer(Answer):
    """A view's tables, and the sentences and remedies of `why`. frame: null in the answer for a whole run.
    search_layers, searches: layers of one search of the frame, and how many searches it has; 0 for a whole run.
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
    notes: list[str]
    tables: list[TableView]
    findings: list[FindingView] = Field(default_factory=list[FindingView])
    remedies: tuple[Remedy, ...] = ()


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


SEEDS = JobKind(
    "seeds",
    "search with other seeds",
    SeedsState,
    at="/api/seeds/{identifier}",
    page="/?session={session}&run={run}&frame={frame}&panel=views&view=seeds",
)


Name = Annotated[str, Query(max_length=64)]


def selection_of(
    layer: Annotated[int | None, Query(ge=0, le=LARGEST, description="Default: the last one.")] = None,
    parameter: Name = "",
    limb: Name = "",
    particle: Annotated[int | None, Query(ge=0, le=LARGEST)] = None,
    camera: Name = "",
    track: Annotated[str, Query(max_length=64, description="Whose pose; default: raw.")] = "",
    second: Annotated[str, Query(max_length=64, description="Another parameter, for a plane.")] = "",
    towards: Annotated[
        str,
        Query(max_length=64, description="End of a line: truth, mean, mode, searched, particle or a track."),
    ] = "",
) -> Selection:
    """What is selected on the page, as a dependency of routes."""
    return Selection(layer, parameter, limb, particle, camera, track, second, towards)


Selected = Annotated[Selection, Depends(selection_of)]


def inspected_run(
    session: OpenSession,
    run: OpenRun,
    app: App,
    trial: Annotated[
        str, Query(max_length=32, description="A trial that is looked at in the place of its frame.")
    ] = "",
) -> InspectedRun:
    """The run that is looked into, with what was tried in one of its frames, as a dependency of routes."""
    return InspectedRun(session, run, app.events.tried.tried(run, session.name, trial) if trial else None)


Inspected = Annotated[InspectedRun, Depends(inspected_run)]


@router.get("/views")
def views() -> ViewList:
    """All views: what each answers, what of the selection it uses, and its tables."""
    return ViewList(views=list(VIEWS.values()))


@router.get(RUN + "/frames/{frame}/views/{view}")
def frame_view(inspected: Inspected, frame: int, view: str, selection: Selected) -> ViewAnswer:
    """A view's tables of a frame. Before a job has ended the tables of `seeds` are empty."""
    return _answer(inspected, view, look(inspected, frame, view, selection), frame)


@router.get(RUN + "/views/{view}")
def run_view(inspected: Inspected, view: str, selection: Selected) -> ViewAnswer:
    """A view's tables of the whole run; none for a view that shows single frames only."""
    return _answer(inspected, view, look_over(inspected, view, selection), None)


@router.get(RUN + "/shared.html", response_class=Response)
def shared(
    session: OpenSession,
    run: OpenRun,
    frame: Annotated[int | None, Query(ge=0, le=LARGEST, description="Default: the run's worst one.")] = None,
    track: Name = "",
    clouds: Annotated[
        tuple[int, ...], Query(max_length=11, description="Frames whose particles are in the page, too.")
    ] = (),
) -> Response:
    """The run as one page that opens without the studio."""
    opened = InspectedRun(session, run)
    chosen = worst_frame(opened) if frame is None else frame
    text = shared_page(opened, chosen, track=track, clouds=clouds)
    return files.download(text, f"{session.name}-{run.name}.html", "text/html; charset=utf-8")


@router.post(RUN + "/frames/{frame}/seeds", status_code=202)
def begin_seeds(
    session: OpenSession,
    run: OpenRun,
    frame: int,
    arguments: Annotated[Arguments, body_of(seeds, "SeedsRequest", without=("frame",))],
    inspected: Inspected,
    app: App,
) -> SeedsState:
    """Begin to search a frame, or a trial of it, with other seeds. Ask for its state, or wait for `seeds` events."""
    inspected.frame(frame)

    def work(job: Job) -> dict[str, object]:
        if inspected.tried is None:
            seeds(run, frame, **arguments, progress=job.report_or_stop)
        else:
            search_seeds(inspected, frame, int(arguments["count"]), job.report_or_stop)
        return {}

    return app.jobs.begin(SEEDS, SeedsState(session=session.name, run=run.name, frame=frame), work)


add_job_routes(router, "/seeds/{identifier}", SEEDS)


@router.get("/compared-runs")
def compared_runs(
    app: App,
    run: Annotated[list[str], Query(max_length=6, description="Two to six runs, as SESSION/RUN.")],
) -> RunsComparedView:
    """Stored runs side by side: curves over frames, settings that differ, the worst frame of each."""
    opened: list[InspectedRun] = []
    for entry in run:
        owner, slash, name = entry.partition("/")
        if not slash:
            raise RunError(f"'{entry[:80]}' names no run.", "Write SESSION/RUN, such as walk/run-1.")
        session = app.workspace.session(owner)
        opened.append(InspectedRun(session, session.run(name)))
    return RunsComparedView.model_validate(compare_stored(opened))


def _answer(run: InspectedRun, name: str, viewed: Viewed, frame: int | None) -> ViewAnswer:
    view = view_named(name)
    return ViewAnswer(
        view=name,
        title=view.title,
        question=view.question,
        caption=run.caption(frame),
        session=run.session.name,
        run=run.run.name,
        frame=frame,
        search_layers=viewed.search_layers,
        searches=viewed.searches,
        notes=list(viewed.notes),
        tables=[TableView.model_validate(table) for table in viewed.tables],
        findings=[FindingView.model_validate(finding) for finding in viewed.findings],
        remedies=viewed.remedies,
    )
