"""Fits a session's subject: limb lengths and radii from the silhouettes of a few frames, with their poses.

The frames are those with the most different postures (`runs.setup.subject_frames`). Their initial poses come from a
run of the session, else each frame is searched for one (`runs.setup.initialising`). A population finds the basin of
the optimum (`search.trackers.shape_search`), a local descent the optimum (`search.trackers.shape_refinement`). The
result is a subject with all dimensions, so that every later run of the session has this body.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from studio.body.branches import within_limits
from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.shape_space import Kind, ShapeSpace, levelled, shape_space
from studio.body.subject import REPORTED_SPREAD, SHORTEST_MM, TALLEST_MM, Subject, fit_subject, write_subject
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.declaring import Body, Millimetres, Seed, Terminal
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress, no_progress
from studio.runs.problem_source import check_seen
from studio.runs.search_space import parameter_names
from studio.runs.setup.initialising import initialise
from studio.runs.setup.session_settings import masks_of
from studio.runs.setup.subject_frames import varied_frames
from studio.runs.tracks import REFINED, SIDES, best_track, read_track
from studio.search.likelihood.shape_silhouettes import ShapeSilhouettes
from studio.search.trackers.shape_prior import ShapePrior, ShapeSpreads
from studio.search.trackers.shape_refinement import RefinedShape, ShapeRefiner
from studio.search.trackers.shape_search import ShapeSearch, ShapeSearchSettings
from studio.sessions.atomic_files import keep_before
from studio.sessions.calibration_changes import stale_runs
from studio.sessions.session import SUBJECT_NAME, Session
from studio.sessions.work_under_way import one_at_a_time

COUNT = 5
MOST_FRAMES = 24
ANGLE_SPREAD, PLACE_SPREAD = 0.35, 60.0
"""rad and mm: spread of the initial poses."""


Height = Annotated[
    float | None,
    Field(ge=SHORTEST_MM, le=TALLEST_MM),
    Millimetres(SHORTEST_MM, TALLEST_MM),
    Terminal("--height"),
]


@dataclass(frozen=True, slots=True)
class FitRequest:
    """The parameters of a fit. Silhouettes override a height that is off by many times its spread (a standard
    deviation). particles, layers : of the search.
    """

    frames: Annotated[
        Sequence[int],
        Field(max_length=MOST_FRAMES, description="Frames to look at; default: chosen for their variety."),
    ] = ()
    count: Annotated[int, Field(ge=1, le=MOST_FRAMES, description="How many frames to choose.")] = COUNT
    symmetric: Annotated[
        bool, Field(description="Left and right alike."), Terminal("--symmetric/--asymmetric")
    ] = True
    lengths: Annotated[bool, Field(description="Fit lengths.")] = True
    radii: Annotated[bool, Field(description="Fit radii.")] = True
    above_floor: Annotated[
        bool,
        Field(description="Nothing of the body lies below the floor, z = 0."),
        Terminal("--above-floor/--no-floor"),
    ] = True
    height_mm: Annotated[
        Height, Field(description="Known to a few centimetres, mm; default: the subject's.")
    ] = None
    height_spread: Annotated[
        float,
        Field(ge=0, description="How far off the height may be, mm: 15 for a measured one, 60 for a guess."),
    ] = REPORTED_SPREAD
    run: Annotated[
        str, Field(description="Whose poses to begin with; default: the newest."), Terminal(metavar="RUN")
    ] = ""
    body: Body = ""
    seed: Seed = 0
    particles: int = 24
    layers: int = 40


@dataclass(frozen=True, slots=True)
class FittedSize:
    """One group of dimensions, mm: before, after, and the standard deviation of that (`ShapeRefiner.refine`)."""

    name: str
    kind: Kind
    dimensions: tuple[str, ...]
    before: float
    after: float
    deviation: float


Shown = Callable[[BodyModel, tuple[int, ...], Array], None]
"""shown(body, frames, poses) is called with what a fit has so far: poses (F, D) of the body in F frames."""


def _unshown(_body: BodyModel, _frames: tuple[int, ...], _poses: Array) -> None:
    """Nothing is shown of a fit before its end."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedSubject:
    """A subject fitted to footage.

    sizes : what changed, mm, with standard deviations.
    frames, poses : (F,) numbers of the frames, and the body's poses (F, D) in them.
    overlap_before, overlap : (F,) overlap of silhouettes and model (f_s) before and after.
    poses_from : where the first poses came from.
    file : that was written; None for none.
    """

    subject: Subject
    body: BodyModel
    sizes: tuple[FittedSize, ...]
    frames: tuple[int, ...]
    poses: Array
    overlap_before: Array
    overlap: Array
    poses_from: str
    evaluations: int
    file: Path | None = None


