"""The subject's shape from the first frames of a run: radii, flesh beside the bones, and lengths that no tape measures.

Cones too thin or too thick for the clothed body shift the joints (arms ride up by centimetres), and the silhouettes
give the ends of hands, feet and head. So before a run begins, its first frames are tracked, the shape is fitted
to the most different of them (`search.trackers.shape_refinement`), and the run begins again with it. Other lengths are
kept where they were measured: silhouettes hardly separate a knee ten millimetres higher from one that is bent a little
more. Guessed from a height they are farther off than that, and are fitted as well, with published proportions as prior
(`subject_fitting` does that with more frames).

The frames are tracked with the default tracker and seed 0 whatever the run has, so that all runs of a session have one
body; it is kept in the session's folder `shapes` until footage, calibration, masks, subject or start pose change.
"""

import dataclasses
import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import msgspec
import numpy as np

from studio.body.dimensions import with_dimensions
from studio.body.model import BodyModel
from studio.body.scale import rest_height, scale_of
from studio.body.shape_space import ShapeGroup, ShapeSpace, dimension_kinds, shape_space, untaped_lengths
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.settings import EvidenceSettings
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.runs.live.following import Following
from studio.runs.problem_source import ProblemSource
from studio.runs.search_space import search_space, session_sigma
from studio.runs.setup.subject_frames import varied_frames
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.shape_silhouettes import ShapePrograms
from studio.search.settings import RunSettings, default_settings
from studio.search.trackers.frame_refinement import FrameRefiner
from studio.search.trackers.loss_detection import Onlooker, anything_seen
from studio.search.trackers.shape_prior import ShapePrior, ShapeSpreads
from studio.search.trackers.shape_refinement import ShapeRefiner
from studio.search.trackers.tracker import start_of
from studio.sessions.provenance import digests
from studio.sessions.record_files import RecordFile
from studio.sessions.session import Session

TRACKER, WEIGHTING = "annealed", "edge-region-silhouette"
FIRST_FRAMES, FEWEST_FRAMES, FITTED_FRAMES = 30, 8, 8
"""Frames tracked before the fit (with fewer there is none), and the number of most different ones it uses."""
KEY_DIGITS = 6
"""Decimals of mm and radians in a fit's key."""
FEWEST_CAMERAS = 2
"""One camera cannot separate a larger body from a nearer one."""
LEAST_OVERLAP = 0.6
"""Masks that agree less with the body, even with the shape, show something else."""
STEP = "fitting the shape"
MEASURED = "Lengths that a tape measures were kept."
GUESSED = (
    "No limb was measured: all lengths were fitted; 'studio fit-subject' takes frames from the whole footage."
)
RULES = 2
"""Counts the changes of how a shape is fitted, so that one of before is not taken: 2, feet that cannot bend are left in
the floor."""
SCHEMA_VERSION, FOLDER = 1, "shapes"
WORDED = 5.0
"""mm (of a person: `scale_of`): smaller changes are not reported."""
WORDED_RATIO = 0.02
"""Smaller changes of ratios are not reported."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedShape:
    """body : with the shape. start : (D,) its pose in the first frame. sizes : of each group before and after, mm or
    without a unit. overlap : f_s before and after, mean over the fitted frames.
    """

    body: BodyModel
    start: Array
    sizes: Mapping[ShapeGroup, tuple[float, float]]
    overlap: tuple[float, float]


class _Kept(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A stored fit. dimensions : of the fitted body, mm; none after a failure. words : for a run's notes."""

    schema: int = SCHEMA_VERSION
    dimensions: dict[str, float] = {}
    start: tuple[float, ...] = ()
    words: str


_RECORD = RecordFile(
    _Kept, "a fitted shape", "Delete it.", ("There is no such shape.", "Fit it."), SCHEMA_VERSION
)


