"""A session's footage: videos and pictures, masks, and what is kept."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import HEIGHT, WIDTH, number_of, numbered_frame, write_pictures, write_video

from studio.footage.capture.footage import Footage, open_footage
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.errors import FootageError, NotFoundError

COUNT = 20


@pytest.fixture
def footage(tmp_path: Path) -> Footage:
    frames = [numbered_frame(number) for number in range(COUNT)]
    write_video(tmp_path / "a.mp4", frames)
    write_pictures(tmp_path / "b", frames)
    masks = [np.full((HEIGHT, WIDTH, 3), 10 * number, np.uint8) for number in range(COUNT)]
    write_pictures(tmp_path / "masks", masks)
    cameras = (
        CameraSource("a", "video", "a.mp4", WIDTH, HEIGHT, COUNT),
        CameraSource("b", "pictures", "b", WIDTH, HEIGHT, COUNT, masks="masks"),
    )
    return open_footage(FootageSource(30.0, COUNT - 2, cameras), tmp_path)


def test_all_cameras_show_the_same_frame(footage: Footage) -> None:
    for frame in (0, 17, 3, 4, 5, 16):
        found = footage.pictures(frame)
        assert found.cameras == ("a", "b")
        assert [number_of(picture) for picture in found.pictures] == [frame, frame]


def test_masks_are_thresholded_at_127(footage: Footage) -> None:
    assert footage.mask("a", 0) is None
    for frame, level in ((12, 0), (13, 255)):
        masks = footage.masks(frame)
        assert list(masks) == ["b"]
        np.testing.assert_array_equal(masks["b"], np.full((HEIGHT, WIDTH), level))


def test_mask_videos_are_thresholded_too(tmp_path: Path) -> None:
    shape = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    cv2.circle(shape, (60, 50), 25, (255, 255, 255), cv2.FILLED)
    write_video(tmp_path / "m.mp4", [shape] * 9)
    write_video(tmp_path / "a.mp4", [numbered_frame(k) for k in range(5)])
    source = CameraSource("a", "video", "a.mp4", WIDTH, HEIGHT, 5, masks="m.mp4")
    mask = open_footage(FootageSource(30.0, 5, (source,)), tmp_path).mask("a", 3)
    assert mask is not None
    assert set(np.unique(mask)) == {0, 255}
    assert np.mean(mask != shape[:, :, 0]) < 0.01


def test_a_picture_read_again_is_the_same_array(footage: Footage) -> None:
    first = footage.picture("a", 7)
    assert footage.picture("a", 7) is first
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0] = 0


@pytest.mark.parametrize("frame", [-1, COUNT - 2])
def test_frames_outside_the_footage(footage: Footage, frame: int) -> None:
    with pytest.raises(NotFoundError, match="no frame"):
        footage.pictures(frame)


def test_files_that_are_gone_or_changed(tmp_path: Path) -> None:
    source = CameraSource("a", "pictures", "p", WIDTH, HEIGHT, 2)
    with pytest.raises(FootageError, match="is not there"):
        open_footage(FootageSource(30.0, 2, (source,)), tmp_path)
    write_pictures(tmp_path / "p", [numbered_frame(0)[:-2]] * 2)
    with pytest.raises(FootageError, match="128x94"):
        open_footage(FootageSource(30.0, 2, (source,)), tmp_path).picture("a", 0)


def test_pictures_of_no_size_are_refused(tmp_path: Path) -> None:
    write_pictures(tmp_path / "a", [numbered_frame(0)])
    source = CameraSource("a", "pictures", "a", WIDTH, 0, 1)
    with pytest.raises(FootageError, match=r"camera a are said to be 128x0 pixels"):
        open_footage(FootageSource(30.0, 1, (source,)), tmp_path)
