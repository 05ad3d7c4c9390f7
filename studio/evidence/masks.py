"""Clean-up of masks: opening, closing, holes, small pieces, largest pieces. Masks made smaller, and packed."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import cv2
import cv2.typing
import numpy as np
from numpy.typing import NDArray

from studio.evidence.settings import EvidenceSettings
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.camera import Camera


def cleaned(mask: Bytes, settings: EvidenceSettings) -> Bytes:
    """A mask after opening, closing, filling of small holes and dropping of small pieces. mask : (H, W) 0 or 255."""
    if settings.mask_opening > 1:
        mask = _morphed(mask, cv2.MORPH_OPEN, settings.mask_opening)
    left, top, width, height = cv2.boundingRect(mask)
    # Beyond the reach of a closing all stays background.
    reach = settings.mask_closing + 1
    rows = slice(max(top - reach, 0), top + height + reach)
    columns = slice(max(left - reach, 0), left + width + reach)
    part = mask[rows, columns]
    if settings.mask_closing > 1:
        part = _morphed(part, cv2.MORPH_CLOSE, settings.mask_closing)
    if settings.mask_fill_holes or settings.mask_min_component or settings.mask_keep_components:
        part = _pieces(part, settings)
    kept = np.zeros_like(mask)
    kept[rows, columns] = part
    return kept


def reduced(mask: Bytes, camera: Camera) -> Bytes:
    """A mask (H, W) reduced to a camera's size: 255 where at least half of a pixel's area was foreground."""
    if mask.shape == (camera.height, camera.width):
        return mask
    shares = cv2.resize(mask, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.threshold(shares, 127, 255, cv2.THRESH_BINARY)[1], dtype=np.uint8)


def reduced_cleaning(settings: EvidenceSettings, factor: float) -> EvidenceSettings:
    """The settings for masks of pictures reduced by a factor."""
    return dataclasses.replace(
        settings,
        mask_opening=round(settings.mask_opening / factor),
        mask_closing=round(settings.mask_closing / factor),
        mask_fill_holes=round(settings.mask_fill_holes / factor**2),
        mask_min_component=round(settings.mask_min_component / factor**2),
    )


def uncleaned(settings: EvidenceSettings) -> EvidenceSettings:
    """The settings without clean-up; settings with equal raw masks give the same."""
    return dataclasses.replace(
        settings,
        mask_opening=0,
        mask_closing=0,
        mask_fill_holes=0,
        mask_min_component=0,
        mask_keep_components=0,
    )


class PackedMask:
    """A mask in an eighth of its bytes."""

    def __init__(self, mask: Bytes) -> None:
        """mask : (H, W) 0 or 255."""
        self.shape = mask.shape
        self._bits = np.packbits(mask)

    @property
    def nbytes(self) -> int:
        return self._bits.nbytes

    def unpacked(self) -> Bytes:
        """(H, W) uint8, 0 or 255."""
        flat = np.unpackbits(self._bits, count=int(np.prod(self.shape)))
        return (flat * np.uint8(255)).reshape(self.shape)


class PackedMasks(Mapping[str, Bytes]):
    """Masks by camera, packed; each is unpacked on access."""

    def __init__(self) -> None:
        self._packed: dict[str, PackedMask] = {}

    def put(self, camera: str, mask: Bytes) -> None:
        """Keep a mask (H, W) 0 or 255."""
        self._packed[camera] = PackedMask(mask)

    def __getitem__(self, camera: str) -> Bytes:
        return self._packed[camera].unpacked()

    def __iter__(self) -> Iterator[str]:
        return iter(self._packed)

    def __len__(self) -> int:
        return len(self._packed)


def disc(reach: int) -> Bytes:
    """The kernel of a morphology that reaches `reach` pixels around each."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return np.asarray(kernel, dtype=np.uint8)


def _morphed(mask: Bytes, operation: int, size: int) -> Bytes:
    # Only odd kernels have a middle: an even one would shift the mask.
    return np.asarray(cv2.morphologyEx(mask, operation, disc(size // 2)), dtype=np.uint8)


def _pieces(mask: Bytes, settings: EvidenceSettings) -> Bytes:
    """Small pieces dropped, the largest ones kept, small holes of these filled.

    Works on contours (outer borders of pieces, borders of holes), which costs a fraction of labelling
    every pixel.
    """
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return mask
    parent = np.asarray(tree[0, :, 3], dtype=np.int64)
    outer, holes = np.flatnonzero(parent < 0), np.flatnonzero(parent >= 0)
    area = _areas(contours, parent)
    kept = outer[area[outer] >= settings.mask_min_component]
    if settings.mask_keep_components:
        kept = kept[np.argsort(-area[kept], kind="stable")[: settings.mask_keep_components]]
    is_kept = np.zeros(len(contours), np.bool_)
    is_kept[kept] = True
    filled = holes[is_kept[parent[holes]] & (area[holes] < settings.mask_fill_holes)]
    dropped = np.flatnonzero(~is_kept[np.where(parent < 0, np.arange(len(contours)), parent)]).tolist()
    if len(filled) == 0 and not dropped:
        return mask
    out = mask.copy()
    if dropped:
        cv2.drawContours(out, [contours[k] for k in dropped], -1, 0, cv2.FILLED)
    for index in filled:
        cv2.drawContours(out, contours, int(index), 255, cv2.FILLED)
    return out


def _areas(contours: Sequence[cv2.typing.MatLike], parent: NDArray[np.int64]) -> NDArray[np.float64]:
    """Pixels of each piece (its holes left out) and of each hole, by Pick's theorem.

    A contour runs through pixel centres, of the piece itself or, around a hole, of the pixels that
    enclose it.
    """
    enclosed = np.array([cv2.contourArea(contour) for contour in contours])
    border = np.array([len(contour) for contour in contours])
    is_hole = parent >= 0
    area = np.where(is_hole, enclosed - 0.5 * border + 1.0, enclosed + 0.5 * border + 1.0)
    np.subtract.at(area, parent[is_hole], area[is_hole])
    return area
