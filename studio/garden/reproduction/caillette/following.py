"""A tracker on the dance, with or without a behaviour model: the trial of most of these experiments."""

import copy
import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.volume.blob_fitting import fit_blobs
from studio.evidence.volume.relative_entropy import DivergenceOfPoses
from studio.foundations.arrays import Array
from studio.foundations.errors import SettingsError
from studio.foundations.progress import report
from studio.garden.reproduction.caillette.training_set import Training, learnt
from studio.garden.reproduction.caillette.true_motion import TrueMotion, joint_errors, true_motion
from studio.garden.reproduction.tracking import Candidate
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Trial, kept_as
from studio.runs.behaviour_models import fitting
from studio.runs.live.following import Following
from studio.runs.search_space import search_space, session_sigma
from studio.search.behaviour.feature_space import feature_space
from studio.search.behaviour.model import BehaviourModel
from studio.search.likelihood.blobs import FLOOR, BlobFrameLikelihood, ExpectedBlobs
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import FittedToPoses, FrameLikelihood, QualityMeasured
from studio.search.settings import RunSettings, changed_settings, default_settings
from studio.search.trackers.guided_particles import spread_over_clusters
from studio.search.trackers.loss_detection import Onlooker
from studio.search.trackers.random_numbers import keyed_generator
from studio.search.trackers.tracker import FilterState, FrameResult, LayerRecord, start_of
from studio.sessions.session import Session

# The frames that trials weigh, prepared once for all trials of a process that use the same ones.
# Two ways: as in a run, where blobs are fitted from where the tracker expects the body; and with blobs that are
# fitted from the true pose in every frame, learnt from true poses too (section 7.3: "initialised from the annotated
# ground-truth pose", so that trackers are compared by their dynamics alone).


