"""Tracks of a run: listed, made in the background with progress as `track` events, downloaded; runs corrected."""

import asyncio
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.run_routes import RUN, OpenRun
from studio.app.server.schemas import Answer, Number
from studio.app.server.session_routes import OpenSession
from studio.foundations.knobs import Knob, changed, knobs_of
from studio.foundations.progress import unheard
from studio.operations.exports import keep_file, kept_file
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob, Work
from studio.operations.person import landmarks
from studio.operations.results import check as check_run
from studio.operations.results import evaluate, refine, smooth
from studio.operations.run_errors import evaluation_of
from studio.operations.tracking import correct, corrected_run
from studio.runs.checking import RunCheck, kept_check
from studio.runs.correcting import track_backwards
from studio.runs.refining import REFINED, SMOOTHED, MadeTrack, check_making, jitter
from studio.runs.tracks import BEST, best_track, read_track, track_named, track_names
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.smoothing import SmoothingSettings
from studio.sessions.named_rows import poses_csv
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = APIRouter(prefix="/api", tags=["tracks"])
LANDMARKS = "landmarks"
"""Stem of the file with a network's joints among a run's exports."""
Verb = Literal["refine", "smooth", "correct", "pose", "check", "landmarks"]


class TrackLine(Answer):
    """A track of a run. made_by: verb, what it was made from, settings, and of a smoothed one the frames that were
    filled and left out; empty for raw. jitter_mm: root mean square second difference of the markers. mean_mm, worst_mm:
    against the session's truth; mean_angle_deg, mean_direction_deg: the same, of the angles between limbs and of the
    limbs' directions.
    """

    name: str
    frames: int
    made_by: dict[str, object] = Field(default_factory=dict)
    jitter_mm: Number = None
    mean_mm: Number = None
    mean_angle_deg: Number = None
    mean_direction_deg: Number = None
    worst_mm: Number = None


class TrackList(Answer):
    """The run's tracks, raw first, those under way, and the knobs of refining and smoothing."""

    tracks: list[TrackLine]
    running: list["TrackJobState"]
    refine_settings: list[Annotated[Knob, Shown]]
    smooth_settings: list[Annotated[Knob, Shown]]


class LandmarksLine(Answer):
    """A track against a network's joints. file: of the run's exports, with the joints; seen: share of the frames with
    all of them; mean_mm: from them; without_offsets_mm: the same without each joint's constant offset.
    """

    file: str
    seen: Number
    mean_mm: Number
    without_offsets_mm: Number


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
    landmarks: LandmarksLine | None = None


TRACK = JobKind(
    "track",
    "job",
    TrackJobState,
    at="/api/track-jobs/{identifier}",
    page="/?session={session}&run={run}",
)


class JumpLine(Answer):
    """A limb that leaps into a frame. mm: the largest second difference of its markers; usual_mm: the median."""

    frame: int
    limb: str
    mm: Number
    usual_mm: Number


class CheckLine(Answer):
    """What was measured. inside: per looked-at frame and camera, the share of the model's pixels that lie in the mask;
    covered: of the mask's, under the model. poor: frames whose views have too little of it inside; turned: sudden
    turns. lost_limbs: limbs that the masks deny in more than one of the frames, with these.
    """

    cameras: list[str]
    frames: list[int]
    inside: list[list[Number]]
    covered: list[list[Number]]
    poor: list[int]
    lost: list[int]
    doubtful: list[int]
    turned: list[int]
    jitter_mm: Number
    jumps: list[JumpLine] = Field(default_factory=list[JumpLine])
    lost_limbs: dict[str, list[int]] = Field(default_factory=dict)
    inside_mean: Number
    good: bool
    words: str


class CheckAnswer(Answer):
    """track: the one that is requested; usual: the best, which is exported unless another is chosen; note: on better
    tracks that are out of date; check: null before.
    """

    track: str
    usual: str
    note: str = ""
    check: CheckLine | None


