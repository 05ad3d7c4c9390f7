"""`studio track --behaviour`, `studio compare --behaviour`."""

import json
from pathlib import Path

import numpy as np
import pytest
from arm_behaviour import FPS, keep_arm_model
from command_line import call, refusal_of
from toy_session import FRAMES, true_poses

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.results.comparison.kept_comparison import BEHAVIOUR_NAME
from studio.sessions.named_rows import write_pose
from studio.sessions.provenance import note
from studio.sessions.session import Session


@pytest.fixture
def started(session_on_disk: Session) -> Session:
    """The toy session with a start pose and a truth."""
    body = session_on_disk.body()
    write_pose(
        session_on_disk.path / "start_pose.csv",
        tuple(entry.name for entry in body.parameters),
        true_poses()[0],
    )
    names = tuple(marker.name for marker in body.markers)
    (session_on_disk.path / "truth").mkdir()
    motion = MarkerMotion(names, np.arange(FRAMES) / FPS, marker_points(body, true_poses(FRAMES)), "mm", FPS)
    write_trc(session_on_disk.path / "truth" / "true.trc", motion)
    return session_on_disk


def test_track_with_a_model(started: Session, tmp_path: Path) -> None:
    path = keep_arm_model(started.path.parent)
    common = ("track", "toy", "--frames", "0:2", "--particles", "40", "--json")
    only = call(*common, "--tracker", "behaviour")
    assert json.loads(only.stdout)["behaviour"] == "swings"
    assert "the only one" in only.stderr
    named = call(*common, "--tracker", "behaviour", "--behaviour", "swings", "--set", "attenuation=0.2")
    assert json.loads(named.stdout)["behaviour"] == "swings"
    predicted = call(*common, "--behaviour", path, "--set", "prediction=behaviour", "--layers", "2")
    assert json.loads(predicted.stdout)["behaviour"] == "swings"
    assert "behaviour" not in json.loads(call(*common, "--layers", "2").stdout)


def test_track_without_a_model_says_how_to_get_one(started: Session) -> None:
    for request in (("--tracker", "behaviour"), ("--set", "prediction=behaviour")):
        result = refusal_of("track toy", *request)
        assert "none of body 'planar_arm4'" in result
        assert "studio learn" in result
    assert "no behaviour model 'nobody'" in refusal_of("track toy --tracker behaviour --behaviour nobody")


@pytest.mark.slow
def test_compare_with_a_model(started: Session) -> None:
    path = keep_arm_model(started.path.parent)
    common = (
        "compare", "toy", "--trackers", "behaviour,annealed:guided,condensation", "--evaluations", "40",
        "--layers", "2", "--seeds", "1", "--frames", "0:3", "--processes", "1", "--json",
    )  # fmt: skip
    result = call(*common)
    printed = json.loads(result.stdout)
    assert [entry["tracker"] for entry in printed["trackers"]] == [
        "behaviour",
        "annealed:guided",
        "condensation",
    ]
    assert (Path(printed["folder"]) / BEHAVIOUR_NAME).read_bytes() == path.read_bytes()
    path.unlink()
    assert "needs a behaviour model" in refusal_of(*common)
    # Nobody who takes part by default needs one.
    assert (
        "behaviour"
        not in call("compare --help").output.partition("--evaluations")[0].partition("default:")[2]
    )


def test_track_despite_what_the_footage_says(started: Session) -> None:
    doubt = "Camera cam2 seems to be mirrored. Record it again."
    note(started, "background", "in doubt", good=False, stops=(doubt,))
    common = ("track", "toy", "--frames", "0:1", "--particles", "20", "--layers", "2", "--json")
    assert doubt in refusal_of(*common)
    assert not started.runs()
    tracked = call(*common, "--allow-inconsistent")
    assert f"Tracked despite: {doubt}" in tracked.stderr
