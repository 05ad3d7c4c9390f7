"""The background models of a session's cameras: fitted once, on the first frame that needs them, and kept.

A model is fitted to a camera's plate picture or empty clip, else to frames spread evenly over the footage
(a moving subject is then absent from the median; one that stays leaves a ghost).
"""

import threading
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.background import (
    BackgroundModel,
    GaussianBackground,
    SubtractorBackground,
    gaussian_from_frames,
    gaussian_from_median,
)
from studio.evidence.combined_background import combine
from studio.evidence.yuv_background import YuvBackground, independent_background, learn_background
from studio.footage.capture.footage import REGIONS, Footage, Region
from studio.footage.capture.pictures import is_picture, read_picture
from studio.footage.capture.video import VideoReader, measure_video
from studio.foundations.arrays import Bytes, evenly_spread
from studio.foundations.errors import FootageError

FittedKind = Literal["gaussian", "median", "combined", "mog2", "knn"]

CLIP_FRAMES = 60
MEDIAN_FRAMES, FEWEST_FRAMES = 31, 3
MEDIAN_BYTES = 200_000_000
TRAINING_FRAMES = 40
LARGEST_DIFFERENCE = 0.02
GRADIENT_LIMIT = 100.0


class Backgrounds:
    """Fitted models by camera and kind, for any number of evidence makers and threads."""

    def __init__(self, footage: Footage) -> None:
        self._footage = footage
        self._fitted: dict[tuple[str, FittedKind], BackgroundModel] = {}
        self._yuv: dict[tuple[str, float], YuvBackground] = {}
        self._regions: dict[tuple[str, Region], Bytes | None] = {}
        self._locks = {camera: threading.Lock() for camera in footage.cameras}

    def model(self, camera: str, kind: FittedKind) -> BackgroundModel:
        """The model of one camera; "gaussian" takes the footage's median where there is no plate or clip.

        Raises FootageError if there is too little to fit it to.
        """
        with self._locks[camera]:
            model = self._fitted.get((camera, kind))
            if model is None:
                model = self._fit(camera, kind)
                self._fitted[camera, kind] = model
            return model

    def empty(self, camera: str) -> Bytes | None:
        """(H, W, 3) BGR: what the camera sees without the subject; None if there is too little to know it by."""
        try:
            model = self.model(camera, "gaussian")
        except FootageError:
            return None
        return model.picture if isinstance(model, GaussianBackground) else None

    def release(self, camera: str) -> None:
        """Drop the models of one camera; they are fitted again when needed."""
        with self._locks[camera]:
            # Other cameras' models may be added meanwhile: iterate over copies of the keys.
            for key in list(self._fitted):
                if key[0] == camera:
                    del self._fitted[key]
            for key in list(self._yuv):
                if key[0] == camera:
                    del self._yuv[key]
            for kind in REGIONS:
                self._regions.pop((camera, kind), None)

    def region(self, kind: Region, camera: str) -> Bytes | None:
        """(H, W) uint8, 255 in it; None without any. Raises FootageError."""
        with self._locks[camera]:
            if (camera, kind) not in self._regions:
                self._regions[camera, kind] = self._footage.region(kind, camera)
            return self._regions[camera, kind]

    def combined(self, camera: str) -> tuple[GaussianBackground, NDArray[np.bool_]]:
        """Plate (or clip) and footage combined, and a mask (H, W) of doubtful pixels: all without a plate."""
        plate, frames = self.empty_room(camera), self._spread(camera, MEDIAN_FRAMES)
        if plate is None:
            return gaussian_from_median(frames), np.ones(frames.shape[1:3], np.bool_)
        return combine(plate, frames)

    def yuv(self, camera: str, least_noise: float) -> YuvBackground:
        """Full Gaussians in YUV of the plate or empty clip, else about the footage's median; least_noise : grey levels.

        Raises FootageError if there is too little to fit it to.
        """
        with self._locks[camera]:
            background = self._yuv.get((camera, least_noise))
            if background is None:
                path = self._footage.background_path(camera)
                if path is not None:
                    background = learn_background(self._plate(camera, path, CLIP_FRAMES), least_noise)
                else:
                    frames = self._spread(camera, MEDIAN_FRAMES)
                    median = gaussian_from_median(frames)
                    background = independent_background(
                        median.mean.astype(np.float32), median.variance, least_noise, len(frames)
                    )
                for old in [key for key in self._yuv if key[0] == camera]:
                    del self._yuv[old]
                self._yuv[camera, least_noise] = background
            return background

    def _fit(self, camera: str, kind: FittedKind) -> BackgroundModel:
        path = self._footage.background_path(camera)
        if kind == "combined" and path is not None:
            return self.combined(camera)[0]
        if kind in ("median", "combined") or (kind == "gaussian" and path is None):
            return gaussian_from_median(self._spread(camera, MEDIAN_FRAMES))
        if kind == "gaussian" and path is not None:
            return gaussian_from_frames(self._plate(camera, path, CLIP_FRAMES))
        if path is not None and not is_picture(path):
            return SubtractorBackground(_subtractor(kind), self._plate(camera, path, TRAINING_FRAMES))
        return SubtractorBackground(_subtractor(kind), list(self._spread(camera, TRAINING_FRAMES)))

    def _spread(self, camera: str, most: int) -> Bytes:
        """(K, H, W, 3) up to `most` frames of the footage, evenly spread, both ends included."""
        count = self._footage.frame_count
        check_frame_count(camera, count)
        first = self._footage.picture(camera, 0)
        most = max(FEWEST_FRAMES, min(most, count, MEDIAN_BYTES // first.nbytes))
        chosen = evenly_spread(count, most)
        stack = np.empty((len(chosen), *first.shape), np.uint8)
        for row, frame in enumerate(chosen):
            stack[row] = self._footage.picture(camera, int(frame))
        return stack

    def empty_room(self, camera: str) -> Bytes | None:
        """(H, W, 3) the plate picture, or the empty clip's mean; None without either. Raises FootageError."""
        path = self._footage.background_path(camera)
        if path is None:
            return None
        pictures = self._plate(camera, path, CLIP_FRAMES)
        if len(pictures) == 1:
            return pictures[0]
        return np.rint(gaussian_from_frames(pictures).mean).astype(np.uint8)

    def _plate(self, camera: str, path: Path, most: int) -> list[Bytes]:
        """The plate picture, or up to `most` frames of the empty clip, of the footage's size."""

        def fitted(picture: Bytes) -> Bytes:
            turned = self._footage.turned_background(camera, picture)
            size = self._footage.size(camera)
            if turned.shape[1::-1] == size:
                return turned
            return fitted_plate(turned, self._footage.picture(camera, 0), path.name)

        if is_picture(path):
            return [fitted(read_picture(path))]
        count = measure_video(path).frame_count
        reader = VideoReader(path, count)
        try:
            return [fitted(reader.read(int(number))) for number in evenly_spread(count, most)]
        finally:
            reader.close()


def check_frame_count(camera: str, count: int) -> None:
    """Raises FootageError if a camera's footage has too few frames to take a background from."""
    if count < FEWEST_FRAMES:
        raise FootageError(
            f"Camera {camera} has no background picture and only {count} frames to take one from.",
            "Give masks, a plate picture or an empty clip in 'background/'.",
        )


def check_plate_size(plate: tuple[int, int], footage: tuple[int, int], name: str) -> None:
    """Raises FootageError if a background of (width, height) is smaller than the footage or 2 % larger."""
    (wide, tall), (width, height) = plate, footage
    if wide < width or tall < height or max(wide / width, tall / height) > 1.0 + LARGEST_DIFFERENCE:
        raise FootageError(
            f"The background '{name}' is {wide}x{tall} pixels, the footage {width}x{height}.",
            "Give a background of the footage's size.",
        )


def fitted_plate(plate: Bytes, frame: Bytes, name: str) -> Bytes:
    """A background picture fitted to the footage's size, in the way that agrees best with one of its frames.

    Either cropped evenly on both sides, or scaled as a whole and centred between black bars, as in
    `footage.capture.footage_fit`. Raises FootageError as `check_plate_size` does.
    """
    height, width = frame.shape[:2]
    tall, wide = plate.shape[:2]
    check_plate_size((wide, tall), (width, height), name)
    if (wide, tall) == (width, height):
        return plate
    seen = _gradients(frame)
    best, most = None, -np.inf
    for scale in (1.0, width / wide, height / tall):
        resized = cv2.resize(plate, (round(wide * scale), round(tall * scale)), interpolation=cv2.INTER_AREA)
        candidate = _centred(np.asarray(resized, dtype=np.uint8), width, height)
        agreement = _correlation(_gradients(candidate), seen)
        if best is None or agreement > most:
            best, most = candidate, np.nan_to_num(agreement, nan=-np.inf)
    assert best is not None
    return best


def _centred(picture: Bytes, width: int, height: int) -> Bytes:
    """A picture cropped or padded with black to width x height, evenly on both sides."""
    tall, wide = picture.shape[:2]
    left, top = max(0, (wide - width) // 2), max(0, (tall - height) // 2)
    inner = picture[top : top + height, left : left + width]
    above, before = (height - inner.shape[0]) // 2, (width - inner.shape[1]) // 2
    out = np.zeros((height, width, 3), np.uint8)
    out[above : above + inner.shape[0], before : before + inner.shape[1]] = inner
    return out


def _correlation(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Pearson's; NaN for a flat picture. `numpy.corrcoef` makes float64 copies, 100 MB of full-HD pictures."""
    one, other = one - one.mean(), other - other.mean()
    return float((one @ other) / np.sqrt((one @ one) * (other @ other)))


def _gradients(picture: Bytes) -> NDArray[np.float32]:
    """Strength of the gradient, limited so that no single edge decides, flat."""
    level = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    across, along = cv2.Sobel(level, cv2.CV_32F, 1, 0), cv2.Sobel(level, cv2.CV_32F, 0, 1)
    return np.minimum(cv2.magnitude(across, along), GRADIENT_LIMIT).astype(np.float32).ravel()


def _subtractor(kind: FittedKind) -> Literal["mog2", "knn"]:
    return "mog2" if kind == "mog2" else "knn"
