"""Folders as other tools leave them: two cameras of one take, frames that say their numbers."""

from pathlib import Path

import cv2
import numpy as np
import tomli_w
from sources import FRAMES, write_pose2sim
from toy_footage import numbered_frame, rig, write_pictures, write_video

from studio.footage.capture.calibration_files import export_calibration

CAMERAS = rig(2, "cam_")


def videos(
    folder: Path, names: tuple[str, ...] = ("cam_1.mp4", "cam_2.mp4"), frames: int = FRAMES, first: int = 0
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for index, name in enumerate(names):
        write_video(folder / name, [numbered_frame(first + k, index) for k in range(frames)], fps=60)


def pose2sim(folder: Path) -> Path:
    videos(folder / "videos")
    write_pose2sim(folder / "calibration" / "Calib_scene.toml", CAMERAS)
    (folder / "Config.toml").write_text(tomli_w.dumps({"project": {"frame_rate": "auto"}}))
    for name in ("pose", "pose-3d", "kinematics"):
        (folder / name).mkdir()
    write_pictures(folder / "pose" / "cam_1_img", [numbered_frame(0)])
    return folder


def freemocap(folder: Path) -> Path:
    videos(folder / "videos" / "synchronized", ("cam_1.mp4", "cam_2.mp4"))
    videos(folder / "videos" / "annotated", ("cam_1_annotated.mp4", "cam_2_annotated.mp4"))
    (folder / "output").mkdir()
    (folder / f"{folder.name}_recording_info.json").write_text("{}")
    export_calibration(CAMERAS, folder / f"{folder.name}_calibration.toml", "aniposelib")
    return folder


def old_freemocap(folder: Path) -> Path:
    videos(folder / "synchronized_videos", ("Camera_1_synchronized.mp4", "Camera_2_synchronized.mp4"))
    videos(folder / "annotated_videos", ("Camera_1_annotated.mp4", "Camera_2_annotated.mp4"))
    (folder / "output_data").mkdir()
    export_calibration(CAMERAS, folder / f"{folder.name}_camera_calibration.toml", "aniposelib")
    return folder


def camera_array(path: Path) -> None:
    """Caliscope's own file: metres, 3x3 rotations, cameras by number."""
    path.parent.mkdir(parents=True, exist_ok=True)
    tables = {
        str(k): {
            "cam_id": k, "rotation_count": 0, "error": 0.2, "size": [camera.width, camera.height],
            "matrix": camera.matrix.tolist(), "distortions": camera.distortion.tolist(),
            "translation": (camera.translation / 1000.0).tolist(), "rotation": camera.rotation.tolist(),
        }
        for k, camera in enumerate(CAMERAS, 1)
    }  # fmt: skip
    path.write_text(tomli_w.dumps({"cameras": tables}))


def caliscope(folder: Path) -> Path:
    videos(folder / "calibration" / "intrinsic", frames=2)
    videos(folder / "calibration" / "extrinsic", frames=2)
    camera_array(folder / "calibration" / "extrinsic" / "capture_volume" / "camera_array.toml")
    videos(folder / "recordings" / "walk")
    videos(folder / "recordings" / "walk" / "ONNX_pose", ("cam_1_ONNX.mp4", "cam_2_ONNX.mp4"), frames=2)
    return folder


def caliscope_take(folder: Path) -> Path:
    videos(folder)
    camera_array(folder / "HOLISTIC" / "camera_array.toml")
    return folder


def anipose(folder: Path) -> Path:
    videos(folder / "videos-raw", ("walk-cam_1.avi.mp4", "walk-cam_2.avi.mp4"))
    (folder / "calibration").mkdir()
    export_calibration(CAMERAS, folder / "calibration" / "calibration.toml", "aniposelib")
    return folder


def easymocap(folder: Path) -> Path:
    for index in (1, 2):
        write_pictures(folder / "images" / f"cam_{index}", [numbered_frame(k) for k in range(FRAMES)])
        mask = np.full((96, 128, 3), 255, np.uint8)
        write_pictures(folder / "mask" / f"cam_{index}", [mask] * FRAMES)
    (folder / "annots").mkdir()
    for name in ("intri", "extri"):
        storage = cv2.FileStorage(str(folder / f"{name}.yml"), cv2.FILE_STORAGE_WRITE)
        for camera in CAMERAS:
            if name == "intri":
                storage.write(f"K_{camera.name}", camera.matrix)
                storage.write(f"dist_{camera.name}", camera.distortion[None])
            else:
                storage.write(f"R_{camera.name}", cv2.Rodrigues(camera.rotation)[0])
                storage.write(f"T_{camera.name}", camera.translation[:, None] / 1000.0)
        storage.release()
    return folder
