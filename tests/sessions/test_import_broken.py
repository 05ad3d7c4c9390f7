"""Wrong input: a cause, a remedy, and nothing left behind."""

from collections.abc import Callable
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import pytest
from sources import everything_below, full_source, write_pose2sim
from toy_footage import numbered_frame, rig, write_pictures

from studio.foundations.errors import BodyError, CalibrationError, FootageError, StudioError, TruthError
from studio.sessions.importers.importing import import_source


def cut_video(source: Path) -> None:
    path = source / "videos" / "cam02.mp4"
    path.write_bytes(path.read_bytes()[: int(0.6 * path.stat().st_size)])


def rubbish_video(source: Path) -> None:
    (source / "videos" / "cam01.mp4").write_bytes(b"rubbish" * 1000)


def wider_calibration(source: Path) -> None:
    text = (source / "calibration" / "Calib.toml").read_text()
    (source / "calibration" / "Calib.toml").write_text(text.replace("128.0", "132.0"))


def turned_calibration(source: Path) -> None:
    text = (source / "calibration" / "Calib.toml").read_text()
    swapped = text.replace("128.0", "SWAP").replace("96.0", "128.0").replace("SWAP", "96.0")
    (source / "calibration" / "Calib.toml").write_text(swapped)


def mirrored_rotation(source: Path) -> None:
    """The first camera's rotation as a matrix, its third row negated."""
    cameras = rig(2, "cam_")
    path = write_pose2sim(source / "calibration" / "Calib.toml", cameras)
    rows = (np.diag([1.0, 1.0, -1.0]) @ cameras[0].rotation).tolist()
    before, entry, after = path.read_text().partition("rotation = [")
    path.write_text(before + f"rotation = {rows}" + after.partition("]")[2])
    assert entry


def nan_in_truth(source: Path) -> None:
    path = source / "truth" / "walk.trc"
    path.write_text(path.read_text().replace("0.0010000", "NaN", 1))


def unknown_body(source: Path) -> None:
    (source / "subject.toml").write_text('body = "centaur"\n')


def body_with_a_missing_parent(source: Path) -> None:
    (source / "bodies").mkdir()
    text = (resources.files("studio.body") / "models" / "human31.toml").read_text(encoding="utf-8")
    assert 'parent = "left_thigh"' in text
    (source / "bodies" / "odd.toml").write_text(text.replace('parent = "left_thigh"', 'parent = "nobody"'))
    (source / "subject.toml").write_text('body = "odd"\n')


def misspelt_subject(source: Path) -> None:
    (source / "subject.toml").write_text("heigth_mm = 1780\n")


def start_pose_of_another_body(source: Path) -> None:
    (source / "start_pose.csv").write_text("a,b\n1,2\n")


def masks_of_another_size(source: Path) -> None:
    for path in (source / "masks" / "camera1").iterdir():
        cv2.imwrite(str(path), np.zeros((90, 128), np.uint8))


def too_few_masks(source: Path) -> None:
    (source / "masks" / "camera2" / "frame0003.png").unlink()


def damaged_mask(source: Path) -> None:
    (source / "masks" / "camera2" / "frame0003.png").write_bytes(b"\x89PNG")


def small_background(source: Path) -> None:
    cv2.imwrite(str(source / "background" / "cam1_plate.png"), numbered_frame(0)[:50])


def stray_masks(source: Path) -> None:
    write_pictures(source / "masks" / "camera9", [numbered_frame(0)])


def cut_calibration(source: Path) -> None:
    text = (source / "calibration" / "Calib.toml").read_text()
    (source / "calibration" / "Calib.toml").unlink()
    (source / "calibration" / "cameras_of_today.toml").write_text(text[: text.rindex("]")])


def no_calibration(source: Path) -> None:
    (source / "calibration" / "Calib.toml").unlink()


def no_footage(source: Path) -> None:
    for path in (source / "videos").iterdir():
        path.unlink()


@pytest.mark.parametrize(
    ("spoil", "kind", "message"),
    [
        (cut_video, FootageError, "cam02.mp4"),
        (rubbish_video, FootageError, "cam01.mp4"),
        (wider_calibration, CalibrationError, "differs by 3.0%"),
        (turned_calibration, CalibrationError, "lies on its side"),
        (mirrored_rotation, CalibrationError, "mirrors the world"),
        (nan_in_truth, TruthError, "gives only part of marker Hip"),
        (unknown_body, BodyError, "centaur"),
        (body_with_a_missing_parent, BodyError, "nobody"),
        (misspelt_subject, BodyError, "heigth_mm"),
        (start_pose_of_another_body, BodyError, "start_pose.csv"),
        (masks_of_another_size, FootageError, "128x90"),
        (too_few_masks, FootageError, "11 frames"),
        (damaged_mask, FootageError, "frame0003.png"),
        (small_background, FootageError, "128x50"),
        (stray_masks, FootageError, "camera9"),
        (cut_calibration, CalibrationError, "'cameras_of_today.toml' is not TOML"),
        (no_calibration, CalibrationError, "no calibration"),
        (no_footage, FootageError, "no footage"),
    ],
)
def test_a_cause_a_remedy_and_nothing_left(
    tmp_path: Path, spoil: Callable[[Path], None], kind: type[StudioError], message: str
) -> None:
    source = full_source(tmp_path / "source")
    spoil(source)
    before = everything_below(tmp_path)
    with pytest.raises(kind) as caught:
        import_source(source, tmp_path / "made")
    assert message in caught.value.message
    assert caught.value.hint.endswith(".")
    assert everything_below(tmp_path) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["source"]


def test_a_source_that_is_no_folder(tmp_path: Path) -> None:
    with pytest.raises(FootageError, match="There is no folder"):
        import_source(tmp_path / "nowhere", tmp_path / "made")
