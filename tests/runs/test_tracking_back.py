"""A run that began in the middle of its footage, at the start pose's frame, and is tracked back to the first frame."""

import numpy as np
from toy_session import FRAMES, true_poses

from studio.operations.jobs.batch import track_to_end
from studio.runs.correcting import prepare_correction, track_backwards
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session

K = 5
QUICK = {"particles": 60, "layers": 4, "start_repeats": 2}


def test_the_frames_before_the_start_pose_are_tracked_backwards(session_on_disk: Session) -> None:
    late = prepare_run(session_on_disk, name="late", first=K, start_pose=true_poses()[K], knobs=QUICK)
    track_to_end(session_on_disk, late, lambda *_: None)
    with late.results() as results:
        frames, forwards = results.poses()
    assert frames.tolist() == list(range(K, FRAMES))
    run = prepare_correction(session_on_disk, late, K, forwards[0], backwards_to=0, name="whole")
    assert (run.record.first, run.record.last) == (0, FRAMES)
    assert track_backwards(session_on_disk, run) == K + 1
    with run.results() as results:
        frames, found = results.poses()
    assert frames.tolist() == list(range(FRAMES))
    assert np.array_equal(found[K + 1 :], forwards[1:])
    assert np.abs(found - true_poses()).mean(axis=1).max() < 0.15
    summary = run.summary()
    assert (summary.status, summary.done) == ("finished", FRAMES)
    with late.results() as results:
        assert np.array_equal(results.poses()[1], forwards)


def test_a_cancelled_way_back_goes_on_from_a_whole_run(session_on_disk: Session) -> None:
    late = prepare_run(session_on_disk, name="late", first=3, start_pose=true_poses()[3], knobs=QUICK)
    track_to_end(session_on_disk, late, lambda *_: None)
    with late.results() as results:
        forwards = results.poses()[1]
    run = prepare_correction(session_on_disk, late, 3, forwards[0], backwards_to=0)
    reached: list[int] = []
    track_backwards(
        session_on_disk, run, lambda _s, done, _t: reached.append(done), lambda: len(reached) == 2
    )
    with run.results() as results:
        frames, found = results.poses()
    assert frames.tolist() == list(range(2, FRAMES))
    assert np.abs(found - true_poses()[2:]).mean(axis=1).max() < 0.15
