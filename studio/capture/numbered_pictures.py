"""Pictures of a live camera, a file a frame, named by its number: `000041.jpg`.

The folder may still grow while it is read. A number may be missing because its camera gave no picture then, or because
no set of pictures was complete; in its place stands the last picture before it.
"""

from pathlib import Path

from studio.arrays import Bytes
from studio.capture.pictures import read_picture
from studio.errors import FootageError

SUFFIX = ".jpg"
DIGITS = 6
FURTHEST = 600
"""Numbers that are looked back for a picture."""


def picture_path(folder: Path, number: int) -> Path:
    """Where the picture of a frame lies, or would."""
    return folder / f"{number:0{DIGITS}d}{SUFFIX}"


def has_picture(folder: Path, number: int) -> bool:
    """Whether the camera gave one."""
    return picture_path(folder, number).exists()


class NumberedReader:
    """The pictures of a folder by their numbers; knows of new ones at once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def read(self, index: int) -> Bytes:
        """(H, W, 3) uint8 BGR of frame `index`, else of the nearest before it, else of the nearest after it.

        Raises FootageError where there is none near, or it is damaged.
        """
        for number in (*range(index, max(-1, index - FURTHEST), -1), *range(index + 1, index + FURTHEST)):
            path = picture_path(self._folder, number)
            if path.exists():
                return read_picture(path)
        raise FootageError(
            f"Camera folder '{self._folder.name}' has no picture near frame {index}.",
            "Record again, or choose frames in which the camera ran.",
        )

    def close(self) -> None:
        """Nothing is kept open."""
