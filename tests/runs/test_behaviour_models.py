"""How a run gets its behaviour model, keeps it, and is refused without one."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from arm_behaviour import FPS, arm_model, keep_arm_model
from toy_session import make_session, true_poses
from tracked_runs import opened, poses_of

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.foundations.errors import BehaviourError, NotFoundError, SettingsError, StudioError
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.tracked import TrackingTrial, track
from studio.runs.behaviour_models import check_prediction, fitting, models_folder, models_in
from studio.runs.new_run import prepare_run
from studio.runs.problem_source import ProblemSource
from studio.runs.reannealing import Reannealing
from studio.runs.run_behaviour import LEARNT_NAME
from studio.runs.tracking_run import TrackingRun
from studio.search.behaviour.model_file import read_model, write_model
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.guided_particles import STATES
from studio.sessions.named_rows import write_pose
from studio.sessions.run_record import BEHAVIOUR_NAME
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

GUIDED = {
    "behaviour": {"particles": 60},
    "annealed": {"particles": 15, "layers": 3, "prediction": "behaviour"},
    "swarm": {"stage1_iterations": 3, "stage2_iterations": 4, "prediction": "behaviour"},
}


def made(session: Session, tracker: str, name: str = "", **changes: object) -> StoredRun:
    """A guided run of all eight frames."""
    return prepare_run(
        session,
        tracker=tracker,
        weighting="edge-region",
        name=name,
        seed=4,
        start_pose=true_poses()[0],
        knobs={**GUIDED[tracker], **changes},
    )


def tracked(session: Session, run: StoredRun, stop: Callable[[int], bool] = lambda _: False) -> np.ndarray:
    """The run's poses; stop : called after each layer; True closes the run and resumes it."""
    steps, over = 0, False
    while not over:
        with opened(session, run) as tracking:
            while not tracking.finished:
                tracking.step_layer()
                steps += 1
                if stop(steps):
                    break
            over = tracking.finished
    return poses_of(run)


@pytest.fixture
def models(session_on_disk: Session) -> Path:
    """The session's workspace has one model."""
    return keep_arm_model(session_on_disk.path.parent)


def test_the_only_model_that_fits_is_used_and_reported(session_on_disk: Session, models: Path) -> None:
    write_model(arm_model(), models.with_name("other.behaviour"))
    other = dataclasses.replace(
        arm_model(), space=dataclasses.replace(arm_model().space, parameters=("a", "b", "c", "d"))
    )
    write_model(other, models.with_name("other.behaviour"))
    run = made(session_on_disk, "behaviour")
    assert run.record.behaviour == "swings"
    assert any("swings" in note for note in run.record.notes)
    assert (run.folder / BEHAVIOUR_NAME).read_bytes() == models.read_bytes()
    model = run.behaviour()
    assert model.fps == FPS == run.record.fps
    assert prepare_run(session_on_disk).record.behaviour == ""


