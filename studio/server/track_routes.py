"""Tracks of a run: listed, made in the background with progress as `track` events, downloaded; runs corrected."""

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Response

from studio.jobs.job_runner import Job
from studio.knobs import changed, knobs_of
from studio.operations.results import refine, smooth
from studio.operations.tracking import correct, corrected_run
from studio.runs.correcting import track_backwards
from studio.runs.refining import (
    REFINED,
    SMOOTHED,
    MadeTrack,
    check_making,
    jitter,
)
from studio.runs.tracks import read_track, track_names
from studio.server.app_state import App
from studio.server.job_kinds import TRACK
from studio.server.job_routes import add_job_routes, begin_job
from studio.server.requests import Arguments, body_of
from studio.server.run_errors import evaluation_of
from studio.server.run_routes import RUN, OpenRun
from studio.server.session_routes import OpenSession
from studio.server.setting_views import knob_view
from studio.server.track_schemas import (
    TrackJobState,
    TrackLine,
    TrackList,
)
from studio.sessions.named_rows import poses_csv
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.trackers.refinement import RefinementSettings
from studio.trackers.smoothing import SmoothingSettings

router = APIRouter(prefix="/api", tags=["tracks"])


@router.get(RUN + "/tracks")
def tracks(session: OpenSession, run: OpenRun, app: App) -> TrackList:
    """The run's tracks with how much they jitter and, where there is a truth, how far off they are."""
    lines = [_line(session, run, name) for name in track_names(run)]
    going = [state for state in app.jobs.going(TRACK, session.name) if state.run == run.name]
    return TrackList(
        tracks=lines,
        running=going,
        refine_settings=[knob_view(entry) for entry in knobs_of(RefinementSettings)],
        smooth_settings=[knob_view(entry) for entry in knobs_of(SmoothingSettings)],
    )


@router.get(RUN + "/tracks/{track}/poses.csv", response_class=Response)
def track_csv(session: OpenSession, run: OpenRun, track: str) -> Response:
    """A track's poses: frame, then one column per parameter in the body's order (radians and mm)."""
    found = read_track(run, track)
    name = f"{session.name}-{run.name}-{found.name}-poses.csv"
    return Response(
        poses_csv(run.record.parameters, found.frames, found.poses),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


@router.post(RUN + "/refine", status_code=202)
async def begin_refining(
    session: OpenSession,
    run: OpenRun,
    arguments: Annotated[Arguments, body_of(refine, "RefineRequest")],
    app: App,
) -> TrackJobState:
    """Refine a track on the silhouettes. Ask for the state, or wait for `track` events."""
    changed(RefinementSettings(), arguments["knobs"])
    check_making(run, arguments.get("source", ""), arguments.get("into", REFINED), arguments["replace"])

    def work(job: Job) -> dict[str, Any]:
        return _answer(refine(run, **arguments, progress=job.report_or_stop))

    return begin_job(app, "refine", session, run, work)


@router.post(RUN + "/smooth", status_code=202)
async def begin_smoothing(
    session: OpenSession,
    run: OpenRun,
    arguments: Annotated[Arguments, body_of(smooth, "SmoothRequest")],
    app: App,
) -> TrackJobState:
    """Smooth a track in time."""
    changed(SmoothingSettings(), arguments["knobs"])
    check_making(run, arguments.get("source", ""), arguments.get("into", SMOOTHED), arguments["replace"])

    def work(_job: Job) -> dict[str, Any]:
        return _answer(smooth(run, **arguments))

    return begin_job(app, "smooth", session, run, work)


@router.post(RUN + "/correct", status_code=202)
async def begin_correction(
    session: OpenSession,
    run: OpenRun,
    arguments: Annotated[Arguments, body_of(correct, "CorrectionRequest")],
    app: App,
) -> TrackJobState:
    """Make a run that begins anew in a frame. Forwards it is ready to be started; backwards it is tracked here."""
    made = await asyncio.to_thread(corrected_run, run, **arguments, source="set in the studio")
    app.events.session_changed(session.name, made.name)

    def work(job: Job) -> dict[str, Any]:
        if "back_to" in arguments:
            moved = track_backwards(session, made, job.report, job.cancelled)
            return {
                "made_run": made.name,
                "moved": moved,
                "state": "cancelled" if job.cancelled() else "done",
            }
        return {"made_run": made.name}

    return begin_job(app, "correct", session, run, work)


add_job_routes(router, "/track-jobs/{identifier}", TRACK)


def _line(session: Session, run: StoredRun, name: str) -> TrackLine:
    track = read_track(run, name, blobs=False)
    line = TrackLine(name=name, frames=len(track.frames), made_by=dict(track.made_by))
    if not len(track.frames):
        return line
    line.jitter_mm = jitter(run, track)
    found = evaluation_of(session, run, name, blobs=False)
    if found is not None:
        line.mean_mm, line.worst_mm = found.mean_mm, found.worst_mm
        line.mean_angle_deg, line.mean_direction_deg = found.mean_angle_deg, found.mean_direction_deg
    return line


def _answer(made: MadeTrack) -> dict[str, Any]:
    return {
        "track": made.track.name,
        "jitter_before_mm": made.jitter_before,
        "jitter_after_mm": made.jitter_after,
        "moved": made.moved,
        "filled": len(made.filled),
        "left_out": len(made.left_out),
    }
