"""The page of Python examples runs from top to bottom."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import studio
from studio.calibration.boards import Board
from studio.export.bvh_reading import read_bvh
from studio.notebook.opening import Tracked
from studio.synthesis.board_footage import BoardRenderer, close_boards, floor_board, waved_boards
from studio.synthesis.cameras import placed_camera

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "web_assets" / "guide" / "python.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
BOARD = Board("charuco", 6, 5, 120.0, 90.0, "DICT_4X4_50")
PLACES = ((2600.0, -900.0, 1500.0), (2600.0, 900.0, 1900.0))


def board_footage(folder: Path) -> None:
    """What the page says lies in its folder: pictures of two cameras, the board on the floor in the last common one."""
    rng = np.random.default_rng(4)
    cameras = tuple(
        placed_camera(f"cam{number + 1}", place, (0.0, 0.0, 700.0), size=(800, 600), focal_px=700.0)
        for number, place in enumerate(PLACES)
    )
    renderer = BoardRenderer(BOARD, cameras)
    common = [*waved_boards(rng, BOARD, cameras, 13, reach=450.0), floor_board((-250.0, 200.0))]
    for number, camera in enumerate(cameras):
        for place, poses in (("intrinsics", close_boards(rng, BOARD, camera, 14)), ("extrinsics", common)):
            pictures = folder / place / camera.name
            pictures.mkdir(parents=True)
            for frame, pose in enumerate(poses):
                cv2.imwrite(str(pictures / f"{frame:03d}.png"), renderer.picture(number, frame, pose))


@pytest.mark.timeout(900)
def test_the_page_runs_from_top_to_bottom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    board_footage(tmp_path / "board-footage")
    names: dict[str, object] = {}
    assert len(BLOCKS) >= 9
    for number, block in enumerate(BLOCKS, 1):
        exec(compile(block, f"python.md, block {number}", "exec"), names)
    run, motion, calibration = names["run"], names["motion"], names["calibration"]
    assert isinstance(run, Tracked)
    assert run.poses.shape == (8, 31)
    assert run.frames.tolist() == list(range(8))
    assert np.isfinite(motion.positions).all()  # pyright: ignore[reportAttributeAccessIssue]
    centres = [camera.centre for camera in calibration.cameras]  # pyright: ignore[reportAttributeAccessIssue]
    apart = np.linalg.norm(np.subtract(*PLACES))
    assert np.linalg.norm(centres[0] - centres[1]) == pytest.approx(apart, abs=15.0)
    assert studio.evaluate("walk/first", track="refined").mean_mm < 60.0
    assert studio.list_tracks("walk/first") == ("raw", "refined", "smoothed")
    assert [entry.name for entry in studio.list_runs("walk")] == ["first", "fixed"]
    assert len(read_bvh(tmp_path / "walk.bvh").turns) == 8
    told = capsys.readouterr().out
    assert "There is no session 'run'" in told
    assert "Traceback" not in told


def test_the_page_names_every_verb() -> None:
    named = set(re.findall(r"studio\.(\w+)", PAGE))
    assert set(dir(studio)) - named <= {"open_run"}
    assert named <= set(dir(studio))
