"""From folders of rendered board footage to a calibration file, by the verb and by the command."""

import dataclasses
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from board_takes import BOARD, FLOOR_PLACE, render_takes, two_cameras
from command_line import answer_of, call, refusal_of

from studio.footage.calibration.boards import Board
from studio.footage.calibration.detection import BoardFinder
from studio.footage.calibration.verbs import _other_spellings, calibrate
from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rigid import best_fit, transform

CAMERAS = two_cameras((800, 600), (690.0, 705.0))
FLOOR = "frame:13"


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """intrinsics/ and extrinsics/ with a folder of pictures each; in the last common ones the board is on the floor."""
    return render_takes(tmp_path_factory.mktemp("footage"), CAMERAS, common_count=13, lens_count=14)


def same_rig(solved: tuple[Camera, ...]) -> float:
    """mm by which the distance of the two cameras is off."""
    true = float(np.linalg.norm(CAMERAS[0].centre - CAMERAS[1].centre))
    return abs(float(np.linalg.norm(solved[0].centre - solved[1].centre)) - true)


def test_two_cameras_from_folders_with_the_floor_board(footage: Path) -> None:
    steps: list[str] = []
    found = calibrate(
        BOARD,
        intrinsics=footage / "intrinsics",
        extrinsics=footage / "extrinsics",
        floor=FLOOR,
        names=("cam1", "cam2"),
        progress=lambda step, done, total: steps.append(step),
    )
    assert [finding.code for finding in found.findings if finding.severity == "blocks"] == []
    for camera, solved in zip(CAMERAS, found.rig.cameras, strict=True):
        np.testing.assert_allclose(solved.matrix[0, 0], camera.matrix[0, 0], rtol=5e-3)
        np.testing.assert_allclose(solved.centre, camera.centre - [*FLOOR_PLACE, 0.0], atol=20.0)
    assert same_rig(found.rig.cameras) < 10.0
    assert any("cam2" in step for step in steps)
    assert "Adjusting all together" in steps


def test_a_person_can_stop_it(footage: Path) -> None:
    def stop(step: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(BOARD, extrinsics=footage / "extrinsics", progress=stop)


def test_the_command_writes_calibration_report_and_pictures(footage: Path, tmp_path: Path) -> None:
    target = tmp_path / "rig.toml"
    words = ["calibrate", footage, "--board", BOARD.text, "--to"]
    report = answer_of(*words, target)
    assert report["usable"] is True
    assert "no-floor" in {finding["code"] for finding in report["findings"]}
    cameras = read_calibration(target).cameras
    assert same_rig(cameras) < 10.0
    assert all(camera.centre[2] > 0.0 for camera in cameras)
    report = msgspec.json.decode((tmp_path / "rig.report.json").read_bytes())
    assert len(report["cameras"][0]["pictures"]) >= 12
    for name in (camera.name for camera in cameras):
        picture = cv2.imread(str(tmp_path / f"rig.coverage-{name}.png"))
        assert picture.std() > 10.0
    refusal_of(*words, target)
    refusal_of(*words, tmp_path / "b.toml", "--distance", f"{cameras[0].name},{cameras[1].name}=1500")
    assert not (tmp_path / "b.toml").exists()
    assert (tmp_path / "b.report.json").exists()


@pytest.mark.slow
def test_the_intrinsics_alone_give_lenses(footage: Path, tmp_path: Path) -> None:
    lenses = ("--intrinsics", footage / "intrinsics", "--to", tmp_path / "rig.toml")
    call("calibrate", footage, "--board", BOARD.text, *lenses)
    assert (tmp_path / "rig.lenses.toml").exists()
    assert not (tmp_path / "rig.toml").exists()
    placed = calibrate(
        BOARD,
        intrinsics=tmp_path / "rig.lenses.toml",
        extrinsics=footage / "extrinsics",
        floor=FLOOR,
        names=("cam1", "cam2"),
    )
    assert same_rig(placed.rig.cameras) < 10.0
    with pytest.raises(CalibrationError, match="Lenses of a file alone"):
        calibrate(BOARD, intrinsics=tmp_path / "rig.lenses.toml")


@pytest.mark.slow
def test_a_mirrored_video_blocks(footage: Path, tmp_path: Path) -> None:
    for camera in ("cam1", "cam2"):
        source = footage / "extrinsics" / f"ext_{camera}_img"
        (tmp_path / camera).mkdir()
        for path in sorted(source.iterdir()):
            picture = cv2.imread(str(path))
            cv2.imwrite(str(tmp_path / camera / path.name), picture[:, ::-1] if camera == "cam2" else picture)
    found = calibrate(BOARD, intrinsics=footage / "intrinsics", extrinsics=None, names=("cam1", "cam2"))
    try:
        spoilt = calibrate(BOARD, extrinsics=tmp_path, lenses=found.lenses)
    except CalibrationError as refused:
        assert "cam2" in refused.message  # noqa: PT017 - either way it must be named
        return
    assert spoilt.findings[0].code == "mirrored-video"
    assert spoilt.findings[0].cameras == ("cam2",)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--board", "circles:4x4,3"], "cannot be understood"),
        (["--board", BOARD.text, "--extrinsics", "nowhere"], "no folder"),
        (["--board", BOARD.text, "--distance", "cam1"], "cannot be understood"),
        (["--board", BOARD.text, "--extrinsics", "extrinsics", "--floor", "frame:x"], "is no number"),
    ],
)
def test_refusals_have_remedies(footage: Path, words: list[str], message: str) -> None:
    words = [str(footage / word) if word == "extrinsics" else word for word in words]
    result = refusal_of("calibrate", footage, *words)
    assert message in result
    assert "remedy" in result


