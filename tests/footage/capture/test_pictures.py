"""Folders of pictures."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import number_of, numbered_frame, write_pictures

from studio.footage.capture.pictures import (
    PictureReader,
    check_picture,
    list_pictures,
    measure_pictures,
    read_picture,
)
from studio.foundations.errors import FootageError


def test_natural_order_and_exact_pixels(tmp_path: Path) -> None:
    for number in range(12):
        cv2.imwrite(str(tmp_path / f"f{number}.png"), numbered_frame(number))
    (tmp_path / "notes.txt").write_text("no picture")
    (tmp_path / ".hidden.png").write_bytes(b"")
    reader = PictureReader(tmp_path, 12)
    assert [number_of(reader.read(number)) for number in range(12)] == list(range(12))
    np.testing.assert_array_equal(reader.read(11), numbered_frame(11))
    found = measure_pictures(tmp_path)
    assert (found.width, found.height, found.frame_count, found.missing) == (128, 96, 12, ())


def test_grey_pictures_have_three_equal_channels(tmp_path: Path) -> None:
    grey = np.arange(96 * 128, dtype=np.uint8).reshape(96, 128)
    cv2.imwrite(str(tmp_path / "g.bmp"), grey)
    picture = read_picture(tmp_path / "g.bmp")
    np.testing.assert_array_equal(picture, np.repeat(grey[:, :, None], 3, axis=2))
    assert check_picture(tmp_path / "g.bmp") == (128, 96)


def test_missing_numbers_are_found_and_strides_are_none(tmp_path: Path) -> None:
    frames = [numbered_frame(number) for number in range(8)]
    write_pictures(tmp_path / "gap", frames)
    (tmp_path / "gap" / "frame0003.png").unlink()
    assert measure_pictures(tmp_path / "gap").missing == (3,)
    write_pictures(tmp_path / "stride", frames)
    for odd in range(1, 8, 2):
        (tmp_path / "stride" / f"frame{odd:04d}.png").unlink()
    assert measure_pictures(tmp_path / "stride").missing == ()


@pytest.mark.parametrize("suffix", ["png", "jpg", "bmp"])
def test_a_picture_cut_short_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cut.{suffix}"
    cv2.imwrite(str(path), numbered_frame(1))
    path.write_bytes(path.read_bytes()[: int(0.6 * path.stat().st_size)])
    with pytest.raises(FootageError, match="damaged or no picture"):
        check_picture(path)


@pytest.mark.parametrize("content", [b"", b"rubbish" * 50])
def test_no_picture_at_all(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.tif").write_bytes(content)
    with pytest.raises(FootageError, match="damaged or no picture"):
        check_picture(tmp_path / "a.tif")


def test_sizes_must_not_change(tmp_path: Path) -> None:
    write_pictures(tmp_path / "p", [numbered_frame(0), numbered_frame(1)[:-2]])
    with pytest.raises(FootageError, match="128x94"):
        measure_pictures(tmp_path / "p")


def test_an_empty_folder_and_one_that_lost_pictures(tmp_path: Path) -> None:
    with pytest.raises(FootageError, match="holds no pictures"):
        measure_pictures(tmp_path)
    assert list_pictures(tmp_path) == ()
    with pytest.raises(FootageError, match="had 3 at import"):
        PictureReader(tmp_path, 3)
    with pytest.raises(FootageError, match="no picture for frame 2"):
        PictureReader(tmp_path, 0).read(2)
