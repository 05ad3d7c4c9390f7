"""A stored session's footage with a stretch in which nothing is to be seen: black pictures, or an empty room."""

import dataclasses
import shutil
from pathlib import Path

import cv2
import msgspec
import numpy as np

from studio.footage.capture.footage_source import FootageSource
from studio.results.drawing_footage.clips import ClipWriter
from studio.sessions.manifest import write_manifest
from studio.sessions.session import Session

BLACK, GONE = "black", "gone"


def interrupted(
    source: Session, folder: Path, frames: list[int], blind: range, kind: str, fps: float
) -> Session:
    """A session of some frames of another, at `fps`, in which the frames `blind` (numbers of the new session) show
    nothing: BLACK pictures, or (GONE) what the camera's empty clip shows.
    """
    shutil.copytree(source.path, folder, ignore=shutil.ignore_patterns("videos", "runs", "truth", "masks"))
    footage, cameras = source.footage(), []
    for camera in source.manifest.footage.cameras:
        empty = _empty(source.path / camera.background)
        path = folder / "videos" / f"{camera.name}.mp4"
        path.parent.mkdir(exist_ok=True)
        with ClipWriter(path, (camera.width, camera.height), fps, 18.0) as clip:
            for number, frame in enumerate(frames):
                picture = footage.picture(camera.name, frame)
                if number in blind:
                    picture = np.zeros_like(picture) if kind == BLACK else empty
                clip.add(picture)
        made = {"frame_count": len(frames), "masks": "", "path": f"videos/{camera.name}.mp4"}
        cameras.append(dataclasses.replace(camera, **made))
    footage.close()
    partial = FootageSource(fps, len(frames), tuple(cameras))
    write_manifest(folder, msgspec.structs.replace(source.manifest, name=folder.name, footage=partial))
    return Session(folder)


def _empty(path: Path) -> np.ndarray:
    """A picture of an empty clip, or the empty picture itself."""
    reader = cv2.VideoCapture(str(path))
    read, picture = reader.read()
    reader.release()
    return np.asarray(picture if read else cv2.imread(str(path)))
