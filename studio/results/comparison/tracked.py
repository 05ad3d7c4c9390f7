"""A tracker on a footage, in memory only: the trial of most experiments."""

import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.inverse_kinematics import known_markers, pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import read_trc
from studio.body.subject import Subject, enlarged, height_spread, read_subject
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError, TruthError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import report
from studio.results.comparison.error_shares import error_shares
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.trials import Trial, kept_as
from studio.results.evaluation.errors import evaluate, rows_of_frames
from studio.results.inspection.error_parts import PARTS
from studio.runs.behaviour_models import check_prediction, fitting, model_folders, model_path
from studio.runs.live.following import Following, step_together
from studio.runs.search_space import search_space, session_sigma
from studio.runs.setup.person_witness import LimbsByNetwork
from studio.runs.setup.shape_on_the_way import WEIGHTING, shaped_body
from studio.runs.sides import known_silhouettes
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import read_model
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.devices import CPU, DEVICE_KNOB
from studio.search.likelihood.hard_priors import HardPriors
from studio.search.settings import RunSettings, changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.clip_mending import mended_clip
from studio.search.trackers.frame_refinement import FrameRefiner, descent, followed_along_lines
from studio.search.trackers.refinement import Distances
from studio.search.trackers.tracker import LayerRecord, start_of
from studio.sessions.session import Session

SEEDS_AT_ONCE, POSES_AT_ONCE = 64, 200_000
"""Most seeds, and most poses of a layer of all of them, that a card searches side by side."""
AS_PUBLISHED: Mapping[str, Any] = {"refine_frames": False}
"""Knobs without refinement, as in the papers; a trial that refines sets them."""
LATER_FIELDS = ("behaviour", "shape_frames", "larger", "split_frames")
"""Of a trial, which outcomes that were kept before they existed do not name."""


@dataclass(frozen=True, slots=True)
class TrackingTrial:
    """One run: all that its poses depend on, plain values.

    footage : a recipe's name, or the path of a session. changes : knobs by flat name. first, last : frames, half
    open; last None means all. every : step between the frames used (fps is divided, σ0 multiplied). cameras :
    names, empty for all. body : a body's name or file, "" for the session's own. subject : a subject file beside the
    session's own, such as "subject_shape.toml" of the Lee-walk twin (no hands and feet), "" for its own. sigma_scale :
    multiplies σ0. behaviour : a behaviour model, by its name in the workspace's models or by path. shape_frames :
    number of frames tracked first, to which the shape of the run is fitted (`runs.setup.shape_on_the_way`). larger :
    share by which the subject's measures are enlarged, a wrong body on purpose. split_frames : in how many frames,
    evenly spread, it is measured whose fault the error is (`error_shares`).
    """

    footage: str
    tracker: str
    weighting: str
    seed: int
    changes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    first: int = 0
    last: int | None = None
    every: int = 1
    cameras: tuple[str, ...] = ()
    body: str = ""
    sigma_scale: float = 1.0
    subject: str = ""
    behaviour: str = ""
    shape_frames: int = 0
    larger: float = 0.0
    split_frames: int = 0

    def plain(self) -> dict[str, Any]:
        """As a trial's arguments; later fields are left out at their defaults, so that stored outcomes stay valid."""
        return {name: value for name, value in asdict(self).items() if value or name not in LATER_FIELDS}

    @classmethod
    def of_plain(cls, arguments: Mapping[str, Any]) -> "TrackingTrial":
        """From a trial's arguments, as read from JSON."""
        words: dict[str, Any] = {**arguments, "cameras": tuple(arguments.get("cameras", ()))}
        return cls(**words)


