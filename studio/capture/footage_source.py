"""Where a session's footage lies and how much of it there is: the frozen description kept in the manifest.

It holds only what was *measured* at import (sizes and frame counts come from decoding every frame once), so
that opening a session needs no probing and a file that changed afterwards is noticed.
"""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class CameraSource:
    """One camera's footage.

    name : the camera's name in `calibration/cameras.toml`. kind : a video file or a folder of pictures.
    path, masks, background : relative to the session folder with forward slashes, or absolute where the
    footage is referred to; masks (video or folder) and background (picture or clip) are "" if there is
    none.
    width, height : pixels. frame_count : frames that decode, whatever the file's header claims.
    """

    name: str
    kind: Literal["video", "pictures"]
    path: str
    width: int
    height: int
    frame_count: int
    masks: str = ""
    background: str = ""


@dataclass(frozen=True, slots=True)
class FootageSource:
    """All cameras' footage, in the order of the session's cameras.

    fps : frames per second. frame_count : frames that every camera has.
    """

    fps: float
    frame_count: int
    cameras: tuple[CameraSource, ...]
