"""The start pose of a body in a frame of a session, from the pictures and the body's dimensions alone.

The masks' visual hull gives the place (Caillette, Galata & Howard 2007, section 6.2),
`search.trackers.initialisation` the pose; which way a person faces, the network that knows people has a say in
(`runs.setup.person_facing`). The result is a function of the frame's pictures, the body, the settings and the seed.
"""

import dataclasses
import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.body.dimensions import with_usual_feet
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.volume.alignment import root_parameters
from studio.evidence.volume.body_space import space_of
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.reconstruction import HullSettings, check_views, reconstruct
from studio.evidence.volume.tracking_space import HEIGHT, Box
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import enumerated
from studio.runs.behaviour_models import fitting, model_folders, model_path
from studio.runs.problem_source import ProblemSource, check_seen
from studio.runs.search_space import parameter_names, search_space, session_sigma
from studio.runs.setup.initial_limbs import limbs_put_right
from studio.runs.setup.mesh_start import EFFORT, outlines_put_right
from studio.runs.setup.person_facing import NETWORK_ODDS, facing_agreement
from studio.runs.setup.session_settings import session_settings
from studio.search.behaviour.model_file import read_model
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.devices import CPU
from studio.search.likelihood.mesh_silhouettes import MeshSilhouettes
from studio.search.settings import DEFAULT_TRACKER, RunSettings, changed_settings
from studio.search.trackers.initialisation import (
    PER_FAMILY,
    THOROUGH,
    Effort,
    FoundStart,
    StartSearch,
    confidence,
    facing_odds,
)
from studio.search.trackers.limb_resampling import Hypothesis, has_tail
from studio.search.trackers.loss_detection import Onlooker
from studio.search.trackers.start_candidates import facing, start_candidates
from studio.search.trackers.tracker import LIMB_LOST_SHARE, FrameLikelihood, SearchSpace
from studio.sessions.atomic_files import keep_before
from studio.sessions.named_rows import write_pose
from studio.sessions.names import free_name
from studio.sessions.provenance import note
from studio.sessions.session import Session
from studio.sessions.work_under_way import one_at_a_time

WEIGHTING = "edge-silhouette"
"""The likelihood that separates poses best: of 20 moments of the Lee walk's twin (human31) it found all, 24 mm off on
average, and with samples of the region beside them 19, at 48 mm; on the balancing man, whose room is full of edges,
those put an arm in front of the chest.
"""
SILHOUETTES, BY_SILHOUETTES = (
    "edge-region-silhouette",
    {"edge_weight": 0.0, "region_weight": 0.0, "silhouette_weight": 5.0},
)
"""The likelihood of bodies with a tail: areas alone. The edges of a tail two pixels wide are worth less than
no edges, so that with them a mouse whose tail is inside it, and which then faces the other way, weighs more."""
HULL_DEPTH = 6
FEWEST_VIEWS = 2
TURNED = "By the silhouettes the person would face the other way; the pictures say this one."
HIPS, NEAR, FAR, AHEAD, AROUND = 950.0, 1500.0, 8000.0, 3500.0, 1500.0
"""mm, for a single camera: height of the hips, their largest distance, their assumed distance, and its spread."""
LEAST_LOSS = 1e-9
"""Of a refined pose: what has less fits exactly."""
EVEN_SHARE, STEEPNESS = 0.1, 4.0
"""Of `trust`: the share at which right and wrong are equally likely, and the width of the transition."""
UNSURE = 0.75
"""A start pose with a lower confidence is to be looked at before it is tracked from: it may face the other way."""


@dataclass(frozen=True, slots=True, eq=False)
class InitialPose:
    """An estimated start pose.

    names : of the D parameters.
    pose : (D,) radians and mm.
    body : its name.
    confidence : 0 to 1, that pose and heading are right.
    margin : log weight above the best pose that faces the other way, inf without one; negative where the pictures say
        that a person faces as the lighter pose does.
    rival : that pose.
    agreement : share of the last searches with this heading.
    overlap : of silhouettes and model, f_s.
    hull_litres : volume of the hull, 0 without one.
    evaluations : poses weighed.
    note : a sentence, or "".
    file : that was written; None for none.
    """

    frame: int
    body: str
    names: tuple[str, ...]
    pose: Array
    confidence: float
    margin: float
    rival: Array | None
    agreement: float
    overlap: float
    hull_litres: float
    evaluations: int
    note: str
    file: Path | None = None

    @property
    def source(self) -> str:
        """The origin of the pose, for a run's record."""
        return f"found in frame {self.frame}, confidence {100.0 * self.confidence:.0f} %"

    @property
    def unsure(self) -> bool:
        """Whether it is to be looked at before it is tracked from."""
        return self.confidence < UNSURE


