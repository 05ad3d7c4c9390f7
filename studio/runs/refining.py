"""Derived tracks of a run: refined on the silhouettes, or smoothed in time.

`made_by` of a track has its source and settings, so that it can be made again.
"""

from contextlib import closing
from dataclasses import asdict, dataclass

import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.foundations.arrays import Array, consecutive
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress, no_progress
from studio.runs.problem_source import ProblemSource
from studio.runs.refined_frames import refined_frames
from studio.runs.search_space import search_space
from studio.runs.sides import correct_clip
from studio.runs.tracks import (
    RAW,
    REFINED,
    SIDES,
    SMOOTHED,
    SOURCE,
    SOURCE_DIGEST,
    Track,
    best_track,
    read_track,
    track_digest,
    track_named,
    track_names,
    write_track,
)
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.smoothing import Smoothed, SmoothingSettings, rms_second_difference, smooth
from studio.sessions.names import checked_name
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@dataclass(frozen=True, slots=True, eq=False)
class MadeTrack:
    """A derived track with its figures.

    moved : number of frames whose pose changed (refine).
    agreement_before, agreement_after : of the silhouettes, f_s, mean over the frames that show any (refine).
    filled, left_out : frame numbers (smooth).
    jitter_before, jitter_after : root mean square second difference of the body's markers, mm a frame², over
        consecutive frames.
    """

    track: Track
    moved: int = 0
    agreement_before: float = 0.0
    agreement_after: float = 0.0
    filled: tuple[int, ...] = ()
    left_out: tuple[int, ...] = ()
    jitter_before: float = 0.0
    jitter_after: float = 0.0


def refine_run(
    session: Session,
    run: StoredRun,
    *,
    source: str = "",
    into: str = REFINED,
    settings: RefinementSettings | None = None,
    replace: bool = False,
    progress: Progress = no_progress,
) -> MadeTrack:
    """Refine every frame of a track and store the result as another (see `runs.refined_frames`).

    source : "" for what was tracked, with its sides put right first (`runs.sides`) where they are not yet. progress :
    the steps of both, called after each frame; where it raises, nothing is kept. Raises
    SessionError where `into` is taken, RunError for a run without frames, and what reading the footage raises.
    """
    knobs = settings or RefinementSettings()
    track = _begin(run, source or RAW, into, replace)
    if not source and into != SIDES:
        with closing(ProblemSource(session, run.body(), run.cameras())) as problems:
            correct_clip(run, problems, progress=progress)
        track = read_track(run, best_track(run, (SIDES,)).name)
    step, total = f"refining {run.name}", len(track.frames)
    progress(step, 0, total)
    refined = refined_frames(session, run, track, knobs, lambda done: progress(step, done, total))
    moved = int(np.count_nonzero((refined.poses != track.poses).any(axis=1)))
    made_by = {"verb": "refine", **_origin(track), **asdict(knobs), "moved": moved}
    made = Track(into, track.frames, refined.poses, refined.agreement, track.states, made_by)
    write_track(run, made, replace=replace)
    return MadeTrack(
        made,
        moved,
        refined.agreement_before,
        refined.agreement_after,
        jitter_before=jitter(run, track),
        jitter_after=jitter(run, made),
    )


def smooth_run(
    run: StoredRun,
    *,
    source: str = "",
    into: str = SMOOTHED,
    settings: SmoothingSettings | None = None,
    replace: bool = False,
) -> MadeTrack:
    """Smooth a track and store the result as another. source : "" for the refined one, else that with corrected sides,
    else the raw one.

    Filled frames keep their state ("" where the run has none) and have confidence 0. Raises SessionError, RunError,
    SettingsError if no frame is reliable.
    """
    knobs = settings or SmoothingSettings()
    chosen = source or best_track(run, (SIDES,) if into == REFINED else (REFINED, SIDES)).name
    track = _begin(run, chosen, into, replace)
    body, record = run.body(), run.record
    smoothed = smooth(
        track.frames,
        track.poses,
        track.confidence,
        track.states,
        search_space(body, np.array(record.sigma)),
        body.angles,
        record.fps,
        knobs,
    )
    filled = tuple(smoothed.frames[smoothed.filled].tolist())
    left_out = tuple(smoothed.left_out.tolist())
    made_by = {"verb": "smooth", **_origin(track), **asdict(knobs), "filled": filled, "left_out": left_out}
    made = Track(into, smoothed.frames, smoothed.poses, *_standing(track, smoothed), made_by)
    write_track(run, made, replace=replace)
    before, after = jitter(run, track), jitter(run, made)
    return MadeTrack(made, filled=filled, left_out=left_out, jitter_before=before, jitter_after=after)


def jitter(run: StoredRun, track: Track) -> float:
    """Root mean square second difference of the body's markers, mm a frame²; 0 without three consecutive frames."""
    body = run.body()
    if not body.markers or len(track.frames) < 3:
        return 0.0
    points = marker_points(body, track.poses)
    parts = [points[part] for part in consecutive(track.frames) if part.stop - part.start > 2]
    if not parts:
        return 0.0
    weights = [len(part) - 2 for part in parts]
    return float(np.sqrt(np.average([rms_second_difference(part) ** 2 for part in parts], weights=weights)))


def check_making(run: StoredRun, source: str, into: str, replace: bool) -> None:
    """Check that a derived track can be stored. source : "" for the default. Raises RunError, SessionError."""
    source = track_named(run, source)
    if checked_name(into, "track").lower() == RAW or into == source:
        raise RunError(
            f"Track '{into}' cannot be replaced by a track made from it.", "Choose another --into."
        )
    if into in track_names(run) and not replace:
        raise RunError(
            f"Run '{run.name}' has a track '{into}' already.", "Choose another name, or replace it."
        )
    if run.record.ping_pong:
        raise RunError(
            f"Run '{run.name}' plays its footage forwards and backwards.", "Track the footage once instead."
        )
    if source and source not in track_names(run):
        read_track(run, source)


def _begin(run: StoredRun, source: str, into: str, replace: bool) -> Track:
    """The track to start from, after checking that the result can be stored."""
    check_making(run, source, into, replace)
    track = read_track(run, source)
    if not len(track.frames):
        raise RunError(f"Run '{run.name}' has no finished frame.", "Track it first.")
    return track


def _origin(track: Track) -> dict[str, str]:
    """The entries of `made_by` that name the source track."""
    return {SOURCE: track.name, SOURCE_DIGEST: track_digest(track)}


def _standing(track: Track, smoothed: Smoothed) -> tuple[Array, tuple[str, ...]]:
    """Confidence and states of the smoothed frames; confidence 0 where they were filled."""
    own = {frame: at for at, frame in enumerate(track.frames.tolist())}
    rows = [own.get(frame, -1) for frame in smoothed.frames.tolist()]
    confidence = np.array([track.confidence[at] if at >= 0 else 0.0 for at in rows])
    states = tuple(track.states[at] if at >= 0 else "" for at in rows)
    return np.where(smoothed.filled, 0.0, confidence), states
