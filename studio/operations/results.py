"""A run's tracks, how good they are, and files for other programs."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion
from studio.body.motion_files.truth_files import ANY_WORLD, READERS, read_truth
from studio.footage.calibration.carried_points import carried
from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.declaring import Knobs, Terminal, Values, operation
from studio.foundations.errors import TruthError
from studio.foundations.knobs import changed, knobs_of
from studio.operations.opening import (
    RunName,
    SessionName,
    keeping_in_place,
    open_run,
    open_session,
    session_of,
)
from studio.operations.progress import Reporting, reporting, say
from studio.results.evaluation.errors import RIGID, SIMILARITY, UNALIGNED, Evaluation, lost_mm, meant_axes
from studio.results.evaluation.errors import evaluate as evaluate_poses
from studio.results.export.exporting import ExportReport
from studio.results.export.exporting import export_run as write_run
from studio.results.export.formats import FORMATS, format_of_file
from studio.results.export.options import ExportOptions
from studio.results.inspection.error_parts import split_of
from studio.results.inspection.reading import InspectedRun
from studio.results.verifying import Repair, Verification, remove_left_behind, repair
from studio.results.verifying import verify as verify_session
from studio.runs.checking import EVERY, RunCheck, check_run
from studio.runs.refining import REFINED, SMOOTHED, MadeTrack, refine_run, smooth_run
from studio.runs.tracks import BEST, Track, best_track, track_names
from studio.runs.tracks import read_track as read_stored_track
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.smoothing import SmoothingSettings

TrackName = Annotated[
    str,
    Field(description="Best: smoothed, else refined, else sides, else raw; or any track's name."),
    Terminal(metavar="NAME"),
]
Origin = Annotated[str, Terminal("--from")]
NewTrack = Annotated[str, Field(description="Name of the new track.")]
Replace = Annotated[bool, Field(description="Replace a derived track of that name.")]


def list_tracks(run: RunName) -> tuple[str, ...]:
    """The names of a run's tracks: "raw" is the result of the search, the others were made from it."""
    return track_names(open_run(run))


def read_track(run: RunName, track: TrackName = BEST) -> Track:
    """A track of a run as arrays.

    run : SESSION/RUN, a run's folder, or a run.
    track : "best" (smoothed, else refined, else sides, else raw) or a track's name.

    Raises NotFoundError where there is no such track.
    """
    return read_stored_track(open_run(run), track)


def markers(run: RunName, track: TrackName = BEST) -> MarkerMotion:
    """The body's markers along a track.

    run : SESSION/RUN, a run's folder, or a run.
    track : "best" (smoothed, else refined, else sides, else raw) or a track's name.

    Raises NotFoundError where there is no such track.
    """
    stored = open_run(run)
    body, chosen = stored.body(), read_stored_track(stored, track)
    return MarkerMotion(
        tuple(marker.name for marker in body.markers),
        np.asarray(chosen.frames / stored.record.fps),
        marker_points(body, chosen.poses),
        "mm",
        stored.record.fps,
    )


@operation
@keeping_in_place
def refine(
    run: RunName,
    *,
    source: Annotated[
        Origin, Field(description="The track to refine; default: as tracked, sides put right.")
    ] = "",
    into: NewTrack = REFINED,
    replace: Replace = False,
    knobs: Annotated[Values, Knobs(lambda: knobs_of(RefinementSettings))] = None,
    progress: Reporting = None,
) -> MadeTrack:
    """Refine every frame of a run on its silhouettes, and keep that as a track beside the result of the search.

    Consecutive frames are refined together; no weight ever falls. Ctrl-C ends it, and nothing is kept.

    Raises RunError for a run without frames or a track that exists, SettingsError for an unknown knob.
    """
    stored = open_run(run)
    opened = session_of(stored)
    settings = changed(RefinementSettings(), knobs or {})
    with reporting(progress, f"{opened.name} / {stored.name}: refining") as report:
        return refine_run(
            opened, stored, source=source, into=into, settings=settings, replace=replace, progress=report
        )


@operation
@keeping_in_place
def smooth(
    run: RunName,
    *,
    source: Annotated[
        Origin, Field(description="The track to smooth; default: refined, else sides, else raw.")
    ] = "",
    into: NewTrack = SMOOTHED,
    replace: Replace = False,
    knobs: Annotated[Values, Knobs(lambda: knobs_of(SmoothingSettings))] = None,
) -> MadeTrack:
    """Smooth a run's poses in time, and keep that as a track beside the result of the search.

    Short gaps are filled and marked, long ones stay gaps.

    Raises RunError for a run without frames or a track that exists, SettingsError for an unknown knob.
    """
    settings = changed(SmoothingSettings(), knobs or {})
    return smooth_run(open_run(run), source=source, into=into, settings=settings, replace=replace)


@operation
@keeping_in_place
def check(
    run: RunName,
    track: Annotated[TrackName, Terminal("--track", "NAME")] = BEST,
    *,
    every: Annotated[int, Field(ge=1, le=10_000, description="Check every so many frames.")] = EVERY,
    progress: Reporting = None,
) -> RunCheck:
    """Say how well a run fits its pictures: share in the masks, lost frames and limbs, sudden turns, jumps, jitter.

    The measurements are kept beside the run, and shown in step Check of the guided set-up.

    Raises RunError for a run without frames.
    """
    stored = open_run(run)
    opened = session_of(stored)
    with reporting(progress, f"{opened.name} / {stored.name}: checking") as report:
        return check_run(opened, stored, track, every, progress=report)


