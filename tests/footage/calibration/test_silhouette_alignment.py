"""Cameras turned by a known amount are turned back by silhouettes alone (oracle: OpenCV's projection of points)."""

import cv2
import numpy as np
import pytest
from looking_cameras import turned_to

from studio.footage.calibration.silhouette_alignment import aligned_cameras, turned
from studio.footage.calibration.silhouette_checks import silhouette_disagreement
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera

SIZE = (1000, 1800)


def camera(name: str, heading: float) -> Camera:
    """One that stands 4 m away, 1.8 m above the floor, and looks at the middle of a person."""
    centre = np.array([4000.0 * np.cos(heading), 4000.0 * np.sin(heading), 1800.0])
    rotation = turned_to(centre, (0.0, 0.0, 900.0))
    matrix = np.array([[1600.0, 0.0, 500.0], [0.0, 1600.0, 900.0], [0.0, 0.0, 1.0]])
    return Camera(name, *SIZE, matrix, np.array([-0.05, 0.1, 0.0, 0.0, 0.0]), rotation, -rotation @ centre)


def seen(cameras: tuple[Camera, ...], points: Array) -> dict[str, Array]:
    """Convex outlines of points (K, 3): planes that touch the points touch the outlines."""
    found = {}
    for one in cameras:
        turn, _ = cv2.Rodrigues(one.rotation)
        pixels, _ = cv2.projectPoints(points, turn, one.translation, one.matrix, one.distortion)
        found[one.name] = cv2.convexHull(pixels.astype(np.float32))[:, 0].astype(np.float64)
    return found


@pytest.fixture(scope="module")
def rig() -> tuple[Camera, ...]:
    return tuple(camera(f"c{k}", heading) for k, heading in enumerate((0.3, 1.9, 3.3, 5.2)))


def outlines(rig: tuple[Camera, ...], frames: int = 14) -> dict[int, dict[str, Array]]:
    rng = np.random.default_rng(5)
    found = {}
    for frame in range(frames):
        points = rng.normal([0.0, 0.0, 900.0], [220.0, 220.0, 420.0], (40, 3)) + rng.normal(0, 150, 3)
        found[frame] = seen(rig, points)
    return found


@pytest.mark.slow
def test_turned_cameras_are_turned_back(rig: tuple[Camera, ...]) -> None:
    turns = np.radians([[0.4, -0.3, 0.0], [0.0, 0.0, 0.0], [-0.5, 0.5, 0.1], [0.1, 0.2, 0.0]])
    wrong, views = turned(rig, turns), outlines(rig)
    found = aligned_cameras(wrong, views)
    assert float(np.max(found.before)) > 8.0
    assert float(np.max(found.after)) < 0.5
    before, after = (silhouette_disagreement(each, views) for each in (wrong, found.cameras))
    assert after < 0.1 * before
    for one, other in zip(wrong, found.cameras, strict=True):
        assert np.allclose(one.centre, other.centre, atol=1e-6)
        assert np.allclose(other.rotation @ other.rotation.T, np.eye(3), atol=1e-9)


@pytest.mark.slow
def test_points_meet_again(rig: tuple[Camera, ...]) -> None:
    """Points that took no part in it are met by all cameras together, to a pixel."""
    wrong = turned(rig, np.radians([[0.4, -0.3, 0.0], [0.0, 0.0, 0.0], [-0.5, 0.5, 0.1], [0.1, 0.2, 0.0]]))
    points = np.random.default_rng(9).normal([0.0, 0.0, 900.0], 250.0, (30, 3))
    true = [cv2.projectPoints(points, cv2.Rodrigues(c.rotation)[0], c.translation, c.matrix, c.distortion)[0]
            for c in rig]  # fmt: skip

    def missed(cameras: tuple[Camera, ...]) -> float:
        rays = []
        for one, pixels in zip(cameras, true, strict=True):
            flat = cv2.undistortPoints(pixels, one.matrix, one.distortion)[:, 0]
            rays.append((np.column_stack([flat, np.ones(len(flat))]), one))
        apart = []
        for k in range(len(points)):
            rows = []
            for flat, one in rays:
                place = np.column_stack([one.rotation, one.translation])
                rows += [flat[k, 0] * place[2] - place[0], flat[k, 1] * place[2] - place[1]]
            found = np.linalg.svd(np.array(rows))[2][-1]
            world = found[:3] / found[3]
            for flat, one in rays:
                seen_at = one.rotation @ world + one.translation
                apart.append(1600.0 * np.linalg.norm(seen_at[:2] / seen_at[2] - flat[k, :2]))
        return float(np.sqrt(np.mean(np.square(apart))))

    found = aligned_cameras(wrong, outlines(rig))
    assert missed(wrong) > 4.0
    assert missed(found.cameras) < 1.0


def test_a_wrong_silhouette_does_not_turn_cameras(rig: tuple[Camera, ...]) -> None:
    """A bystander in one view of two of fourteen frames turns no camera by more than three pixels (0.12°)."""
    views = outlines(rig)
    for frame in (3, 8):
        views[frame]["c2"] = np.vstack([views[frame]["c2"], [[80.0, 700.0], [80.0, 900.0]]])
    found = aligned_cameras(rig, views)
    assert float(np.max(found.turns)) < 0.12
    assert float(np.max(found.after)) < 1.0


def test_too_little_to_align_by_is_reported(rig: tuple[Camera, ...]) -> None:
    with pytest.raises(CalibrationError, match="Too few silhouettes"):
        aligned_cameras(rig, outlines(rig, 1))
