"""Calibrations of other tools project as OpenCV projects the truth."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from calibration_samples import (
    CAMERAS,
    POINTS,
    easymocap,
    freemocap,
    opencv_boards,
    opencv_folder,
    opencv_sample,
    pixels_of_opencv,
    qualisys,
)

from studio.footage.capture.calibration_files import find_calibrations, read_calibration, read_intrinsics
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.projection import project


@pytest.mark.parametrize(
    "write",
    [
        lambda folder: easymocap(folder),
        lambda folder: easymocap(folder, quoted=False, old=True),
        lambda folder: easymocap(folder).parent / "extri.yml",
        lambda folder: qualisys(folder / "Calib.qca.txt"),
        lambda folder: qualisys(folder / "cut.qca.txt", offset=(16, 24)),
        freemocap,
        opencv_folder,
        opencv_boards,
    ],
)
def test_projects_as_opencv_does(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    found = read_calibration(write(tmp_path))
    assert found.sizes_known
    assert [(camera.width, camera.height) for camera in found.cameras] == [(128, 96)] * 3
    for camera, wanted in zip(found.cameras, CAMERAS, strict=True):
        np.testing.assert_allclose(project(camera, POINTS)[0], pixels_of_opencv(wanted), atol=1e-6)
        np.testing.assert_allclose(camera.translation, wanted.translation, atol=1e-6)
    assert found.unit_note.startswith("The calibration is")


def test_easymocap_names_and_missing_sizes(tmp_path: Path) -> None:
    found = read_calibration(easymocap(tmp_path, sizes=False, quoted=False))
    assert [camera.name for camera in found.cameras] == ["00", "01", "02"]
    assert not found.sizes_known
    assert (found.cameras[0].width, found.cameras[0].height) == (127, 94)  # twice the principal point
    assert any("taken from the footage" in note for note in found.notes)
    assert [path.name for path in found.sources] == ["intri.yml", "extri.yml"]
    (tmp_path / "extri.yml").unlink()
    assert [lens.name for lens in read_intrinsics(tmp_path / "intri.yml")] == ["00", "01", "02"]
    with pytest.raises(CalibrationError, match="places no camera"):
        read_calibration(tmp_path / "intri.yml")


def test_the_stereo_samples_pair(tmp_path: Path) -> None:
    left, right = CAMERAS[:2]
    turn = right.rotation @ left.rotation.T
    shift = right.translation - turn @ left.translation
    storage = cv2.FileStorage(str(tmp_path / "intrinsics.yml"), cv2.FILE_STORAGE_WRITE)
    for number, camera in enumerate((left, right), 1):
        storage.write(f"M{number}", camera.matrix)
        storage.write(f"D{number}", np.append(camera.distortion, np.zeros(9))[None])
    storage.release()
    lenses = read_intrinsics(tmp_path / "intrinsics.yml")
    np.testing.assert_array_equal(lenses[1].matrix, right.matrix)
    storage = cv2.FileStorage(str(tmp_path / "extrinsics.yml"), cv2.FILE_STORAGE_WRITE)
    storage.write("R", turn)
    storage.write("T", shift[:, None])
    storage.release()
    found = read_calibration(tmp_path / "intrinsics.yml")
    np.testing.assert_allclose(found.cameras[0].centre, 0.0)
    np.testing.assert_allclose(found.cameras[1].translation, shift)
    assert any("z axis does not point up" in note for note in found.notes)


def test_an_opencv_file_of_a_lens_alone(tmp_path: Path) -> None:
    boards = np.random.default_rng(1).normal(size=(7, 6))
    path = opencv_sample(tmp_path / "cam1.xml", CAMERAS[1], extrinsic_parameters=boards)
    lens = read_intrinsics(path)[0]
    np.testing.assert_array_equal(lens.matrix, CAMERAS[1].matrix)
    np.testing.assert_array_equal(lens.distortion, CAMERAS[1].distortion)
    with pytest.raises(CalibrationError, match="places no camera in the world"):
        read_calibration(path)
    assert find_calibrations(tmp_path) == (path,)


def test_what_a_folder_of_other_tools_holds(tmp_path: Path) -> None:
    pair = easymocap(tmp_path / "easy")
    assert find_calibrations(tmp_path / "easy") == (pair,)
    (tmp_path / "opencv").mkdir()
    assert find_calibrations(opencv_folder(tmp_path / "opencv")) == (tmp_path / "opencv",)
    (tmp_path / "opencv" / "notes.xml").write_text("<notes/>")
    assert len(read_calibration(tmp_path / "opencv").cameras) == 3


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    # Were it loaded, it would write a file.
    path = tmp_path / "cam.pickle"
    path.write_bytes(b"cos\nsystem\n(S'touch " + str(tmp_path / "ran").encode() + b"'\ntR.")
    with pytest.raises(CalibrationError, match="can run any program"):
        read_calibration(path)
    assert not (tmp_path / "ran").exists()
    assert find_calibrations(tmp_path) == ()


@pytest.mark.real_data
def test_the_qualisys_file_equals_the_toml_made_from_it(real_data: Path) -> None:
    folder = real_data / "pose2sim-balance" / "calibration"
    own, made = (read_calibration(folder / name) for name in ("Calib.qca.txt", "Calib_qualisys.toml"))
    assert "in mm" in own.unit_note
    for a, b in zip(own.cameras, made.cameras, strict=True):
        np.testing.assert_allclose(a.matrix, b.matrix, atol=1e-9)
        np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-7)
        np.testing.assert_allclose(a.translation, b.translation, atol=1e-3)
        assert (a.width, a.height) == (b.width, b.height)
        # The TOML divided the lens's coefficients by 64 as if they were pixels; chessboards say that they are not.
        np.testing.assert_allclose(a.distortion / 64.0, b.distortion, atol=1e-12)


@pytest.mark.slow
@pytest.mark.real_data
def test_chessboards_distinguish_the_qualisys_lenses_from_those_divided_by_64(real_data: Path) -> None:
    folder = real_data / "pose2sim-balance" / "calibration"
    squares = np.zeros((28, 3), np.float32)
    squares[:, :2] = np.mgrid[0:4, 0:7].T.reshape(-1, 2) * 60.0
    errors: dict[float, list[float]] = {1.0: [], 64.0: []}
    for camera in read_calibration(folder / "Calib.qca.txt").cameras[1:3]:
        for path in sorted((folder / "intrinsics" / f"int_{camera.name}_img").glob("*.jpg")):
            found, corners = cv2.findChessboardCornersSB(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), (4, 7))
            if not found:
                continue
            seen = corners.reshape(-1, 2)
            for divisor, values in errors.items():
                lens = camera.distortion / divisor
                _, turn, shift = cv2.solvePnP(squares, seen, camera.matrix, lens)
                guess = cv2.projectPoints(squares, turn, shift, camera.matrix, lens)[0].reshape(-1, 2)
                values.append(float(np.mean(np.sum((guess - seen) ** 2, axis=1))))
    assert len(errors[1.0]) >= 7
    assert np.mean(errors[1.0]) < np.mean(errors[64.0])


def test_other_yaml_files_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "compose.yml").write_text("WORK: 1\nK: [1, 2]\nM1: a\n")
    (tmp_path / "boards.yml").write_text("%YAML:1.0\n---\nboard_width: 9\nLOOK: 3\n")
    assert find_calibrations(tmp_path) == ()
