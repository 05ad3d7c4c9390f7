"""Calibrations for other tools, read back by those tools' own rules."""

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import rig

from studio.footage.capture.calibration_files import CALIBRATION_FORMATS, export_calibration, read_calibration
from studio.footage.capture.calibration_writers import without_k3
from studio.foundations.errors import CalibrationError, SettingsError
from studio.foundations.geometry.camera import Camera

CAMERAS = tuple(
    Camera(
        camera.name, 128, 96, np.array([[118.0, 0.0, 63.5], [0.0, 119.0, 47.25], [0.0, 0.0, 1.0]]),
        np.array([-0.12, 0.05, 0.002, -0.001, 0.0]), camera.rotation, camera.translation,
    )
    for camera in rig(11)
)  # fmt: skip
K3 = np.array([0.0, 0.0, 0.0, 0.0, 0.04])
BENT = tuple(
    Camera(c.name, c.width, c.height, c.matrix, c.distortion + K3, c.rotation, c.translation)
    for c in CAMERAS[:2]
)
POINTS = np.random.default_rng(6).uniform([-500, -500, 200], [500, 500, 1800], (50, 3))


WIDE = np.random.default_rng(7).uniform([-1500, -1500, -500], [1500, 1500, 2500], (3000, 3))


def pixels(
    matrix: object,
    distortion: object,
    vector: object,
    translation: object,
    unit: float,
    points: np.ndarray = POINTS,
) -> np.ndarray:
    """OpenCV's projection of the points. unit : of the translation, mm."""
    found = cv2.projectPoints(
        points / unit,
        np.array(vector, dtype=float).reshape(3, 1),
        np.array(translation, dtype=float).reshape(3, 1),
        np.array(matrix, dtype=float),
        np.array(distortion, dtype=float).ravel(),
    )[0]
    return found.reshape(-1, 2)


def truth(camera: Camera, points: np.ndarray = POINTS) -> np.ndarray:
    vector = cv2.Rodrigues(camera.rotation)[0]
    return pixels(camera.matrix, camera.distortion, vector, camera.translation, 1.0, points)


@pytest.mark.parametrize(("writer", "unit", "count"), [("pose2sim", 1000.0, 4), ("aniposelib", 1.0, 5)])
def test_toml_projects_as_before(tmp_path: Path, writer: str, unit: float, count: int) -> None:
    written = export_calibration(CAMERAS[::-1], tmp_path / "Calib.toml", writer)
    assert written.files == (tmp_path / "Calib.toml",)
    assert written.notes == ()
    document = tomllib.loads(written.files[0].read_text())
    metadata = document.pop("metadata")
    assert (metadata["adjusted"], metadata["error"]) == (False, 0.0)
    # aniposelib goes through the sections in the order of their names as text.
    tables = (
        [document[key] for key in sorted(document)] if writer == "aniposelib" else list(document.values())
    )
    assert [table["name"] for table in tables] == [camera.name for camera in CAMERAS]
    for camera, table in zip(CAMERAS, tables, strict=True):
        assert table["size"] == [128.0, 96.0]
        assert len(table["distortions"]) == count
        assert np.shape(table["rotation"]) == (3,)
        assert table.get("fisheye", False) is False
        found = pixels(table["matrix"], table["distortions"], table["rotation"], table["translation"], unit)
        np.testing.assert_allclose(found, truth(camera), atol=1e-6)


@pytest.mark.parametrize("suffix", [".yml", ".xml"])
def test_opencv_reads_its_own_format(tmp_path: Path, suffix: str) -> None:
    written = export_calibration(CAMERAS, tmp_path / f"calib{suffix}", "opencv")
    assert [path.name for path in written.files[:2]] == [f"calib_cam1{suffix}", f"calib_cam2{suffix}"]
    for camera, path in zip(CAMERAS, written.files, strict=True):
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        matrix, bent = (storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))
        turn, shift = (storage.getNode(name).mat() for name in ("R", "T"))
        size = [int(storage.getNode(name).real()) for name in ("image_width", "image_height")]
        assert size == [128, 96]
        np.testing.assert_allclose(
            pixels(matrix, bent, cv2.Rodrigues(turn)[0], shift, 1.0), truth(camera), atol=1e-6
        )
    assert export_calibration(CAMERAS[:1], tmp_path / "one.yml", "opencv").files == (tmp_path / "one.yml",)


@pytest.mark.parametrize("writer", CALIBRATION_FORMATS)
def test_the_studio_reads_what_it_wrote(tmp_path: Path, writer: str) -> None:
    path = tmp_path / f"calibration{CALIBRATION_FORMATS[writer].suffix}"
    written = export_calibration(CAMERAS, path, writer)
    found = read_calibration(written.files[0] if len(written.files) == 1 else tmp_path)
    assert [camera.name for camera in found.cameras] == [camera.name for camera in CAMERAS]
    for a, b in zip(found.cameras, CAMERAS, strict=True):
        for part in ("matrix", "distortion", "rotation", "translation"):
            np.testing.assert_allclose(getattr(a, part), getattr(b, part), atol=1e-9)


def test_pose2sim_has_no_k3_and_the_note_has_the_error(tmp_path: Path) -> None:
    written = export_calibration(BENT, tmp_path / "c.toml", "pose2sim")
    largest = [float(note.split("at most ")[1].split(" px")[0]) for note in written.notes]
    assert len(largest) == 2
    document = tomllib.loads(written.files[0].read_text())
    for camera, most in zip(BENT, largest, strict=True):
        table = document[camera.name]
        place = (table["rotation"], table["translation"], 1000.0, WIDE)
        wanted = truth(camera, WIDE)
        inside = np.all((wanted > 0) & (wanted < [128, 96]), axis=1)
        off = np.linalg.norm(pixels(table["matrix"], table["distortions"], *place) - wanted, axis=1)[inside]
        assert 0.2 * most < off.max() <= most + 0.005
        dropped = np.linalg.norm(pixels(table["matrix"], camera.distortion[:4], *place) - wanted, axis=1)[
            inside
        ]
        assert dropped.max() > 3.0 * off.max()
    assert without_k3(CAMERAS[0]) == (CAMERAS[0].distortion, 0.0)


def test_a_skew_is_reported_and_no_cameras_or_formats_are_refused(tmp_path: Path) -> None:
    camera = CAMERAS[0]
    skewed = camera.matrix + np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    slanted = Camera("s", 128, 96, skewed, camera.distortion, camera.rotation, camera.translation)
    for writer in CALIBRATION_FORMATS:
        (note,) = export_calibration((slanted,), tmp_path / f"{writer}.yml", writer).notes
        assert "skew" in note
        with pytest.raises(CalibrationError, match="no cameras"):
            export_calibration((), tmp_path / "none.toml", writer)
    with pytest.raises(SettingsError, match="no calibration format 'vicon'"):
        export_calibration(CAMERAS, tmp_path / "c.xcp", "vicon")
