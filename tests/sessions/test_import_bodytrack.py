"""Importing a folder of the bodytrack benchmark."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from sources import everything_below

from studio.body.forward_kinematics import limb_ends
from studio.foundations.errors import BodyError
from studio.sessions.importers.importing import ImportOptions, import_source

PERSON_TOP = 1705.0


@pytest.fixture
def lee(real_data: Path) -> Path:
    return real_data / "lee-walk"


@pytest.mark.real_data
def test_the_lee_walk(lee: Path, tmp_path: Path) -> None:
    report = import_source(lee, tmp_path / "made")
    session = report.session
    assert [(m.footage, m.camera) for m in report.matching] == [
        (f"CAM{k}", f"Camera{k}") for k in range(1, 5)
    ]
    assert report.warnings == ()
    assert (session.manifest.body, session.manifest.fps, session.manifest.frame_count) == ("human31", 60.0, 4)
    start, sigma, slow = session.start_pose(), session.sigma(), session.sigma(20.0)
    assert start is not None
    assert sigma is not None
    assert slow is not None
    # The file keeps the data's numbers; what is read is the same attitude within the body's limits.
    initial = np.loadtxt(lee / "InitialPose.txt").ravel()
    written = np.loadtxt(session.path / "start_pose.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(written, initial)
    ends = [limb_ends(session.body(), pose) for pose in (start, initial)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0.0, atol=1e-9)
    for entry, value in zip(session.body().parameters, start, strict=True):
        assert entry.lower <= value <= entry.upper, entry.name
    stated = np.array((lee / "PoseParameters.txt").read_text().split(), float)[:31]
    np.testing.assert_allclose(sigma, stated)
    np.testing.assert_allclose(slow, 3.0 * stated)
    lengths = np.array((lee / "BodyShapeParameters.txt").read_text().split(), float)[40:]
    dimensions = session.body().dimensions
    assert dimensions["torso_length"] == pytest.approx(lengths[0], abs=1e-9)
    assert dimensions["head_length"] == pytest.approx(lengths[17], abs=1e-9)
    for k in range(1, 5):
        copied = session.path / "calibration" / "original" / f"Camera{k}.cal"
        assert copied.read_bytes() == (lee / "CALIB" / f"Camera{k}.cal").read_bytes()


@pytest.mark.real_data
def test_pictures_and_masks_are_the_files_own(lee: Path, tmp_path: Path) -> None:
    footage = import_source(lee, tmp_path / "made").session.footage()
    for index in range(1, 5):
        for frame in range(4):
            picture = cv2.imread(str(lee / f"CAM{index}" / f"image{frame:04d}.bmp"), cv2.IMREAD_UNCHANGED)
            mask = cv2.imread(str(lee / f"FG{index}" / f"image{frame:04d}.bmp"), cv2.IMREAD_GRAYSCALE)
            assert mask is not None
            np.testing.assert_array_equal(
                footage.picture(f"Camera{index}", frame),
                cv2.merge([picture] * 3) if picture is not None and picture.ndim == 2 else picture,
            )
            np.testing.assert_array_equal(footage.mask(f"Camera{index}", frame), np.where(mask > 0, 255, 0))


@pytest.mark.real_data
def test_the_rolled_cameras_are_shown_upright(lee: Path, tmp_path: Path) -> None:
    session = import_source(lee, tmp_path / "made").session
    footage = session.footage()
    for camera in session.cameras():
        mask = footage.mask(camera.name, 0)
        assert mask is not None
        # The head's end points of the data's README, seen by OpenCV, turned as the picture is.
        ends = np.array([[134.7, 940.1, 0.0], [225.0, 999.9, PERSON_TOP]])
        pixels, _ = cv2.projectPoints(
            ends, cv2.Rodrigues(camera.rotation)[0], camera.translation, camera.matrix, camera.distortion
        )
        marked = np.zeros_like(mask)
        for value, (x, y) in zip((1, 2), np.round(pixels.reshape(2, 2)).astype(int), strict=True):
            marked[y, x] = value
        shown = np.rot90(marked, -camera.quarter_turns)
        (floor, left), (head, right) = np.argwhere(shown == 1)[0], np.argwhere(shown == 2)[0]
        assert floor - head > abs(left - right), camera.name


@pytest.mark.real_data
def test_another_rate_and_missing_parts(lee: Path, tmp_path: Path) -> None:
    shutil.copytree(lee, tmp_path / "source")
    for name in ("InitialPose.txt", "PoseParameters.txt", "BodyShapeParameters.txt"):
        (tmp_path / "source" / name).unlink()
    for index in range(1, 5):
        shutil.rmtree(tmp_path / "source" / f"FG{index}")
    session = import_source(tmp_path / "source", tmp_path / "made", ImportOptions(fps=20.0)).session
    assert session.manifest.fps == 20.0
    assert session.start_pose() is None
    assert session.sigma() is None
    assert session.subject() is None
    assert session.footage().masks(0) is None


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("InitialPose.txt", "0.1 0.2", "does not hold 31 finite numbers"),
        ("PoseParameters.txt", "nan " * 93, "does not hold 93 finite numbers"),
        ("BodyShapeParameters.txt", "1 2 3", "3 numbers"),
        ("InitialPose.txt", "walk", "not a list of numbers"),
    ],
)
def test_parameter_files_that_do_not_fit(
    lee: Path, tmp_path: Path, name: str, content: str, message: str
) -> None:
    shutil.copytree(lee, tmp_path / "source")
    (tmp_path / "source" / name).write_text(content)
    before = everything_below(tmp_path)
    with pytest.raises(BodyError, match=message):
        import_source(tmp_path / "source", tmp_path / "made")
    assert everything_below(tmp_path) == before
