"""A KUKA LBR Med 7, five still poses before a stereo pair: every pose from nothing, against the encoders (issue 29).

The masks end in the middle of the last link, on which a gripper hangs that the model has not: so A7, which turns a
round link, is not determined, and A5 and A6 are known from link 6 alone: a degree of A6 is half a pixel there. The
cameras were placed by drawing the robot onto these same masks, so A1 to A4 are no better than these.
"""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

import studio
from studio.foundations.arrays import Array
from studio.sessions.session import Session

pytestmark = [pytest.mark.slow, pytest.mark.real_data, pytest.mark.timeout(1800)]

FRAMES = range(5)
ARM, WRIST = 2.5, 8.0
"""Degrees, of A1 to A4 and of A5 and A6: what is reached, and a margin; the goal of issue 29 is 1.0 of all six."""


@pytest.fixture(scope="module")
def folder(real_data: Path) -> Path:
    take = real_data / "robot-lbr-med7"
    if not take.is_dir():
        pytest.skip("the footage of the robot is not here")
    return take


@pytest.fixture(scope="module")
def session(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Session:
    take = tmp_path_factory.mktemp("robot") / "take"
    for name in ("pictures", "masks", "calibration"):
        shutil.copytree(folder / name, take / name)
    shutil.copytree(folder / "model", take / "bodies")
    (take / "subject.toml").write_text('body = "lbr_med7"\n')
    return studio.import_footage(take, take.parent / "session", unit="mm", fps=1.0)


@pytest.fixture(scope="module")
def encoders(folder: Path) -> Array:
    """(5, 7) degrees."""
    with (folder / "truth" / "joint_angles.csv").open() as file:
        rows = [[float(row[f"A{axis}_rad"]) for axis in range(1, 8)] for row in csv.DictReader(file)]
    return np.degrees(rows)


def test_the_meshes_come_with_the_session(session: Session) -> None:
    assert len(session.body().meshes) == 8


@pytest.mark.parametrize("frame", FRAMES)
def test_each_pose_is_found_from_nothing(session: Session, encoders: Array, frame: int) -> None:
    start = studio.initialise(session, frame=frame, keep=False)
    off = np.degrees(start.pose) - encoders[frame]
    print(frame, np.round(off, 1), round(start.confidence, 2))
    assert np.abs(off[:4]).max() < ARM
    assert np.abs(off[4:6]).max() < WRIST
