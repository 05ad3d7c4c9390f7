"""A tracker on the dance, with or without a behaviour model: the trial of most of these experiments."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from studio.behaviour.feature_space import feature_space
from studio.behaviour.model import BehaviourModel
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.trials import Trial, kept_as
from studio.errors import SettingsError
from studio.reproduction.caillette.training_set import Training, learnt
from studio.reproduction.caillette.true_motion import TrueMotion, joint_errors, true_motion
from studio.reproduction.tracking import Contender
from studio.runs.behaviour_models import fitting
from studio.runs.following import Following
from studio.runs.search_space import search_space, session_sigma
from studio.sessions.session import Session
from studio.settings import RunSettings, changed_settings, default_settings
from studio.tracking.tracker import LayerRecord, start_of
from studio.weighting.catalogue import WEIGHTINGS
from studio.weighting.problem import Expectant, FrameProblem

Array = NDArray[np.float64]

# The frames that trials weigh, prepared once for all trials of a process that use the same ones.
# Two ways: as in a run, where blobs are fitted from where the tracker expects the body; and with blobs that are
# fitted from the true pose in every frame, learnt from true poses too (section 7.3: "initialised from the annotated
# ground-truth pose", so that trackers are compared by their dynamics alone).


@dataclass(frozen=True, slots=True)
class Known:
    """A frame with given expected poses, which a search does not change."""

    informed: FrameProblem

    def weigh(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights."""
        return self.informed.weigh(poses, stage)

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) the fitness that a swarm maximises."""
        return self.informed.fitness(poses, stage)

    def feasible(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether they are possible for the body."""
        return self.informed.feasible(poses, limbs_apart)


def problems(
    shelf: FootageShelf, session: Session, settings: RunSettings, last: int
) -> Callable[[int], FrameProblem]:
    """Frame number to problem, for the first `last` frames. Those of hulls are kept, as carving takes longest."""
    weighting, cameras = WEIGHTINGS[settings.weighting_name], session.cameras()
    weigher = weighting.prepare(session.body(), cameras, settings.weighting)

    def made(frame: int) -> FrameProblem:
        seen = shelf.evidence(
            session, cameras, frame, settings.evidence, weighting.edge_kind, weighting.reads_pictures
        )
        return weigher.problem(seen)

    if weighting.edge_kind != "hull":
        return made
    key = ("hulls", session.path, settings.weighting, settings.evidence, last)
    kept = shelf.prepared(key, lambda: [made(frame) for frame in range(last)])
    return lambda frame: kept[frame]


def known_problems(
    shelf: FootageShelf, session: Session, settings: RunSettings, true_poses: Array
) -> Callable[[int], FrameProblem]:
    """Frame number to problem, each given the true pose (F, D) as the expected one. Raises SettingsError for a
    weighting that does not use expected poses.
    """
    last = len(true_poses)

    def informed() -> Sequence[FrameProblem]:
        memory: Mapping[str, Array] = {}
        found = []
        of_frame = problems(shelf, session, settings, last)
        for frame, pose in enumerate(true_poses):
            problem = of_frame(frame)
            if not isinstance(problem, Expectant):
                raise SettingsError(
                    f"Weighting '{settings.weighting_name}' uses no expected poses.",
                    "Take one that fits blobs.",
                )
            expecting = problem.expecting(pose[None], memory)
            memory = cast("Expectant", expecting).remembered(pose)
            found.append(Known(expecting))
        return found

    key = ("known", session.path, settings.weighting, settings.evidence, last)
    kept = shelf.prepared(key, informed)
    return lambda frame: kept[frame]


