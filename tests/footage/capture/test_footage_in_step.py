"""Cameras that began at different moments, or stood on their heads, read as one session."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import HEIGHT, WIDTH, number_of, numbered_frame, write_pictures, write_video

from studio.footage.capture.footage import Footage, background_turn, open_footage, turned_picture
from studio.footage.capture.footage_source import CameraSource, FootageSource, Turn
from studio.foundations.errors import FootageError, NotFoundError

COUNT = 30
OPENCV_TURNS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}


def opened(folder: Path, offset_a: int, offset_b: int, count: int, turned: Turn = 0) -> Footage:
    """A video and a folder of pictures whose every frame says its number in the file; masks that do so too."""
    frames = [numbered_frame(number) for number in range(COUNT)]
    if turned:
        opposite = OPENCV_TURNS[360 - turned]
        recorded = [cv2.rotate(picture, opposite) for picture in frames]
    else:
        recorded = frames
    write_video(folder / "a.mp4", frames)
    write_pictures(folder / "b", recorded)
    masks = [np.full((*recorded[0].shape[:2], 3), 255 * (number >= 13), np.uint8) for number in range(COUNT)]
    write_pictures(folder / "masks", masks)
    cameras = (
        CameraSource("a", "video", "a.mp4", WIDTH, HEIGHT, COUNT, offset=offset_a),
        CameraSource("b", "pictures", "b", WIDTH, HEIGHT, COUNT, "masks", offset=offset_b, turned=turned),
    )
    return open_footage(FootageSource(30.0, count, cameras), folder)


def test_frames_are_counted_from_each_cameras_offset(tmp_path: Path) -> None:
    footage = opened(tmp_path, 0, 7, COUNT - 7)
    for frame in (0, 22, 5, 6, 21):
        assert [number_of(picture) for picture in footage.pictures(frame).pictures] == [frame, frame + 7]
        masks = footage.masks(frame)
        assert bool(masks["b"].all()) == (frame + 7 >= 13)
    with pytest.raises(NotFoundError, match="no frame 23"):
        footage.picture("a", 23)
    assert [camera.last for camera in footage.source.cameras] == [30, 23]


@pytest.mark.parametrize(("offset", "count"), [(-1, 20), (11, 20), (31, 1)])
def test_offsets_that_leave_too_few_frames_are_refused(tmp_path: Path, offset: int, count: int) -> None:
    with pytest.raises(FootageError, match="Camera b has 30 frames"):
        opened(tmp_path, 0, offset, count)


@pytest.mark.parametrize("turned", [90, 180, 270])
def test_pictures_and_masks_are_turned_clockwise(tmp_path: Path, turned: Turn) -> None:
    footage = opened(tmp_path, 0, 2, 20, turned)
    for frame in (0, 15):
        picture = footage.picture("b", frame)
        np.testing.assert_array_equal(picture, numbered_frame(frame + 2))
        mask = footage.mask("b", frame)
        assert mask.shape == (HEIGHT, WIDTH)
    plate = numbered_frame(40)
    lying = cv2.rotate(plate, OPENCV_TURNS[360 - turned])
    np.testing.assert_array_equal(footage.turned_background("b", lying), plate)
    np.testing.assert_array_equal(footage.turned_background("a", plate), plate)
    np.testing.assert_array_equal(turned_picture(lying, turned), cv2.rotate(lying, OPENCV_TURNS[turned]))


def test_a_background_that_stands_upright_already_is_not_turned_again() -> None:
    assert background_turn(90, (96, 128), (96, 128)) == 0
    assert background_turn(90, (96, 128), (128, 96)) == 90
    assert background_turn(270, (96, 128), (130, 98)) == 270
    assert background_turn(180, (128, 96), (128, 96)) == 180
    assert background_turn(90, (96, 96), (96, 96)) == 90
    assert background_turn(0, (128, 96), (128, 96)) == 0
