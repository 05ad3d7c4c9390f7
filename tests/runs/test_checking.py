"""How well a track fits its pictures."""

import numpy as np
import pytest
from store_records import layer_of, result_of
from toy_session import FRAMES, make_session, true_poses

from studio.body.catalogue import load_body
from studio.body.mirroring import Mirror
from studio.foundations.errors import RunError, SessionError
from studio.runs.checking import check_run, kept_check, sudden_turns
from studio.runs.new_run import prepare_run
from studio.runs.refining import SMOOTHED
from studio.runs.setup.workflow import check_step, workflow_of
from studio.runs.tracks import Track, best_track, write_track
from studio.sessions.results_store import ResultsWriter


def step(session, name):
    """A step's status."""
    return next(one for one in workflow_of(session).steps if one.step == name)


@pytest.fixture
def session(tmp_path):
    """The toy arm with a run that holds nothing yet."""
    return make_session(tmp_path / "toy")


def track_of(poses):
    """A track of these poses, called the smoothed one."""
    count = len(poses)
    return Track(SMOOTHED, np.arange(count), poses, np.full(count, 0.9), ("tracked",) * count)


def kept(run, poses):
    """Keep such a track."""
    write_track(run, track_of(poses), replace=True)


def test_the_true_poses_fit_and_others_do_not(session):
    run = prepare_run(session, start_pose=true_poses()[0])
    with pytest.raises(RunError, match="no finished frame"):
        check_run(session, run)
    with ResultsWriter(run.folder) as writer:
        writer.write_frame(result_of(0, layers=1), [layer_of(0, 0)])
    kept(run, true_poses())
    assert best_track(run).name == SMOOTHED
    found = check_run(session, run, every=3)
    assert found.frames == tuple(range(0, FRAMES, 3))
    assert found.cameras == ("front",)
    assert all(share is not None and share > 0.7 for row in found.covered for share in row)
    assert found.inside_mean > 0.9
    assert kept_check(run, SMOOTHED) == found
    assert (check_step(session).state, check_step(session).why) == ("done", "")
    kept(run, true_poses() + 1.0)
    assert kept_check(run, SMOOTHED) is None
    wrong = check_run(session, run, every=3)
    assert wrong.inside_mean < 0.6
    assert wrong.poor == wrong.frames
    assert not found.lost_limbs
    assert set().union(*wrong.lost_limbs.values()) == set(wrong.frames)
    assert "not where masks or pictures show it in" in wrong.in_words()
    assert not wrong.good
    assert check_step(session).state == "done"
    assert "look at the frames" in check_step(session).why


def test_a_body_that_turns_round_at_once_is_named():
    body = load_body("human25")
    poses = np.tile(body.neutral, (6, 1))
    mirror = Mirror(body)
    assert sudden_turns(body, track_of(poses), 60.0) == ()
    turned = np.array([mirror.turned_round(pose) for pose in poses[3:]])
    assert sudden_turns(body, track_of(np.concatenate([poses[:3], turned])), 60.0) == (3,)


def test_what_a_disk_cannot_keep_is_measured_all_the_same(session, monkeypatch):
    run = prepare_run(session, start_pose=true_poses()[0])
    with ResultsWriter(run.folder) as writer:
        writer.write_frame(result_of(0, layers=1), [layer_of(0, 0)])
    kept(run, true_poses())

    def refused(*_):
        raise SessionError("The disk cannot be written.", "")

    monkeypatch.setattr("studio.sessions.record_files.write_bytes", refused)
    assert check_run(session, run, every=3).inside_mean > 0.9
    assert kept_check(run, SMOOTHED) is None