def test_the_board_command(tmp_path: Path) -> None:
    place = tmp_path / "board.pdf"
    result = answer_of("board --kind chessboard --to", place)
    assert result["board"].startswith("chessboard:9x6,")
    assert place.read_bytes().startswith(b"%PDF")


def test_the_rigs_own_frame_is_kept_by_names(footage: Path) -> None:
    """Footage is matched to cameras by name, so that the order of folders does not matter."""
    found = calibrate(BOARD, extrinsics=footage / "extrinsics", names=("cam2", "cam1"))
    centres = {camera.name: camera.centre for camera in found.rig.cameras}
    boards = np.array([pose[:, 3] for pose in found.rig.boards.values()])
    near = {name: float(np.linalg.norm(boards - centre, axis=1).mean()) for name, centre in centres.items()}
    assert set(near) == {"cam1", "cam2"}
    fit = best_fit(np.array(list(centres.values())), np.array([CAMERAS[0].centre, CAMERAS[1].centre]))
    assert np.isfinite(transform(fit, boards)).all()


@pytest.mark.slow
def test_a_board_that_was_meant_otherwise_is_found_and_named(footage: Path) -> None:
    given = dataclasses.replace(BOARD, columns=BOARD.rows, rows=BOARD.columns)
    found = calibrate(given, intrinsics=footage / "intrinsics", names=("cam1", "cam2"))
    named = {finding.code: finding for finding in found.findings}["board-pattern"]
    assert "columns and rows exchanged" in named.message
    assert BOARD.text in named.remedy
    assert found.board == BOARD


def test_boards_of_older_programs_are_tried() -> None:
    board = Board("charuco", 6, 8, 60.0, 45.0)
    assert dataclasses.replace(board, legacy=True) in _other_spellings(board)
    picture = dataclasses.replace(board, legacy=True).opencv_board().generateImage((600, 800))
    assert BoardFinder(board, mirrored_too=False).find(picture, "a", 0) is None
    assert BoardFinder(_other_spellings(board)[0]).find(picture, "a", 0) is not None
