"""Views of a run's search: the registry, a frame's tables, a run's tables."""

from typing import Annotated

from fastapi import Depends, Query, Response

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.run_routes import RUN, RunInPath
from studio.app.server.session_routes import OpenSession
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import RunError
from studio.operations.inspecting import (
    ViewAnswer,
    ViewList,
    check_uncertainty,
    compare_runs,
    seeds,
    split_error,
    uncertainty,
    view_answer,
)
from studio.operations.inspecting import inspected as run_to_inspect
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.operations.sharing import page_text
from studio.results.inspection.comparing import RunsCompared
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.tables import Name, Selection
from studio.results.inspection.views import VIEWS

router = Router(prefix="/api", tags=["views"])


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


class SplitState(NumberedJob):
    """How long searches of a run's frames stand. Each that is done shows in view `why`. words : once all are done."""

    run: str
    frame: int | None
    words: str = ""


SPLIT = JobKind(
    "split",
    "long search of frames",
    SplitState,
    at="/api/split-error/{identifier}",
    page="/?session={session}&run={run}&panel=why",
)


class UncertaintyState(NumberedJob):
    """How a run drawn and tracked again stands. Once it is done, the view `uncertainty` has its numbers."""

    run: str


UNCERTAINTY = JobKind(
    "uncertainty",
    "run drawn again",
    UncertaintyState,
    at="/api/uncertainty/{identifier}",
    page="/?session={session}&run={run}&panel=views&view=uncertainty",
)


Selected = Annotated[Selection, Depends(Selection)]


def inspected_run(
    run: RunInPath,
    app: App,
    trial: Annotated[
        str, Query(max_length=32, description="A trial that is looked at in the place of its frame.")
    ] = "",
) -> InspectedRun:
    """The run that is looked into, with what was tried in one of its frames, as a dependency of routes."""
    return run_to_inspect(run, app.events.tried.tried(run, run.session_name, trial) if trial else None)


Inspected = Annotated[InspectedRun, Depends(inspected_run)]


@router.get("/views")
def views() -> ViewList:
    """All views: what each answers, what of the selection it uses, and its tables."""
    return ViewList(tuple(VIEWS.values()))


@router.get(RUN + "/frames/{frame}/views/{view}")
def frame_view(inspected: Inspected, frame: int, view: str, selection: Selected) -> ViewAnswer:
    """A view's tables of a frame. Before a job has ended the tables of `seeds` are empty."""
    return view_answer(inspected, view, selection, frame)


@router.get(RUN + "/views/{view}")
def run_view(inspected: Inspected, view: str, selection: Selected) -> ViewAnswer:
    """A view's tables of the whole run; none for a view that shows single frames only."""
    return view_answer(inspected, view, selection)


@router.get(RUN + "/shared.html", response_class=Response)
def shared(
    session: OpenSession,
    run: RunInPath,
    frame: Annotated[int | None, Query(ge=0, le=LARGEST, description="Default: the run's worst one.")] = None,
    track: Name = "",
    clouds: Annotated[
        tuple[int, ...], Query(max_length=11, description="Frames whose particles are in the page, too.")
    ] = (),
) -> Response:
    """The run as one page that opens without the studio."""
    _, text = page_text(run, frame, track, clouds)
    return files.download(text, f"{session.name}-{run.name}.html", "text/html; charset=utf-8")


@router.post(RUN + "/frames/{frame}/seeds", status_code=202)
def begin_seeds(
    session: OpenSession,
    run: RunInPath,
    frame: int,
    arguments: Annotated[Arguments, body_of(seeds, "SeedsRequest", without=("frame",))],
    inspected: Inspected,
    app: App,
) -> SeedsState:
    """Begin to search a frame, or a trial of it, with other seeds. Ask for its state, or wait for `seeds` events."""
    inspected.frame(frame)

    def work(job: Job) -> dict[str, object]:
        seeds(run, frame, **arguments, tried=inspected.tried, progress=job.report_or_stop)
        return {}

    return app.jobs.begin(SEEDS, SeedsState(session=session.name, run=run.name, frame=frame), work)


add_job_routes(router, "/seeds/{identifier}", SEEDS)


@router.post(RUN + "/split-error", status_code=202)
def begin_split(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(split_error, "SplitRequest")],
    app: App,
) -> SplitState:
    """Begin to search frames for long. Ask for its state, or wait for `split` events."""
    frame = arguments.get("frame")
    if frame is not None:
        run_to_inspect(run).frame(frame)

    def work(job: Job) -> dict[str, object]:
        return {"words": split_error(run, **arguments, progress=job.report_or_stop).words}

    state = SplitState(session=session.name, run=run.name, frame=frame)
    return app.jobs.begin(SPLIT, state, work)


add_job_routes(router, "/split-error/{identifier}", SPLIT)


@router.post(RUN + "/uncertainty", status_code=202)
def begin_uncertainty(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(uncertainty, "UncertaintyRequest")],
    app: App,
) -> UncertaintyState:
    """Begin to draw and track a run again. Ask for its state, or wait for `uncertainty` events."""
    check_uncertainty(run)

    def work(job: Job) -> dict[str, object]:
        uncertainty(run, **arguments, progress=job.report_or_stop)
        return {}

    return app.jobs.begin(UNCERTAINTY, UncertaintyState(session=session.name, run=run.name), work)


add_job_routes(router, "/uncertainty/{identifier}", UNCERTAINTY)


@router.get("/compared-runs")
def compared_runs(
    app: App, run: Annotated[list[str], Query(max_length=6, description="Two to six runs, as SESSION/RUN.")]
) -> RunsCompared:
    """Stored runs side by side: curves over frames, settings that differ, the worst frame of each."""
    folders: list[str] = []
    for entry in run:
        owner, slash, name = entry.partition("/")
        if not slash:
            raise RunError(f"'{entry[:80]}' names no run.", "Write SESSION/RUN, such as walk/run-1.")
        folders.append(str(app.workspace.session(owner).run(name).folder))
    return compare_runs(folders)
