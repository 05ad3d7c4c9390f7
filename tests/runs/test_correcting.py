"""A run corrected in the middle: what is kept, what follows from the correction, forwards and backwards."""

import dataclasses

import numpy as np
import pytest
from toy_session import FRAMES, true_poses
from tracked_runs import finish, opened, poses_of

from studio.foundations.errors import NotFoundError, RunError
from studio.runs.correcting import prepare_correction, track_backwards
from studio.runs.new_run import prepare_run
from studio.search.trackers.tracker import LOST, TRACKED
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

QUICK = {"particles": 60, "layers": 4, "start_repeats": 2}
QUICK_FIRST_LAYERS = 2
"""Of a frame that begins anew, with the settings of the wrong run."""
K = 5


def off(poses: np.ndarray, frame: int) -> float:
    return float(np.abs(poses[frame] - true_poses()[frame]).mean())


@pytest.fixture
def wrong(session_on_disk: Session) -> StoredRun:
    """A run that begins folded the wrong way and stays there."""
    start = true_poses()[0] + np.array([1.2, -2.0, 1.8, -1.5])
    changes = {
        **QUICK,
        "particles": 8,
        "layers": 2,
        "start_repeats": 1,
        "recovery": "off",
        "refine_frames": False,
    }
    run = prepare_run(session_on_disk, name="wrong", start_pose=start, knobs=changes)
    poses = finish(session_on_disk, run)
    assert off(poses, 6) > 0.3
    return run


def test_forwards_keeps_what_was_before_and_follows_the_correction(
    session_on_disk: Session, wrong: StoredRun
) -> None:
    before = poses_of(wrong)
    run = prepare_correction(session_on_disk, wrong, K, true_poses()[K], source="by hand", name="right")
    assert run.summary().tracked_to == K
    found = finish(session_on_disk, run)
    assert np.array_equal(found[:K], before[:K])
    assert max(off(found, frame) for frame in range(K, FRAMES)) < 0.15
    assert np.array_equal(poses_of(wrong), before)
    record = run.record
    assert (record.made_from, record.corrected, record.backwards_to) == ("wrong", K, None)
    assert np.allclose(record.corrected_pose or (), true_poses()[K])
    assert "frame 5 corrected (by hand)" in record.notes[-1]
    assert run.summary().status == "finished"
    with run.results() as results:
        assert len(results.layers(K - 1)) > 0
        assert len(results.layers(K)) == QUICK_FIRST_LAYERS


def test_a_corrected_run_may_be_interrupted(session_on_disk: Session, wrong: StoredRun) -> None:
    whole = prepare_correction(session_on_disk, wrong, K, true_poses()[K])
    parts = prepare_correction(session_on_disk, wrong, K, true_poses()[K])
    finish(session_on_disk, parts, layers=1)
    finish(session_on_disk, parts, layers=2)
    assert np.array_equal(finish(session_on_disk, whole), finish(session_on_disk, parts))


def test_backwards_replaces_what_was_before_and_keeps_the_rest(
    session_on_disk: Session, wrong: StoredRun
) -> None:
    before = poses_of(wrong)
    run = prepare_correction(session_on_disk, wrong, K, true_poses()[K], backwards_to=2)
    reports: list[tuple[int, int]] = []
    assert (
        track_backwards(session_on_disk, run, lambda _step, done, total: reports.append((done, total))) == 4
    )
    assert reports == [(1, 4), (2, 4), (3, 4), (4, 4)]
    found = poses_of(run)
    assert np.array_equal(found[:2], before[:2])
    assert np.array_equal(found[K + 1 :], before[K + 1 :])
    assert max(off(found, frame) for frame in range(2, K + 1)) < 0.15
    assert np.array_equal(poses_of(wrong), before)
    with run.results() as results:
        assert results.timeline().tracking[2 : K + 1] == (TRACKED,) * 4
        assert results.result(2).carried.particles is not None
    assert run.summary().status == "finished"
    again = prepare_correction(session_on_disk, wrong, K, true_poses()[K], backwards_to=2)
    track_backwards(session_on_disk, again)
    assert np.array_equal(poses_of(again), found)


def test_a_cancelled_way_back_keeps_what_it_reached(session_on_disk: Session, wrong: StoredRun) -> None:
    run = prepare_correction(session_on_disk, wrong, K, true_poses()[K], backwards_to=0)
    reached: list[int] = []
    done = track_backwards(
        session_on_disk, run, lambda _step, done, _total: reached.append(done), lambda: len(reached) == 2
    )
    assert done == 2
    before, found = poses_of(wrong), poses_of(run)
    assert np.array_equal(found[: K - 1], before[: K - 1])
    assert off(found, K - 1) < 0.15


def test_an_early_frame_may_be_searched_again_after_the_way_back(
    session_on_disk: Session, wrong: StoredRun
) -> None:
    run = prepare_correction(session_on_disk, wrong, K, true_poses()[K], backwards_to=0)
    track_backwards(session_on_disk, run)
    with opened(session_on_disk, run) as tracking, run.results() as results:
        after = results.result(3).carried.particles
        carried = tracking.carried_into(2).particles
    assert np.array_equal(carried.poses, after.poses)


@pytest.mark.parametrize(
    ("frame", "back", "cause"),
    [
        (-1, None, "Frame -1 of run 'wrong' cannot be tracked again"),
        (99, None, "Frame 99 of run"),
        (4, 4, "frames from 4 back to 4 are not"),
        (4, -2, "frames from 4 back to -2 are not"),
    ],
)
def test_frames_that_are_not_there_are_refused(
    session_on_disk: Session, wrong: StoredRun, frame: int, back: int | None, cause: str
) -> None:
    with pytest.raises(RunError, match=cause):
        prepare_correction(session_on_disk, wrong, frame, true_poses()[0], backwards_to=back)
    assert [run.name for run in session_on_disk.runs()] == ["wrong"]


def test_poses_and_names_are_checked(session_on_disk: Session, wrong: StoredRun) -> None:
    with pytest.raises(RunError, match="has 4 finite numbers"):
        prepare_correction(session_on_disk, wrong, 3, np.full(4, np.nan))
    with pytest.raises(RunError, match="was not prepared for tracking backwards"):
        track_backwards(session_on_disk, wrong)
    with pytest.raises(NotFoundError):
        session_on_disk.run("right")


def test_what_was_lost_before_is_not_held_against_a_corrected_frame(session_on_disk: Session) -> None:
    run = prepare_run(session_on_disk, name="lost", start_pose=true_poses()[0], knobs=QUICK)
    finish(session_on_disk, run)
    with run.results() as results, ResultsWriter(run.folder) as writer:
        for frame in (2, 3, 4):
            lost = dataclasses.replace(results.result(frame), tracking=LOST, doubts=frame)
            writer.write_frame(lost, results.layers(frame))
    right = prepare_correction(session_on_disk, run, K, true_poses()[K])
    with opened(session_on_disk, right) as tracking:
        assert not tracking._watch.searches_for_lost(K)
        first = tracking.step_layer().record
    assert np.abs(first.poses.mean(axis=0) - true_poses()[K]).max() < 0.1
    finish(session_on_disk, right)
    with right.results() as results:
        states = results.timeline().tracking
    assert states[2:5] == (LOST,) * 3
    assert states[K] == TRACKED
    assert "recovered" not in states[K:]
