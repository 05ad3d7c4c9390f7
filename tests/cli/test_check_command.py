"""`studio check`, and the same as a verb: jumps are told by frame and limb."""

import numpy as np
from command_line import answer_of, call
from toy_session import FRAMES, true_poses

import studio
from studio.runs.new_run import prepare_run
from studio.runs.tracks import Track, write_track
from studio.sessions.session import Session


def kept(session: Session, name: str, poses: np.ndarray) -> None:
    """A track of a run that holds nothing itself."""
    run = session.run("one")
    count = len(poses)
    write_track(run, Track(name, np.arange(count), poses, np.full(count, 0.9), ("tracked",) * count))


def test_a_leap_is_reported_and_kept(session_on_disk: Session) -> None:
    prepare_run(session_on_disk, name="one", start_pose=true_poses()[0])
    wrong = true_poses()
    wrong[5:, 0] += 1.0
    kept(session_on_disk, "smoothed", wrong)
    kept(session_on_disk, "good", true_poses())
    found = answer_of("check toy one --every 3")
    assert (found["track"], found["good"]) == ("smoothed", False)
    assert [(jump["frame"], jump["limb"]) for jump in found["jumps"]] == [(5, "arm")]
    assert found["frames"] == list(range(0, FRAMES, 3))
    call("workflow toy")
    again = studio.check("toy/one", every=4)
    assert "1 jump (frame 5, arm)" in again.in_words()
    right = studio.check("toy/one", "good", every=4)
    assert right.jumps == ()
    assert "jump" not in right.in_words()
