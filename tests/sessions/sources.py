"""Folders as users bring them: videos or pictures, a calibration, a subject, truth."""

from pathlib import Path

import cv2
import numpy as np
import tomli_w
from toy_footage import numbered_frame, rig, write_pictures, write_video

from studio.body.catalogue import load_body
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.foundations.geometry.camera import Camera

FRAMES = 12
BODY = load_body("human31")


def write_pose2sim(path: Path, cameras: tuple[Camera, ...]) -> Path:
    """A Pose2Sim calibration in metres."""
    path.parent.mkdir(parents=True, exist_ok=True)
    document = {
        camera.name: {
            "name": camera.name,
            "size": [float(camera.width), float(camera.height)],
            "matrix": camera.matrix.tolist(),
            "distortions": camera.distortion[:4].tolist(),
            "rotation": cv2.Rodrigues(camera.rotation)[0].ravel().tolist(),
            "translation": (camera.translation / 1000.0).tolist(),
            "fisheye": False,
        }
        for camera in cameras
    }
    path.write_text(tomli_w.dumps(document))
    return path


def video_source(folder: Path, count: int = 2, frames: int = FRAMES, fps: int = 60) -> Path:
    """videos/cam01.mp4 ... with calibration/Calib.toml naming the cameras cam_1 ..."""
    cameras = rig(count, "cam_")
    (folder / "videos").mkdir(parents=True)
    for index in range(count):
        pictures = [numbered_frame(number, index) for number in range(frames)]
        write_video(folder / "videos" / f"cam{index + 1:02d}.mp4", pictures, fps=fps)
    write_pose2sim(folder / "calibration" / "Calib.toml", cameras)
    return folder


def full_source(folder: Path) -> Path:
    """A source with every optional part."""
    video_source(folder)
    mask = np.zeros((96, 128, 3), np.uint8)
    mask[20:80, 40:70] = 255
    for index in (1, 2):
        write_pictures(folder / "masks" / f"camera{index}", [mask] * FRAMES)
        plate = folder / "background" / f"cam{index}_plate.png"
        plate.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(plate), numbered_frame(0))
    (folder / "truth").mkdir()
    motion = MarkerMotion(("Hip", "Neck"), np.arange(FRAMES) / 60.0, np.ones((FRAMES, 2, 3)))
    write_trc(folder / "truth" / "walk.trc", motion)
    (folder / "subject.toml").write_text(
        'body = "human31"\nheight_mm = 1780\n[lengths_mm]\nRHip_RKnee = 420\n'
    )
    names = [entry.name for entry in BODY.parameters]
    values = [f"{value:.4f}" for value in BODY.neutral]
    (folder / "start_pose.csv").write_text(",".join(names) + "\n" + ",".join(values) + "\n")
    return folder


def everything_below(folder: Path) -> dict[str, bytes]:
    """All files of a folder with their content, hidden ones too."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
