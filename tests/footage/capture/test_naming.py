"""Names of footage and cameras."""

import pytest

from studio.footage.capture.naming import match_names, natural_key, words
from studio.foundations.errors import FootageError


def test_natural_order() -> None:
    names = ["cam_10", "cam_2", "cam_1", "Cam_3"]
    assert sorted(names, key=natural_key) == ["cam_1", "cam_2", "Cam_3", "cam_10"]


@pytest.mark.parametrize("name", ["Camera1", "CAM1", "cam_01", "cam-1", "Cam 001", "view1"])
def test_spellings_of_a_camera_are_one(name: str) -> None:
    assert words(name) == ("cam", "1")


@pytest.mark.parametrize(
    ("footage", "cameras", "expected"),
    [
        (["b", "a"], ["a", "b"], ["b", "a"]),
        (["CAM2", "CAM1"], ["Camera1", "Camera2"], ["Camera2", "Camera1"]),
        (["cam01", "cam10"], ["cam_1", "cam_10"], ["cam_1", "cam_10"]),
        (["take3_cam_01", "take3_cam_02"], ["cam1", "cam2"], ["cam1", "cam2"]),
        (["left", "right"], ["GoPro left", "GoPro right"], ["GoPro left", "GoPro right"]),
        (["7", "9"], ["Kinect_7", "Kinect_9"], ["Kinect_7", "Kinect_9"]),
        (["cam1"], ["cam1", "cam2"], ["cam1"]),
    ],
)
def test_matching(footage: list[str], cameras: list[str], expected: list[str]) -> None:
    matches = match_names(footage, cameras, "videos", FootageError)
    assert [match.camera for match in matches] == expected
    assert [match.footage for match in matches] == footage


@pytest.mark.parametrize(
    ("footage", "cameras"),
    [
        (["cam1", "cam3"], ["cam1", "cam2"]),
        (["a1", "b1"], ["cam1", "cam2"]),
        (["cam1", "CAM_01"], ["cam1", "cam2"]),
        (["front", "back"], ["left", "right"]),
    ],
)
def test_what_cannot_be_matched_names_both_lists(footage: list[str], cameras: list[str]) -> None:
    with pytest.raises(FootageError) as caught:
        match_names(footage, cameras, "videos", FootageError)
    for name in (*footage, *cameras):
        assert name in caught.value.message