def test_a_model_is_named_or_given_by_path(session_on_disk: Session, models: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "mine.behaviour"
    write_model(arm_model().at_rate(30.0), elsewhere)
    for asked, name in (("swings", "swings"), ("swings.behaviour", "swings"), (str(elsewhere), "mine")):
        run = prepare_run(session_on_disk, behaviour=asked)
        assert run.record.behaviour == name
        assert not any("behaviour" in note.lower() for note in run.record.notes)


def refused(session: Session, **wanted: object) -> StudioError:
    with pytest.raises(StudioError) as caught:
        prepare_run(session, start_pose=true_poses()[0], **wanted)  # pyright: ignore[reportArgumentType]
    assert caught.value.hint
    folder = session.path / "runs"
    assert not folder.exists() or not list(folder.iterdir())
    return caught.value


def test_refusals_list_the_models(session_on_disk: Session) -> None:
    none = refused(session_on_disk, tracker="behaviour")
    assert isinstance(none, BehaviourError)
    assert "none of body 'planar_arm4'" in none.message
    assert "studio learn" in none.hint
    keep_arm_model(session_on_disk.path.parent)
    unknown = refused(session_on_disk, behaviour="nobody")
    assert isinstance(unknown, NotFoundError)
    assert "'swings'" in unknown.hint
    keep_arm_model(session_on_disk.path.parent, "more")
    several = refused(session_on_disk, knobs={"prediction": "behaviour"})
    assert "'more', 'swings'" in several.message
    (models_folder(session_on_disk.path.parent) / "broken.behaviour").write_bytes(b"no model")
    broken = refused(session_on_disk, behaviour="broken")
    assert "damaged" in broken.message
    lines = {line.name: line for line in models_in([models_folder(session_on_disk.path.parent)])}
    assert "damaged" in lines["broken"].problem
    assert (lines["swings"].body, lines["swings"].clusters) == ("planar_arm4", arm_model().clusters)


def test_a_name_never_leads_out_of_the_models_folder(session_on_disk: Session, models: Path) -> None:
    write_model(arm_model(), models.parent.parent / "outside.behaviour")
    assert isinstance(refused(session_on_disk, behaviour="outside"), NotFoundError)


def test_another_body_is_refused_naming_what_differs() -> None:
    human = load_body("human25")
    with pytest.raises(BehaviourError, match="4 parameters, 'human25' 25"):
        fitting(arm_model(), human, 30.0)
    renamed = dataclasses.replace(
        arm_model(), space=dataclasses.replace(arm_model().space, parameters=("x1", "y2", "x3", "x4"))
    )
    with pytest.raises(BehaviourError, match="it has 'y2' where 'planar_arm4' has 'x2'"):
        fitting(renamed, load_body("planar_arm4"), 30.0)
    assert fitting(arm_model(), load_body("planar_arm4"), 20.0).fps == 20.0


def test_a_change_that_needs_a_model_is_refused_without_one() -> None:
    plain = default_settings("annealed")
    guided = changed_settings(plain, {"prediction": "behaviour"})
    check_prediction(plain, has_model=False)
    check_prediction(guided, has_model=True)
    with pytest.raises(SettingsError, match="no behaviour model"):
        check_prediction(guided, has_model=False)


@pytest.mark.parametrize("tracker", sorted(GUIDED))
def test_runs_replay_with_their_copy_and_resume_bit_for_bit(
    session_on_disk: Session, models: Path, tracker: str
) -> None:
    whole = tracked(session_on_disk, made(session_on_disk, tracker, "whole"))
    run = made(session_on_disk, tracker, "broken")
    again = made(session_on_disk, tracker, "again")
    models.unlink()
    assert np.array_equal(tracked(session_on_disk, run, lambda step: step % 4 == 2), whole)
    assert np.array_equal(tracked(session_on_disk, again), whole)
    assert np.abs(whole - true_poses()).max() < 0.3


def test_a_run_whose_copy_is_gone_says_so_and_stays_free(session_on_disk: Session, models: Path) -> None:
    run = made(session_on_disk, "behaviour")
    (run.folder / BEHAVIOUR_NAME).unlink()
    for _ in range(2):
        with pytest.raises(BehaviourError, match=BEHAVIOUR_NAME):
            TrackingRun(run, ProblemSource(session_on_disk, run.body(), run.cameras()))


LEARNING = {"online_learning": True, "learning_interval": 10}


@pytest.fixture
def long_session(models: Path, monkeypatch: pytest.MonkeyPatch) -> Session:
    """A session of two lessons, in which short stretches count."""
    monkeypatch.setattr("studio.search.trackers.online_learning.SHORTEST_S", 0.03)
    return make_session(models.parent.parent / "long", 24)


@pytest.mark.slow
@pytest.mark.parametrize("tracker", sorted(GUIDED))
def test_lessons_are_the_same_wherever_a_run_is_taken_up(long_session: Session, tracker: str) -> None:
    whole = made(long_session, tracker, "whole", **LEARNING)
    poses = tracked(long_session, whole)
    broken = made(long_session, tracker, "broken", **LEARNING)
    assert np.array_equal(tracked(long_session, broken, lambda step: step % 17 == 3), poses)
    learnt = read_model(whole.folder / LEARNT_NAME)
    assert learnt.making.frames > arm_model().making.frames
    assert np.array_equal(
        learnt.automaton.next_state, read_model(broken.folder / LEARNT_NAME).automaton.next_state
    )
    # What was learnt serves another run.
    following = prepare_run(long_session, behaviour=str(whole.folder / LEARNT_NAME))
    assert following.record.behaviour == "learnt"


def test_frames_annealed_again_see_the_lessons_of_their_time(long_session: Session) -> None:
    run = made(long_session, "behaviour", **LEARNING)
    tracked(long_session, run)
    with opened(long_session, run) as tracking, run.results() as results:
        for frame in (9, 10, 23):
            question = Reannealing(tracking, frame, *tracking.latest_settings())
            while not question.finished:
                question.step_layer()
            stored, again = results.result(frame), question.result()
            assert np.array_equal(again.estimate.pose, stored.estimate.pose)
            assert np.array_equal(
                again.carried.particles.extra[STATES], stored.carried.particles.extra[STATES]
            )


def test_an_attempt_without_a_model_is_the_trial_that_it_was(session_on_disk: Session) -> None:
    without = TrackingTrial(str(session_on_disk.path), "behaviour", "edge-region", 0, {"particles": 20})
    assert "behaviour" not in without.plain()
    given = dataclasses.replace(without, behaviour="swings")
    assert TrackingTrial.of_plain(given.plain()) == given


@pytest.mark.slow
def test_experiments_track_with_a_model(long_session: Session) -> None:
    """The same frames as a run with the same seed, lessons included."""
    body = long_session.body()
    truth = marker_points(body, true_poses(24))
    names = tuple(marker.name for marker in body.markers)
    (long_session.path / "truth").mkdir()
    write_trc(
        long_session.path / "truth" / "true.trc", MarkerMotion(names, np.arange(24) / FPS, truth, "mm", FPS)
    )
    write_pose(long_session.path / "start_pose.csv", tuple(arm_model().space.parameters), true_poses()[0])
    changes = {**GUIDED["behaviour"], **LEARNING}
    attempt = TrackingTrial(
        str(long_session.path), "behaviour", "edge-region", 4, {**changes, "refine_frames": True}
    )
    cache = FootageCache(long_session.path.parent)
    with pytest.raises(SettingsError, match="no behaviour model"):
        track(attempt, cache)
    found = track(dataclasses.replace(attempt, behaviour="swings"), cache)
    cache.close()
    run = made(long_session, "behaviour", **LEARNING)
    poses = tracked(long_session, run)
    own = marker_points(body, poses)
    assert found.per_frame_mm == pytest.approx(np.linalg.norm(own - truth, axis=2).mean(axis=1), abs=5e-3)
