"""`studio learn` and `studio models` as a stranger calls them."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import answer_of, call, refusal_of
from moving_bodies import c3d_of, swinging

from studio.body.catalogue import load_body
from studio.operations import behaviours
from studio.sessions.workspace import Workspace, begin_session, workspace_root

BODY = load_body("human25")
QUICK = (
    "--most-clusters",
    "12",
    "--reduced-dimensions",
    "4",
    "--clustering-patience",
    "4",
    "--smoothings",
    "2",
)
BY_NAME = ("--body", "human25")


@pytest.fixture
def motions(tmp_path: Path) -> Path:
    """A folder with two motions and something else."""
    folder = tmp_path / "motions"
    folder.mkdir()
    for seed, name in ((3, "one"), (4, "two")):
        c3d_of(folder / f"{name}.c3d", BODY, swinging(BODY, 60, 30.0, seed), 30.0)
    (folder / "notes.txt").write_text("nothing")
    return folder


@pytest.mark.slow
def test_learn_tells_numbers_and_models_lists(motions: Path, tmp_path: Path) -> None:
    printed = answer_of("learn", motions, "--into", "mine", *QUICK, *BY_NAME, "--memory", "3")
    assert {"frames", "clusters", "states", "entropy_train", "entropy_test"} <= set(printed)
    assert printed["frames"] == 2 * (48 + 47)
    assert (printed["recorded_frames"], printed["test_frames"], printed["body"]) == (96, 24, "human25")
    assert [entry["name"] for entry in printed["sources"]] == ["one", "two"]
    assert all(entry["rms_mm"] < 8.0 for entry in printed["sources"])
    assert Path(printed["path"]) == workspace_root() / "models" / "mine.behaviour"
    listed = answer_of("models")["models"]
    assert [(entry["name"], entry["memory"], entry["clusters"]) for entry in listed] == [
        ("mine", 3, printed["clusters"])
    ]
    assert "mine" in call("models").stdout
    before = Path(printed["path"]).read_bytes()
    assert "--force" in refusal_of("learn", motions, "--into", "mine", *QUICK)
    assert Path(printed["path"]).read_bytes() == before
    tested = (motions / "one.c3d", "--test", motions / "two.c3d", motions / "one.c3d")
    printed = answer_of("learn", *tested, "--into", "mine", "--force", *QUICK)
    assert (printed["recorded_frames"], printed["test_frames"]) == (60, 120)


def test_wrong_calls_are_refused_and_leave_nothing(motions: Path, tmp_path: Path) -> None:
    (tmp_path / "01_01.amc").write_text("1\n")
    cases = {
        ("learn", str(tmp_path / "gone.bvh"), "--into", "m"): "gone.bvh",
        ("learn", str(motions / "notes.txt"), "--into", "m"): "notes.txt",
        ("learn", str(tmp_path / "01_01.amc"), "--into", "m"): "01.asf",
        ("learn", str(motions), "--into", "a b"): "a b",
        ("learn", str(motions), "--into", "m", "--memory", "many"): "memory",
        ("learn", str(motions), "--into", "m", "--smoothings", "0"): "smoothings",
        ("learn", str(motions), "--into", "m", "--body", "nobody"): "nobody",
        ("learn", str(motions), "--into", "m", "--body", "dog"): "dog",
        ("learn", "--into", "m"): "SOURCES",
        ("learn", str(motions), "--into", "m", "--test"): "--test",
    }
    for arguments, words in cases.items():
        assert words in refusal_of(*arguments)
    assert not (workspace_root() / "models").exists()


def test_a_cancelled_learning_leaves_nothing(motions: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_arguments: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(behaviours, "learn_from", interrupted)
    call("learn", motions / "one.c3d", "--into", "mine", *QUICK, code=130)
    assert not (workspace_root() / "models").exists()


@pytest.mark.slow
def test_frames_that_the_body_cannot_follow_are_named(tmp_path: Path) -> None:
    poses = swinging(BODY, 60, 30.0)
    names = [entry.name for entry in BODY.parameters]
    poses[20:26, names.index("left_hip_spread")] = np.radians(178.0)
    path = c3d_of(tmp_path / "split.c3d", BODY, poses, 30.0)
    result = call("learn", path, "--into", "mine", *QUICK)
    assert "split: " in result.stderr
    assert "fit badly" in result.stderr


@pytest.mark.slow
def test_learn_takes_the_body_that_the_sessions_have(motions: Path) -> None:
    """Where most of the workspace's sessions have another body than a new one would, that is the model's."""
    for name, body in (("a", "human25"), ("b", "human31"), ("c", "human25")):
        begin_session(workspace_root() / name, body=body)
    printed = answer_of("learn", motions, "--into", "mine", *QUICK)
    assert printed["body"] == "human25"
    shutil.rmtree(workspace_root() / "a")
    shutil.rmtree(workspace_root() / "c")
    assert Workspace().usual_body() == "human31"
