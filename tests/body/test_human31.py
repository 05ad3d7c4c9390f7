"""human31 against the Lee-walk data that it is interchangeable with."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from studio.body.branches import within_limits
from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, limb_frames, marker_points
from studio.body.model import kinematic_tables
from studio.body.subject import fit_subject, subject_from_shape
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project

pytestmark = pytest.mark.real_data

# The data dictionary prints one decimal; world and pixels are rounded once.
ROUNDED = 0.0501


@pytest.fixture
def lee_walk(real_data: Path) -> Path:
    return real_data / "lee-walk"


def _numbers(path: Path) -> np.ndarray:
    return np.array(path.read_text().split(), dtype=float)


def _camera(lee_walk: Path, number: int = 1) -> Camera:
    values = _numbers(lee_walk / "CALIB" / f"Camera{number}.cal")
    matrix = np.array(
        [[values[0], values[4] * values[0], values[2]], [0.0, values[1], values[3]], [0.0, 0.0, 1.0]]
    )
    return Camera(str(number), 640, 480, matrix, values[5:10], values[10:19].reshape(3, 3), values[19:22])


def _printed_ends(lee_walk: Path) -> dict[str, np.ndarray]:
    """Limb name to the ten numbers of its row: two world points, two pixels."""
    rows = {}
    for line in (lee_walk / "README.md").read_text().splitlines():
        found = re.match(r"\| \d ([a-z ]+) \| \(.*\) \| \(.*\) \| \(.*\) \| \(.*\) \|", line)
        if found:
            cells = " ".join(re.findall(r"\(([^)]*)\)", line)).replace(",", " ")
            rows[found.group(1)] = np.array(cells.split(), dtype=float)
    return rows


def test_end_points_and_pixels_are_those_of_the_data_dictionary(lee_walk: Path) -> None:
    body = load_body("human31")
    ends = limb_ends(body, _numbers(lee_walk / "InitialPose.txt"))[0]
    pixels, _ = project(_camera(lee_walk), ends)
    printed = _printed_ends(lee_walk)
    assert list(printed) == [limb.name for limb in body.drawn]
    for place, row in enumerate(printed.values()):
        np.testing.assert_allclose(ends[place].ravel(), row[:6], atol=ROUNDED)
        np.testing.assert_allclose(pixels[place].ravel(), row[6:], atol=ROUNDED)


def test_sigma_is_half_a_frames_largest_step_at_sixty_frames_a_second(lee_walk: Path) -> None:
    sigma = _numbers(lee_walk / "PoseParameters.txt")[:31]
    steps = np.array([entry.max_step for entry in load_body("human31").parameters])
    np.testing.assert_allclose(0.5 * steps / 60.0, sigma, rtol=1e-7)


def test_the_initial_pose_lies_within_the_limits_once_it_is_written_on_their_branch(lee_walk: Path) -> None:
    body, stated = load_body("human31"), _numbers(lee_walk / "InitialPose.txt")
    pose = within_limits(body, stated)
    for entry, value in zip(body.parameters, pose, strict=True):
        assert entry.lower < value < entry.upper, entry.name
        assert entry.lower < entry.neutral < entry.upper, entry.name
    changed = {
        entry.name for entry, one, two in zip(body.parameters, stated, pose, strict=True) if one != two
    }
    assert changed == {
        *("right_hip_rz", "right_knee_ry", "right_shoulder_rz", "right_elbow_ry"),
        *("left_shoulder_rx", "left_shoulder_ry", "left_shoulder_rz", "left_elbow_ry"),
    }
    np.testing.assert_allclose(limb_ends(body, pose), limb_ends(body, stated), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(marker_points(body, pose), marker_points(body, stated), rtol=0.0, atol=1e-9)
    # A limb may only have turned by half a turn about its own axis.
    for one, two in zip(limb_frames(body, pose)[0], limb_frames(body, stated)[0], strict=True):
        relative = one[:, :3].T @ two[:, :3]
        np.testing.assert_allclose(np.abs(relative), np.eye(3), atol=1e-9)
        assert relative[2, 2] > 0.0


def test_the_shape_file_gives_the_bodys_own_dimensions(lee_walk: Path) -> None:
    body, numbers = load_body("human31"), _numbers(lee_walk / "BodyShapeParameters.txt")
    subject = subject_from_shape(body, numbers)
    fitted, notes = fit_subject(body, subject)
    assert notes == ()
    for name, value in fitted.dimensions.items():
        assert value == pytest.approx(body.dimensions[name], abs=1e-8)
    lengths = [abs(limb.length) for limb in fitted.drawn]
    np.testing.assert_allclose(lengths, numbers[40:][[0, 2, 3, 6, 7, 10, 11, 14, 15, 17]])
    radii = [[limb.radius_start, limb.radius_end, limb.scale_x, limb.scale_y] for limb in fitted.drawn]
    np.testing.assert_allclose(np.ravel(radii), numbers[:40])
    other, _ = fit_subject(body, subject_from_shape(body, np.r_[numbers[:40], 2.0 * numbers[40:]]))
    assert other.drawn[0].length == pytest.approx(2.0 * numbers[40])


@pytest.mark.parametrize(("number", "inside"), [(1, 0.978), (2, 0.962), (3, 0.946), (4, 0.922)])
def test_outlines_lie_inside_the_masks_as_far_as_the_data_dictionary_says(
    lee_walk: Path, number: int, inside: float
) -> None:
    body, camera = load_body("human31"), _camera(lee_walk, number)
    frames = limb_frames(body, _numbers(lee_walk / "InitialPose.txt"))
    corners, _ = project(camera, limb_outlines(kinematic_tables(body).limb_shape, frames, camera)[0])
    mask = cv2.imread(str(lee_walk / f"FG{number}" / "image0000.bmp"), cv2.IMREAD_GRAYSCALE)
    # A pixel is drawn when its centre lies in a quadrilateral; printed shares are rounded to a thousandth.
    rows, columns = np.mgrid[:480, :640]
    drawn = np.zeros(mask.shape, bool)
    for corner in corners:
        along = np.roll(corner, -1, axis=0) - corner
        turn = [
            side[0] * (rows - start[1]) - side[1] * (columns - start[0])
            for start, side in zip(corner, along, strict=True)
        ]
        drawn |= np.all(np.array(turn) >= 0.0, axis=0) | np.all(np.array(turn) <= 0.0, axis=0)
    assert (mask[drawn] > 0).mean() == pytest.approx(inside, abs=0.0005)
