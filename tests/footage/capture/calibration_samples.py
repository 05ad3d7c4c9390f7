"""Calibrations of other tools, each written by the format's own rules, and what OpenCV projects with them."""

from pathlib import Path

import cv2
import numpy as np
import tomli_w
from toy_footage import rig

from studio.foundations.geometry.camera import Camera

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
