"""Tracks of a run: listed, made in the background with progress as `track` events, downloaded; runs corrected."""

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Response

from studio.evaluation.errors import evaluate
from studio.knobs import changed, knobs_of
from studio.motion_files.trc import read_trc
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
from studio.sessions.named_rows import poses_csv
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.tracking.refinement import RefinementSettings
from studio.tracking.smoothing import SmoothingSettings
from studio.web.doors import Door
from studio.web.job_kinds import TRACK
from studio.web.job_routes import add_job_routes, begin_job
from studio.web.requests import Asked, body_of
from studio.web.run_routes import RUN, OpenRun
from studio.web.session_routes import OpenSession
from studio.web.setting_views import knob_view
from studio.web.track_schemas import (
    TrackJobState,
    TrackLine,
    TrackList,
)
from studio.worker.jobs import Job

router = APIRouter(prefix="/api", tags=["tracks"])


@router.get(RUN + "/tracks")
def tracks(session: OpenSession, run: OpenRun, doors: Door) -> TrackList:
    """The run's tracks with how much they jitter and, where there is a truth, how far off they are."""
    lines = [_line(session, run, name) for name in track_names(run)]
    going = [state for state in doors.jobs.going(TRACK, session.name) if state.run == run.name]
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
    session: OpenSession, run: OpenRun, asked: Annotated[Asked, body_of(refine, "RefineRequest")], doors: Door
) -> TrackJobState:
    """Refine a track on the silhouettes. Ask for the state, or wait for `track` events."""
    changed(RefinementSettings(), asked["knobs"])
    check_making(run, asked.get("source", ""), asked.get("into", REFINED), asked["replace"])

    def work(job: Job) -> dict[str, Any]:
        return _answer(refine(run, **asked, progress=job.report_or_stop))

    return begin_job(doors, "refine", session, run, work)


@router.post(RUN + "/smooth", status_code=202)
async def begin_smoothing(
    session: OpenSession, run: OpenRun, asked: Annotated[Asked, body_of(smooth, "SmoothRequest")], doors: Door
) -> TrackJobState:
    """Smooth a track in time."""
    changed(SmoothingSettings(), asked["knobs"])
    check_making(run, asked.get("source", ""), asked.get("into", SMOOTHED), asked["replace"])

    def work(_job: Job) -> dict[str, Any]:
        return _answer(smooth(run, **asked))

    return begin_job(doors, "smooth", session, run, work)


@router.post(RUN + "/correct", status_code=202)
async def begin_correction(
    session: OpenSession,
    run: OpenRun,
    asked: Annotated[Asked, body_of(correct, "CorrectionRequest")],
    doors: Door,
) -> TrackJobState:
    """Make a run that begins anew in a frame. Forwards it is ready to be started; backwards it is tracked here."""
    made = await asyncio.to_thread(corrected_run, run, **asked, source="set in the studio")
    doors.events.session_changed(session.name, made.name)

    def work(job: Job) -> dict[str, Any]:
        if "back_to" in asked:
            moved = track_backwards(session, made, job.report, job.cancelled)
            return {
                "made_run": made.name,
                "moved": moved,
                "state": "cancelled" if job.cancelled() else "done",
            }
        return {"made_run": made.name}

    return begin_job(doors, "correct", session, run, work)


add_job_routes(router, "/track-jobs/{identifier}", TRACK)


def _line(session: Session, run: StoredRun, name: str) -> TrackLine:
    track = read_track(run, name)
    line = TrackLine(name=name, frames=len(track.frames), made_by=dict(track.made_by))
    if not len(track.frames):
        return line
    line.jitter_mm = jitter(run, track)
    path = session.truth_path
    if path is not None:
        found = evaluate(track.poses, track.frames, run.body(), read_trc(path), run.record.fps)
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
