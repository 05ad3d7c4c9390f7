"""Refines a pose set by hand: a short search around it with the session's likelihood, then local refinement.

The result never has a lower likelihood than the given pose.
"""

from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from studio.body.branches import within_limits
from studio.body.model import checked_pose
from studio.evidence.distance_maps import silhouette_distances
from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress, no_progress
from studio.runs.problem_source import ProblemSource, check_seen
from studio.runs.refined_frames import JUDGE
from studio.runs.search_space import search_space, session_sigma
from studio.runs.setup.session_settings import session_settings
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import RunSettings, settings_from_values
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.loss_detection import Onlooker
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.tracker import FilterState, ParticleSet
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

TRACKER = "annealed"
SHORT = {"particles": 150, "layers": 8, "start_repeats": 1}
HAND_FPS = 15.0
"""Frame rate whose σ0 matches the error of a pose set by hand."""
STEP = "searching around the pose"


@dataclass(frozen=True, slots=True, eq=False)
class BetterPose:
    """A refined pose. pose : (D,). gain : of the log-likelihood, 0 where the given pose was best. overlap_before,
    overlap : of the silhouettes, 0 to 1, NaN without a silhouette.
    """

    pose: Array
    gain: float
    overlap_before: float
    overlap: float


def better_pose(
    session: Session,
    frame: int,
    pose: Array,
    *,
    run: StoredRun | None = None,
    seed: int = 0,
    progress: Progress = no_progress,
) -> BetterPose:
    """The best pose near a given one (D,) in a frame. run : whose body, cameras and likelihood are used; None: the
    session's.

    progress : called before each layer. Raises RunError where nothing is to be seen in the frame or the pose does not
    fit the body.
    """
    body = run.body() if run else session.body()
    given = within_limits(body, checked_pose(body, pose, RunError))
    settings = _short_settings(session, run)
    with closing(ProblemSource(session, body, run.cameras() if run else None)) as problems:
        evidence, problem = problems.evidence(frame, settings), problems.problem(frame, settings)
    check_seen(session, evidence)
    layers, done = int(SHORT["layers"]), 0

    def checked(_: object) -> None:
        nonlocal done
        done += 1
        progress(STEP, done, layers + 1)

    progress(STEP, done, layers + 1)
    space = search_space(body, session_sigma(session, body, min(HAND_FPS, session.manifest.fps)))
    result = search_frame(
        TRACKERS[TRACKER],
        problem,
        FilterState(ParticleSet(given[None], np.zeros(1))),
        space,
        seed=seed,
        frame=frame,
        settings_source=lambda: (1, settings.tracker),
        on_layer=checked,
    )
    searched = np.stack([given, result.estimate.pose, result.estimate.mode])
    begin = searched[int(np.argmax(problem.log_likelihood(searched)))]
    refiner = Refiner(body, problems.cameras, RefinementSettings())
    refined = refiner.refine(begin, silhouette_distances(evidence), problem).pose
    weights = problem.log_likelihood(np.stack([given, begin, refined]))
    best = [given, begin, refined][int(np.argmax(weights))]
    onlooker = Onlooker(body, problems.cameras)
    progress(STEP, layers + 1, layers + 1)
    return BetterPose(
        pose=best,
        gain=float(weights.max() - weights[0]),
        overlap_before=onlooker.sight(evidence, given).overlap,
        overlap=onlooker.sight(evidence, best).overlap,
    )


def _short_settings(session: Session, run: StoredRun | None) -> RunSettings:
    """Settings of a short search with the likelihood in use, or the default one where that uses no masks."""
    weighting = run.record.weighting if run else session.manifest.weighting
    if weighting not in WEIGHTINGS or WEIGHTINGS[weighting].reads_pictures:
        weighting = JUDGE
    settings = session_settings(session, TRACKER, weighting, SHORT)
    if run is None or run.record.weighting != weighting:
        return settings
    with run.results() as results:
        history = results.settings_history()
    values = history[-1].values if history else run.record.settings
    own = settings_from_values(run.record.tracker, weighting, values)
    return replace(settings, weighting=own.weighting, evidence=own.evidence)
