"""Where cameras should stand: what is known of a run's rig, and a job that finds out more."""

from typing import Annotated

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.run_routes import RUN, RunInPath
from studio.app.server.session_routes import OpenSession
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.operations.rigs import check_rig, rig, rig_so_far
from studio.results.rig.study import RunRig

router = Router(prefix="/api", tags=["views"])


class RigState(NumberedJob):
    """How a study of a run's rig stands. What is done of it is kept as it comes."""

    run: str


RIG = JobKind(
    "rig",
    "study of a rig",
    RigState,
    at="/api/rig/{identifier}",
    page="/rig?session={session}&run={run}",
)


@router.get(RUN + "/rig")
def known_rig(run: RunInPath) -> RunRig:
    """What errors to expect of a run's rig and of others, as far as that was asked."""
    return rig_so_far(run)


@router.post(RUN + "/rig", status_code=202)
def begin_rig(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(rig, "RigRequest")],
    app: App,
) -> RigState:
    """Begin to find out what other rigs' errors would be. Ask for its state, or wait for `rig` events."""
    check_rig(run, **arguments)

    def work(job: Job) -> dict[str, object]:
        rig(run, **arguments, progress=job.report_or_stop)
        return {}

    return app.jobs.begin(RIG, RigState(session=session.name, run=run.name), work)


add_job_routes(router, "/rig/{identifier}", RIG)