@operation
@keeping_in_place
def evaluate(
    run: RunName,
    *,
    truth: Annotated[
        str | Path | None,
        Field(description=f"Named points: a {', '.join(READERS)} file; default: the session's own truth."),
        Terminal(kind=Path),
    ] = None,
    truth_cameras: Annotated[
        str | Path | None,
        Field(
            description="Calibration of the same cameras in whose world the points of a CSV lie: each point is"
            " projected with it and triangulated with the session's."
        ),
        Terminal(kind=Path),
    ] = None,
    truth_up: Annotated[
        Literal["", "x", "y", "z", "-x", "-y", "-z"],
        Field(description="The axis of a TRC that points up; default: from its heads and feet, else y."),
    ] = "",
    align: Annotated[
        Literal["", "none", "rigid", "similarity"],
        Field(
            description="How a truth of another world is laid on the run, once for all frames; default: not at"
            " all for a TRC or with --truth-cameras, else rigidly (by similarity where the file names"
            " no unit)."
        ),
    ] = "",
    track: TrackName = BEST,
    progress: Reporting = None,
) -> Evaluation:
    """Measure a run against the true markers: mm without alignment, root-aligned, after Procrustes.

    Raises TruthError for a truth that is missing or does not fit the body, CalibrationError for cameras that do not fit
    the truth.
    """
    stored = open_run(run)
    opened = session_of(stored)
    path = Path(truth) if truth is not None else opened.truth_path
    if path is None:
        raise TruthError(
            f"Session '{opened.name}' has no truth.", f"Give one with --truth FILE ({', '.join(READERS)})."
        )
    if track == BEST:
        best = best_track(stored)
        track = best.name
        say(progress, [best.note] if best.note else [])
    chosen = read_stored_track(stored, track)
    motion = read_truth(path, stored.record.fps, opened.manifest.frame_count, truth_up)
    say(progress, motion.notes)
    if truth_cameras is not None:
        theirs = read_calibration(Path(truth_cameras)).cameras
        positions, missed = carried(motion.positions, theirs, stored.cameras())
        motion = replace(motion, positions=positions)
        say(
            progress,
            [f"The truth was carried over by the cameras' pictures, {missed:.1f} px off in the median."],
        )
    elif not align and path.suffix.lower() in ANY_WORLD:
        align = RIGID if motion.unit else SIMILARITY
    evaluation = evaluate_poses(
        chosen.poses, chosen.frames, stored.body(), motion, stored.record.fps, align or UNALIGNED
    )
    if evaluation.alignment == UNALIGNED and evaluation.mean_mm > lost_mm(stored.body()):
        meant = meant_axes(chosen.poses, chosen.frames, stored.body(), motion, stored.record.fps)
        say(progress, [meant.replace("FILE", f"'{path.name}'")] if meant else [])
    if truth is not None:
        return evaluation
    split = split_of(InspectedRun(opened, stored))
    return replace(evaluation, parts_mm=split.parts_mm, parts_frames=len(split.frames))


@operation
@keeping_in_place
def export_run(
    run: RunName,
    to: Annotated[
        str | Path,
        Field(description=f"The file; its ending is the format: {', '.join(FORMATS)}."),
        Terminal("--to", "FILE", kind=Path),
    ],
    *,
    progress: Reporting = None,
    **options: Annotated[object, Knobs(lambda: knobs_of(ExportOptions), with_defaults=False)],
) -> ExportReport:
    """Write the motion of a run to a file that other programs open.

    The file is read back and compared before it takes its place; Ctrl-C leaves nothing behind.

    Raises ExportError for an unknown format or option, or where the file cannot be written.
    """
    place = Path(to)
    stored, form = open_run(run), format_of_file(place)
    with reporting(progress, f"{stored.session_name} / {stored.name}: {form.title}") as report:
        done = write_run(session_of(stored), stored, form, options, place, progress=report)
    say(progress, done.notes)
    return done


@dataclass(frozen=True, slots=True)
class Verified:
    """The result of a verification.

    verification : what was read, and what is wrong after repairs.
    repaired : the runs that were repaired.
    """

    verification: Verification
    repaired: tuple[Repair, ...] = ()


@operation
@keeping_in_place
def verify(
    session: SessionName,
    *,
    mend: Annotated[
        bool,
        Field(
            description="Track damaged frames again, bit for bit where nothing else has changed, and remove what"
            " interrupted work left behind."
        ),
        Terminal("--repair"),
    ] = False,
    progress: Reporting = None,
) -> Verified:
    """Compare everything that a session stores with its checksums, and name what is damaged.

    The command ends with 1 where something is damaged and was not repaired.
    """
    opened = open_session(session)
    repaired: tuple[Repair, ...] = ()
    with reporting(progress, f"{opened.name}: verifying") as report:
        verification = verify_session(opened, report)
        if mend and any(fault.run for fault in verification.faults):
            repaired = repair(opened, verification.faults, report)
            verification = verify_session(opened, report)
        if mend and verification.left:
            remove_left_behind(opened)
    say(progress, [f"damaged: {fault.place}: {fault.what}. {fault.remedy}" for fault in verification.faults])
    done = "removed" if mend else "to be removed by --repair"
    say(progress, [f"left behind by interrupted work, {done}: {place}" for place in verification.left])
    return Verified(verification, repaired)
