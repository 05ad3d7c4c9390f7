"""Poses and σ by the names of their parameters."""

from pathlib import Path

import numpy as np
import pytest

from studio.foundations.csv_text import poses_csv
from studio.foundations.errors import BodyError
from studio.sessions.named_rows import read_pose, read_sigma, write_pose, write_sigma

NAMES = ("a", "b", "c")


def test_a_pose_comes_back_bit_for_bit_in_the_bodys_order(tmp_path: Path) -> None:
    path = tmp_path / "start_pose.csv"
    pose = np.array([0.1 + 0.2, -1e-17, 867.3])
    write_pose(path, NAMES, pose)
    assert np.array_equal(read_pose(path, NAMES), pose)
    assert np.array_equal(read_pose(path, ("c", "a")), pose[[2, 0]])


def test_a_row_of_a_poses_file_is_found_by_its_frame(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text(poses_csv(NAMES, np.array([4, 5]), np.array([[1.0, 2, 3], [4, 5, 6]])))
    assert read_pose(path, NAMES, frame=5).tolist() == [4, 5, 6]
    assert read_pose(path, NAMES).tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no row"),
        ("a,b,c\n", "no row"),
        ("a,b\n1,2\n", "lacks 1 of the body's 3 parameters: c"),
        ("a,b,c\n1,2\n", "Line 2"),
        ("a,b,c\n1,nan,3\n", "'nan' for 'b'"),
        ("a,b,c\n1,x,3\n", "'x' for 'b'"),
        ("a,b,c\n1,inf,3\n", "'inf' for 'b'"),
        ("a,b,c\n1,2,3\n4,5,6\n", "2 rows"),
    ],
)
def test_wrong_files_are_refused_by_line_and_name(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "start_pose.csv"
    path.write_text(text)
    with pytest.raises(BodyError, match=words) as caught:
        read_pose(path, NAMES)
    assert caught.value.hint


def test_sigma_scales_with_the_time_between_frames(tmp_path: Path) -> None:
    """The Lee-walk's σ are of 60 Hz and three times as large at 20 Hz, as its README says."""
    path = tmp_path / "sigma.csv"
    write_sigma(path, NAMES, np.array([13.73, 0.0928, 0.0]), 60.0)
    assert np.array_equal(read_sigma(path, NAMES, 60.0), [13.73, 0.0928, 0.0])
    assert np.allclose(read_sigma(path, NAMES, 20.0), [41.19, 0.2784, 0.0], rtol=1e-12)


@pytest.mark.parametrize("text", ["a,b,c\n1,2,3\n", "fps,a,b,c\n60,1,-2,3\n", "fps,a,b,c\n0,1,2,3\n"])
def test_wrong_sigmas_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "sigma.csv"
    path.write_text(text)
    with pytest.raises(BodyError):
        read_sigma(path, NAMES, 60.0)
