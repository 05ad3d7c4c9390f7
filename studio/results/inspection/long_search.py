"""A frame searched far longer than a run searches it: the heaviest pose that is known of it, kept with the run.

An evolution strategy with an adapted covariance (CMA-ES; Hansen 2016, "The CMA Evolution Strategy: A Tutorial",
arXiv:1604.00772, Eq. 6 to 44 with equal learning for all ranks) climbs the likelihood from every known pose of the
frame that is not near another: what the search found, what its refinement made of it, the run's own search again with
TIMES as many particles, a refinement on the silhouettes that draws lost limbs anew, and the truth where there is one.
Its first step moves the body's points by FIRST_STEP_MM, whatever σ0 the run was tracked with.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError, RunError
from studio.foundations.progress import Progress
from studio.results.inspection.likelihoods import evaluation_of
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.reference import body_points, refined_pose, true_points, true_pose
from studio.results.inspection.retracking import Change, Retracking, more_evaluations
from studio.sessions.provenance import digests
from studio.sessions.record_files import RecordFile
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import one_at_a_time

FILE_NAME = "long_searches.json"
TIMES, SEED = 8.0, 404
FIRST_STEP_MM, NEAR_MM = 5.0, 30.0
"""How far the first step moves the body's points; poses whose points are nearer in the mean are climbed from once."""
SET = 200
"""Poses a step: with 100 a climb ends lower (bundled walk)."""
EVALUATIONS = 40_000
FEWEST_STEPS = 5
PROGRESS_STEPS = 100
"""Of a frame."""
OF_RANGE = 0.1
"""Share of its range that a parameter is moved by at first whatever it moves."""
FOUND, REFINED, SEARCHED, REDRAWN, TRUTH = "found", "refined", "search", "silhouettes", "truth"


class LongSearch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The heaviest pose that is known of a frame.

    stamp : of the frame's result when it was searched.
    evaluations : poses weighed in one climb.
    found, truth, best : log-weights of the pose that the run's search found, of the truth's pose (None without one),
        and of the heaviest.
    origin : the pose from which the heaviest was climbed to.
    pose : (D,) the heaviest.
    masks : digest of what masks were made of; "" where it was not kept.
    """

    frame: int
    stamp: tuple[float, float]
    evaluations: int
    found: float
    truth: float | None
    best: float
    origin: str
    pose: tuple[float, ...]
    masks: str = ""


class _Searches(msgspec.Struct, frozen=True):
    searches: tuple[LongSearch, ...] = ()
    schema: int = 1


_RECORD = RecordFile(
    _Searches,
    "a list of long searches",
    "Move the file away: the run is unchanged without it.",
    ("Run '{name}' has no long search.", "Search some frames."),
)


def kept_searches(run: StoredRun) -> dict[int, LongSearch]:
    """A run's long searches by frame, also of frames that were tracked again since. Raises SessionError."""
    return {one.frame: one for one in _RECORD.read(_path(run), _Searches()).searches}


def searches_that_hold(run: InspectedRun) -> dict[int, LongSearch]:
    """The kept ones by frame, without those before other masks. Raises SessionError."""
    masks = _masks_of(run)
    return {frame: one for frame, one in kept_searches(run.run).items() if one.masks in ("", masks)}


def search_of(frame: InspectedFrame, kept: dict[int, LongSearch]) -> LongSearch | None:
    """The kept long search of a frame as it is stored now; None where there is none."""
    known = kept.get(frame.number)
    if known is None or known.stamp != _stamp(frame) or len(known.pose) != len(frame.of.names):
        return None
    return known


def frames_to_split(run: InspectedRun, count: int) -> list[int]:
    """Finished frames of a run, evenly spread. Raises RunError for a run without any."""
    with run.run.results() as results:
        finished = sorted(results.stored_poses())
    if not finished:
        raise RunError(f"Run '{run.run.name}' has no finished frame.", "Track it first.")
    places = (np.arange(min(count, len(finished))) + 0.5) * len(finished) / min(count, len(finished))
    return [finished[int(at)] for at in places]