def fit_session_subject(
    session: Session,
    request: FitRequest | None = None,
    *,
    progress: Progress = no_progress,
    shown: Shown = _unshown,
) -> FittedSubject:
    """The subject of a session, fitted to its silhouettes. Nothing is written: see `keep_subject`.

    progress : the step in words, how much of it is done, and how much there is. Raises RunError where nothing is to be
    seen in a frame or nothing may change, NotFoundError for a frame or run that is not there.
    """
    request = request or FitRequest()
    if not request.lengths and not request.radii:
        raise RunError("Neither lengths nor radii are to be fitted.", "Choose at least one of them.")
    body, subject = _first_body(session, request)
    progress("choosing frames", 0, 1)
    frames, start, poses_from = _first_poses(session, body, request, progress, shown)
    shown(body, frames, start)
    evidence = _evidence(session, frames, progress)
    space = shape_space(body, symmetric=request.symmetric, lengths=request.lengths, radii=request.radii)
    space = levelled(space) if request.symmetric else space
    limbs = {name: number for number, name in enumerate(dict.fromkeys(p.limb for p in body.parameters))}
    prior = ShapePrior(space, ShapeSpreads(height=request.height_spread), subject.height_mm)
    silhouettes = ShapeSilhouettes(space, session.cameras(), evidence)
    search = ShapeSearch(
        silhouettes,
        np.stack([body.lower, body.upper]),
        np.where(body.angles, ANGLE_SPREAD, PLACE_SPREAD),
        np.array([limbs[entry.limb] for entry in body.parameters]),
        prior,
        settings=ShapeSearchSettings(particles=request.particles, layers=request.layers),
        seed=request.seed,
        progress=lambda done, total: progress("2 of 3, fitting lengths and radii", done, total),
    )
    searched = search.run(start)
    shown(space.body_of(searched.shape), frames, searched.poses)
    progress("3 of 3, refining lengths and radii", 0, 1)
    borders = [silhouette_distances(one) for one in evidence]
    refiner = ShapeRefiner(
        silhouettes.programs,
        session.cameras(),
        borders,
        prior,
        lengths_known=not request.lengths,
        above_floor=request.above_floor,
    )
    refined = refiner.refine(searched.shape, searched.poses, request.seed, others=(start,))
    fitted = space.body_of(refined.shape)
    return FittedSubject(
        subject_of(subject, fitted),
        fitted,
        _sizes(space, refined),
        frames,
        refined.poses,
        searched.before,
        search.fitness(refined.shape, refined.poses),
        poses_from,
        search.evaluations,
    )


def _sizes(space: ShapeSpace, refined: RefinedShape) -> tuple[FittedSize, ...]:
    before, after = space.sizes(np.zeros_like(refined.shape)), space.sizes(refined.shape)
    return tuple(
        FittedSize(group.name, group.kind, group.dimensions, float(one), float(other), float(other * share))
        for group, one, other, share in zip(space.groups, before, after, refined.deviation, strict=True)
    )


def keep_subject(session: Session, fitted: FittedSubject, into: Path | None = None) -> Path:
    """Write a fitted subject to a file, or as the session's own (the old one is kept as subject-before.toml)."""
    if into is not None:
        write_subject(fitted.subject, into)
        return into
    return replace_subject(session, fitted.subject)


def replace_subject(session: Session, subject: Subject) -> Path:
    """Write a session's subject; the old one is kept as subject-before.toml."""
    own = session.path / SUBJECT_NAME
    with one_at_a_time(session.path):
        keep_before(own)
        write_subject(subject, own)
    return own