@dataclass(frozen=True, slots=True)
class Known:
    """A frame with given expected poses, which a search does not change."""

    informed: FrameLikelihood

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights."""
        return self.informed.log_likelihood(poses, stage)

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) the fitness that a swarm maximises."""
        return self.informed.fitness(poses, stage)

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether they are possible for the body."""
        return self.informed.feasible(poses, limbs_apart=limbs_apart)


HIDDEN_SIDE, SPELL, NOISE_MM = "left", 30, 20.0
"""Of occluded evidence: the blobs of this side's arm and leg are missing in every other second (30 frames), and the
middle of every blob is off by Gaussian noise of so many mm in each direction.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Occluded(Known):
    """A frame whose evidence is occluded and noisy. seen : of the blobs that are there."""

    seen: DivergenceOfPoses
    sharpness: float

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights by the blobs that are there, at any stage."""
        del stage
        return -self.sharpness * np.log(np.maximum(self.seen(poses), FLOOR))


def occluded(body: BodyModel, frame: int, informed: FrameLikelihood) -> Known:
    """The frame with occluded evidence, the same for every tracker and seed; as it is where nothing was seen."""
    if not isinstance(informed, ExpectedBlobs) or informed.fitted is None:
        return Known(informed)
    image, limbs = informed.fitted.mixture, informed.model.limb
    noise = np.random.default_rng((NOISE_KEY, frame)).normal(0.0, NOISE_MM, image.means.shape)
    hidden = [body.drawn[int(limb)].side == HIDDEN_SIDE and (frame // SPELL) % 2 == 1 for limb in limbs]
    there = np.flatnonzero(~np.array(hidden))
    moved = dataclasses.replace(image, means=image.means + noise)
    seen = DivergenceOfPoses.against(body, informed.model, moved, there)
    return Occluded(informed, seen, informed.likelihood.settings.blob_sharpness)


NOISE_KEY = 0xB10B


def problems(
    cache: FootageCache, session: Session, settings: RunSettings, last: int
) -> Callable[[int], FrameLikelihood]:
    """Frame number to problem, for the first `last` frames. Those of hulls are kept, as carving takes longest."""
    weighting, cameras = WEIGHTINGS[settings.weighting_name], session.cameras()
    likelihood = weighting.prepare(session.body(), cameras, settings.weighting)

    def made(frame: int) -> FrameLikelihood:
        seen = cache.evidence(
            session, cameras, frame, settings.evidence, weighting.edge_kind, weighting.reads_pictures
        )
        return likelihood.problem(seen)

    if weighting.edge_kind != "hull":
        return made
    key = ("hulls", session.path, settings.weighting, settings.evidence, last)
    kept = cache.prepared(key, lambda: [made(frame) for frame in range(last)])
    return lambda frame: kept[frame]


def known_problems(
    cache: FootageCache, session: Session, settings: RunSettings, true_poses: Array, covered: bool = False
) -> Callable[[int], FrameLikelihood]:
    """Frame number to problem, each given the true pose (F, D) as the expected one. covered : with occluded evidence.
    Raises SettingsError for a weighting that does not use expected poses.
    """
    last, body = len(true_poses), session.body()

    def informed() -> Sequence[FrameLikelihood]:
        memory: Mapping[str, Array] = {}
        likelihoods: list[FrameLikelihood] = []
        of_frame = problems(cache, session, settings, last)
        for frame, pose in enumerate(true_poses):
            problem = of_frame(frame)
            if not isinstance(problem, FittedToPoses):
                raise SettingsError(
                    f"Weighting '{settings.weighting_name}' uses no expected poses.",
                    "Take one that fits blobs.",
                )
            expecting = problem.expecting(pose[None], memory)
            memory = cast("FittedToPoses", expecting).remembered(pose)
            likelihoods.append(occluded(body, frame, expecting) if covered else Known(expecting))
        return likelihoods

    key = ("known", session.path, settings.weighting, settings.evidence, last, covered)
    kept = cache.prepared(key, informed)
    return lambda frame: kept[frame]


def taught_blobs(
    problem_of: Callable[[int], FrameLikelihood], true_poses: Array, settings: RunSettings
) -> Mapping[str, Array]:
    """The memory with blobs learnt from true poses (F, D), of as many frames as a run learns from. Raises
    SettingsError for a likelihood without blobs.
    """
    weighting = settings.weighting
    memory: Mapping[str, Array] = {}
    for frame, pose in enumerate(true_poses[: weighting.blob_learning]):
        problem = problem_of(frame)
        if not isinstance(problem, FittedToPoses):
            raise SettingsError(
                f"Weighting '{settings.weighting_name}' learns no blobs.", "Take one that fits blobs."
            )
        memory = cast("FittedToPoses", problem.expecting(pose[None], memory)).remembered(pose)
    return memory


def placed_quality(problem: FrameLikelihood, pose: Array, memory: Mapping[str, Array]) -> float:
    """Likelihood of the voxels by the learnt blobs where a pose (D,) puts them, not fitted, less these blobs' own, nats
    a voxel; -inf where nothing is seen. Raises SettingsError for a likelihood without blobs.
    """
    if not isinstance(problem, BlobFrameLikelihood):
        raise SettingsError("This likelihood has no blobs.", "Take one that fits blobs.")
    if problem.hull.empty:
        return float("-inf")
    likelihood = problem.likelihood
    model = likelihood.model(memory)
    return fit_blobs(problem.hull, model, likelihood.body, pose[None], 0, moved=False).margin


FITTED, PLACED = "fitted", "placed"
"""What a loss is told by: the likelihood of the blobs fitted from the pose, as printed, or of those that it places."""
LATER = ("recovers", "covered", "taught", "lost_by", "lost_below")


@dataclass(frozen=True, slots=True)
class Follow:
    """One run: all that its poses depend on, plain values.

    footage : a recipe's name. last : frames from the first, which begins at the true pose. changes : knobs by flat
    name. from_truth : blobs are fitted from the true pose in every frame. training : of the behaviour
    model, None without one. recovers : by the paper's own recovery (`Recovering`). covered : by occluded evidence
    (`occluded`), with blobs fitted from the true pose. taught : the run begins with blobs that were learnt from the
    true poses of the first frames (`taught_blobs`). lost_by, lost_below : with recovery, FITTED or PLACED, and
    how many nats a voxel below a body like the blobs a frame counts as lost; "": FITTED, by the knob.
    """

    footage: str
    tracker: str
    weighting: str
    seed: int
    last: int
    changes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    from_truth: bool = False
    training: Training | None = None
    recovers: bool = False
    covered: bool = False
    taught: bool = False
    lost_by: str = ""
    lost_below: float = 0.0

    def plain(self) -> dict[str, Any]:
        """As a trial's arguments; those of LATER only where they are, so that stored outcomes stay valid."""
        return {name: value for name, value in asdict(self).items() if value or name not in LATER}

    @classmethod
    def of_plain(cls, arguments: Mapping[str, Any]) -> "Follow":
        """From a trial's arguments, as read from JSON."""
        training = arguments.get("training")
        words: dict[str, Any] = {**arguments, "training": Training.of_plain(training) if training else None}
        return cls(**words)

    def settings(self) -> RunSettings:
        """All knobs of the run. Raises SettingsError."""
        return changed_settings(default_settings(self.tracker, self.weighting), self.changes)