def fit_session_shape(
    session: Session,
    body: BodyModel,
    settings: RunSettings,
    start: Array,
    first: int,
    progress: Progress = no_progress,
    *,
    height_spread: float | None = None,
) -> tuple[BodyModel, Array, str]:
    """The body with the shape of a session's frames from `first` on, its pose there (D,), and a text for the notes.

    settings : whose evidence is used. height_spread : as in `fitted_shape`. The unchanged body and "", if it has no
    radii to fit or there are too few frames or cameras.
    """
    frames = range(first, min(session.manifest.frame_count, first + FIRST_FRAMES))
    few = len(frames) < FEWEST_FRAMES or len(session.cameras()) < FEWEST_CAMERAS
    if few or not can_be_fitted(body):
        return body, start, ""
    path = session.path / FOLDER / f"{_key(session, body, settings, start, frames, height_spread)}.json"
    try:
        kept = _RECORD.read(path)
    except (NotFoundError, SessionError):
        kept = _fitted_now(session, body, settings, start, frames, progress, height_spread)
        path.parent.mkdir(exist_ok=True)
        _RECORD.write(path, kept)
    if not kept.dimensions:
        return body, start, kept.words
    return with_dimensions(body, kept.dimensions), np.array(kept.start), kept.words


def can_be_fitted(body: BodyModel) -> bool:
    return body.definition is not None and "radius" in dimension_kinds(body.definition).values()


def _fitted_now(
    session: Session,
    body: BodyModel,
    settings: RunSettings,
    start: Array,
    frames: range,
    progress: Progress,
    height_spread: float | None,
) -> _Kept:
    with closing(ProblemSource(session, body)) as problems:
        wanted = _judging(settings)
        cameras = problems.cameras
        if any(problems.footage.absent(frame) for frame in frames):
            return _Kept(words="The shape was not fitted: not every camera has the first frames.")
        fps = session.manifest.fps
        shape = shaped_body(
            body,
            cameras,
            lambda frame: problems.evidence(frame, wanted),
            frames,
            start,
            session_sigma(session, body, fps),
            above_floor=settings.refinement.above_floor,
            height_spread=height_spread,
            progress=progress,
        )
    before, after = shape.overlap
    if after < max(LEAST_OVERLAP, before):
        return _Kept(words="The shape was not fitted: the masks agree too little with the body.")
    return _Kept(
        dimensions=dict(shape.body.dimensions),
        start=tuple(float(value) for value in shape.start),
        words=_words(shape, frames, height_spread is None),
    )


def shaped_body(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    evidence: Callable[[int], FrameEvidence],
    frames: Sequence[int],
    start: Array,
    sigma: Array,
    *,
    above_floor: bool = True,
    height_spread: float | None = None,
    progress: Progress = no_progress,
) -> FittedShape:
    """The shape of a body in the first frames. evidence : of a frame, with edge proximity maps. start : (D,) of
    the first of `frames`. sigma : (D,) σ0 from frame to frame. above_floor : as in `ShapeRefiner`. height_spread : as
    in `fitted_shape`.
    """
    usual = default_settings(TRACKER, WEIGHTING)
    rules = dataclasses.replace(
        usual, refinement=dataclasses.replace(usual.refinement, above_floor=above_floor)
    )
    likelihood = WEIGHTINGS[WEIGHTING].prepare(body, cameras, rules.weighting)
    following = Following(
        rules, search_space(body, sigma), start_of(tuple(start.tolist())), 0, FrameRefiner(body, cameras, 0)
    )
    for number, frame in enumerate(frames):
        progress(STEP, number, len(frames) + 1)
        seen = evidence(frame)
        if not anything_seen(seen):
            break
        following.step(frame, likelihood.problem(seen), seen)
    if not following.poses:
        return FittedShape(body, start, {}, (0.0, 0.0))
    followed = np.array(following.poses)
    numbers = np.array(frames[: len(followed)])
    chosen = varied_frames(body, numbers, followed, FITTED_FRAMES)
    rows = np.searchsorted(numbers, chosen)
    seen_there = [evidence(frame) for frame in chosen]
    fit = fitted_shape(body, cameras, seen_there, followed[rows], above_floor, height_spread)
    progress(STEP, len(frames) + 1, len(frames) + 1)
    return FittedShape(fit.body, followed[0], fit.sizes, fit.overlap)


