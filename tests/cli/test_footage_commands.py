"""`studio synchronise`, and `studio import` with offsets, turns and trials."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from command_line import answer_of, call, refusal_of
from toy_footage import rig, write_pictures, write_video

from studio.footage.capture.calibration_files import export_calibration
from studio.sessions.session import Session

FRAMES, LATE = 110, 6


def moving(first: int, view: int) -> list[np.ndarray]:
    """Pictures of a block that moves in bursts, from frame `first` of the take on, seen by one of two views."""
    rng = np.random.default_rng(4)
    speed = np.zeros(200)
    for start in (12, 40, 47, 75, 96, 130):
        length = int(rng.integers(6, 14))
        speed[start : start + length] += rng.uniform(2.0, 5.0) * np.hanning(length + 2)[1:-1]
    place = np.cumsum(speed) * (1.0 if view else 0.7)
    noise = np.random.default_rng(view)
    wall = cv2.GaussianBlur(noise.integers(0, 255, (96, 128, 3), dtype=np.uint8), (0, 0), 2)
    pictures = []
    for frame in range(first, first + FRAMES):
        picture = wall.copy()
        x = 5 + round(place[frame] % 90)
        cv2.rectangle(picture, (x, 30), (x + 20, 80), (40 + 90 * view, 60, 200), cv2.FILLED)
        pictures.append(np.clip(picture + noise.normal(0, 2, picture.shape), 0, 255).astype(np.uint8))
    return pictures


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two videos of one take; the second began six frames later."""
    folder = tmp_path_factory.mktemp("footage")
    (folder / "videos").mkdir()
    for view, first in enumerate((0, LATE)):
        write_video(folder / "videos" / f"cam{view + 1}.mp4", moving(first, view), fps=60)
    (folder / "calibration").mkdir()
    export_calibration(rig(2), folder / "calibration" / "Calib.toml", "pose2sim")
    return folder


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    return tmp_path / "workspace"


def test_an_estimate_is_shown_then_applied(footage: Path, workspace: Path) -> None:
    assert answer_of("import", footage, "--into", "take")["layout"] == "folder in the studio's layout"
    shown = answer_of("synchronise take --within 0.5")
    assert shown["estimate"]["offsets"] == {"cam1": LATE, "cam2": 0}
    assert shown["estimate"]["sure"]
    assert shown["offsets"] == {"cam1": 0, "cam2": 0}
    text = call("synchronise take --within 0.5")
    assert "cam1: +6 frames, give or take" in text.stdout
    assert "Nothing was changed" in text.stderr
    applied = answer_of("synchronise take --within 0.5 --apply")
    assert applied["offsets"] == {"cam1": LATE, "cam2": 0}
    assert applied["frames"] == FRAMES - LATE
    # Once in step, the estimate is of the files, so it says the same again.
    assert answer_of("synchronise take --within 0.5")["estimate"]["offsets"] == {
        "cam1": LATE,
        "cam2": 0,
    }
    source = Session(workspace / "take").manifest.footage
    assert [camera.offset for camera in source.cameras] == [LATE, 0]


def test_offsets_and_turns_by_hand_and_back(footage: Path, workspace: Path) -> None:
    answer_of("import", footage, "--into", "take", "--offset", "cam1=6")
    session = Session(workspace / "take")
    upright = session.footage().picture("cam2", 3)
    changed = answer_of("synchronise take --offset cam2=2 --rotate cam2=180")
    assert changed["offsets"] == {"cam1": 4, "cam2": 0}
    assert changed["rotations"] == {"cam1": 0, "cam2": 180}
    turned = Session(workspace / "take").footage().picture("cam2", 3)
    np.testing.assert_array_equal(turned, cv2.rotate(upright, cv2.ROTATE_180))
    answer_of("synchronise take --rotate cam2=0 --offset cam1=6")
    np.testing.assert_array_equal(Session(workspace / "take").footage().picture("cam2", 3), upright)