@dataclass(frozen=True, slots=True)
class Follow:
    """One run: all that its poses depend on, plain values.

    footage : a recipe's name. last : frames from the first, which begins at the true pose. changes : knobs by flat
    name. from_truth : blobs are fitted from the true pose in every frame. training : of the behaviour
    model, None without one.
    """

    footage: str
    tracker: str
    weighting: str
    seed: int
    last: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    from_truth: bool = False
    training: Training | None = None

    def plain(self) -> dict[str, Any]:
        """As a trial's arguments."""
        return asdict(self)

    @classmethod
    def of_plain(cls, arguments: Mapping[str, Any]) -> "Follow":
        """From a trial's arguments, as read from JSON."""
        training = arguments.get("training")
        return cls(**{**arguments, "training": Training.of_plain(training) if training else None})

    def settings(self) -> RunSettings:
        """All knobs of the run. Raises SettingsError."""
        return changed_settings(default_settings(self.tracker, self.weighting), self.changes)


@dataclass(frozen=True, slots=True)
class Followed:
    """The errors of a run. Of each frame: angle_deg, limb_deg, position_mm : RMS over joint angles, limbs' directions
    and markers; lost : a marker is off by more than 150 mm; free : share of the particles that no model moved, empty
    where none guides them. mean_mm : mean marker error. evaluations : of a frame. milliseconds : of a frame's search.
    """

    angle_deg: list[float]
    limb_deg: list[float]
    position_mm: list[float]
    lost: list[bool]
    free: list[float]
    mean_mm: float
    evaluations: int
    milliseconds: float

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


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The poses (F, D) of a run, and its frames' records. model : the behaviour model at its end, if any."""

    poses: Array
    free: list[float]
    evaluations: int
    seconds: float
    model: BehaviourModel | None


def follow_trial(
    contender: Contender,
    group: str,
    footage: str,
    seed: int,
    last: int,
    **fields: Any,  # noqa: ANN401
) -> Trial:
    """The trial of a contender. group : contender and setting as text. fields : other fields of `Follow`."""
    changes = {**contender.changes, **fields.pop("changes", {})}
    follow = Follow(footage, contender.tracker, contender.weighting, seed, last, changes, **fields)
    return Trial(f"{group}, seed {seed}", follow.plain())


@kept_as("caillette.following.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track and compare; the fields of `Followed`."""
    wanted = Follow.of_plain(arguments)
    model = learnt(shelf, wanted.training).model if wanted.training else None
    session = shelf.session(wanted.footage)
    truth = true_motion(shelf, session, wanted.last)
    return asdict(followed(session, truth, way_of(shelf, session, truth, wanted, model)))


def way_of(
    shelf: FootageShelf, session: Session, truth: TrueMotion, wanted: Follow, model: BehaviourModel | None
) -> Way:
    """The run that tracks the footage from the true pose of its first frame."""
    settings, body, fps = wanted.settings(), session.body(), session.manifest.fps
    problem_of = problems(shelf, session, settings, wanted.last)
    if wanted.from_truth:
        problem_of = known_problems(shelf, session, settings, truth.poses)
    free: list[float] = []

    def note(record: LayerRecord) -> None:
        if np.isfinite(record.model_free_share):
            free.append(float(record.model_free_share))

    fitted = None if model is None else fitting(model, body, fps)
    following = Following(
        settings,
        search_space(body, session_sigma(session, body, fps), fitted),
        start_of(tuple(float(value) for value in truth.poses[0])),
        wanted.seed,
        on_layer=note,
    )
    seconds, evaluations = 0.0, 0
    for frame in range(wanted.last):
        problem = problem_of(frame)
        began = time.perf_counter()
        evaluations = following.step(frame, problem).evaluations
        seconds += time.perf_counter() - began if frame else 0.0
    return Way(np.array(following.poses), free, evaluations, seconds, following.model)


def followed(session: Session, truth: TrueMotion, way: Way) -> Followed:
    """The errors of a run."""
    body = session.body()
    found = joint_errors(body, feature_space(body, session.manifest.fps).columns, way.poses, truth)
    return Followed(
        _rounded(found.angle_deg),
        _rounded(found.limb_deg),
        _rounded(found.position_mm),
        found.lost.tolist(),
        [round(value, 4) for value in way.free],
        round(float(found.mean_mm.mean()), 4),
        way.evaluations,
        round(1000.0 * way.seconds / max(1, len(way.poses) - 1), 3),
    )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _rounded(values: Sequence[float] | Array) -> list[float]:
    return [round(float(value), 3) for value in values]
