"""The arena's page: its problems and racers, the last race in the workspace, and a race begun in the background."""

from dataclasses import dataclass
from typing import Annotated

from starlette.responses import FileResponse, Response

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.requests import Arguments, body_of
from studio.operations.arena import (
    ARENA,
    KeptRace,
    ProblemLine,
    kept_race,
    problem_line,
    problems,
    race,
    race_page,
    racers,
)
from studio.operations.jobs.comparison_run import processes_beside
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob

router = Router(prefix="/api/arena", tags=["arena"])


class RaceState(SessionJob):
    """How a race stands. measured, kept: trials run now, and kept from before."""

    measured: int = 0
    kept: int = 0

    @property
    def key(self) -> str:
        """There is one at a time."""
        return ARENA


RACE = JobKind("race", "race", RaceState, busy="A race is running; one runs at a time.", page="/arena")


@dataclass(frozen=True, slots=True)
class RacerLine:
    """A racer that is installed."""

    name: str
    label: str


@dataclass(frozen=True, slots=True)
class Arena:
    """What can be raced, the last race, and how the one stands that was begun last; null before the first."""

    problems: tuple[ProblemLine, ...]
    racers: tuple[RacerLine, ...]
    race: KeptRace | None
    job: RaceState | None


@router.get("")
def arena(app: App) -> Arena:
    """The bundled problems, the racers that are installed, and the last race in the workspace."""
    return Arena(
        tuple(map(problem_line, problems())),
        tuple(RacerLine(one.name, one.label) for one in racers()),
        kept_race(app.workspace),
        app.jobs.known(RACE, ARENA),
    )


@router.post("/race", status_code=202)
def begin_race(app: App, arguments: Annotated[Arguments, body_of(race, "RaceRequest")]) -> RaceState:
    """Begin a race in the background (`race` events). What is measured is kept as it comes: when begun again it goes on
    where it was stopped.
    """
    folder = app.workspace.root / ARENA

    def work(job: Job) -> dict[str, object]:
        done = race(**arguments, out=folder, processes=processes_beside(), progress=job.report_or_stop)
        return {"measured": done.measured, "kept": done.kept}

    return app.jobs.begin(RACE, RaceState(), work)


@router.get("/race.html", response_class=Response)
def download(app: App) -> Response:
    """The last race as one page that opens without the studio, as a download."""
    return FileResponse(race_page(app.workspace), media_type="text/html", filename="race.html")
