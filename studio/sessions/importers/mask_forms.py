"""How other programs write masks: white where the person is, labels, an alpha channel, or inverted."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.footage.capture.footage import MASK_LEVEL
from studio.footage.capture.pictures import list_pictures, png_of
from studio.footage.capture.video import VideoReader
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import foreign_file, read_file

Levels = NDArray[np.uint8] | NDArray[np.uint16]
"""(H, W) or (H, W, C) levels of a picture as its file has them."""
SAMPLES = 9
FULL = 0.5
"""Masks that cover more than this share of the picture in every frame are of no person: they are inverted."""
MOST_LABELS = 64
"""Largest value of a picture of labels: none of a grey mask whose person is white is that dark everywhere."""
Reading = Literal["white", "alpha", "labels"]


@dataclass(frozen=True, slots=True)
class MaskForm:
    """reading : where the person is. labels : the values of label pictures. share : of the picture that the masks
    cover, least and most of the frames looked at. inverted : black is the person, as was requested.
    """

    reading: Reading
    labels: tuple[int, ...]
    share: tuple[float, float]
    inverted: bool = False

    @property
    def usual(self) -> bool:
        """Whether the masks can be used as they are."""
        return self.reading == "white" and not self.inverted

    def words(self, camera: str) -> tuple[str, ...]:
        """How the masks were read, sentences."""
        if self.reading == "alpha":
            return (f"The masks of camera {camera} lie in the alpha channel and are taken from there.",)
        if self.reading != "labels":
            return ()
        values = ", ".join(map(str, self.labels))
        several = "; all of them are taken for the person" if len(self.labels) > 1 else ""
        return (f"The masks of camera {camera} are labels ({values}), not black and white{several}.",)

    def warnings(self, camera: str) -> tuple[str, ...]:
        """What speaks against the masks, sentences."""
        least, most = self.share
        if most == 0.0:
            return (f"The masks of camera {camera} are empty in every frame that was looked at: check them.",)
        if least > FULL:
            return (
                f"The masks of camera {camera} cover {100 * least:.0f} % of the picture or more in every frame: are"
                " they inverted, black where the person is? Then import them with --masks inverted.",
            )
        return ()


def form_of_masks(path: Path, frame_count: int, inverted: bool = False) -> MaskForm:
    """How a video or folder of masks marks the person, by some of its frames. Raises FootageError."""
    with MaskPictures(path, frame_count) as read:
        chosen = np.unique(np.linspace(0, frame_count - 1, min(SAMPLES, frame_count)).astype(int))
        pictures = [read(int(frame)) for frame in chosen]
    alphas = [one[..., 3] for one in pictures if one.ndim == 3 and one.shape[2] == 4]
    reading: Reading = "white"
    labels: tuple[int, ...] = ()
    if len(alphas) == len(pictures) and any((alpha < alpha.max()).any() for alpha in alphas):
        reading = "alpha"
    elif 0 < (most := max(int(_grey(one).max()) for one in pictures)) <= MOST_LABELS:
        reading = "labels"
        values = {int(value) for one in pictures for value in np.unique(_grey(one))}
        labels = tuple(sorted(values - {0}))[:8]
        assert most in values
    form = MaskForm(reading, labels, (0.0, 0.0), inverted)
    shares = [float(np.count_nonzero(meant_mask(one, form)) / _grey(one).size) for one in pictures]
    return MaskForm(reading, labels, (min(shares), max(shares)), inverted)


def meant_mask(picture: Levels, form: MaskForm) -> Bytes:
    """(H, W) uint8, 255 where the person is, of a picture as its file has it."""
    if form.reading == "alpha":
        person = picture[..., 3] > _half(picture)
    elif form.reading == "labels":
        person = _grey(picture) > 0
    else:
        level = _grey(picture)
        person = level > (MASK_LEVEL if level.dtype == np.uint8 else _half(level))
    return np.where(person != form.inverted, np.uint8(255), np.uint8(0))


def write_meant_masks(
    source: Path, frame_count: int, form: MaskForm, target: Path, on_frame: Callable[[int, int], None]
) -> None:
    """A folder of pictures, white where the person is. Raises FootageError."""
    target.mkdir(parents=True)
    with MaskPictures(source, frame_count) as read:
        for frame in range(frame_count):
            (target / f"{frame:06d}.png").write_bytes(png_of(meant_mask(read(frame), form)))
            on_frame(frame + 1, frame_count)


class MaskPictures:
    """Reads frames of masks as their files have them: with alpha, and sixteen bits where there are."""

    def __init__(self, path: Path, frame_count: int) -> None:
        self._folder = list_pictures(path) if path.is_dir() else ()
        self._video = None if path.is_dir() else VideoReader(path, frame_count)

    def __enter__(self) -> Callable[[int], Levels]:
        return self._read_levels

    def __exit__(self, *_: object) -> None:
        if self._video is not None:
            self._video.close()

    def _read_levels(self, frame: int) -> Levels:
        if self._video is not None:
            return self._video.read(frame)
        path = self._folder[frame]
        with foreign_file(path, FootageError, "a picture that can be read", "Copy or export it again."):
            picture = cv2.imdecode(
                np.frombuffer(read_file(path, footage=True), np.uint8), cv2.IMREAD_UNCHANGED
            )
            if picture is None:
                raise ValueError("no picture")
            levels = np.asarray(picture)
            if levels.dtype == np.uint8:
                return levels.astype(np.uint8, copy=False)
            if levels.dtype == np.uint16:
                return levels.astype(np.uint16, copy=False)
            raise ValueError(f"{levels.dtype} pixels")


def _half(picture: Levels) -> int:
    """Half of the largest level that the picture's type holds."""
    return 127 if picture.dtype == np.uint8 else 32767


def _grey(picture: Levels) -> Levels:
    """(H, W) the largest of the colours."""
    return picture if picture.ndim == 2 else picture[..., :3].max(axis=2)
