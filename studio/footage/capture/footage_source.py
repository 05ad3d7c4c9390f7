"""The description of a session's footage, stored in the manifest.

It holds only what was *measured* at import (sizes and frame counts come from decoding every frame once), so
that opening a session needs no probing and a file that changed afterwards is noticed.
"""

from dataclasses import dataclass
from typing import Literal

from studio.footage.capture.frame_pairing import file_frame
from studio.footage.capture.interlacing import Fields

Turn = Literal[0, 90, 180, 270]
TURNS: tuple[Turn, ...] = (0, 90, 180, 270)


@dataclass(frozen=True, slots=True)
class CameraSource:
    """One camera's footage.

    name : the camera's name in `calibration/cameras.toml`. kind : a video file, a folder of pictures, or one of
    pictures that are named by their frames' numbers, some of which the camera may not have ("numbered"). path, masks,
    background : relative to the session folder with forward slashes, or absolute where the footage is referred to;
    masks (video or folder) and background (picture or clip) are "" if there is
    none.
    width, height : pixels, as they are after turning. frame_count : frames that decode, whatever the file's header
    claims. offset : the file's frame that was taken at the session's frame 0. turned : degrees clockwise by which the
    pictures (masks and background too) are turned, in addition to the file's own rotation: 0, 90, 180 or 270. steps :
    where frames are paired by time, (frame of the session, so many frames further in the file) from that frame on.
    fields : of an interlaced video that is split, which field of a picture comes first; then every field counts as a
    frame of the file.
    """

    name: str
    kind: Literal["video", "pictures", "numbered"]
    path: str
    width: int
    height: int
    frame_count: int
    masks: str = ""
    background: str = ""
    offset: int = 0
    turned: Turn = 0
    steps: tuple[tuple[int, int], ...] = ()
    fields: Fields = ""

    def file_frame(self, frame: int) -> int:
        """The file's frame that belongs to a frame of the session."""
        return self.offset + file_frame(self.steps, frame)

    @property
    def places(self) -> tuple[str, str, str]:
        """Of its footage, masks and background, "" where there are none."""
        return self.path, self.masks, self.background

    @property
    def last(self) -> int:
        """Frames of the session that the camera has: those before it lie within its file."""
        return self.frame_count - self.offset - (self.steps[-1][1] if self.steps else 0)


@dataclass(frozen=True, slots=True)
class FootageSource:
    """All cameras' footage, in the order of the session's cameras.

    fps : frames per second. frame_count : frames that every camera has, each after its own offset.
    """

    fps: float
    frame_count: int
    cameras: tuple[CameraSource, ...]
