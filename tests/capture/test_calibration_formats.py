"""Calibrations of other tools, each written here by the format's own rules, project as OpenCV projects the truth."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w
from toy_footage import rig

from studio.capture.calibration_files import find_calibrations, read_calibration, read_intrinsics
from studio.errors import CalibrationError
from studio.geometry.camera import Camera
from studio.geometry.projection import project

CAMERAS = tuple(
    Camera(
        f"cam{k}", 128, 96, np.array([[118.0 + k, 0.0, 63.5], [0.0, 119.0, 47.25], [0.0, 0.0, 1.0]]),
        np.array([-0.12, 0.05, 0.002, -0.001, 0.01 * k]), camera.rotation, camera.translation,
    )
    for k, camera in enumerate(rig(3))
)  # fmt: skip
POINTS = np.random.default_rng(5).uniform([-600, -600, 100], [600, 600, 1900], (60, 3))


def pixels_of_opencv(camera: Camera) -> np.ndarray:
    vector = cv2.Rodrigues(camera.rotation)[0]
    found = cv2.projectPoints(POINTS, vector, camera.translation, camera.matrix, camera.distortion)[0]
    return found.reshape(-1, 2)


def yaml_matrix(name: str, values: np.ndarray, line: str = "\n") -> str:
    """A matrix in OpenCV's YAML, every digit kept."""
    rows, columns = values.shape
    data = ", ".join(repr(float(value)) for value in values.ravel())
    return line.join(
        [f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d", f"   data: [{data}]"]
    ) + line  # fmt: skip


def easymocap(folder: Path, sizes: bool = True, quoted: bool = True, old: bool = False) -> Path:
    """intri.yml and extri.yml with CRLF line ends, metres; old : D_x for dist_x."""
    end = "\r\n"
    mark = '"' if quoted else ""
    names = "names:" + end + "".join(f"  - {mark}{k:02d}{mark}{end}" for k in range(len(CAMERAS)))
    inner = outer = f"%YAML:1.0{end}---{end}{names}"
    for k, camera in enumerate(CAMERAS):
        inner += yaml_matrix(f"K_{k:02d}", camera.matrix, end)
        inner += yaml_matrix(f"{'D' if old else 'dist'}_{k:02d}", camera.distortion[None], end)
        if sizes:
            inner += f"H_{k:02d}: {camera.height}{end}W_{k:02d}: {camera.width}{end}"
        outer += yaml_matrix(f"R_{k:02d}", cv2.Rodrigues(camera.rotation)[0], end)
        outer += yaml_matrix(f"Rot_{k:02d}", camera.rotation, end)
        outer += yaml_matrix(f"T_{k:02d}", camera.translation[:, None] / 1000.0, end)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "intri.yml").write_bytes(inner.encode())
    (folder / "extri.yml").write_bytes(outer.encode())
    return folder / "intri.yml"


