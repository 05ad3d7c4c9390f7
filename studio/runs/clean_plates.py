"""Backgrounds of all cameras made clean together: each camera is told by the others when a place is empty.

One camera cannot tell a background from a person who hardly leaves the place, nor from the same person in its plate.
The others can: carve the visual hull from their masks only, and where its silhouette in this camera does not reach,
this camera sees background in that frame, whatever it looks like. The background is the median of what a pixel showed
when it was empty so. Where it never was, it is plate and footage combined (`evidence.combined_background`); where that
is in doubt too, as on somebody who stood in the plate, it is filled in from around: seldom right, but no one. Masks
made with it are better, so is their hull: two rounds.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.capture.footage import Footage
from studio.errors import RunError
from studio.evidence.background import GaussianBackground
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.evidence.masks import cleaned
from studio.evidence.settings import EvidenceSettings
from studio.geometry.camera import Camera
from studio.numba_in_threads import njit
from studio.progress import Progress, watched
from studio.sessions.session import Session
from studio.volume.hull_settings import HullSettings
from studio.volume.hull_silhouette import silhouette
from studio.volume.reconstruction import Reconstructor
from studio.volume.tracking_space import box_of

Bytes = NDArray[np.uint8]

FRAMES = 20
ROUNDS = 2
CARVING = HullSettings(hull_depth=7, hull_edge_share=0.05, hull_least_views=2)
"""Generous: a place is empty only where no hull comes near."""
STRIDE = 4
REACH = 3
"""Times STRIDE pixels: how far around a silhouette nothing counts as empty."""
FEWEST_EMPTY = 1
WIDE_REACH = 12
"""Times STRIDE pixels: how far beyond all silhouettes a person may get in frames that were not looked at."""
CLEARED = {"mask_shadow_test": False, "mask_gain_fit": True}
"""Knobs while backgrounds are cleaned: a hole that the shadow test tears costs more than a shadow does."""


@dataclass(frozen=True, slots=True, eq=False)
class CleanPlate:
    """One camera's background.

    picture : (H, W, 3) uint8 BGR. never_empty : share of pixels that no frame showed empty. never_taken : (H, W) uint8,
    255 where the others' hull came near in no frame: what moves there is a shadow, a reflection or a bystander.
    """

    picture: Bytes
    never_empty: float
    never_taken: Bytes


def clean_plates(
    session: Session,
    settings: EvidenceSettings,
    *,
    frames: int = FRAMES,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Mapping[str, CleanPlate]:
    """Clean backgrounds by camera, from the plates, clips or medians that the session has.

    settings : of the masks. frames : how many of the footage are looked at, evenly spread. Raises RunError for fewer
    than three cameras (the hull of one says too little about another) or where it was cancelled, FootageError.
    """
    cameras = session.cameras()
    if len(cameras) < 3:
        raise RunError(
            f"Session '{session.name}' has {len(cameras)} cameras: backgrounds are cleaned with three or more.",
            "Use a plate, an empty clip or the median instead.",
        )
    footage = session.footage()
    try:
        cleaning = _Cleaning(cameras, footage, dataclasses.replace(settings, **CLEARED), frames)
        return cleaning.run(watched(progress, cancelled, "Making the background"))
    finally:
        footage.close()


class _Cleaning:
    """The rounds of one session."""

    def __init__(
        self, cameras: tuple[Camera, ...], footage: Footage, settings: EvidenceSettings, frames: int
    ) -> None:
        self.cameras, self.footage, self.settings = cameras, footage, settings
        count = footage.frame_count
        self.frames = np.unique(np.linspace(0, count - 1, min(frames, count)).round().astype(int)).tolist()
        self.space = box_of(cameras)
        backgrounds = Backgrounds(footage)
        combined = {camera.name: backgrounds.combined(camera.name) for camera in cameras}
        self.first = {name: model for name, (model, _) in combined.items()}
        self.doubtful = {name: doubtful for name, (_, doubtful) in combined.items()}

    def run(self, tell: Progress) -> Mapping[str, CleanPlate]:
        models, plates = dict(self.first), {}
        total = ROUNDS * (len(self.frames) + len(self.cameras))
        done = 0
        for _ in range(ROUNDS):
            taken = {camera.name: [] for camera in self.cameras}
            for frame in self.frames:
                tell("finding where nobody stands", done, total)
                for name, cover in self._covers(frame, models).items():
                    taken[name].append(cover)
                done += 1
            for camera in self.cameras:
                tell("making the background", done, total)
                plates[camera.name] = self._plate(camera.name, np.stack(taken[camera.name]))
                picture = plates[camera.name].picture.astype(np.float32)
                models[camera.name] = GaussianBackground(picture, np.zeros_like(picture))
                done += 1
        tell("making the background", total, total)
        return plates

    def _covers(self, frame: int, models: Mapping[str, GaussianBackground]) -> dict[str, Bytes]:
        """(h, w) of each camera, 1 where the others' hull may hide the background, every STRIDE-th pixel."""
        views = []
        for camera in self.cameras:
            picture = self.footage.picture(camera.name, frame)
            mask = cleaned(models[camera.name].foreground(picture, self.settings), self.settings)
            views.append(ViewEvidence(camera.name, picture, mask, mask))
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * REACH + 1, 2 * REACH + 1))
        found = {}
        for left_out, camera in enumerate(self.cameras):
            others = self.cameras[:left_out] + self.cameras[left_out + 1 :]
            seen = FrameEvidence(frame, tuple(views[:left_out] + views[left_out + 1 :]))
            hull = Reconstructor(others, self.space, CARVING).hull(seen)
            small = silhouette(hull, camera)[::STRIDE, ::STRIDE]
            found[camera.name] = (cv2.dilate(small, kernel) > 0).astype(np.uint8)
        return found

    def _plate(self, name: str, taken: Bytes) -> CleanPlate:
        """taken : (K, h, w) of `_covers`."""
        stack = np.empty((len(self.frames), *self.first[name].mean.shape), np.uint8)
        for row, frame in enumerate(self.frames):
            stack[row] = self.footage.picture(name, frame)
        fallback = np.clip(np.rint(self.first[name].mean), 0, 255).astype(np.uint8)
        picture, empty = median_of_empty(stack, taken, fallback)
        never = empty < FEWEST_EMPTY
        reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * WIDE_REACH + 1, 2 * WIDE_REACH + 1))
        near = cv2.dilate(taken.max(axis=0), reach)
        unused = cv2.resize(255 * (1 - near), picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        filled = _filled_in(picture, never & self.doubtful[name])
        return CleanPlate(filled, float(np.mean(never)), np.asarray(unused, dtype=np.uint8))


def _filled_in(picture: Bytes, holes: NDArray[np.bool_]) -> Bytes:
    """The picture with holes (H, W) closed from around, coarsely."""
    if not holes.any():
        return picture
    height, width = picture.shape[:2]
    small = np.ascontiguousarray(picture[::STRIDE, ::STRIDE])
    wide = cv2.dilate(holes.astype(np.uint8)[::STRIDE, ::STRIDE], np.ones((3, 3), np.uint8))
    filled = cv2.resize(cv2.inpaint(small, wide, 5, cv2.INPAINT_TELEA), (width, height))
    return np.where(holes[..., None], filled, picture).astype(np.uint8)


@njit(cache=True, nogil=True)
def median_of_empty(frames, taken, fallback):
    """The median (H, W, 3) over the frames in which a pixel is empty, and their number (H, W).

    frames : (K, H, W, 3) uint8. taken : (K, h, w), 1 where it is not. fallback : (H, W, 3), where too few are.
    """
    count, height, width = frames.shape[:3]
    out = fallback.copy()
    empty = np.zeros((height, width), np.uint8)
    values = np.empty((3, count), np.float32)
    for y in range(height):
        for x in range(width):
            found = 0
            for k in range(count):
                if taken[k, y // STRIDE, x // STRIDE] == 0:
                    for c in range(3):
                        values[c, found] = frames[k, y, x, c]
                    found += 1
            empty[y, x] = found
            if found >= FEWEST_EMPTY:
                for c in range(3):
                    out[y, x, c] = np.uint8(np.median(values[c, :found]) + 0.5)
    return out, empty