@dataclass(frozen=True, slots=True)
class Tracked:
    """The errors of a trial, mm without alignment.

    frames : numbers in the footage. per_frame_mm : mean over markers. lost : per frame the names of limbs that are
    lost (a marker more than 150 mm off). evaluations : poses weighed in a frame after the first. seconds : of the
    search (weighting and tracker), without reading and preparing pictures; its share where seeds were tracked side by
    side. named : per frame the limbs that the tracker itself reported lost, as in a run's timeline.
    impossible_frames : frames whose pose breaks a hard prior (a joint beyond its limits, a limb inside another); -1 in
    outcomes that were kept before it was counted. log_evidence : nats a frame, mean over the frames; None where the
    tracker has none. parts_mm : the search's, the likelihood's and the body's part of the error of what the search
    found, means over the frames in which it was split; {} where it was not.
    """

    frames: list[int]
    per_frame_mm: list[float]
    lost: list[list[str]]
    mean_mm: float
    worst_mm: float
    lost_frames: int
    lost_limbs: list[str]
    evaluations: int
    seconds: float
    named: list[list[str]] = field(default_factory=list[list[str]])
    impossible_frames: int = -1
    log_evidence: float | None = None
    parts_mm: dict[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True, slots=True)
class Changed:
    """Disturbance of a tracker's input by an experiment. cameras : of all views. evidence : of each frame."""

    cameras: Callable[[tuple[Camera, ...]], tuple[Camera, ...]] = lambda cameras: cameras
    evidence: Callable[[FrameEvidence], FrameEvidence] = lambda evidence: evidence


UNCHANGED = Changed()


def track(
    trial: TrackingTrial,
    cache: FootageCache,
    *,
    on_layer: Callable[[LayerRecord], None] | None = None,
    spoilt: Changed = UNCHANGED,
) -> Tracked:
    """Track and measure; each frame is reported. on_layer : called with every layer.

    Raises TruthError for a footage without truth and what tracking raises.
    """
    return track_seeds(trial, (trial.seed,), cache, on_layer=on_layer, spoilt=spoilt)[0]