def search_frames(
    run: InspectedRun, frames: Sequence[int], evaluations: int, progress: Progress, *, again: bool = False
) -> None:
    """Search frames for long whose search is not kept, or was shorter. again : those as well.

    Each is kept as soon as it is done. Raises NotFoundError for a frame that is not finished.
    """
    kept, wanted = searches_that_hold(run), list[int]()
    for number in frames:
        known = search_of(run.frame(number), kept)
        is_kept = known is not None and known.evaluations >= evaluations
        lacks_truth = known is not None and known.truth is None and true_points(run, number) is not None
        if again or lacks_truth or not is_kept:
            wanted.append(number)
    total = PROGRESS_STEPS * len(wanted)
    for at, number in enumerate(wanted):

        def told(share: float, before: int = at) -> None:
            progress("frames", int(PROGRESS_STEPS * (before + share)), total)

        search_long(run, number, evaluations, told)
    progress("frames", total, total)


def search_long(
    run: InspectedRun, number: int, evaluations: int, step: Callable[[float], None]
) -> LongSearch:
    """The heaviest pose of a frame; kept with the run. step : is told the share that is done; what it raises ends it.

    Raises NotFoundError for a frame that is not finished.
    """
    frame = run.frame(number)
    if frame.result is None:
        raise NotFoundError(
            f"Frame {number} of run '{run.run.name}' is not finished.", "Choose a finished frame."
        )
    evaluation, truth = evaluation_of(frame), true_pose(run, number)
    starts = _starts(frame, None if truth is None else truth.pose)
    knobs = frame.settings.tracker
    apart = getattr(knobs, "constraints", "ignore") != "ignore" and getattr(knobs, "limbs_apart", False)

    def weigh(poses: Array) -> Array:
        held = run.priors.hold(poses, limbs_apart=apart)
        return np.where(held, evaluation.log_weights(poses), -np.inf)

    found = frame.searched()
    best, weight, origin = found, float(evaluation.log_weights(found[None])[0]), FOUND
    own = None if truth is None else float(evaluation.log_weights(truth.pose[None])[0])
    search = LongSearch(number, _stamp(frame), evaluations, weight, own, weight, origin, (), _masks_of(run))
    steps = max(FEWEST_STEPS, evaluations // SET)
    for at, (kind, start) in enumerate(starts):
        scale = FIRST_STEP_MM * scale_of(run.body) * parameters_a_mm(run.body, start)
        rng = np.random.default_rng((SEED, number, at))

        def told(done: int, before: int = at) -> None:
            step((before + done / steps) / len(starts))

        pose, height = climb(weigh, start, scale, (run.body.lower, run.body.upper), steps, rng, told)
        if height > weight:
            best, weight, origin = pose, height, kind
    search = msgspec.structs.replace(search, best=weight, origin=origin, pose=tuple(best.tolist()))
    _keep(run.run, search)
    return search


def _starts(frame: InspectedFrame, truth: Array | None) -> list[tuple[str, Array]]:
    """Known poses of a frame with where they come from, none near another; the truth's is always among them."""
    run, result = frame.of, frame.result
    assert result is not None
    longer = Change(more_evaluations(frame.settings, TIMES), SEED)
    particles = Retracking(run, frame.number, frame.number).searched(longer).carried.particles
    evaluation = evaluation_of(frame)
    known = [(FOUND, frame.searched()), (REFINED, result.estimate.pose)]
    if particles is not None and len(particles.poses):
        weights = evaluation.log_weights(particles.poses)
        known.append((SEARCHED, particles.poses[int(np.argmax(weights))]))
    known.append((REDRAWN, refined_pose(run, evaluation.evidence, frame.number, result.estimate.pose)))
    starts = list[tuple[str, Array]]()
    for kind, pose in known:
        if all(points_apart(run, pose, other) > NEAR_MM * scale_of(run.body) for _, other in starts):
            starts.append((kind, pose))
    return starts if truth is None else [*starts, (TRUTH, truth)]


def points_apart(run: InspectedRun, one: Array, other: Array) -> float:
    """Mean distance of the body's points in two poses (D,), mm."""
    points = body_points(run.body, np.stack([one, other]))
    return float(np.linalg.norm(points[0] - points[1], axis=1).mean())


def parameters_a_mm(body: BodyModel, pose: Array) -> Array:
    """(D,) what moves the body's points by a mm (RMS); at most a share of the parameter's range."""
    small = 1e-3
    moved = body_points(body, pose + small * np.eye(len(pose))) - body_points(body, pose[None])
    mm = np.sqrt(np.mean(np.sum(moved**2, axis=2), axis=1)) / small
    most = OF_RANGE * (body.upper - body.lower) / (FIRST_STEP_MM * scale_of(body))
    return np.minimum(1.0 / np.maximum(mm, 1e-9), most)


def climb(
    weigh: Callable[[Array], Array],
    start: Array,
    scale: Array,
    limits: tuple[Array, Array],
    steps: int,
    rng: np.random.Generator,
    step: Callable[[int], None] = lambda done: None,
) -> tuple[Array, float]:
    """The heaviest pose (D,) that was met, and its weight.

    weigh : poses (N, D) to weights (N,). start, scale : (D,) where it begins, and its first deviations. limits : (D,)
    lowest and highest values. step : is told how many steps are done.
    """
    size, parents = len(start), SET // 2
    shares = np.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
    shares /= shares.sum()
    effective = 1.0 / float(shares @ shares)
    keeping = (4.0 + effective / size) / (size + 4.0 + 2.0 * effective / size)
    path_rate = (effective + 2.0) / (size + effective + 5.0)
    one = 2.0 / ((size + 1.3) ** 2 + effective)
    many = min(1.0 - one, 2.0 * (effective - 2.0 + 1.0 / effective) / ((size + 2.0) ** 2 + effective))
    damping = 1.0 + 2.0 * max(0.0, np.sqrt((effective - 1.0) / (size + 1.0)) - 1.0) + path_rate
    usual = np.sqrt(size) * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size * size))
    mean, length = np.zeros(size), 1.0
    path, whitened, matrix = np.zeros(size), np.zeros(size), np.eye(size)
    best, weight = start, float(weigh(start[None])[0])
    for done in range(steps):
        step(done)
        values, axes = np.linalg.eigh(matrix)
        widths = np.sqrt(np.maximum(values, 1e-20))
        drawn = mean + length * (rng.standard_normal((SET, size)) * widths) @ axes.T
        poses = np.clip(start + scale * drawn, *limits)
        heights = weigh(poses)
        order = np.argsort(-heights)
        if heights[order[0]] > weight:
            best, weight = poses[order[0]], float(heights[order[0]])
        moves = ((poses[order[:parents]] - start) / scale - mean) / length
        moved = shares @ moves
        mean = mean + length * moved
        whitened = (1.0 - path_rate) * whitened
        whitened += np.sqrt(path_rate * (2.0 - path_rate) * effective) * (axes @ ((axes.T @ moved) / widths))
        far = float(np.linalg.norm(whitened))
        expected = np.sqrt(1.0 - (1.0 - path_rate) ** (2 * (done + 1))) * usual
        is_steady = far < (1.4 + 2.0 / (size + 1.0)) * expected
        path = (1.0 - keeping) * path
        path += is_steady * np.sqrt(keeping * (2.0 - keeping) * effective) * moved
        lost = 0.0 if is_steady else keeping * (2.0 - keeping)
        matrix = (1.0 - one - many) * matrix + one * (np.outer(path, path) + lost * matrix)
        matrix += many * (moves.T * shares) @ moves
        length *= float(np.exp(path_rate / damping * (far / usual - 1.0)))
    step(steps)
    return best, weight


def _masks_of(run: InspectedRun) -> str:
    return digests(run.session, ("masks",))["masks"]


def _stamp(frame: InspectedFrame) -> tuple[float, float]:
    result = frame.result
    return (0.0, 0.0) if result is None else (result.milliseconds, result.estimate.log_weight)


def _path(run: StoredRun) -> Path:
    return run.folder / FILE_NAME


def _keep(run: StoredRun, search: LongSearch) -> None:
    with one_at_a_time(run.folder.parent.parent):
        searches = {**kept_searches(run), search.frame: search}
        _RECORD.write(_path(run), _Searches(tuple(searches[frame] for frame in sorted(searches))))
