"""Whose fault the errors of a trial are, in some of its frames, measured while it tracks.

Parts as in `inspection.error_parts`, of what the search found, before any refinement. The heaviest known pose of a
frame is that of two long climbs, from what the search found and from the body laid on the truth; so each trial has its
own, and its parts depend on no other trial.
"""

from collections.abc import Mapping

import numpy as np

from studio.body.inverse_kinematics import known_markers, pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.results.evaluation.errors import evaluate, rows_of_frames
from studio.results.inspection.error_parts import BODY, LIKELIHOOD, SEARCH
from studio.results.inspection.likelihoods import telling_nats
from studio.results.inspection.long_search import FIRST_STEP_MM, SET, climb, parameters_a_mm
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.settings import RunSettings

CLIMB = 20_000
"""Poses that a climb weighs."""
SEED = 405


def error_shares(
    body: BodyModel,
    truth: MarkerMotion,
    fps: float,
    settings: RunSettings,
    problem: FrameLikelihood,
    frame: int,
    found: Array,
) -> Mapping[str, float] | None:
    """The search's, the likelihood's and the body's part of the error of a pose (D,), mm; they add up to it.

    found : what a search of the frame reported. fps : of the footage. None for a frame without a true marker.
    """
    row = rows_of_frames(truth, fps).get(frame)
    if row is None:
        return None
    places, _ = known_markers(body, truth.names)
    seen = [place for place in places if np.isfinite(truth.positions[row, place]).all()]
    if not seen:
        return None
    names = tuple(truth.names[place] for place in seen)
    laid = pose_from_markers(body, names, truth.positions[row, seen], found)[0]

    def weigh(poses: Array) -> Array:
        return np.where(problem.feasible(poses), problem.log_likelihood(poses), -np.inf)

    limits, size = (body.lower, body.upper), FIRST_STEP_MM * scale_of(body)
    climbed = [
        climb(
            weigh,
            start,
            size * parameters_a_mm(body, start),
            limits,
            CLIMB // SET,
            np.random.default_rng((SEED, frame, at)),
        )
        for at, start in enumerate((found, laid))
    ]
    heaviest, weight = max(climbed, key=lambda one: one[1])
    own = float(problem.log_likelihood(found[None])[0])
    preferred = heaviest if weight - own > telling_nats(settings) else found

    poses = np.stack([found, preferred, laid])
    of_found, of_preferred, of_laid = evaluate(poses, np.full(3, frame), body, truth, fps).per_frame_mm
    return {SEARCH: of_found - of_preferred, LIKELIHOOD: of_preferred - of_laid, BODY: of_laid}