def track_seeds(
    trial: TrackingTrial,
    seeds: Sequence[int],
    cache: FootageCache,
    *,
    on_layer: Callable[[LayerRecord], None] | None = None,
    spoilt: Changed = UNCHANGED,
) -> list[Tracked]:
    """As `track` with each of the seeds, a frame of all at a time, side by side where a card searches it. Each has the
    poses that it has alone.
    """
    session = cache.session(trial.footage)
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    subject = read_subject(session.path / trial.subject, session.manifest.body) if trial.subject else None
    if trial.larger:
        subject = enlarged(subject or session.subject() or Subject(body=session.manifest.body), trial.larger)
    body = session.body(trial.body or None, subject)
    settings = settings_of(trial)
    cameras, fps = _cameras(session, trial.cameras), session.manifest.fps
    seen_with, rate = spoilt.cameras(cameras), fps / trial.every
    count = session.manifest.frame_count
    frames = range(trial.first, trial.last or count, trial.every)
    if frames[-1] >= count:
        raise NotFoundError(f"There is no frame {frames[-1]}. '{trial.footage}' has 0 to {count - 1}.", "")

    def evidence(frame: int, name: str = trial.weighting) -> FrameEvidence:
        kind = WEIGHTINGS[name].edge_kind
        pictures = WEIGHTINGS[name].reads_pictures or settings.refinement.refine_frames
        return spoilt.evidence(cache.evidence(session, cameras, frame, settings.evidence, kind, pictures))

    start = _start_pose(session, body, trial.first)
    if trial.larger and start is not None:
        start = tuple(map(float, pose_on_truth(session, body, trial.first, np.array(start))))
    if trial.shape_frames and start is not None:
        sigma, first = session_sigma(session, body, rate), frames[: trial.shape_frames]
        of_shape = partial(evidence, name=WEIGHTING)
        on_floor = settings.refinement.above_floor
        shaped = shaped_body(
            body, seen_with, of_shape, first, np.array(start), sigma, above_floor=on_floor,
            height_spread=height_spread(body, subject or session.subject()),
        )  # fmt: skip
        body, start = shaped.body, tuple(float(value) for value in shaped.start)
    sigma = session_sigma(session, body, rate) * trial.sigma_scale
    space = search_space(body, sigma, _behaviour(session, body, settings, trial))
    evidences = [dict[int, float]() for _ in seeds]

    def noting(own: dict[int, float]) -> Callable[[LayerRecord], None]:
        def note(record: LayerRecord) -> None:
            own[record.frame] = record.log_evidence
            if on_layer is not None:
                on_layer(record)

        return note

    source = LimbsByNetwork(body, seen_with)
    runs = [
        Following(
            settings, space, start_of(start), seed, FrameRefiner(body, seen_with, seed, source), noting(own)
        )
        for seed, own in zip(seeds, evidences, strict=True)
    ]
    likelihood = WEIGHTINGS[trial.weighting].prepare(body, seen_with, settings.weighting)
    seconds, evaluations, named = 0.0, 0, [list[list[str]]() for _ in runs]
    split = set(middles(frames, trial.split_frames))
    truth = read_trc(session.truth_path) if split else None
    shares = [list[Mapping[str, float]]() for _ in runs]
    for number, frame in enumerate(frames):
        seen = evidence(frame)
        began = time.perf_counter()
        problem = likelihood.problem(seen)
        results = step_together(runs, frame, problem, seen)
        seconds += time.perf_counter() - began if number else 0.0
        evaluations = results[0].evaluations
        for lost, result in zip(named, results, strict=True):
            lost.append(list(result.limbs_lost))
        for own, result in zip(shares, results, strict=True):
            if truth is not None and frame in split:
                found = result.estimate.pose if result.estimate.searched is None else result.estimate.searched
                parts = error_shares(body, truth, fps, settings, problem, frame, found)
                own += [] if parts is None else [parts]
        report("tracking", number + 1, len(frames))
    tracked: list[Tracked] = []
    for run, lost, own, parts in zip(runs, named, evidences, shares, strict=True):
        poses = np.array(run.poses)
        if settings.refinement.refine_frames:

            def silhouettes_of(
                frame: int, run: Following = run, poses: Array = poses
            ) -> Mapping[str, Distances]:
                row = frames.index(frame)
                return known_silhouettes(body, seen_with, evidence(frame), poses[row], run.memories[row])

            rows = np.array(frames)
            how, kept = descent(settings.refinement), followed_along_lines(body, settings.refinement)
            poses, _ = mended_clip(body, seen_with, rows, poses, lost, rate, silhouettes_of, how, kept=kept)
        figures = measured(session, body, poses, np.array(frames), evaluations, seconds / len(runs))
        by_frame = dict(zip(frames, lost, strict=True))
        impossible = int((~HardPriors(body).hold(poses, limbs_apart=True)).sum())
        named_of = [by_frame[frame] for frame in figures.frames]
        evidence_mean = float(np.mean(list(own.values())))
        tracked.append(
            dataclasses.replace(
                figures,
                named=named_of,
                impossible_frames=impossible,
                log_evidence=round(evidence_mean, 3) if math.isfinite(evidence_mean) else None,
                parts_mm={name: round(float(np.mean([one[name] for one in parts])), 3) for name in PARTS}
                if parts
                else {},
            )
        )
    return tracked


def middles(frames: range, count: int) -> list[int]:
    """The frames in the middle of `count` even stretches of them; all of them where there are fewer."""
    count = min(count, len(frames))
    return [frames[int((at + 0.5) * len(frames) / count)] for at in range(count)]


def settings_of(trial: TrackingTrial) -> RunSettings:
    """The settings that a trial tracks with."""
    return changed_settings(
        default_settings(trial.tracker, trial.weighting), {**AS_PUBLISHED, **trial.changes}
    )


def measured(
    session: Session,
    body: BodyModel,
    poses: Array,
    frames: NDArray[np.int64],
    evaluations: int,
    seconds: float,
) -> Tracked:
    """The errors of poses (K, D) of frames (K,) of a session with truth."""
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    evaluation = evaluate(poses, frames, body, truth, session.manifest.fps)
    return Tracked(
        frames=[int(frame) for frame in evaluation.frames],
        per_frame_mm=[round(value, 3) for value in evaluation.per_frame_mm],
        lost=[list(limbs) for limbs in evaluation.lost_by_frame],
        mean_mm=round(evaluation.mean_mm, 4),
        worst_mm=round(evaluation.worst_mm, 3),
        lost_frames=evaluation.lost_frames,
        lost_limbs=list(evaluation.lost_limbs),
        evaluations=evaluations,
        seconds=round(seconds, 4),
    )


