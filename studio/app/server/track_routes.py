"""Tracks of a run: listed, made in the background with progress as `track` events, downloaded; runs corrected."""

import asyncio
from typing import Annotated, Any, Literal

from fastapi import Response

from studio.app.server import files
from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.run_routes import RUN, RunInPath
from studio.app.server.schemas import Answer, Number
from studio.app.server.session_routes import OpenSession
from studio.foundations.csv_text import poses_csv
from studio.foundations.knobs import Knob, knobs_of
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob, Work
from studio.operations.results import check as check_run
from studio.operations.results import evaluate, read_track, refine, smooth
from studio.operations.tracking import correct, set_up_correction, track_back
from studio.operations.tracks import (
    CheckAnswer,
    LandmarksLine,
    TrackLine,
    check_derived,
    measure_by_landmarks,
    track_check,
    track_lines,
)
from studio.runs.refining import REFINED, SMOOTHED, MadeTrack
from studio.runs.tracks import BEST
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.smoothing import SmoothingSettings
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = Router(prefix="/api", tags=["tracks"])
Verb = Literal["refine", "smooth", "correct", "pose", "check", "landmarks"]


class TrackList(Answer):
    """The run's tracks, raw first, those under way, and the knobs of refining and smoothing.

    truth_problem: why no track can be measured though there is a truth.
    """

    tracks: Annotated[tuple[TrackLine, ...], Shown]
    truth_problem: str
    running: list["TrackJobState"]
    refine_settings: list[Annotated[Knob, Shown]]
    smooth_settings: list[Annotated[Knob, Shown]]


class TrackJobState(NumberedJob):
    """How refining, smoothing or correcting stands.

    made_run: the corrected run. track: the track that is made. pose, gain, overlap_before, overlap: of a search around
    a pose (verb pose; run is "" where it is the session's). landmarks: of verb landmarks.
    """

    verb: Verb
    run: str
    track: str = ""
    made_run: str = ""
    jitter_before_mm: Number = None
    jitter_after_mm: Number = None
    moved: int = 0
    filled: int = 0
    left_out: int = 0
    pose: list[float] | None = None
    gain: Number = None
    overlap_before: Number = None
    overlap: Number = None
    landmarks: Annotated[LandmarksLine | None, Shown] = None


TRACK = JobKind(
    "track", "job", TrackJobState, at="/api/track-jobs/{identifier}", page="/?session={session}&run={run}"
)


def begin_job(
    app: AppState, verb: Verb, session: Session, run: StoredRun | None, work: Work
) -> TrackJobState:
    """Begin work on a session's poses or tracks. run : that it is about, if it is about one."""
    state = TrackJobState(verb=verb, session=session.name, run=run.name if run else "")
    return app.jobs.begin(TRACK, state, work)


@router.get(RUN + "/tracks")
def tracks(session: OpenSession, run: RunInPath, app: App) -> TrackList:
    """The run's tracks with how much they jitter and, where there is a truth, how far off they are."""
    going = [state for state in app.jobs.going(TRACK, session.name) if state.run == run.name]
    lines, problem = track_lines(session, run)
    return TrackList(
        tracks=lines,
        truth_problem=problem,
        running=going,
        refine_settings=list(knobs_of(RefinementSettings)),
        smooth_settings=list(knobs_of(SmoothingSettings)),
    )


@router.get(RUN + "/tracks/{track}/poses.csv", response_class=Response)
def track_csv(session: OpenSession, run: RunInPath, track: str) -> Response:
    """A track's poses: frame, then one column per parameter in the body's order (radians and mm)."""
    read = read_track(run, track)
    name = f"{session.name}-{run.name}-{read.name}-poses.csv"
    return files.download(poses_csv(run.record.parameters, read.frames, read.poses), name, files.CSV)


@router.post(RUN + "/refine", status_code=202)
async def begin_refining(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(refine, "RefineRequest")],
    app: App,
) -> TrackJobState:
    """Refine a track on the silhouettes. Ask for the state, or wait for `track` events."""
    check_derived(run, REFINED, **arguments)
    return begin_job(
        app,
        "refine",
        session,
        run,
        lambda job: _answer(refine(run, **arguments, progress=job.report_or_stop)),
    )


@router.post(RUN + "/smooth", status_code=202)
async def begin_smoothing(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(smooth, "SmoothRequest")],
    app: App,
) -> TrackJobState:
    """Smooth a track in time."""
    check_derived(run, SMOOTHED, **arguments)
    return begin_job(app, "smooth", session, run, lambda _: _answer(smooth(run, **arguments)))


@router.post(RUN + "/correct", status_code=202)
async def begin_correction(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(correct, "CorrectionRequest")],
    app: App,
) -> TrackJobState:
    """Make a run that begins again in a frame. Forwards it is ready to be started; backwards it is tracked here."""
    made = await asyncio.to_thread(set_up_correction, run, **arguments, source="set in the studio")
    app.events.session_changed(session.name, made.name)

    def work(job: Job) -> dict[str, Any]:
        if "back_to" in arguments:
            moved = track_back(made, job.report, job.cancelled)
            return {
                "made_run": made.name,
                "moved": moved,
                "state": "cancelled" if job.cancelled() else "done",
            }
        return {"made_run": made.name}

    return begin_job(app, "correct", session, run, work)


add_job_routes(router, "/track-jobs/{identifier}", TRACK)


def _answer(made: MadeTrack) -> dict[str, Any]:
    return {
        "track": made.track.name,
        "jitter_before_mm": made.jitter_before,
        "jitter_after_mm": made.jitter_after,
        "moved": made.moved,
        "filled": len(made.filled),
        "left_out": len(made.left_out),
    }


@router.get(RUN + "/check")
def check(run: RunInPath, track: str = "") -> CheckAnswer:
    """What was measured of a track as it is now (empty: the best)."""
    return track_check(run, track)


@router.post(RUN + "/check", status_code=202)
async def begin_check(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(check_run, "CheckRequest")],
    app: App,
) -> TrackJobState:
    "Measure how well a track fits the pictures."
    name = (await asyncio.to_thread(read_track, run, arguments.get("track", BEST))).name

    def work(job: Job) -> dict[str, object]:
        check_run(run, name, every=arguments["every"], progress=job.report_or_stop)
        return {"track": name}

    return begin_job(app, "check", session, run, work)


@router.post(RUN + "/landmarks", status_code=202)
async def begin_landmarks(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[
        Arguments,
        body_of(evaluate, "LandmarksRequest", without=("truth", "truth_cameras", "truth_up", "align")),
    ],
    app: App,
) -> TrackJobState:
    """Measure a track against the joints that a network sees of a person, which are kept among the run's exports."""
    name = (await asyncio.to_thread(read_track, run, arguments.get("track", BEST))).name

    def work(job: Job) -> dict[str, object]:
        return {"track": name, "landmarks": measure_by_landmarks(run, name, progress=job.report_or_stop)}

    return begin_job(app, "landmarks", session, run, work)