def _first_body(session: Session, request: FitRequest) -> tuple[BodyModel, Subject]:
    """The initial body and the known measures of the subject."""
    known = session.subject() or Subject(body=session.manifest.body)
    if request.height_mm is not None:
        known = Subject(body=known.body, height_mm=request.height_mm)
    tree = load_body(request.body or session.manifest.body, session.body_folders)
    return fit_subject(tree, known, session.body_folders)[0], msgspec.structs.replace(known, body=tree.name)


def _first_poses(
    session: Session, body: BodyModel, request: FitRequest, report: Progress, shown: Shown
) -> tuple[tuple[int, ...], Array, str]:
    """The frames, a pose in each (F, D), and the origin of the poses."""
    count = session.manifest.frame_count
    for frame in request.frames:
        if not 0 <= frame < count:
            raise RunError(
                f"Frame {frame} does not lie in the footage of '{session.name}'.", f"It has frames 0:{count}."
            )
    if not 1 <= (len(request.frames) or request.count) <= MOST_FRAMES:
        raise RunError("A subject is fitted to 1 to 24 frames.", "Choose fewer, or at least one.")
    stored = _stored_poses(session, body, request.run)
    if stored is not None:
        numbers, poses, name = stored
        frames = tuple(request.frames) or varied_frames(body, numbers, poses, request.count)
        rows = {int(number): row for row, number in enumerate(numbers)}
        if all(frame in rows for frame in frames):
            return frames, poses[[rows[frame] for frame in frames]], f"run {name}"
    frames = tuple(request.frames) or varied_frames(body, np.arange(count), None, request.count)
    first_poses: list[Array] = []
    reached = 0
    for done, frame in enumerate(frames):

        def report_frame(step: str, part: int, whole: int, done: int = done) -> None:
            # Never back, as a search ends with a step of its own: the time left is measured from rising parts.
            nonlocal reached
            reached = max(reached, done * 100 + 100 * part // max(whole, 1))
            report(f"1 of 3, {step} in frame {frames[done]}", reached, 100 * len(frames))

        first_poses.append(
            within_limits(
                body, initialise(session, frame, body=body, seed=request.seed, progress=report_frame).pose
            )
        )
        shown(body, frames[: done + 1], np.array(first_poses))
    return frames, np.array(first_poses), "a search in each frame"


def _stored_poses(
    session: Session, body: BodyModel, wanted: str
) -> tuple[NDArray[np.int64], Array, str] | None:
    """Frames, poses and name of the requested run, or of the newest one of this body and calibration with poses."""
    stale = stale_runs(session)
    usual = [run for run in reversed(session.runs()) if run.name not in stale]
    runs = [session.run(wanted)] if wanted else usual
    for run in runs:
        if run.record.parameters != parameter_names(body):
            continue
        track = read_track(run, best_track(run, (REFINED, SIDES)).name)
        if len(track.frames):
            return track.frames, track.poses, run.name
    if wanted:
        raise RunError(f"Run '{wanted}' has no poses of {body.name}.", "Choose another run, or none.")
    return None


def _evidence(session: Session, frames: Sequence[int], report: Progress) -> tuple[FrameEvidence, ...]:
    """The masks of the frames. Raises RunError for a frame that shows no body."""
    with masks_of(session) as maker:
        frames_evidence: list[FrameEvidence] = []
        for done, frame in enumerate(frames):
            report("reading the frames", done, len(frames))
            evidence = maker.evidence(frame)
            check_seen(session, evidence)
            frames_evidence.append(evidence)
    return tuple(frames_evidence)


def subject_of(subject: Subject, body: BodyModel) -> Subject:
    """The subject with all dimensions of a body, which reproduces that body exactly."""
    entries = body.definition.dimensions if body.definition else {}
    lengths = {name: value for name, value in body.dimensions.items() if entries[name].ratio is None}
    ratios = {name: value for name, value in body.dimensions.items() if entries[name].ratio is not None}
    return Subject(body=body.name, height_mm=subject.height_mm, dimensions_mm=lengths, ratios=ratios)