@dataclass(frozen=True, slots=True)
class Followed:
    """The errors of a run. Of each frame: angle_deg, limb_deg, position_mm : RMS over joint angles, limbs' directions
    and markers; lost : a marker is off by more than 150 mm; free : share of the particles that no model moved, empty
    where none guides them; resets : the automaton was reset, empty where there is no recovery; centre_mm : error of the
    markers' middle. mean_mm : mean marker error. evaluations : of a frame. milliseconds : of a frame's search.
    """

    angle_deg: list[float]
    limb_deg: list[float]
    position_mm: list[float]
    lost: list[bool]
    free: list[float]
    mean_mm: float
    evaluations: int
    milliseconds: float
    resets: list[bool] = field(default_factory=list[bool])
    centre_mm: list[float] = field(default_factory=list[float])

    @property
    def centre_rms(self) -> float:
        """RMS over frames of the error of the body's middle, mm."""
        return _rms(self.centre_mm)

    @property
    def shape_rms(self) -> float:
        """RMS over frames and markers once the body's middle is put in its place, mm."""
        return float(np.sqrt(max(self.position_rms**2 - self.centre_rms**2, 0.0)))

    @property
    def angle_rms(self) -> float:
        """RMS over frames and joint angles, degrees."""
        return _rms(self.angle_deg)

    @property
    def limb_rms(self) -> float:
        """RMS over frames and limbs of the angle between found and true axis, degrees."""
        return _rms(self.limb_deg)

    @property
    def position_rms(self) -> float:
        """RMS over frames and markers, mm."""
        return _rms(self.position_mm)

    @property
    def lost_share(self) -> float:
        """Share of the frames with a limb lost."""
        return float(np.mean(self.lost))


@dataclass(eq=False)
class Recovering(Following):
    """Following with the recovery of section 6.3. lost_by, lost_below : as in `Follow`. resets : of each frame.

    Where the best mixture of blobs gives the voxels a poor likelihood the states of all particles are reset, which
    spreads them over the clusters, and the frame's blobs are fitted from all clusters that hold one before it is
    searched again. Roots stay, with noise of σ0.
    """

    lost_by: str = ""
    lost_below: float = 0.0
    resets: list[bool] = field(default_factory=list[bool])

    def step(self, frame: int, problem: FrameLikelihood, seen: FrameEvidence | None = None) -> FrameResult:
        """Search a frame; again from all clusters where its blobs fit poorly."""
        before = self.carried
        result = super().step(frame, problem, seen)
        root = before.estimate
        lost = root is not None and self._is_lost(problem, before, result)
        self.resets.append(lost)
        if not lost or root is None or self.space.behaviour is None:
            return result
        for kept in (self.poses, self.log_weights, self.memories, self.overlaps):
            kept.pop()
        tracker = self.settings.tracker
        rng = keyed_generator(self.seed, frame, RESET_KEY)
        sigma = self.space.sigma * tracker.diffusion_scale
        spread = spread_over_clusters(rng, self.space, tracker.particles, root, sigma)
        self.carried = dataclasses.replace(before, particles=spread)
        usual, clusters = self.settings, self.space.behaviour.clusters
        # Beyond the knobs' range: as many as there are.
        every = dataclasses.replace(tracker, expected_support=0.0, expected_most=clusters)
        self.settings = dataclasses.replace(usual, tracker=every)
        try:
            return super().step(frame, _fitted_from(problem, clusters + LAST_POSES), seen)
        finally:
            self.settings = usual

    def _is_lost(self, problem: FrameLikelihood, before: FilterState, result: FrameResult) -> bool:
        """Whether blobs fitted from where the body was found, or placed there, give the voxels a poor likelihood."""
        if self.lost_by == PLACED:
            return placed_quality(problem, result.estimate.pose, before.memory) < -self.lost_below
        if not isinstance(problem, FittedToPoses):
            return False
        fitted = problem.expecting(result.estimate.pose[None], before.memory)
        if not isinstance(fitted, QualityMeasured):
            return False
        return fitted.quality < -self.lost_below if self.lost_by else fitted.lost_evidence


RESET_KEY = 0x5EED


LAST_POSES = 2
"""That a search expects beside its tracker's: where the body was last, and where it was going."""


def _fitted_from(problem: FrameLikelihood, starts: int) -> FrameLikelihood:
    """A frame whose blobs are fitted from as many expected poses."""
    if not isinstance(problem, BlobFrameLikelihood):
        return problem
    likelihood = copy.copy(problem.likelihood)
    likelihood.settings = dataclasses.replace(likelihood.settings, blob_starts=starts)
    return BlobFrameLikelihood(likelihood, problem.hull)