def initialise(
    session: Session,
    frame: int = 0,
    *,
    body: BodyModel | None = None,
    behaviour: str = "",
    weighting: str = WEIGHTING,
    device: str = CPU,
    seed: int = 0,
    progress: Progress = no_progress,
) -> InitialPose:
    """The pose of the session's body in a frame.

    body : the session's own by default. device : what weighs poses, where the weighting has that knob. behaviour : name
    or path of a model whose prototypes are candidates.

    Raises RunError where the frame shows no body, NotFoundError for an unknown frame.
    """
    tree = body or session.body()
    tailed = has_tail(tree)
    settings = (
        session_settings(session, DEFAULT_TRACKER, SILHOUETTES, BY_SILHOUETTES)
        if tailed and weighting == WEIGHTING
        else session_settings(session, DEFAULT_TRACKER, weighting)
    )
    if device != CPU:
        settings = changed_settings(settings, {"device": device})
    prototypes = None
    if behaviour:
        model = read_model(model_path(model_folders(session), behaviour))
        prototypes = fitting(model, tree, session.manifest.fps).prototypes.poses
    with closing(ProblemSource(session, tree)) as problems:
        progress("reading the frame", 0, 1)
        cameras = problems.cameras_in(frame)
        check_views(cameras)
        evidence = problems.evidence(frame, settings)
        masks = problems.evidence(frame, session_settings(session, DEFAULT_TRACKER, WEIGHTING))
        pictures = {camera.name: problems.footage.picture(camera.name, frame) for camera in cameras}
    check_seen(session, masks)
    hull, box, note = hull_of(tree, cameras, masks)
    space = search_space(tree, session_sigma(session, tree, session.manifest.fps))
    problem = (
        MeshSilhouettes(tree, cameras, masks)
        if tree.meshes
        else whole_problem(tree, cameras, settings, evidence)
    )
    start = seek(
        problem,
        space,
        tree,
        hull,
        box,
        cameras=len(cameras),
        seed=seed,
        effort=EFFORT if tree.meshes else THOROUGH,
        prototypes=prototypes,
        progress=lambda done, total: progress("searching for the pose", done, total),
    )
    progress("checking each limb", 0, 1)
    votes = facing_agreement(tree, cameras, pictures, start.pose)
    start = facing_as_said(start, len(cameras), votes)
    if start.margin < 0.0:
        note = f"{note} {TURNED}".strip()
    draw = len(cameras) >= FEWEST_VIEWS
    if tree.meshes:
        stands = outlines_put_right(tree, cameras, masks, start.pose, seed, progress)
    elif tailed and start.rival is not None:
        start, stands = better_facing(problem, tree, cameras, masks, start, seed, draw=draw)
    else:
        stands = limbs_put_right(tree, cameras, masks, start.pose, seed, draw=draw)
    shares = stands.off.shares()
    contradicted = [limb for limb, share in shares.items() if share > LIMB_LOST_SHARE]
    if contradicted:
        note = f"{note} The masks do not agree with the {enumerated(contradicted)}: check there.".strip()
    return InitialPose(
        frame=evidence.frame,
        body=tree.name,
        names=parameter_names(tree),
        pose=stands.pose,
        confidence=start.confidence * trust(contradicted_share(tree, stands)),
        margin=start.margin,
        rival=start.rival,
        agreement=start.agreement,
        overlap=Onlooker(tree, cameras).sight(masks, stands.pose).overlap,
        hull_litres=0.0 if hull is None else hull.volume() * 1e-6,
        evaluations=start.evaluations,
        note=note,
    )


def better_facing(
    problem: FrameLikelihood,
    body: BodyModel,
    cameras: tuple[Camera, ...],
    masks: FrameEvidence,
    start: FoundStart,
    seed: int,
    *,
    draw: bool,
) -> tuple[FoundStart, Hypothesis]:
    """The start or its rival, each with its limbs put right and its facing kept, whichever the silhouettes show rather:
    by their areas (the likelihood) and their borders (the logarithm of the loss that the refinement leaves).

    Of 24 drawn mice (other girths than the body's, most masks without a tail; three views) all face right so, 22 by
    the areas alone. Of 39 starts in two films, all right or wrong by the pictures, 33 do, and 30 by the areas alone.
    """
    assert start.rival is not None
    stands, other = (
        limbs_put_right(body, cameras, masks, pose, seed, draw=draw, turn=False)
        for pose in (start.pose, start.rival)
    )
    own, rival = (float(weight) for weight in problem.log_likelihood(np.stack([stands.pose, other.pose])))
    gain = own - rival + math.log(max(other.loss, LEAST_LOSS) / max(stands.loss, LEAST_LOSS))
    turned = gain < 0.0
    best, second = (other, stands) if turned else (stands, other)
    start = dataclasses.replace(
        start,
        pose=best.pose,
        rival=second.pose,
        log_weight=rival if turned else own,
        margin=abs(gain),
        agreement=1.0 - start.agreement if turned else start.agreement,
        confidence=confidence(facing_odds(abs(gain), len(cameras))),
    )
    return start, best


def facing_as_said(start: FoundStart, cameras: int, votes: float) -> FoundStart:
    """The start pose or its rival, whichever faces the right way by its weight and by what the network says of the
    pictures (`facing_agreement` of the start pose), with the confidence of both together.
    """
    weighed = 0.0 if start.rival is None and votes < 0.0 else facing_odds(start.margin, cameras)
    odds = weighed + NETWORK_ODDS * votes
    if odds < 0.0 and start.rival is not None:
        return dataclasses.replace(
            start, pose=start.rival, rival=start.pose, log_weight=start.log_weight - start.margin,
            margin=-start.margin, agreement=1.0 - start.agreement, confidence=confidence(-odds),
        )  # fmt: skip
    return dataclasses.replace(start, confidence=confidence(odds))


