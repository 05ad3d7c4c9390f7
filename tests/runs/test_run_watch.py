"""A run that is thrown off: noticed, held or searched for, the same way however often it is interrupted."""

from pathlib import Path

import numpy as np
import pytest
from interrupted_session import BLACK, GONE, interrupted
from sample_walk import WALK
from tracked_runs import opened

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import read_trc
from studio.results.drawing_footage.recipes import synthesize
from studio.results.motion_sources import read_source
from studio.runs.new_run import prepare_run
from studio.runs.reannealing import Reannealing
from studio.search.behaviour.model_file import write_model
from studio.search.behaviour.model_learning import learn_model
from studio.search.behaviour.settings import LearningSettings
from studio.search.trackers.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED, TRACKED, FrameResult
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

STEP, FPS = 3, 20.0
SMALL = {"particles": 100, "layers": 6}
SECOND, LONGER, NEAR_MM = 20, 74, 150.0


@pytest.fixture(scope="module")
def walk() -> Session:
    return Session(WALK)


@pytest.fixture(scope="module")
def black(walk: Session, tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The bundled walk at 20 Hz, four frames, then five black ones, and four more; the person walks on meanwhile."""
    frames = [STEP * number for number in range(13)]
    return interrupted(walk, tmp_path_factory.mktemp("black") / "walk", frames, range(4, 9), BLACK, FPS)


def made(session: Session, **request: object) -> StoredRun:
    changes = SMALL | dict(request.pop("changes", {}))  # pyright: ignore[reportCallIssue, reportArgumentType]
    return prepare_run(session, knobs=changes, **request)  # pyright: ignore[reportArgumentType]


def tracked(session: Session, run: StoredRun) -> list[FrameResult]:
    """All results of a run that is tracked to its end."""
    results = []
    with opened(session, run) as tracking:
        while not tracking.finished:
            stepped = tracking.step_layer()
            if stepped.result is not None:
                results.append(stepped.result)
    return results


def errors(session: Session, walk: Session, results: list[FrameResult], step: int = STEP) -> list[float]:
    """Mean marker error of each frame, mm. step : frames of the walk in one of the session."""
    assert walk.truth_path is not None
    truth, body = read_trc(walk.truth_path), session.body()
    order = [truth.names.index(marker.name) for marker in body.markers]
    found = marker_points(body, np.stack([result.estimate.pose for result in results]))
    wanted = truth.positions[[step * result.frame for result in results]][:, order]
    return np.linalg.norm(found - wanted, axis=2).mean(axis=1).tolist()


@pytest.fixture(scope="module")
def through(black: Session) -> tuple[StoredRun, list[FrameResult]]:
    """A run through the black frames, never interrupted."""
    run = made(black, name="through")
    return run, tracked(black, run)


@pytest.mark.slow
def test_black_frames_are_held_and_the_body_is_found_after_them(
    black: Session, walk: Session, through: tuple[StoredRun, list[FrameResult]]
) -> None:
    run, results = through
    states = [result.tracking for result in results]
    assert states[:10] == [TRACKED] * 4 + [NO_EVIDENCE] * 5 + [RECOVERED]
    assert set(states[10:]) <= {TRACKED, LIMB_LOST}
    for result in results[4:9]:
        assert np.array_equal(result.estimate.pose, results[3].estimate.pose)
    assert max(errors(black, walk, results)[9:]) < 80.0
    with run.results() as stored:
        line = stored.timeline()
    assert line.tracking == tuple(states)
    assert np.isnan(line.overlaps[4:9]).all()
    assert (line.overlaps[[*range(4), *range(9, 13)]] > 0.7).all()


@pytest.mark.slow
def test_a_run_taken_up_again_in_the_frame_of_the_search_gives_the_same_bits(
    black: Session, through: tuple[StoredRun, list[FrameResult]]
) -> None:
    expected, run = through[1], made(black, name="interrupted")
    results: list[FrameResult] = []
    for _ in range(20):
        with opened(black, run) as tracking:
            while not tracking.finished:
                stepped = tracking.step_layer()
                if stepped.result is not None:
                    results.append(stepped.result)
                inside = tracking.layers_done in (3, 8) and tracking.next_frame in (6, 9, 10)
                if inside:
                    break
            if tracking.finished:
                break
    assert [result.tracking for result in results] == [result.tracking for result in expected]
    for one, other in zip(results, expected, strict=True):
        assert np.array_equal(one.estimate.pose, other.estimate.pose), one.frame
        assert (one.layers, one.evaluations, one.doubts) == (other.layers, other.evaluations, other.doubts)


@pytest.mark.slow
def test_the_frame_of_the_search_annealed_again_is_the_same(
    black: Session, through: tuple[StoredRun, list[FrameResult]]
) -> None:
    run, results = through
    with opened(black, run) as tracking:
        again = Reannealing(tracking, 9, *tracking.latest_settings())
        while not again.finished:
            again.step_layer()
        result = again.result()
    assert result.tracking == RECOVERED
    assert np.array_equal(result.estimate.pose, results[9].estimate.pose)


def test_recovery_can_be_switched_off(black: Session) -> None:
    run = made(black, name="off", last=7, changes={"recovery": "off"})
    results = tracked(black, run)
    assert {result.tracking for result in results} == {TRACKED}
    assert all(np.isnan(result.overlap) for result in results)
    assert not np.array_equal(results[4].estimate.pose, results[3].estimate.pose)


@pytest.mark.slow
def test_a_run_that_starts_beside_the_body_is_lost_and_finds_it(walk: Session, tmp_path: Path) -> None:
    frames = [STEP * number for number in range(9)]
    session = interrupted(walk, tmp_path / "walk", frames, range(0), BLACK, FPS)
    start = session.start_pose()
    body = session.body()
    away = start.copy()
    away[[entry.name for entry in body.parameters].index("pelvis_x")] += 1500.0
    results = tracked(
        session, made(session, start_pose=away, last=6, fit_shape=False, changes={"refine_frames": False})
    )
    states = [result.tracking for result in results]
    assert states[:4] == [TRACKED, TRACKED, LOST, RECOVERED]
    assert [result.doubts for result in results[:4]] == [1, 2, 3, 0]
    found = errors(session, walk, results)
    assert min(found[:3]) > 300.0
    assert max(found[3:]) < 150.0


@pytest.fixture(scope="module")
def habits(walk: Session, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A behaviour model of the walk itself."""
    body = walk.body()
    assert walk.truth_path is not None
    recording = read_source(walk.truth_path, body)
    rng = np.random.default_rng(0)
    model = learn_model([recording.poses], body, recording.fps, LearningSettings(), rng)
    place = tmp_path_factory.mktemp("models") / "walk.behaviour"
    write_model(model, place)
    return place


@pytest.fixture(scope="module")
def longer(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The bundled walk's recipe at 20 Hz, long enough for a second before, in and after an interruption."""
    place = tmp_path_factory.mktemp("longer")
    recipe = f'title = "Longer"\nlike = "walk"\nframes = {LONGER}\nfps = {SECOND}\n'
    (place / "longer.toml").write_text(recipe)
    return Session(synthesize(place / "longer.toml", place / "longer"))


def tracks_again(states: list[str], apart: list[float], back: int) -> bool:
    """Whether a run is on the body within a second of evidence from frame `back` on: marked so, near the truth for
    five frames running, and not lost again within the next second.
    """
    for frame in range(back, back + SECOND):
        next_second = states[frame : frame + 1 + SECOND]
        if max(apart[frame : frame + 5]) < NEAR_MM and set(next_second) <= {TRACKED, RECOVERED}:
            return True
    return False


def test_what_counts_as_tracking_again() -> None:
    found = [NO_EVIDENCE] * 3 + [LOST] * 4 + [RECOVERED] + [TRACKED] * 42
    near = [500.0] * 7 + [20.0] * 43
    assert tracks_again(found, near, 3)
    assert not tracks_again(found, [500.0] * 50, 3)
    lost_again = [*found]
    lost_again[24] = LOST
    assert not tracks_again(lost_again, near, 3)
    late = [NO_EVIDENCE] * 3 + [LOST] * SECOND + [RECOVERED] + [TRACKED] * 26
    assert not tracks_again(late, [20.0] * 50, 3)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", [BLACK, GONE])
@pytest.mark.parametrize("tracker", ["annealed", "swarm", "condensation", "behaviour"])
def test_every_tracker_tracks_again_within_a_second(
    longer: Session, habits: Path, tmp_path: Path, tracker: str, kind: str
) -> None:
    """A second of black pictures; the person leaves and comes back a second further on. 9 of 10 seeds."""
    blind = range(12, 12 + SECOND)
    session = interrupted(longer, tmp_path / "walk", list(range(LONGER)), blind, kind, float(SECOND))
    model, recovered = str(habits) if tracker == "behaviour" else "", []
    for seed in range(10):
        run = prepare_run(session, tracker=tracker, seed=seed, behaviour=model)
        results = tracked(session, run)
        states = [result.tracking for result in results]
        reported = all(states[frame] in (NO_EVIDENCE, LOST) for frame in blind)
        recovered.append(reported and tracks_again(states, errors(session, longer, results, 1), blind.stop))
    assert sum(recovered) >= 9, recovered
