"""The contract that every tracker runs with every weighting: end to end on the toy arm, and on a person in four
pictures, whose trunk the first stage of a search looks at alone."""

import numpy as np
import pytest
from arm_behaviour import keep_arm_model
from toy_session import true_poses
from tracked_runs import finish

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.garden.benchmarks.kernels import made_evidence, ring_of_cameras
from studio.runs.new_run import prepare_run
from studio.runs.search_space import default_sigma, search_space
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.tracker import FrameResult, start_of
from studio.sessions.session import Session

PAIRS = [(tracker, weighting) for tracker in TRACKERS for weighting in WEIGHTINGS]
EVALUATIONS = 240


@pytest.mark.parametrize(("tracker", "weighting"), PAIRS)
def test_a_pair_follows_the_arm(session_on_disk: Session, tracker: str, weighting: str) -> None:
    start = true_poses()[0]
    keep_arm_model(session_on_disk.path.parent)
    changes = {**knobs_for_evaluations(tracker, EVALUATIONS), "start_repeats": 1}
    run = prepare_run(
        session_on_disk,
        tracker=tracker,
        weighting=weighting,
        seed=1,
        start_pose=tuple(start),
        last=3,
        knobs=changes,
    )
    finish(session_on_disk, run)
    with run.results() as results:
        frames, poses = results.poses()
        assert frames.tolist() == [0, 1, 2]
        assert np.isfinite(poses).all()
        assert results.timeline().evaluations.tolist() == [EVALUATIONS] * 3
    # The arm moves by 1.2 degrees a frame at most; one camera and few particles hold it within some 15.
    assert np.abs(poses - true_poses()[:3]).max() < 0.26


@pytest.fixture(scope="module")
def person() -> tuple[BodyModel, dict[str, FrameEvidence]]:
    """The default body in its neutral pose in four pictures, by kind of edge map."""
    body = load_body("human31")
    return body, made_evidence(body, ring_of_cameras(body), np.random.default_rng(0))


@pytest.mark.parametrize(("tracker", "weighting"), PAIRS)
def test_a_pair_moves_a_person_towards_the_pictures(
    person: tuple[BodyModel, dict[str, FrameEvidence]], tracker: str, weighting: str
) -> None:
    body, evidence = person
    space = search_space(body, default_sigma(body, 60.0))
    start = body.neutral + 2.0 * space.sigma * np.random.default_rng(5).uniform(-1.0, 1.0, len(space.names))
    start = np.clip(start, space.lower, space.upper)
    settings = changed_settings(
        default_settings(tracker, weighting), knobs_for_evaluations(tracker, EVALUATIONS)
    ).tracker
    chosen = WEIGHTINGS[weighting]
    likelihood = chosen.prepare(body, ring_of_cameras(body), chosen.settings_type())
    problem = likelihood.problem(evidence["bodytrack" if chosen.edge_kind == "bodytrack" else "proximity"])

    def searched() -> FrameResult:
        return search_frame(
            TRACKERS[tracker],
            problem,
            start_of(tuple(start)),
            space,
            seed=3,
            frame=0,
            settings_source=lambda: (1, settings),
        )

    result = searched()
    assert result.evaluations == TRACKERS[tracker].evaluations(settings) == EVALUATIONS
    assert np.isfinite(result.estimate.pose).all()
    last = result.carried.particles
    assert last is not None
    if tracker == "tempered":
        # A sample of a posterior climbs no higher than its scale asks for: it is beside what the prior draws.
        drawn = start + 1.5 * space.sigma * np.random.default_rng(6).normal(size=(200, len(start)))
        drawn = np.clip(drawn, space.lower, space.upper)
        assert problem.fitness(last.poses).mean() > problem.fitness(drawn).mean()
    else:
        assert problem.fitness(result.estimate.mode[None])[0] > problem.fitness(start[None])[0]
    np.testing.assert_array_equal(searched().estimate.pose, result.estimate.pose)