def test_recorded_times(footage: Path, workspace: Path, tmp_path: Path) -> None:
    answer_of("import", footage, "--into", "take")
    rows = [f"{camera},{(late + k) / 60.0}" for camera, late in ((1, 0), (2, LATE)) for k in range(FRAMES)]
    path = tmp_path / "timestamps.csv"
    path.write_text("\n".join(["cam_id,frame_time", *rows]))
    shown = answer_of("synchronise take --timestamps", path)
    assert shown["recorded"]["offsets"] == {"cam1": LATE, "cam2": 0}
    assert shown["offsets"] == {"cam1": 0, "cam2": 0}
    assert answer_of("synchronise take --timestamps", path, "--apply")["offsets"] == {
        "cam1": LATE,
        "cam2": 0,
    }
    path.write_text("\n".join(["cam_id,frame_time", *rows[:FRAMES]]))
    assert "times of 1 of the 2 cameras" in refusal_of("synchronise take --timestamps", path)


def test_an_estimate_that_is_not_reliable_is_not_applied(tmp_path: Path, workspace: Path) -> None:
    source = tmp_path / "source"
    for view in range(2):
        rng = np.random.default_rng(view)
        frames = [rng.integers(0, rng.integers(40, 255), (96, 128, 3), dtype=np.uint8) for _ in range(60)]
        write_pictures(source / "pictures" / f"cam{view + 1}", frames)
    (source / "calibration").mkdir()
    export_calibration(rig(2), source / "calibration" / "Calib.toml", "pose2sim")
    answer_of("import", source, "--into", "noise", "--fps", "60")
    assert "not reliable" in refusal_of("synchronise noise --apply")
    assert Session(workspace / "noise").manifest.footage.cameras[0].offset == 0


def test_one_of_several_trials(footage: Path, workspace: Path, tmp_path: Path) -> None:
    for name in ("Trial_1", "Trial_2"):
        shutil.copytree(footage, tmp_path / "batch" / name)
    said = refusal_of("import", tmp_path / "batch", "--into", "one")
    assert "2 trials: Trial_1, Trial_2" in said
    assert "--trial Trial_1" in said
    shutil.rmtree(tmp_path / "batch" / "Trial_1" / "calibration")
    answer_of("import", tmp_path / "batch", "--into", "one", "--trial", "Trial_2")
    assert Session(workspace / "one").manifest.imported_from.endswith("Trial_2")


@pytest.mark.parametrize(
    ("place", "kind", "instead"),
    [
        ("videos/cam1.mp4", "one camera's video", "--calibration FILE"),
        ("calibration/Calib.toml", "a calibration", "calibration/Calib.toml"),
        ("one.png", "a picture", "folder of pictures a camera"),
        ("notes.txt", "a file", "a zip or tar"),
    ],
)
def test_a_single_file_is_named_with_what_to_give_instead(
    footage: Path, workspace: Path, place: str, kind: str, instead: str
) -> None:
    (footage / place).touch()
    said = refusal_of("import", footage / place, "--into", "take")
    assert f"is {kind}, and no folder of footage" in said
    assert instead in said
    assert "There is no folder" in refusal_of("import", footage / "nothing", "--into", "take")


def test_videos_alone_need_the_calibrations_file(footage: Path, workspace: Path) -> None:
    assert "--calibration FILE" in refusal_of("import", footage / "videos", "--into", "take")
    file = footage / "calibration" / "Calib.toml"
    answer_of("import", footage / "videos", "--into", "take", "--calibration", file)


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (["--offset", "cam1"], "'--offset cam1' cannot be understood"),
        (["--offset", "cam1=three"], "cannot be understood"),
        (["--offset", "cam1=1", "--offset", "cam1=2"], "names camera 'cam1' twice"),
        (["--rotate", "cam1=45"], "cannot be turned by 45 degrees"),
        (["--rotate", "cam1=90"], "are 96x128, and its calibration is for 128x96"),
        (["--offset", "cam7=1"], "There is no camera 'cam7'"),
        (["--offset", "cam1=1", "--apply"], "by hand and estimated"),
    ],
)
def test_refusals(footage: Path, workspace: Path, words: list[str], cause: str) -> None:
    answer_of("import", footage, "--into", "take", "--reference")
    assert cause in refusal_of("synchronise take", *words)
