"""Tracking, and what comes after the search."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studio.body.subject import Subject, read_subject
from studio.errors import RunError
from studio.knobs import changed
from studio.notebook.opening import RunName, SessionName, Tracked, open_run, open_session, session_of
from studio.notebook.progress import Told, told
from studio.runs.correcting import prepare_correction, track_backwards
from studio.runs.initialising import InitialPose
from studio.runs.new_run import RunRequest, prepare_run
from studio.runs.refining import REFINED, SMOOTHED, MadeTrack, refine_run, smooth_run
from studio.runs.start_pose_file import frame_of_file, start_pose_from_file
from studio.runs.tracks import pose_in_track, read_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.tracking.refinement import RefinementSettings
from studio.tracking.smoothing import SmoothingSettings
from studio.worker.batch import BatchResult, track_to_end

Array = NDArray[np.float64]
StartPose = ArrayLike | InitialPose | str | Path
"""(D,) radians and mm in the body's order, what `initialise` found, or a file: a CSV row or a TRC."""


def track(
    session: SessionName,
    *,
    tracker: str = "",
    weighting: str = "",
    body: str = "",
    subject: Subject | str | Path | None = None,
    start_pose: StartPose | None = None,
    behaviour: str = "",
    first: int | None = None,
    last: int | None = None,
    seed: int = 0,
    name: str = "",
    knobs: Mapping[str, object] | None = None,
    despite_findings: bool = False,
    fit_shape: bool = True,
    progress: Told = None,
) -> Tracked:
    """Track a session and store the run; the same seed gives the same run.

    tracker, weighting, body : names, the session's own by default. first : default the frame that the start pose is of;
    last : the frame after the last. knobs : any, by name. despite_findings : also where the footage speaks against the
    calibration, as `mask_quality` may find. fit_shape : begin with the radii, hands, feet and head that the first
    frames show. Interrupted, what was tracked stays, and `go_on` goes on with it. Raises
    StudioError.
    """
    opened = open_session(session)
    measures = subject if isinstance(subject, Subject) or subject is None else read_subject(Path(subject))
    first = _first(start_pose) if first is None else first
    pose, source = _start(opened, start_pose, body, measures, first or 0)
    request = RunRequest(
        tracker=tracker,
        weighting=weighting,
        body=body,
        subject=measures,
        start_pose=pose,
        start_source=source,
        first=first,
        last=last,
        seed=seed,
        changes=dict(knobs or {}),
        name=name,
        behaviour=behaviour,
        despite_findings=despite_findings,
        fit_shape=fit_shape,
    )
    with told(progress, f"{opened.name}: tracking") as report:
        run = prepare_run(opened, request, report)
        return _tracked(run, track_to_end(opened, run, report))


def go_on(run: RunName, *, progress: Told = None) -> Tracked:
    """Track a run on that was interrupted: bit for bit what it would have been."""
    stored = open_run(run)
    opened = session_of(stored)
    with told(progress, f"{opened.name} / {stored.name}") as report:
        return _tracked(stored, track_to_end(opened, stored, report))


def correct(
    run: RunName,
    frame: int,
    pose: StartPose | None = None,
    *,
    from_track: str = "",
    back_to: int | None = None,
    name: str = "",
    progress: Told = None,
) -> Tracked:
    """Give a run the right pose in a frame and track on from there, into a new run; the old one stays.

    pose : as of a start, or `from_track` takes that of a track of the run. back_to : track backwards from `frame` to
    this one instead; all other frames stay. Raises RunError unless exactly one pose is given.
    """
    stored = open_run(run)
    opened = session_of(stored)
    given, source = corrected_pose(stored, frame, pose, from_track)
    new = prepare_correction(opened, stored, frame, given, source=source, backwards_to=back_to, name=name)
    with told(progress, f"{opened.name} / {new.name}") as report:
        if back_to is None:
            return _tracked(new, track_to_end(opened, new, report))
        track_backwards(opened, new, report)
    return _tracked(new, None)


def refine(
    run: RunName,
    *,
    source: str = "",
    into: str = REFINED,
    replace: bool = False,
    knobs: Mapping[str, object] | None = None,
    progress: Told = None,
) -> MadeTrack:
    """Refine every frame on its silhouettes and keep that beside what the search found; no weight ever falls. source :
    default what was tracked, left and right put right.
    """
    stored = open_run(run)
    opened = session_of(stored)
    settings = changed(RefinementSettings(), knobs or {})
    with told(progress, f"{opened.name} / {stored.name}: refining") as report:
        return refine_run(
            opened, stored, source=source, into=into, settings=settings, replace=replace, progress=report
        )


def smooth(
    run: RunName,
    *,
    source: str = "",
    into: str = SMOOTHED,
    replace: bool = False,
    knobs: Mapping[str, object] | None = None,
) -> MadeTrack:
    """Smooth the poses in time and keep that beside what the search found. source : default the
    refined, else that with sides put right, else raw.
    """
    settings = changed(SmoothingSettings(), knobs or {})
    return smooth_run(open_run(run), source=source, into=into, settings=settings, replace=replace)


def corrected_pose(run: StoredRun, frame: int, pose: StartPose | None, from_track: str) -> tuple[Array, str]:
    """The pose (D,) of a frame that is corrected, and in words where it came from."""
    if (pose is None) == (not from_track):
        raise RunError("A corrected frame needs a pose.", "Give one, or the track to take it from.")
    if pose is None:
        return pose_in_track(run, from_track, frame), f"track {from_track}"
    if isinstance(pose, InitialPose):
        return pose.pose, pose.source
    if isinstance(pose, str | Path):
        return start_pose_from_file(Path(pose), run.body(), frame, run.record.fps)
    return np.asarray(pose, dtype=np.float64), "given"


def _first(pose: StartPose | None) -> int | None:
    """The frame that a start pose is of; None for the session's own."""
    if isinstance(pose, InitialPose):
        return pose.frame
    return frame_of_file(Path(pose)) if isinstance(pose, str | Path) else None if pose is None else 0


def _start(
    session: Session, pose: StartPose | None, body: str, subject: Subject | None, frame: int
) -> tuple[Array | None, str]:
    if pose is None:
        return None, ""
    if isinstance(pose, InitialPose):
        return pose.pose, pose.source
    if isinstance(pose, str | Path):
        scaled = session.body(body or None, subject)
        return start_pose_from_file(Path(pose), scaled, frame, session.manifest.fps)
    return np.asarray(pose, dtype=np.float64), "given"


def _tracked(run: StoredRun, result: BatchResult | None) -> Tracked:
    fresh = StoredRun(run.folder)
    record = fresh.record
    return Tracked(
        fresh,
        read_track(fresh),
        tuple(record.parameters),
        tuple(record.notes),
        result.seconds if result else float("nan"),
        result.evaluations_per_frame if result else 0,
    )
