"""Backgrounds of all cameras cleaned together: the other views show when a place is empty.

One camera cannot distinguish background from a person who hardly moves, or who also stands in its plate. The others
can: outside the silhouette of the visual hull carved from their masks only, this camera sees background in that frame.
The background is the median of a pixel over the frames in which it was empty. Where it never was, plate and footage are
combined (`evidence.combined_background`); where that is doubtful too (a person stood in the plate), the hole is filled
in from its surroundings: seldom right, but no person. Masks made with this background are better, and so is their hull:
two rounds.

Empty regions are found in small pictures. The footage is read twice, a camera at a time: for the small pictures, and
for the backgrounds, whose frames are spooled to disk.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.scale import scale_of
from studio.evidence.background import GaussianBackground, gaussian_from_median
from studio.evidence.backgrounds import Backgrounds, check_frame_count
from studio.evidence.combined_background import Combination, combination
from studio.evidence.masks import cleaned, disc, reduced, reduced_cleaning
from studio.evidence.settings import EvidenceSettings
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.hull_silhouette import silhouette
from studio.evidence.volume.reconstruction import Reconstructor, check_views
from studio.evidence.volume.tracking_space import Box, box_of
from studio.footage.capture.footage import Footage
from studio.footage.capture.frame_spool import FrameSpool
from studio.foundations.arrays import Bytes, evenly_spread
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.foundations.numba_in_threads import KERNEL, njit
from studio.foundations.progress import Progress, no_progress
from studio.sessions.session import Session

Part = TypeVar("Part")

FRAMES = 20
"""Read from the footage, evenly spread."""
ROUNDS = 2
CARVING = HullSettings(hull_depth=7, hull_edge_share=0.05, hull_least_views=2)
"""Coarse on purpose: a place is empty only where no hull comes near."""
FIRST_CARVING = dataclasses.replace(CARVING, hull_depth=6)
"""Of the first round, whose backgrounds are used once."""
COMBINED_SIDE, COVER_SIDE = 480, 240
"""Least shorter side (pixels) of the pictures in which plate and footage are combined, and of those in which occlusion
is computed."""
REACH = 12
"""Pixels of the footage: margin around a silhouette that does not count as empty."""
BLUR = 2.0
"""Small pixels by which a hull of small masks is wider on each side."""
FEWEST_EMPTY = 1
WIDE_REACH = 48
"""Small pixels: margin around all silhouettes for frames that were not read."""
FILLING = 4
"""Reduction of the pictures in which holes are filled in."""
CLEARED = {"mask_shadow_test": False, "mask_gain_fit": True}
"""Knobs while backgrounds are cleaned: a hole that the shadow test tears costs more than a shadow does."""


@dataclass(frozen=True, slots=True, eq=False)
class CleanPlate:
    """One camera's background.

    picture : (H, W, 3) uint8 BGR. never_empty : share of pixels that no frame showed empty. never_taken : (H, W) uint8,
    255 where the others' hull came near in no frame: motion there is a shadow, a reflection or a bystander.
    """

    picture: Bytes
    never_empty: float
    never_taken: Bytes


def clean_plates(
    session: Session, settings: EvidenceSettings, *, progress: Progress = no_progress
) -> Mapping[str, CleanPlate]:
    """Clean backgrounds by camera, from the session's plates, clips or medians.

    settings : of the masks. Raises RunError for fewer than three cameras (too few for a hull without one of them),
    FootageError.
    """
    cameras = session.cameras()
    if len(cameras) < 3:
        raise RunError(
            f"Session '{session.name}' has {len(cameras)} cameras: backgrounds are cleaned with three or more.",
            "Use a plate, an empty clip or the median instead.",
        )
    with closing(session.footage()) as footage:
        cleaning = _Cleaning(
            cameras, footage, dataclasses.replace(settings, **CLEARED), progress, scale_of(session.body())
        )
        return cleaning.run(session.path)


@dataclass(frozen=True, slots=True, eq=False)
class _First:
    """Plate and footage of one camera combined at low resolution. picture : (h, w, 3) uint8. doubtful : (h, w) 0 or 1.
    combination : its parts, None without a plate.
    """

    picture: Bytes
    doubtful: Bytes
    combination: Combination | None


class _Cleaning:
    """Cleans the backgrounds of one session in rounds."""

    def __init__(
        self,
        cameras: tuple[Camera, ...],
        footage: Footage,
        settings: EvidenceSettings,
        report: Progress,
        scale: float,
    ) -> None:
        self.footage, self.report, self.scale = footage, report, scale
        self.cameras = cameras
        self.middle = tuple(camera.reduced(COMBINED_SIDE) for camera in cameras)
        self.small = tuple(camera.reduced(COVER_SIDE) for camera in cameras)
        self.settings = settings
        self.frames = evenly_spread(footage.frame_count, FRAMES).tolist()
        self.done, self.total = 0, 2 * len(cameras) * len(self.frames) + ROUNDS * len(self.frames)

    def run(self, folder: Path) -> Mapping[str, CleanPlate]:
        """folder : on a disk with room for one camera's frames."""
        check_views(self.cameras)
        firsts: list[_First] = []
        pictures: list[Bytes] = []
        masks: list[list[Bytes]] = []
        for camera, middle, small in zip(self.cameras, self.middle, self.small, strict=True):
            first, seen, rough_masks = self._first(camera, middle, small)
            firsts.append(first)
            pictures.append(seen)
            masks.append(rough_masks)
        space = box_of(self.cameras, scale=self.scale)
        taken = self._covers(masks, self._carvers(space, FIRST_CARVING))
        for _ in range(ROUNDS - 1):
            masks = [
                self._cleaner_masks(*parts)
                for parts in zip(self.cameras, self.small, firsts, pictures, taken, strict=True)
            ]
            taken = self._covers(masks, self._carvers(space, CARVING))
        del pictures, masks
        plates: dict[str, CleanPlate] = {}
        for camera, first, covers in zip(self.cameras, firsts, taken, strict=True):
            plates[camera.name] = self._plate(camera, first, covers, folder)
        self.report("making the background", self.total, self.total)
        return plates

    def _carvers(self, space: Box, fineness: HullSettings) -> list[Reconstructor]:
        """One carver for each camera left out."""
        return [Reconstructor(_without(self.small, k), space, fineness) for k in range(len(self.cameras))]

    def _first(self, camera: Camera, middle: Camera, small: Camera) -> tuple[_First, Bytes, list[Bytes]]:
        """Plate and footage of one camera combined, its small pictures (K, h, w, 3), and small masks."""
        check_frame_count(camera.name, self.footage.frame_count)
        plate = Backgrounds(self.footage).empty_room(camera.name)
        plate = None if plate is None else _resized(plate, middle)
        stack = np.empty((len(self.frames), middle.height, middle.width, 3), np.uint8)
        seen = np.empty((len(self.frames), small.height, small.width, 3), np.uint8)
        for row, frame in enumerate(self.frames):
            self._step("finding empty regions")
            picture = self.footage.picture(camera.name, frame)
            stack[row] = _resized(picture, middle)
            seen[row] = _resized(picture, small)
        self.footage.release(camera.name)
        if plate is None:
            rough_masks, model = None, gaussian_from_median(stack)
            doubtful = np.ones(stack.shape[1:3], np.bool_)
        else:
            model, doubtful, rough_masks = combination(plate, stack, camera.width / middle.width)
        settings = reduced_cleaning(self.settings, camera.width / middle.width)
        masks = [
            reduced(cleaned(model.foreground(picture, settings).mask, settings), small) for picture in stack
        ]
        first = _First(_rounded(model.mean), doubtful.astype(np.uint8), rough_masks)
        return first, seen, masks

    def _cleaner_masks(
        self, camera: Camera, small: Camera, first: _First, pictures: Bytes, taken: Bytes
    ) -> list[Bytes]:
        """Masks of small pictures (K, h, w, 3) with the background computed from their empty pixels."""
        picture, empty = median_of_empty(pictures, taken, _resized(first.picture, small))
        doubtful = _enlarged(first.doubtful, small)
        factor = camera.width / small.width
        background = GaussianBackground(
            _filled_in(picture, (empty < FEWEST_EMPTY) & (doubtful > 0), max(1, round(FILLING / factor)))
        )
        settings = reduced_cleaning(self.settings, factor)
        return [cleaned(background.foreground(seen, settings).mask, settings) for seen in pictures]

    def _covers(self, masks: Sequence[Sequence[Bytes]], carvers: Sequence[Reconstructor]) -> list[Bytes]:
        """(K, h, w) of each camera, 1 where the others' hull may hide the background in a frame.

        masks : of each camera, in each frame. carvers : of the cameras without each.
        """
        covers = [np.empty((len(self.frames), small.height, small.width), np.uint8) for small in self.small]
        for row in range(len(self.frames)):
            self._step("finding empty regions")
            seen = [of_camera[row] for of_camera in masks]
            for left_out, (camera, small) in enumerate(zip(self.cameras, self.small, strict=True)):
                hull = carvers[left_out].shape(_without(seen, left_out))
                reach = max(1, round(REACH * small.width / camera.width - BLUR))
                covers[left_out][row] = cv2.dilate(silhouette(hull, small), disc(reach)) > 0
        return covers

    def _plate(self, camera: Camera, first: _First, taken: Bytes, folder: Path) -> CleanPlate:
        """taken : (K, h, w) of `_covers`."""
        plate = None if first.combination is None else Backgrounds(self.footage).empty_room(camera.name)
        picture = _enlarged(first.picture, camera)
        empty = np.zeros(picture.shape[:2], np.uint8)
        with FrameSpool(folder) as spool:
            for frame in self.frames:
                self._step("making the background")
                spool.put(self.footage.picture(camera.name, frame))
            self.footage.release(camera.name)
            for top, band in spool.bands():
                fill_medians_of_empty(band, taken, top, picture, empty)
                if first.combination is not None and plate is not None:
                    unseen = empty[top : top + band.shape[1]] < FEWEST_EMPTY
                    first.combination.fill(plate, band, top, unseen, picture)
        never = empty < FEWEST_EMPTY
        reach = round(WIDE_REACH * taken.shape[2] / camera.width)
        near = np.asarray(cv2.dilate(taken.max(axis=0), disc(reach)), dtype=np.uint8)
        unused = cv2.resize(255 * (1 - near), picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        filled = _filled_in(picture, never & (_enlarged(first.doubtful, camera) > 0), FILLING)
        return CleanPlate(filled, float(np.mean(never)), np.asarray(unused, dtype=np.uint8))

    def _step(self, step: str) -> None:
        self.report(step, self.done, self.total)
        self.done += 1


def _without(those: Sequence[Part], left_out: int) -> tuple[Part, ...]:
    return (*those[:left_out], *those[left_out + 1 :])


def _resized(picture: Bytes, camera: Camera) -> Bytes:
    """A picture (H, W, 3) made as small as a camera's."""
    size = (camera.width, camera.height)
    if picture.shape[1::-1] == size:
        return picture
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _enlarged(picture: Bytes, camera: Camera) -> Bytes:
    """A picture (h, w) or (h, w, 3) made as large as a camera's; a copy."""
    size = (camera.width, camera.height)
    return np.array(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _rounded(mean: NDArray[np.uint8 | np.float32]) -> Bytes:
    return np.clip(np.rint(mean), 0, 255).astype(np.uint8)


def _filled_in(picture: Bytes, holes: NDArray[np.bool_], factor: int) -> Bytes:
    """The picture with holes (H, W) filled in from their surroundings, in a picture `factor` times smaller."""
    if not holes.any():
        return picture
    height, width = picture.shape[:2]
    small = np.ascontiguousarray(picture[::factor, ::factor])
    wide = cv2.dilate(holes.astype(np.uint8)[::factor, ::factor], np.ones((3, 3), np.uint8))
    filled = cv2.resize(cv2.inpaint(small, wide, 5, cv2.INPAINT_TELEA), (width, height))
    np.copyto(picture, np.asarray(filled, dtype=np.uint8), where=holes[..., None])
    return picture


def median_of_empty(frames: Bytes, taken: Bytes, fallback: Bytes) -> tuple[Bytes, Bytes]:
    """The median (H, W, 3) over the frames in which a pixel is empty, and their number (H, W).

    frames : (K, H, W, 3) uint8. taken : (K, h, w), 1 where not empty. fallback : (H, W, 3), used where too few are
    empty.
    """
    out, empty = fallback.copy(), np.zeros(fallback.shape[:2], np.uint8)
    fill_medians_of_empty(frames, taken, 0, out, empty)
    return out, empty


@njit(**KERNEL)
def fill_medians_of_empty(frames: Bytes, taken: Bytes, top: int, out: Bytes, empty: Bytes) -> None:
    """`median_of_empty` of a band of rows from `top` on: frames (K, rows, W, 3). out (H, W, 3) and empty (H, W) are
    filled there, out only where enough is empty.

    Taken pixels count as 255, so that they sort to the end. All pixels of a row are sorted at once by K rounds of
    exchanging neighbours (odd-even transposition sort).
    """
    count, rows, width = frames.shape[:3]
    height, tall, wide = len(out), taken.shape[1], taken.shape[2]
    values = np.empty((count, 3 * width), np.uint8)
    for row in range(rows):
        y = top + row
        above = y * tall // height
        for x in range(width):
            empty[y, x] = 0
        for k in range(count):
            seen, covered, line = frames[k, row], taken[k, above], values[k]
            for x in range(width):
                hidden = covered[x * wide // width] != 0
                empty[y, x] += np.uint8(0) if hidden else np.uint8(1)
                for c in range(3):
                    line[3 * x + c] = np.uint8(255) if hidden else seen[x, c]
        for turn in range(count):
            for k in range(turn % 2, count - 1, 2):
                lower, upper = values[k], values[k + 1]
                for at in range(3 * width):
                    one, other = lower[at], upper[at]
                    lower[at] = min(one, other)
                    upper[at] = max(one, other)
        for x in range(width):
            empty_count = int(empty[y, x])
            if empty_count >= FEWEST_EMPTY:
                for c in range(3):
                    pair = int(values[(empty_count - 1) // 2, 3 * x + c]) + int(
                        values[empty_count // 2, 3 * x + c]
                    )
                    out[y, x, c] = np.uint8((pair + 1) // 2)