def fitted_shape(
    body: BodyModel,
    cameras: tuple[Camera, ...],
    frames: Sequence[FrameEvidence],
    poses: Array,
    above_floor: bool = True,
    height_spread: float | None = None,
) -> FittedShape:
    """The shape of a body on some frames' masks, from its poses there (F, D), which are in the right valley.

    above_floor : as in `ShapeRefiner`. height_spread : mm by which the body's height may be off, of which its lengths
    were guessed; None: they were measured, and only those that no tape measures are fitted.
    """
    guessed = height_spread is not None
    space = shape_space(body, lengths=guessed or "untaped", flesh=True)
    prior = (
        ShapePrior(space, ShapeSpreads(height=height_spread), rest_height(body))
        if guessed
        else ShapePrior(space, ShapeSpreads(), None)
    )
    borders = [silhouette_distances(frame) for frame in frames]
    refiner = ShapeRefiner(
        ShapePrograms(space), cameras, borders, prior, lengths_known=not guessed, above_floor=above_floor
    )
    fit = refiner.refine(np.zeros(len(space.groups)), poses)
    shaped = space.body_of(fit.shape)
    overlap = _overlap(body, cameras, frames, poses), _overlap(shaped, cameras, frames, fit.poses)
    return FittedShape(shaped, fit.poses[0], _sizes(space, fit.shape), overlap)


def _overlap(
    body: BodyModel, cameras: tuple[Camera, ...], frames: Sequence[FrameEvidence], poses: Array
) -> float:
    onlooker = Onlooker(body, cameras)
    return float(
        np.mean([onlooker.sight(frame, pose).overlap for frame, pose in zip(frames, poses, strict=True)])
    )


def _judging(settings: RunSettings) -> RunSettings:
    """The settings for tracking the first frames: the run's evidence, all else the studio's defaults."""
    return dataclasses.replace(default_settings(TRACKER, WEIGHTING), evidence=settings.evidence)


def _sizes(space: ShapeSpace, shape: Array) -> dict[ShapeGroup, tuple[float, float]]:
    before, after = space.sizes(np.zeros_like(shape)), space.sizes(shape)
    return {
        group: (float(one), float(other))
        for group, one, other in zip(space.groups, before, after, strict=True)
    }


def _words(shape: FittedShape, frames: range, measured: bool) -> str:
    in_mm, without_unit = list[str](), list[str]()
    for group, (one, other) in shape.sizes.items():
        words = group.name.replace("_", " ")
        if group.kind == "ratio":
            if abs(other - one) >= WORDED_RATIO:
                without_unit.append(f"{words} {one:.2f} → {other:.2f}")
        elif abs(other - one) >= WORDED * scale_of(shape.body):
            in_mm.append(f"{words} {one:.0f} → {other:.0f}")
    changed = [*([", ".join(in_mm) + " mm"] if in_mm else []), *without_unit]
    listed = f": {', '.join(changed)}" if changed else ""
    return (
        f"The body's shape was fitted to frames {frames[0]} to {frames[-1]}{listed}; the silhouettes agree by "
        f"{100.0 * shape.overlap[1]:.0f} % (before: {100.0 * shape.overlap[0]:.0f} %)."
        f" {MEASURED if measured else GUESSED}"
    )


def _key(
    session: Session,
    body: BodyModel,
    settings: RunSettings,
    start: Array,
    frames: range,
    height_spread: float | None,
) -> str:
    """A digest of all that the fit depends on: of the evidence the masks' knobs, whose defaults may change, and others
    that are not at their defaults. Sizes and start pose are rounded: their last bits are a processor's own.
    """
    evidence, usual = msgspec.to_builtins(settings.evidence), msgspec.to_builtins(EvidenceSettings())
    made_of = (
        RULES,
        height_spread,
        digests(session, ("footage", "calibration", "masks")),
        body.name,
        {name: round(value, KEY_DIGITS) for name, value in body.dimensions.items()},
        sorted(untaped_lengths(body)),
        {name: value for name, value in evidence.items() if name.startswith("mask_") or value != usual[name]},
        settings.refinement.above_floor,
        (np.round(start, KEY_DIGITS) + 0.0).tolist(),  # no negative zero
        (frames.start, frames.stop),
    )
    return hashlib.sha256(msgspec.json.encode(made_of)).hexdigest()[:32]