def begin_job(
    app: AppState, verb: Verb, session: Session, run: StoredRun | None, work: Work
) -> TrackJobState:
    """Begin work on a session's poses or tracks. run : that it is about, if it is about one."""
    state = TrackJobState(verb=verb, session=session.name, run=run.name if run else "")
    return app.jobs.begin(TRACK, state, work)


@router.get(RUN + "/tracks")
def tracks(session: OpenSession, run: OpenRun, app: App) -> TrackList:
    """The run's tracks with how much they jitter and, where there is a truth, how far off they are."""
    lines = [_line(session, run, name) for name in track_names(run)]
    going = [state for state in app.jobs.going(TRACK, session.name) if state.run == run.name]
    return TrackList(
        tracks=lines,
        running=going,
        refine_settings=list(knobs_of(RefinementSettings)),
        smooth_settings=list(knobs_of(SmoothingSettings)),
    )


@router.get(RUN + "/tracks/{track}/poses.csv", response_class=Response)
def track_csv(session: OpenSession, run: OpenRun, track: str) -> Response:
    """A track's poses: frame, then one column per parameter in the body's order (radians and mm)."""
    found = read_track(run, track)
    name = f"{session.name}-{run.name}-{found.name}-poses.csv"
    return files.download(poses_csv(run.record.parameters, found.frames, found.poses), name, files.CSV)


@router.post(RUN + "/refine", status_code=202)
async def begin_refining(
    session: OpenSession,
    run: OpenRun,
    arguments: Annotated[Arguments, body_of(refine, "RefineRequest")],
    app: App,
) -> TrackJobState:
    """Refine a track on the silhouettes. Ask for the state, or wait for `track` events."""
    changed(RefinementSettings(), arguments["knobs"])
    _check(run, arguments, REFINED)
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
    run: OpenRun,
    arguments: Annotated[Arguments, body_of(smooth, "SmoothRequest")],
    app: App,
) -> TrackJobState:
    """Smooth a track in time."""
    changed(SmoothingSettings(), arguments["knobs"])
    _check(run, arguments, SMOOTHED)
    return begin_job(app, "smooth", session, run, lambda _: _answer(smooth(run, **arguments)))


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


def _check(run: StoredRun, arguments: Arguments, usual: str) -> None:
    """Raises what making the track would, before a job is begun. usual : the name of the track."""
    check_making(run, arguments.get("source", ""), arguments.get("into", usual), arguments["replace"])


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
def check(run: OpenRun, track: str = "") -> CheckAnswer:
    """What was measured of a track as it is now (empty: the best)."""
    best = best_track(run)
    name = best.name if track in ("", BEST) else track
    read_track(run, name)
    found = kept_check(run, name)
    check = None if found is None else _check_line(found)
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


@router.post(RUN + "/landmarks", status_code=202)
async def begin_landmarks(
    session: OpenSession,
    run: OpenRun,
    arguments: Annotated[
        Arguments,
        body_of(evaluate, "LandmarksRequest", without=("truth", "truth_cameras", "truth_up", "align")),
    ],
    app: App,
) -> TrackJobState:
    """Measure a track against the joints that a network sees of a person, which are kept among the run's exports."""
    name = await asyncio.to_thread(track_named, run, arguments.get("track", BEST))
    await asyncio.to_thread(read_track, run, name)

    def work(job: Job) -> dict[str, object]:
        seen = 0.0

        def write(place: Path) -> int:
            nonlocal seen
            made = landmarks(session, place, progress=job.report_or_stop)
            seen = made.seen
            return len(made.motion.times)

        kept = keep_file(run, LANDMARKS, "trc", session.manifest.fps, write, "A network's joints")
        found = evaluate(run, truth=kept_file(run, kept.file), track=name, progress=unheard)
        line = LandmarksLine.of(found, file=kept.file, seen=seen)
        return {"track": name, "landmarks": line}

    return begin_job(app, "landmarks", session, run, work)


def _check_line(found: RunCheck) -> CheckLine:
    return CheckLine.of(found, jumps=found.jumps or (), words=found.in_words())
