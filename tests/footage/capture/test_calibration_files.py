"""Calibrations of the field's formats."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w
from toy_footage import rig

from studio.footage.capture.calibration_files import find_calibrations, read_calibration, write_calibration
from studio.footage.capture.calibration_parts import AssumedCrop
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera

CAMERAS = rig(3)


def table(camera: Camera, unit: float = 1.0, **changes: object) -> dict[str, object]:
    """A camera as Pose2Sim and aniposelib write it; unit : file units per mm."""
    return {
        "name": camera.name,
        "size": [float(camera.width), float(camera.height)],
        "matrix": camera.matrix.tolist(),
        "distortions": camera.distortion.tolist(),
        "rotation": cv2.Rodrigues(camera.rotation)[0].ravel().tolist(),
        "translation": (camera.translation * unit).tolist(),
        **changes,
    }


def write(path: Path, document: dict[str, object]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(tomli_w.dumps(document))
    return path


def write_cal(path: Path, camera: Camera, rotation: np.ndarray | None = None, om: bool = True) -> Path:
    """25 numbers in Bouguet's order."""
    matrix, turned = camera.matrix, camera.rotation if rotation is None else rotation
    vector = cv2.Rodrigues(camera.rotation if om else turned)[0].ravel()
    numbers = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], 0.0]
    numbers += [*camera.distortion, *turned.ravel(), *camera.translation, *vector]
    path.write_text("\n".join(f"{number:.10f}" for number in numbers))
    return path


def same(found: Camera, wanted: Camera, tolerance: float = 1e-6) -> bool:
    return found.name == wanted.name and all(
        np.allclose(getattr(found, part), getattr(wanted, part), atol=tolerance)
        for part in ("matrix", "distortion", "rotation", "translation")
    )


@pytest.mark.parametrize(("unit", "word"), [(1.0, "mm"), (1e-3, "in m ")])
def test_aniposelib_and_pose2sim_in_their_units(tmp_path: Path, unit: float, word: str) -> None:
    document = {f"cam_{k}": table(camera, unit) for k, camera in enumerate(CAMERAS)}
    document["metadata"] = {"adjusted": False, "error": 0.0}
    found = read_calibration(write(tmp_path / "calibration.toml", document))
    assert all(same(a, b) for a, b in zip(found.cameras, CAMERAS, strict=True))
    assert word in found.unit_note
    assert (found.cameras[0].width, found.cameras[0].height) == (128, 96)


def test_cameras_are_in_natural_order(tmp_path: Path) -> None:
    cameras = rig(11)
    document = {f"cam_{k}": table(camera) for k, camera in enumerate(cameras)}
    path = write(tmp_path / "calibration.toml", dict(sorted(document.items())))
    assert [camera.name for camera in read_calibration(path).cameras] == [camera.name for camera in cameras]


def test_four_distortions_mean_no_k3(tmp_path: Path) -> None:
    path = write(tmp_path / "c.toml", {"c": table(CAMERAS[0], distortions=[0.1, 0.2, 0.003, 0.004])})
    np.testing.assert_array_equal(read_calibration(path).cameras[0].distortion, [0.1, 0.2, 0.003, 0.004, 0.0])


def test_caliscope_matrix_rotation_and_unposed_cameras(tmp_path: Path) -> None:
    camera = CAMERAS[0]
    posed = table(camera, 1e-3, cam_id=4, rotation=camera.rotation.tolist(), rotation_count=1)
    unposed = table(camera, cam_id=5)
    for entry, gone in ((posed, "name"), (unposed, "name"), (unposed, "rotation"), (unposed, "translation")):
        entry.pop(gone)
    found = read_calibration(write(tmp_path / "camera_array.toml", {"cameras": {"4": posed, "5": unposed}}))
    assert [entry.name for entry in found.cameras] == ["cam_4"]
    np.testing.assert_allclose(found.cameras[0].translation, camera.translation)
    assert "cam_5" in found.notes[0]


def test_freemocap_says_its_unit(tmp_path: Path) -> None:
    # A rig of 4 cm, as around a hand: by its size it would be taken for metres.
    document = {camera.name: table(camera, 0.01) for camera in CAMERAS}
    document["metadata"] = {"board": {"square_length_mm": 5.0}}
    found = read_calibration(write(tmp_path / "c.toml", document))
    np.testing.assert_allclose(found.cameras[0].translation, CAMERAS[0].translation * 0.01)


def test_bouguet_files_of_a_folder(tmp_path: Path) -> None:
    for camera in CAMERAS:
        write_cal(tmp_path / f"{camera.name}.cal", camera)
    found = read_calibration(tmp_path)
    assert all(same(a, b, 1e-8) for a, b in zip(found.cameras, CAMERAS, strict=True))
    assert not found.sizes_known
    assert len(found.sources) == 3
    one = read_calibration(tmp_path / "cam2.cal")
    assert [camera.name for camera in one.cameras] == ["cam2"]


def test_canonical_file_keeps_every_bit(tmp_path: Path) -> None:
    crop = AssumedCrop(4.0, 0.0, 4.0, 0.0, (136, 96))
    write_calibration(CAMERAS, tmp_path / "cameras.toml", {"cam2": crop})
    found = read_calibration(tmp_path / "cameras.toml")
    for a, b in zip(found.cameras, CAMERAS, strict=True):
        for part in ("matrix", "distortion", "rotation", "translation"):
            np.testing.assert_array_equal(getattr(a, part), getattr(b, part))
        assert (a.name, a.width, a.height, a.quarter_turns) == (b.name, b.width, b.height, b.quarter_turns)
    assert found.crops == {"cam2": crop}