@dataclass(frozen=True, slots=True, eq=False)
class FollowedRun:
    """The poses (F, D) of a run, and its frames' records.

    model : the behaviour model at its end, if any. resets : as in `Followed`. overlaps : of each frame's pose with the
    masks, NaN without online learning.
    """

    poses: Array
    free: list[float]
    evaluations: int
    seconds: float
    model: BehaviourModel | None
    resets: list[bool]
    overlaps: list[float]


def follow_trial(
    candidate: Candidate,
    group: str,
    footage: str,
    seed: int,
    last: int,
    **fields: Any,  # noqa: ANN401
) -> Trial:
    """The trial of a candidate. group : candidate and setting as text. fields : other fields of `Follow`."""
    changes = {**candidate.changes, **fields.pop("changes", {})}
    follow = Follow(footage, candidate.tracker, candidate.weighting, seed, last, changes, **fields)
    return Trial(f"{group}, seed {seed}", follow.plain())


@kept_as("caillette.following.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track and compare; the fields of `Followed`."""
    wanted = Follow.of_plain(arguments)
    model = learnt(cache, wanted.training).model if wanted.training else None
    session = cache.session(wanted.footage)
    truth = true_motion(cache, session, wanted.last)
    return asdict(followed(session, truth, run_of(cache, session, truth, wanted, model)))


def run_of(
    cache: FootageCache, session: Session, truth: TrueMotion, wanted: Follow, model: BehaviourModel | None
) -> FollowedRun:
    """The run that tracks the footage from the true pose of its first frame."""
    settings, body, fps = wanted.settings(), session.body(), session.manifest.fps
    problem_of = problems(cache, session, settings, wanted.last)
    if wanted.from_truth:
        problem_of = known_problems(cache, session, settings, truth.poses, wanted.covered)
    start = start_of(tuple(float(value) for value in truth.poses[0]))
    if wanted.taught:
        start = dataclasses.replace(start, memory=taught_blobs(problem_of, truth.poses, settings))
    free: list[float] = []

    def note(record: LayerRecord) -> None:
        if np.isfinite(record.model_free_share):
            free.append(float(record.model_free_share))

    fitted = None if model is None else fitting(model, body, fps)
    recovering = partial(Recovering, lost_by=wanted.lost_by, lost_below=wanted.lost_below)
    following = (recovering if wanted.recovers else Following)(
        settings,
        search_space(body, session_sigma(session, body, fps), fitted),
        start,
        wanted.seed,
        on_layer=note,
        overlap_of=_overlap_of(cache, session, settings),
    )
    seconds, evaluations = 0.0, 0
    for frame in range(wanted.last):
        problem = problem_of(frame)
        began = time.perf_counter()
        evaluations = following.step(frame, problem).evaluations
        seconds += time.perf_counter() - began if frame else 0.0
        report("tracking", frame + 1, wanted.last)
    resets = following.resets if isinstance(following, Recovering) else []
    return FollowedRun(
        np.array(following.poses), free, evaluations, seconds, following.model, resets, following.overlaps
    )


MASKS = "edge-region-silhouette"
"""The likelihood whose masks tell how well a pose agrees: hulls are carved without any."""


def _overlap_of(
    cache: FootageCache, session: Session, settings: RunSettings
) -> Callable[[int, Array], float]:
    """A frame's number and a pose (D,) to the overlap of their silhouettes (f_s)."""
    cameras, kind = session.cameras(), WEIGHTINGS[MASKS].edge_kind
    onlooker = Onlooker(session.body(), cameras)

    def overlap(frame: int, pose: Array) -> float:
        return onlooker.sight(cache.evidence(session, cameras, frame, settings.evidence, kind), pose).overlap

    return overlap


def followed(session: Session, truth: TrueMotion, way: FollowedRun) -> Followed:
    """The errors of a run."""
    body = session.body()
    errors = joint_errors(body, feature_space(body, session.manifest.fps).columns, way.poses, truth)
    return Followed(
        _rounded(errors.angle_deg),
        _rounded(errors.limb_deg),
        _rounded(errors.position_mm),
        errors.lost.tolist(),
        [round(value, 4) for value in way.free],
        round(float(errors.mean_mm.mean()), 4),
        way.evaluations,
        round(1000.0 * way.seconds / max(1, len(way.poses) - 1), 3),
        way.resets,
        _rounded(errors.centre_mm),
    )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _rounded(values: Sequence[float] | Array) -> list[float]:
    return [round(float(value), 3) for value in values]
