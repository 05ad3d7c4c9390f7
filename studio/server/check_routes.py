"""How well a run's track fits its pictures: measured in the background (`track` events, verb "check"), and kept."""

import asyncio
from typing import Annotated

from fastapi import APIRouter

from studio.jobs.job_runner import Job
from studio.operations.results import check as check_run
from studio.runs.checking import RunCheck, kept_check
from studio.runs.tracks import BEST, best_track, read_track, track_named
from studio.server.app_state import App
from studio.server.check_schemas import CheckAnswer, CheckLine
from studio.server.job_routes import begin_job
from studio.server.requests import Arguments, body_of
from studio.server.run_routes import RUN, OpenRun
from studio.server.session_routes import OpenSession
from studio.server.track_schemas import TrackJobState

router = APIRouter(prefix="/api", tags=["tracks"])


@router.get(RUN + "/check")
def check(run: OpenRun, track: str = "") -> CheckAnswer:
    """What was measured of a track as it is now (empty: the best)."""
    best = best_track(run)
    name = best.name if track in ("", BEST) else track
    read_track(run, name)
    found = kept_check(run, name)
    check = None if found is None else _line(found)
    return CheckAnswer(track=name, usual=best.name, note=best.note, check=check)


@router.post(RUN + "/check", status_code=202)
async def begin_check(
    session: OpenSession,
    run: OpenRun,
    arguments: Annotated[Arguments, body_of(check_run, "CheckRequest")],
    app: App,
) -> TrackJobState:
    """Measure a track in every so-many-th frame."""
    name = await asyncio.to_thread(track_named, run, arguments.get("track", BEST))
    await asyncio.to_thread(read_track, run, name)

    def work(job: Job) -> dict[str, object]:
        check_run(run, name, every=arguments["every"], progress=job.report_or_stop)
        return {"track": name}

    return begin_job(app, "check", session, run, work)


def _line(found: RunCheck) -> CheckLine:
    return CheckLine.of(found, jumps=found.jumps or (), words=found.in_words())
