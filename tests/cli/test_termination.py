"""SIGTERM ends a command as Ctrl-C does: the finished frames are kept, and the run goes on from there bit for bit."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from toy_session import make_session, true_poses
from tracked_runs import finish, poses_of

from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

SLOW = {"particles": 600, "layers": 3, "start_repeats": 1}
FRAMES = 60


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return make_session(tmp_path / "toy", frames=FRAMES)


def prepared(session: Session, name: str) -> StoredRun:
    return prepare_run(session, name=name, seed=3, start_pose=true_poses()[0], knobs=SLOW)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code", "words"),
    [(signal.SIGTERM, 143, "Ended from outside"), (signal.SIGINT, 130, "Cancelled")],
)
def test_a_tracked_run_ends_with_what_is_finished(
    session: Session, number: signal.Signals, code: int, words: str
) -> None:
    run = prepared(session, "ended")
    command = [sys.executable, "-c", "from studio.cli.main import main; main()", "track", str(session.path)]
    process = subprocess.Popen(
        [*command, "--resume", "ended"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell's background jobs ignore SIGINT, and so would their children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not run.summary().done and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code, said
    assert words in said
    assert "Traceback" not in said
    summary = run.summary()
    assert summary.status == "cancelled"
    assert 0 < summary.done < FRAMES
    other = prepared(session, "whole")
    assert np.array_equal(finish(session, run), finish(session, other))
    assert len(poses_of(run)) == FRAMES