def opencv_sample(path: Path, camera: Camera, **entries: np.ndarray) -> Path:
    """As OpenCV's calibration sample writes a camera."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Sat 21 Nov 2026")
    storage.write("image_width", camera.width)
    storage.write("image_height", camera.height)
    storage.write("board_width", 9)
    storage.write("flags", 0)
    storage.write("camera_matrix", camera.matrix)
    storage.write("distortion_coefficients", camera.distortion[:, None])
    storage.write("avg_reprojection_error", 0.21)
    for name, values in entries.items():
        storage.write(name, values)
    storage.release()
    return path


def qualisys(path: Path, offset: tuple[int, int] = (0, 0), head: str = "", **changes: str) -> Path:
    """A .qca.txt in 1/64 px and mm; offset : of the picture on the sensor; changes : attributes of the last camera."""
    left, top = offset
    lines = ["<?xml version='1.0' encoding='ASCII'?>", head, '<calibration type="regular"><cameras>']
    for camera in CAMERAS:
        axes = np.diag([1.0, -1.0, -1.0]) @ camera.rotation
        # r11 r12 r13 is the camera's first axis in the world (a matrix from camera to world, by columns).
        names = {f"r{i + 1}{j + 1}": axes[i, j] for i in range(3) for j in range(3)}
        place = dict(zip("xyz", camera.centre, strict=True))
        transform = {key: repr(float(value)) for key, value in {**place, **names}.items()}
        matrix, bent = camera.matrix, camera.distortion
        intrinsic = {
            "focalLengthU": repr(float(64.0 * matrix[0, 0])),
            "focalLengthV": repr(float(64.0 * matrix[1, 1])),
            "centerPointU": repr(float(64.0 * (matrix[0, 2] + left))),
            "centerPointV": repr(float(64.0 * (matrix[1, 2] + top))),
            "skew": "0.000000",
            "radialDistortion1": repr(float(bent[0])),
            "radialDistortion2": repr(float(bent[1])),
            "radialDistortion3": repr(float(bent[4])),
            "tangentalDistortion1": repr(float(bent[2])),
            "tangentalDistortion2": repr(float(bent[3])),
        }
        if camera is CAMERAS[-1]:
            for key, value in changes.items():
                (transform if key in transform else intrinsic)[key] = value
        view = (
            f'left="{left}" top="{top}" right="{left + camera.width - 1}" bottom="{top + camera.height - 1}"'
        )
        lines += [f'<camera active="1" serial="{camera.name}" viewrotation="0"><fov_video {view}/>']
        lines += [f"<transform {attributes(transform)}/><intrinsic {attributes(intrinsic)}/></camera>"]
    path.write_text("\n".join([*lines, "</cameras></calibration>"]))
    return path


def attributes(values: dict[str, str]) -> str:
    return " ".join(f'{key}="{value}"' for key, value in values.items())


def freemocap(folder: Path) -> Path:
    """FreeMoCap v2: sections by camera id, mm, where each camera stands, the board."""
    document: dict[str, object] = {
        f"cam_{k}": {
            "name": camera.name,
            "id": f"cam_{k}",
            "index": k,
            "image_size" if k else "size": [camera.width, camera.height],
            "matrix": camera.matrix.tolist(),
            "distortions": camera.distortion.tolist(),
            "rotation": cv2.Rodrigues(camera.rotation)[0].ravel().tolist(),
            "translation": camera.translation.tolist(),
            "world_orientation": camera.rotation.T.tolist(),
            "world_position": camera.centre.tolist(),
        }
        for k, camera in enumerate(CAMERAS)
    }
    board = {"squares_x": 5, "squares_y": 3, "square_length_mm": 58.0}
    document["metadata"] = {"reprojection_error_px": 0.4, "board": board}
    path = folder / "rec_calibration.toml"
    path.write_text(tomli_w.dumps(document))
    return path


def opencv_folder(folder: Path) -> Path:
    """A file a camera with R and T, some of them XML."""
    for camera, suffix in zip(CAMERAS, (".yml", ".xml", ".yaml"), strict=True):
        place = {"R": camera.rotation, "T": camera.translation[:, None] / 1000.0}
        opencv_sample(folder / f"{camera.name}{suffix}", camera, **place)
    return folder


def opencv_boards(folder: Path) -> Path:
    """A file a camera in which one picture of the same board stands: its place is the world."""
    for camera in CAMERAS:
        vector = cv2.Rodrigues(camera.rotation)[0].ravel()
        place = np.concatenate([vector, camera.translation])[None]
        opencv_sample(folder / f"{camera.name}.yml", camera, extrinsic_parameters=place)
    return folder


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


def spoiled(path: Path, old: str, new: str) -> Path:
    text = path.read_bytes().decode()
    assert old in text
    path.write_bytes(text.replace(old, new, 1).encode())
    return path


def without(path: Path, name: str) -> Path:
    (path.parent / name).unlink()
    return path


ENTITY = '<!DOCTYPE c [<!ENTITY e SYSTEM "file:///etc/hostname">]>'
BROKEN: dict[str, tuple[Callable[[Path], Path], str]] = {
    "no yaml": (lambda folder: spoiled(easymocap(folder), "%YAML:1.0", "hello"), "is not a file that OpenCV"),
    "cut yaml": (lambda folder: spoiled(easymocap(folder), "data: [", "data: [[[ "), "intri.yml"),
    "extri alone": (lambda folder: without(easymocap(folder), "intri.yml").with_name("extri.yml"), "lies without"),
    "three distortions": (
        lambda folder: spoiled(easymocap(folder), "cols: 5", "cols: 3"), "(intri.yml|distortions)"),
    "strange camera": (
        lambda folder: spoiled(easymocap(folder).with_name("extri.yml"), "T_02", "T_99"), "does not have|T_02"),
    "mirrored": (lambda folder: mirrored(easymocap(folder)), "mirrors the world"),
    "contradiction": (lambda folder: contradicting(easymocap(folder)), "say different things"),
    "sheared": (lambda folder: qualisys(folder / "c.qca.txt", r11="1.7"), "is no rotation"),
    "focal length": (lambda folder: qualisys(folder / "c.qca.txt", focalLengthU="118.0"), "focal lengths of 1.84"),
    "torn": (lambda folder: qualisys(folder / "c.qca.txt", radialDistortion1="-46"), "tear the picture apart"),
    "far centre": (lambda folder: qualisys(folder / "c.qca.txt", centerPointU="64000"), "far outside 128x96"),
    "a word": (lambda folder: qualisys(folder / "c.qca.txt", x="left"), "'transform' x is 'left', no number"),
    "not finite": (lambda folder: qualisys(folder / "c.qca.txt", y="nan"), "no number"),
    "entity": (lambda folder: qualisys(folder / "c.qca.txt", head=ENTITY), "document type or entities"),
    "cut xml": (lambda folder: spoiled(qualisys(folder / "c.qca.txt"), "</cameras>", ""), "is not XML"),
    "no cameras": (lambda folder: written(folder / "c.qca.txt", "<calibration/>"), "no calibrated camera"),
    "pickle": (lambda folder: written(folder / "cameraIntrinsicsExtrinsics.pickle", ""), "pickle.*not read"),
    "no matrix": (lambda folder: written(folder / "c.yml", "%YAML:1.0\n---\na: 1\n"), "holds no camera matrix"),
    "vicon": (lambda folder: written(folder / "c.xcp", "<a/>"), "no calibration format"),
    "fisheye": (
        lambda folder: opencv_sample(folder / "c.yml", CAMERAS[0], fisheye_model=np.ones((1, 1))), "fisheye"),
}  # fmt: skip


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def mirrored(intri: Path) -> Path:
    camera = CAMERAS[1]
    flip = np.diag([1.0, 1.0, -1.0]) @ camera.rotation
    old, new = (yaml_matrix("Rot_01", matrix, "\r\n") for matrix in (camera.rotation, flip))
    spoiled(intri.with_name("extri.yml"), old, new)
    return intri


def contradicting(intri: Path) -> Path:
    old, new = (yaml_matrix("Rot_01", CAMERAS[k].rotation, "\r\n") for k in (1, 2))
    spoiled(intri.with_name("extri.yml"), old, new)
    return intri


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_gives_a_cause_and_a_remedy(tmp_path: Path, name: str) -> None:
    make, said = BROKEN[name]
    with pytest.raises(CalibrationError, match=said) as caught:
        read_calibration(make(tmp_path))
    assert caught.value.hint.endswith(".")
    assert caught.value.message.count(". ") == 0


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    # Were it loaded, it would write a file.
    path = tmp_path / "cam.pickle"
    path.write_bytes(b"cos\nsystem\n(S'touch " + str(tmp_path / "ran").encode() + b"'\ntR.")
    with pytest.raises(CalibrationError, match="can run any program"):
        read_calibration(path)
    assert not (tmp_path / "ran").exists()
    assert find_calibrations(tmp_path) == ()


@pytest.mark.real_data
def test_the_qualisys_file_says_what_the_toml_made_from_it_says(real_data: Path) -> None:
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


@pytest.mark.real_data
def test_chessboards_tell_the_qualisys_lenses_from_those_divided_by_64(real_data: Path) -> None:
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
            for divisor, told in errors.items():
                lens = camera.distortion / divisor
                _, turn, shift = cv2.solvePnP(squares, seen, camera.matrix, lens)
                guess = cv2.projectPoints(squares, turn, shift, camera.matrix, lens)[0].reshape(-1, 2)
                told.append(float(np.mean(np.sum((guess - seen) ** 2, axis=1))))
    assert len(errors[1.0]) >= 7
    assert np.mean(errors[1.0]) < np.mean(errors[64.0])


def test_other_yaml_files_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "compose.yml").write_text("WORK: 1\nK: [1, 2]\nM1: a\n")
    (tmp_path / "boards.yml").write_text("%YAML:1.0\n---\nboard_width: 9\nLOOK: 3\n")
    assert find_calibrations(tmp_path) == ()