MIRRORED = np.diag([1.0, 1.0, -1.0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rotation": (MIRRORED @ CAMERAS[0].rotation).tolist()}, "mirrors the world"),
        ({"rotation": (1.01 * CAMERAS[0].rotation).tolist()}, "is no rotation"),
        ({"rotation": [[1.0, 0.0], [0.0, 1.0]]}, "not 3x3"),
        ({"translation": [1.0, float("nan"), 2.0]}, "not finite"),
        ({"translation": [1.0, 2.0]}, "'translation' has 2 numbers, not 3"),
        ({"matrix": [[1.0, 0.0], [0.0, 1.0]]}, "'matrix' has 2x2 numbers"),
        ({"matrix": np.zeros((3, 3)).tolist()}, "no intrinsic matrix"),
        ({"size": [0.5, 96.0]}, "no picture size"),
        ({"size": ["a", "b"]}, "'size' is not numbers"),
        ({"distortions": [0.1, 0.2]}, "distortions has 2 numbers"),
        ({"distortions": [0.1, 0.0, 0.0, 0.0, 0.0, 0.5]}, "distortions has 6 numbers"),
        ({"fisheye": True}, "fisheye"),
    ],
)
def test_a_wrong_entry_names_file_camera_and_remedy(
    tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    path = write(tmp_path / "c.toml", {"cam_0": table(CAMERAS[0], **changes)})
    with pytest.raises(CalibrationError) as caught:
        read_calibration(path)
    assert message in caught.value.message
    assert "c.toml" in caught.value.message
    assert "cam1" in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize(
    ("rotation", "message"),
    [(MIRRORED @ CAMERAS[0].rotation, "mirrors"), (0.99 * CAMERAS[0].rotation, "no rotation")],
)
def test_a_wrong_rotation_in_a_cal_file(tmp_path: Path, rotation: np.ndarray, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        read_calibration(write_cal(tmp_path / "a.cal", CAMERAS[0], rotation))


def test_a_cal_file_that_contradicts_itself_or_is_short(tmp_path: Path) -> None:
    path = write_cal(tmp_path / "a.cal", CAMERAS[0], CAMERAS[1].rotation)
    with pytest.raises(CalibrationError, match="disagree"):
        read_calibration(path)
    path.write_text(" ".join(["1.0"] * 24))
    with pytest.raises(CalibrationError, match="24 finite numbers, not 25"):
        read_calibration(path)
    path.write_text("one two")
    with pytest.raises(CalibrationError, match="not a list of numbers"):
        read_calibration(path)


def test_a_name_given_twice_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "c.toml", {"a": table(CAMERAS[0]), "b": table(CAMERAS[0])})
    with pytest.raises(CalibrationError, match="names a camera twice"):
        read_calibration(path)


def test_what_a_folder_holds(tmp_path: Path) -> None:
    assert find_calibrations(tmp_path / "none") == ()
    write(tmp_path / "Config.toml", {"project": {"fps": 60}})
    (tmp_path / "Calib.txt").write_text("<xml/>")
    assert find_calibrations(tmp_path) == ()
    (tmp_path / "Calib.qca.txt").write_text("<xml/>")
    assert find_calibrations(tmp_path) == (tmp_path / "Calib.qca.txt",)
    first = write(tmp_path / "Calib_a.toml", {"c": table(CAMERAS[0])})
    assert find_calibrations(tmp_path) == (first,)
    write_cal(tmp_path / "cam1.cal", CAMERAS[0])
    assert set(find_calibrations(tmp_path)) == {first, tmp_path}
    write_calibration(CAMERAS, tmp_path / "cameras.toml")
    assert find_calibrations(tmp_path) == (tmp_path / "cameras.toml",)


def test_a_file_that_is_no_toml_or_unknown(tmp_path: Path) -> None:
    (tmp_path / "calibration.toml").write_text("[cam\nname=")
    with pytest.raises(CalibrationError, match="is not TOML"):
        read_calibration(tmp_path / "calibration.toml")
    (tmp_path / "c.pickle").write_bytes(b"\x80\x04")
    with pytest.raises(CalibrationError, match="is a Python pickle"):
        read_calibration(tmp_path / "c.pickle")
    with pytest.raises(CalibrationError, match="There is no calibration"):
        read_calibration(tmp_path / "gone.toml")


@pytest.mark.real_data
def test_real_calibrations_agree_with_their_description(real_data: Path) -> None:
    lee = read_calibration(real_data / "lee-walk" / "CALIB")
    centres = [(2760.9, 2546.8, 2538.5), (-2121.1, 2445.9, 2577.7), (-2032.6, -1871.5, 2528.4)]
    for camera, centre in zip(lee.cameras, [*centres, (2853.6, -1892.3, 2535.3)], strict=True):
        np.testing.assert_allclose(camera.centre, centre, atol=0.05)
    folder = real_data / "pose2sim-balance" / "calibration"
    (path,) = find_calibrations(folder)
    balance = read_calibration(path)
    # The Qualisys file beside it gives the same cameras in mm; its transforms hold the camera centres.
    text = (folder / "Calib.qca.txt").read_text()
    stated = np.array(
        [[float(v) for v in m] for m in re.findall(r' x="([^"]+)" y="([^"]+)" z="([^"]+)"', text)]
    )
    found = np.array([camera.centre for camera in balance.cameras])
    distance = np.linalg.norm(stated[:, None] - found[None], axis=2).min(axis=0)
    assert len(found) == 4
    assert distance.max() < 1.0
