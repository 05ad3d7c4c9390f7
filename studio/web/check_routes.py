"""How well a run's track fits its pictures: measured in the background (`track` events, verb "check"), and kept."""

import asyncio
from typing import Annotated

from fastapi import APIRouter

from studio.operations.results import check as check_run
from studio.runs.checking import RunCheck, kept_check
from studio.runs.tracks import BEST, best_track, read_track, track_named
from studio.web.check_schemas import CheckAnswer, CheckLine, JumpLine
from studio.web.doors import Door
from studio.web.job_routes import begin_job
from studio.web.requests import Asked, body_of
from studio.web.run_routes import RUN, OpenRun
from studio.web.session_routes import OpenSession
from studio.web.track_schemas import TrackJobState
from studio.worker.jobs import Job

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
    session: OpenSession, run: OpenRun, asked: Annotated[Asked, body_of(check_run, "CheckWish")], doors: Door
) -> TrackJobState:
    """Measure a track in every so-many-th frame."""
    name = await asyncio.to_thread(track_named, run, asked.get("track", BEST))
    await asyncio.to_thread(read_track, run, name)

    def work(job: Job) -> dict[str, object]:
        check_run(run, name, every=asked["every"], progress=job.report_or_stop)
        return {"track": name}

    return begin_job(doors, "check", session, run, work)


def _line(found: RunCheck) -> CheckLine:
    return CheckLine(
        cameras=list(found.cameras),
        frames=list(found.frames),
        inside=[list(row) for row in found.inside],
        covered=[list(row) for row in found.covered],
        poor=list(found.poor),
        lost=list(found.lost),
        doubtful=list(found.doubtful),
        turned=list(found.turned),
        jitter_mm=found.jitter_mm,
        jumps=[JumpLine.model_validate(jump) for jump in found.jumps or ()],
        lost_limbs={limb: list(frames) for limb, frames in found.lost_limbs.items()},
        inside_mean=found.inside_mean,
        good=found.good,
        words=found.in_words(),
    )