def _behaviour(
    session: Session, body: BodyModel, settings: RunSettings, trial: TrackingTrial
) -> BehaviourModel | None:
    """The trial's model at the rate of its frames. Raises SettingsError where one is needed and none given."""
    if not trial.behaviour:
        check_prediction(settings, has_model=False)
        return None
    path = model_path(model_folders(session), trial.behaviour)
    return fitting(read_model(path), body, session.manifest.fps / trial.every)


def _cameras(session: Session, names: tuple[str, ...]) -> tuple[Camera, ...]:
    """The session's cameras, or the named ones, in the session's order."""
    known = session.cameras()
    unknown = set(names) - {camera.name for camera in known}
    if unknown:
        words = ", ".join(camera.name for camera in known)
        raise NotFoundError(f"'{session.name}' has no camera '{min(unknown)}'.", f"It has {words}.")
    return tuple(camera for camera in known if not names or camera.name in names)


def start_of_trial(session: Session, body: str, first: int) -> tuple[float, ...] | None:
    """The pose that a trial starts from. body : a name, "" for the session's own."""
    return _start_pose(session, session.body(body or None), first)


def _start_pose(session: Session, body: BodyModel, first: int) -> tuple[float, ...] | None:
    """The session's start pose; for a later first frame, and for a body other than the session's, the pose
    fitted to the true markers of that frame.
    """
    is_own = body.name == session.manifest.body
    own = session.start_pose(body) if is_own else None
    pose = own if first == 0 and is_own else pose_on_truth(session, body, first, own)
    return None if pose is None else tuple(float(value) for value in pose)


def pose_on_truth(session: Session, body: BodyModel, frame: int, near: Array | None = None) -> Array:
    """(D,) the pose whose markers come closest to the true ones of a frame, angles near `near` where given.

    Raises TruthError where the truth lacks the frame.
    """
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    rows = rows_of_frames(truth, session.manifest.fps)
    if frame not in rows:
        raise TruthError(f"The truth has no row for frame {frame}.", "Start at a frame that it has.")
    kept, names = known_markers(body, truth.names)
    points = truth.positions[rows[frame], kept]
    return pose_from_markers(body, names, points, body.neutral if near is None else near)[0]


# The trial that experiments on tracked footage and comparisons share: equal settings are the same trial.


def tracking_trial(group: str, trial: TrackingTrial) -> Trial:
    """A tracking as a trial of an experiment. group : candidate and setting in words, the same for all its seeds."""
    return Trial(f"{group}, seed {trial.seed}", trial.plain())


@kept_as("tracking_trials.measure_tracking")
def measure_tracking(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track; the fields of `Tracked`."""
    return asdict(track(TrackingTrial.of_plain(arguments), cache))


def seeds_at_once(trial: TrackingTrial, seeds: int, processes: int) -> int:
    """How many of a trial's seeds a card searches side by side, 1 where none does.

    processes : that track at once. What the processor refines is left to all of them.
    """
    return 1 if trial.behaviour else runs_at_once(settings_of(trial), seeds, processes)


def runs_at_once(settings: RunSettings, runs: int, processes: int) -> int:
    """How many of the runs with such settings a card searches side by side, 1 where none does; see `seeds_at_once`."""
    if getattr(settings.weighting, DEVICE_KNOB, CPU) == CPU:
        return 1
    tracker = TRACKERS[settings.tracker_name]
    poses = tracker.evaluations(settings.tracker) // tracker.layer_count(settings.tracker)
    most = min(max(POSES_AT_ONCE // poses, 1), SEEDS_AT_ONCE)
    return min(most, -(-runs // processes)) if settings.refinement.refine_frames else most


@kept_as("tracking_trials.measure_seeds")
def measure_seeds(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track trials that differ by seed alone side by side: `measured`, the fields of each one's `Tracked`.

    arguments : `trials`, those of each. Where they fail together, they are tracked one by one.
    """
    trials = [TrackingTrial.of_plain(one) for one in arguments["trials"]]
    try:
        tracked = track_seeds(trials[0], [trial.seed for trial in trials], cache)
    except Exception:
        tracked = [track(trial, cache) for trial in trials]
    return {"measured": [asdict(one) for one in tracked]}
