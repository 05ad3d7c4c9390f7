"""DANNCE's MATLAB files, as label3d and its calibration write them."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from sources import FRAMES
from toy_footage import numbered_frame, rig, write_video

from studio.footage.capture.calibration_files import find_calibrations, read_calibration
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.sessions.importers.importing import import_source

CAMERAS = rig(2, "Camera")


def params(camera: Camera) -> dict[str, np.ndarray]:
    """MATLAB's: transposed, pixels from 1."""
    matrix = camera.matrix.copy()
    matrix[:2, 2] += 1.0
    k1, k2, p1, p2, k3 = camera.distortion
    return {
        "K": matrix.T,
        "RDistort": np.array([k1, k2, k3]),
        "TDistort": np.array([p1, p2]),
        "r": camera.rotation.T,
        "t": camera.translation.reshape(1, 3),
    }


def same(found: tuple[Camera, ...]) -> None:
    for camera, wanted in zip(found, CAMERAS, strict=True):
        np.testing.assert_allclose(camera.matrix, wanted.matrix)
        np.testing.assert_allclose(camera.rotation, wanted.rotation)
        np.testing.assert_allclose(camera.translation, wanted.translation)
        np.testing.assert_allclose(camera.distortion, wanted.distortion)


def test_label3d_and_a_file_a_camera(tmp_path: Path) -> None:
    cells = np.empty((2, 1), dtype=object)
    cells[:, 0] = [params(camera) for camera in CAMERAS]
    names = np.array(["Camera1", "Camera2"], dtype=object)
    scipy.io.savemat(tmp_path / "take_dannce.mat", {"params": cells, "camnames": names})
    same(read_calibration(tmp_path / "take_dannce.mat").cameras)
    single = tmp_path / "calibration"
    single.mkdir()
    for number, camera in enumerate(CAMERAS, 1):
        scipy.io.savemat(single / f"hires_cam{number}_params.mat", params(camera))
    assert find_calibrations(single) == (single,)
    same(read_calibration(single).cameras)


def test_a_project_is_imported_in_one_step(tmp_path: Path) -> None:
    project = tmp_path / "mouse"
    for number, camera in enumerate(CAMERAS, 1):
        (project / "videos" / f"Camera{number}").mkdir(parents=True)
        pictures = [numbered_frame(frame, number) for frame in range(FRAMES)]
        write_video(project / "videos" / f"Camera{number}" / "0.mp4", pictures)
        (project / "calibration").mkdir(exist_ok=True)
        scipy.io.savemat(project / "calibration" / f"hires_cam{number}_params.mat", params(camera))
    session = import_source(project, tmp_path / "made").session
    same(session.cameras())


@pytest.mark.parametrize(
    "spoil", [{"K": np.zeros((2, 2))}, {"RDistort": np.zeros(5)}, {"r": np.ones((3, 3))}]
)
def test_what_is_no_camera_is_named(tmp_path: Path, spoil: dict[str, np.ndarray]) -> None:
    path = tmp_path / "hires_cam1_params.mat"
    scipy.io.savemat(path, params(CAMERAS[0]) | spoil)
    with pytest.raises(CalibrationError, match="cam1"):
        read_calibration(path)
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(500))
    with pytest.raises(CalibrationError, match="MATLAB file of cameras"):
        read_calibration(path)