def contradicted_share(body: BodyModel, stands: Hypothesis) -> float:
    """The largest share of a limb's area that the masks contradict; of a body with a tail the share of the whole body:
    tails are missing in masks more often than they are lost.
    """
    if not has_tail(body):
        return max(stands.off.shares().values(), default=0.0)
    off = stands.off
    return float((off.outside + off.bare).sum() / max(off.area.sum(), 1.0))


def trust(most: float) -> float:
    """The confidence in a start pose, from the largest share of a limb's area that the masks contradict.

    Measured on drawn footage (initialised in three frames of each clip, right: mean marker error at most 100 mm): of
    the choosing half the right ones have at most 0.08, the wrong ones 0.12 and more. On the reporting half 30 of 30
    rated 90 % or more are right.
    """
    return 1.0 / (1.0 + (most / EVEN_SHARE) ** STEEPNESS)


def keep_pose(session: Session, initial: InitialPose, replace: bool = False) -> Path:
    """Write a found pose into the session's folder; returns the file.

    It becomes the start pose of its body if there is none, or with `replace` (the old one is kept beside it as
    start_pose-before.csv, numbered if there are more): start_pose.csv of the session's body, start_pose-of-BODY.csv of
    another one. Otherwise it is a separate file for `--start-pose`, named after its frame.
    """
    own, taken = session.start_pose_path(initial.body), {path.name for path in session.path.glob("*.csv")}
    if replace or not own.exists():
        with one_at_a_time(session.path):
            keep_before(own)
            write_pose(own, initial.names, initial.pose, initial.frame)
            if initial.body == session.manifest.body:
                note(session, "start-pose", initial.source, good=not initial.unsure)
        return own
    place = session.path / _free(f"{own.stem}-frame-{initial.frame}", taken)
    write_pose(place, initial.names, initial.pose, initial.frame)
    return place


def _free(stem: str, taken: set[str]) -> str:
    return f"{free_name(stem, {Path(name).stem for name in taken})}.csv"


def hull_of(
    body: BodyModel, cameras: tuple[Camera, ...], evidence: FrameEvidence
) -> tuple[Hull | None, Box, str]:
    """The hull of a frame's masks (None if there is none), the search volume, and why there is no hull."""
    if len(cameras) < FEWEST_VIEWS:
        box = _before(cameras[0], scale_of(body)) if len(root_parameters(body)) else space_of(body, cameras)
        return None, box, "One camera makes no hull: the body was searched for in the middle of its view."
    box = space_of(body, cameras)
    hull = reconstruct(evidence, cameras, box, HullSettings(hull_depth=HULL_DEPTH))
    if hull.empty:
        return (
            None,
            box,
            "The masks have no volume in common: the body was searched for in the middle of the views.",
        )
    return hull, box, ""


def _before(camera: Camera, scale: float) -> Box:
    """The search volume in the middle of one camera's view: around its axis at hip height, if that is near. scale : of
    the body (`scale_of`).
    """
    ahead, centre = camera.rotation[2], camera.centre
    distance = (scale * HIPS - centre[2]) / ahead[2] if ahead[2] else np.inf
    place = centre + ahead * (distance if scale * NEAR < distance < scale * FAR else scale * AHEAD)
    half = scale * np.array([AROUND, AROUND, 0.0])
    return Box(place * [1, 1, 0] - half, place * [1, 1, 0] + half + [0.0, 0.0, scale * HEIGHT])


def whole_problem(
    body: BodyModel, cameras: tuple[Camera, ...], settings: RunSettings, evidence: FrameEvidence
) -> FrameLikelihood:
    """A frame as a function of the body's poses, with feet also where the body is tracked without: their direction
    distinguishes front from back.
    """
    whole = with_usual_feet(body)
    likelihood = WEIGHTINGS[settings.weighting_name].prepare(whole, cameras, settings.weighting)
    return likelihood.problem(evidence)


def seek(
    problem: FrameLikelihood,
    space: SearchSpace,
    body: BodyModel,
    hull: Hull | None,
    box: Box,
    *,
    cameras: int,
    seed: int,
    effort: Effort = THOROUGH,
    prototypes: Array | None = None,
    known: Array | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> FoundStart:
    """Search a prepared frame for the start pose. known : (K, D) poses to try unchanged."""
    rng = np.random.default_rng(np.random.SeedSequence((seed, 0xB0D1)))
    candidates = start_candidates(rng, body, hull, box, PER_FAMILY, prototypes)
    search = StartSearch(
        problem,
        space,
        body.neutral,
        lambda poses: facing(body, poses),
        cameras=cameras,
        seed=seed,
        spread=body.spread,
        effort=effort,
        progress=progress,
    )
    return search.run(candidates, known)
