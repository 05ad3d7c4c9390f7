"""`studio correct`, forwards and backwards."""

from pathlib import Path

import numpy as np
import pytest
from command_line import answer_of, call, refusal_of
from toy_session import true_poses

from studio.sessions.named_rows import write_pose
from studio.sessions.session import Session


@pytest.fixture
def pose(session_on_disk: Session, tmp_path: Path) -> str:
    """A file with the true pose of frame 4, and a run to be corrected."""
    file = tmp_path / "pose.csv"
    write_pose(file, tuple(entry.name for entry in session_on_disk.body().parameters), true_poses()[4])
    words = ["track", "toy", "--particles", "20", "--layers", "3", "--name", "one", "--start-pose", str(file)]
    call(*words)
    return str(file)


def test_on_and_back(session_on_disk: Session, pose: str) -> None:
    printed = answer_of("correct toy one --at 4 --pose", pose, "--name", "on")
    assert (printed["run"], printed["made_from"], printed["corrected"], printed["frames"]) == (
        "on",
        "one",
        4,
        4,
    )
    assert session_on_disk.run("on").summary().status == "finished"
    printed = answer_of("correct toy one --at 4 --from-track raw --back-to 1 --name back")
    assert (printed["frames"], printed["back_to"]) == (4, 1)
    record = session_on_disk.run("back").record
    with session_on_disk.run("one").results() as results:
        frames, poses = results.poses()
    assert np.allclose(record.corrected_pose or (), poses[list(frames).index(4)])


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (["--at", "4"], "needs a pose"),
        (["--at", "4", "--from-track", "smoothed"], "no track 'smoothed'"),
        (["--at", "44", "--from-track", "raw"], "has no frame 44"),
        (["--at", "4", "--from-track", "raw", "--back-to", "6"], "frames from 4 back to 6"),
    ],
)
def test_refusals(session_on_disk: Session, pose: str, words: list[str], cause: str) -> None:
    assert cause in refusal_of("correct toy one", *words)
    assert len(session_on_disk.runs()) == 1
