"""The page of Python examples runs from top to bottom."""

import re
from pathlib import Path

import numpy as np
import pytest
from board_takes import PLACES, render_takes, two_cameras

import studio
from studio.body.motion_files.bvh import read_bvh_file
from studio.operations.opening import Tracked

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "web_assets" / "guide" / "python.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_page_runs_from_top_to_bottom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    render_takes(
        tmp_path / "board-footage", two_cameras((800, 600), (700.0, 700.0)), common_count=13, lens_count=14
    )
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
    assert len(read_bvh_file(tmp_path / "walk.bvh").turns) == 8
    printed = capsys.readouterr().out
    assert "There is no session 'run'" in printed
    assert "Traceback" not in printed


def test_the_page_names_every_verb() -> None:
    named = set(re.findall(r"studio\.(\w+)", PAGE))
    assert set(dir(studio)) - named <= {"open_run"}
    assert named <= set(dir(studio))
