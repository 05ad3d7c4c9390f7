"""Numbers that no body, place or pose has are refused with where they stand and what to do."""

from pathlib import Path

import numpy as np
import pytest
from moving_bodies import write_c3d
from toy_session import BODY

from studio.body.catalogue import load_body
from studio.body.motion_files.c3d import read_c3d
from studio.body.motion_files.trc import MarkerMotion, read_trc, write_trc
from studio.body.subject import Subject, fit_subject, read_subject
from studio.foundations.errors import BodyError, StudioError, TruthError
from studio.runs.new_run import start_of
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.sessions.named_rows import read_pose, write_pose
from studio.sessions.session import Session


@pytest.mark.parametrize("height", [1e300, 1e9, 3001.0, 299.0, 0.0, -5.0, float("inf"), float("nan")])
def test_heights(height: float, tmp_path: Path) -> None:
    with pytest.raises(BodyError, match="height_mm") as caught:
        fit_subject(load_body("human31"), Subject(height_mm=height))
    assert "from 300 to 3000" in caught.value.hint
    path = tmp_path / "subject.toml"
    path.write_text(f'body = "human31"\nheight_mm = {height}\n')
    with pytest.raises(BodyError, match="height_mm"):
        read_subject(path)


@pytest.mark.parametrize("length", [1e300, 1e5, float("inf")])
def test_lengths(length: float) -> None:
    with pytest.raises(BodyError, match="RHip_RKnee"):
        fit_subject(load_body("human31"), Subject(lengths_mm={"RHip_RKnee": length}))


@pytest.mark.parametrize("value", [1e300, 1e10, -1e9])
def test_coordinates_of_a_trc(value: float, tmp_path: Path) -> None:
    path, points = tmp_path / "a.trc", np.ones((3, 2, 3))
    points[1, 1, 2] = value
    write_trc(path, MarkerMotion(("A", "B"), np.arange(3) / 60.0, points, "mm"))
    with pytest.raises(TruthError, match=r"'a\.trc' marker 'B' is at .* mm in row 2") as caught:
        read_trc(path)
    assert "10 km" in caught.value.hint


@pytest.mark.parametrize("value", [3e38, 1e10, float("inf"), float("-inf")])
def test_coordinates_of_a_c3d(value: float, tmp_path: Path) -> None:
    path, points = tmp_path / "a.c3d", np.ones((12, 2, 3))
    points[4, 1, 0] = value
    write_c3d(path, ["A", "B"], points, 60.0)
    with pytest.raises(StudioError, match=r"'a\.c3d' marker 'B' is at .* mm in row 5"):
        read_c3d(path)


@pytest.mark.parametrize("value", [1e300, 1e9, float("inf"), float("nan")])
def test_start_poses(value: float, session_on_disk: Session, tmp_path: Path) -> None:
    body = load_body(BODY)
    names = tuple(entry.name for entry in body.parameters)
    pose = np.zeros(len(names))
    pose[2] = value
    with pytest.raises(StudioError):
        keep_start_pose(session_on_disk, body, pose)
    with pytest.raises(BodyError):
        start_of(session_on_disk, body, pose, "given")
    write_pose(tmp_path / "start_pose.csv", names, pose)
    with pytest.raises(BodyError, match=names[2]):
        read_pose(tmp_path / "start_pose.csv", names)
