"""The vertical is judged by the cameras, however the world's axes are called."""

import dataclasses

import cv2
import numpy as np
import pytest
from looking_cameras import turned_to

from studio.footage.calibration.checks import check_calibration
from studio.footage.calibration.vertical import common_vertical
from studio.foundations.geometry.camera import Camera

K = np.array([[900.0, 0.0, 359.5], [0.0, 900.0, 639.5], [0.0, 0.0, 1.0]])


def phones(rolls: tuple[float, ...], high: float = 1200.0, target: float = 1000.0) -> tuple[Camera, ...]:
    """Phones on tripods about a person, rolled by so many degrees; z up, the floor at 0."""
    found: list[Camera] = []
    for number, roll in enumerate(rolls):
        angle = np.radians(-90.0 + (50.0, -50.0, 20.0, 170.0)[number % 4] * (number > 0) + 0.4 * number)
        centre = np.array([3400.0 * np.cos(angle), 3400.0 * np.sin(angle), high])
        rotation = turned_to(centre, np.array([0.0, 0.0, target]))
        rotation = cv2.Rodrigues(np.array([0.0, 0.0, np.radians(roll)]))[0] @ rotation
        found.append(Camera(f"cam{number}", 720, 1280, K, np.zeros(5), rotation, -rotation @ centre))
    return tuple(found)


def of_the_first(cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
    """The same in the world of the first camera."""
    rotation, translation = cameras[0].rotation, cameras[0].translation
    return tuple(
        dataclasses.replace(
            camera,
            rotation=camera.rotation @ rotation.T,
            translation=camera.translation - camera.rotation @ rotation.T @ translation,
        )
        for camera in cameras
    )


def in_world(cameras: tuple[Camera, ...], axes: np.ndarray) -> tuple[Camera, ...]:
    """axes : rows, the new world's axes in the old one."""
    return tuple(dataclasses.replace(camera, rotation=camera.rotation @ axes.T) for camera in cameras)


def codes(cameras: tuple[Camera, ...]) -> dict[str, str]:
    return {finding.code: finding.severity for finding in check_calibration(cameras)}


MINUS_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@pytest.mark.parametrize("rolls", [(0.0, 0.0), (1.0, -2.0, 1.5), (0.0, 3.0, -2.0, 2.0)])
def test_level_phones_with_z_up_raise_nothing(rolls: tuple[float, ...]) -> None:
    assert codes(phones(rolls)) == {}


@pytest.mark.parametrize("rolls", [(90.0, -90.0, 90.0, 180.0), (90.0, -90.0, 0.0, 180.0)])
def test_phones_on_their_side_raise_nothing(rolls: tuple[float, ...]) -> None:
    assert codes(phones(rolls)) == {}


@pytest.mark.parametrize(
    "rolls", [(0.0, 0.0, 0.0), (3.0, 38.0, 33.0), (3.0, -38.0, 33.0), (-20.0, 15.0, 40.0)]
)
def test_a_line_of_sight_is_not_up_however_the_others_are_rolled(rolls: tuple[float, ...]) -> None:
    findings = check_calibration(of_the_first(phones(rolls)))
    assert findings[0].code == "up-axis"
    assert "minus Y" in findings[0].message or "Minus Y" in findings[0].message
    assert "--up=-y" in findings[0].remedy
    if any(rolls):
        assert "degrees off" in findings[0].message


def test_upside_down_pictures_from_above_raise_nothing() -> None:
    """As of four cameras at the ceiling of a hall, each rolled its own way: their common up is roughly down."""
    hung = phones((150.0, 100.0, -160.0, 170.0), high=2550.0)
    assert codes(hung) == {}
    assert "blocks" in codes(in_world(hung, np.diag([1.0, -1.0, -1.0]))).values()


def test_how_far_a_named_axis_is_off_is_said() -> None:
    """The first camera looks down by 25 degrees, so its minus Y is 25 degrees off the vertical."""
    down = 3400.0 * np.tan(np.radians(25.0))
    rig = of_the_first(phones((0.0, 0.0, 0.0, 0.0), high=1000.0 + down))
    named = in_world(rig, MINUS_Y)
    findings = {finding.code: finding for finding in check_calibration(named)}
    assert findings["tilted-world"].severity == "warns"
    assert "25.0 degrees off" in findings["tilted-world"].message
    assert "studio level" in findings["tilted-world"].remedy
    assert "lens of camera cam0" in findings["floor-unknown"].message
    before = {finding.code: finding for finding in check_calibration(rig)}
    assert "25.0 degrees off" in before["up-axis"].message


def test_the_vertical_of_level_pictures_is_exact() -> None:
    turn = cv2.Rodrigues(np.array([0.3, -0.2, 0.5]))[0]
    found = common_vertical(in_world(phones((0.0, 0.0, 0.0, 0.0)), turn))
    assert found.level
    np.testing.assert_allclose(found.up, turn @ [0.0, 0.0, 1.0], atol=1e-9)


def test_a_camera_that_looks_down_shows_no_vertical() -> None:
    down = Camera("a", 720, 1280, K, np.zeros(5), np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 4000.0]))
    spun = [
        dataclasses.replace(
            down, name=str(n), rotation=cv2.Rodrigues(np.array([0, 0, n * np.pi / 2]))[0] @ down.rotation
        )
        for n in range(4)
    ]
    assert common_vertical(spun) is None
