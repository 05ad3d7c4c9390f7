"""What a run's masks get wrong against the silhouettes of the poses that it found, to be given to other masks.

A fault is an area of a mask thicker than THICK_MM that the body should cover and the mask does not (a hole, a limb lost
to a shadow), or the other way round (a false area, clothes). Each fault goes with the limb that is nearest to it: in
another frame it is turned, moved and scaled as that limb's line in the picture. So its size, its camera, its limb and
how long it lasts stay as they were measured; when it happens does not, so that what the run made of it is not in what
its twin makes of it.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import msgspec
import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.search.likelihood.overlay import limb_contours
from studio.search.trackers.refinement import mm_at

THICK_MM = 15.0
"""At a person's size. With 45 mm, what clothes make of an outline is left out, and the twin's silhouettes agree better
with its poses (0.954, clip choosing-walk) than the run's with its own (0.940); with 15 mm as well (0.942).
"""
SHORTEST_LINE_PX, MOST_SCALED = 6.0, 1.5
"""A limb seen end on tells no direction; and areas are scaled by no more than this."""
ALL_LOST = 0.8
"""Where so much of the silhouette is missing, the twin's mask is empty."""


@dataclass(frozen=True, slots=True, eq=False)
class Fault:
    """An area of a mask. limb : number of the drawn limb that it goes with. corner : (x, y) of `area`, (h, w) 0 or 255.
    is_hole : whether the body is missing there.
    """

    limb: int
    corner: tuple[int, int]
    area: Bytes
    is_hole: bool


class FaultShares(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a camera's masks get wrong. holes, false_areas : mean area over frames, as a share of the silhouette's.
    empty : share of frames without a mask where the body should be. touched : share of frames with a fault.
    """

    camera: str
    holes: float
    false_areas: float
    empty: float
    touched: float


class MaskFaults:
    """The faults of masks over F frames and V cameras, frames counted from 0."""

    def __init__(self, body: BodyModel, cameras: Sequence[Camera], poses: Array) -> None:
        """poses : (F, D) of the body in the frames that the faults are of, and that they are given to."""
        self._body, self._cameras, self._poses = body, tuple(cameras), poses
        self._lines = _lines_of(body, cameras, poses)
        """(F, V, L, 2, 2) pixels of the limbs' lines, NaN behind a camera."""
        self._given_to, self._like = self._lines, list(range(len(cameras)))
        self._faults: dict[tuple[int, int], list[Fault]] = {}
        self._empty: set[tuple[int, int]] = set()
        self._measured: set[int] = set()
        self._sums: Array = np.zeros((len(cameras), 2))

    def in_cameras(self, cameras: Sequence[Camera], like: Sequence[int]) -> "MaskFaults":
        """The same faults to be given to masks of other cameras. like : whose faults each of them has, by number."""
        other = copy.copy(self)
        other._given_to, other._like = _lines_of(self._body, cameras, self._poses), list(like)
        return other

    def measure(self, frame: int, masks: Mapping[str, Bytes]) -> None:
        """Find the faults of a frame. masks : by camera (H, W), 0 or 255."""
        pose = self._poses[frame]
        self._measured.add(frame)
        outlines, sizes = (
            limb_contours(self._body, self._cameras, pose),
            mm_at(self._body, self._cameras, pose),
        )
        for view, (camera, contours, mm) in enumerate(zip(self._cameras, outlines, sizes, strict=True)):
            mask = masks.get(camera.name)
            if mask is None:
                continue
            body = projected_silhouette(contours, camera.height, camera.width)
            whole = int(np.count_nonzero(body))
            if not whole:
                continue
            missing, false = body & ~mask, mask & ~body
            if np.count_nonzero(missing) > ALL_LOST * whole:
                self._empty.add((frame, view))
                continue
            across = max(3, round(THICK_MM / mm))
            found = [
                *self._pieces(frame, view, missing, across, is_hole=True),
                *self._pieces(frame, view, false, across, is_hole=False),
            ]
            if found:
                self._faults[frame, view] = found
            for fault in found:
                self._sums[view, int(fault.is_hole)] += np.count_nonzero(fault.area) / whole

    def _pieces(self, frame: int, view: int, area: Bytes, across: int, *, is_hole: bool) -> list[Fault]:
        """The pieces of an area that are as thick as `across` pixels somewhere, each with its nearest limb."""
        thick = cv2.morphologyEx(area, cv2.MORPH_OPEN, _disc(across))
        if not thick.any():
            return []
        # Grown back to what it was, as far as it is near what is thick.
        grown = cv2.bitwise_and(area, cv2.dilate(thick, _disc(across)))
        count, labels, stats, middles = cv2.connectedComponentsWithStats(grown, connectivity=8)
        found: list[Fault] = []
        for label in range(1, count):
            left, top, width, height = (int(value) for value in stats[label, :4])
            piece = (labels[top : top + height, left : left + width] == label).astype(np.uint8) * np.uint8(
                255
            )
            limb = _nearest_line(self._lines[frame, view], middles[label])
            if limb >= 0:
                found.append(Fault(limb, (left, top), piece, is_hole))
        return found

    def given_to(self, mask: Bytes, view: int, frame: int, source: int) -> Bytes:
        """A mask (H, W) of a frame with the faults of another one, `source`."""
        if (source, self._like[view]) in self._empty:
            return np.zeros_like(mask)
        spoilt = mask
        for fault in self._faults.get((source, self._like[view]), ()):
            moved = self._moved(fault, view, frame, source, mask.shape)
            spoilt = cv2.subtract(spoilt, moved) if fault.is_hole else cv2.bitwise_or(spoilt, moved)
        return np.asarray(spoilt, np.uint8)

    def _moved(self, fault: Fault, view: int, frame: int, source: int, shape: tuple[int, ...]) -> Bytes:
        """(H, W) the area of a fault where its limb is in another frame."""
        before = self._lines[source, self._like[view], fault.limb]
        after = self._given_to[frame, view, fault.limb]
        if not np.isfinite(after).all():
            return np.zeros(shape, np.uint8)
        old, new = (complex(*(line[1] - line[0])) for line in (before, after))
        turn = new / old if min(abs(old), abs(new)) >= SHORTEST_LINE_PX else 1.0 + 0.0j
        turn *= np.clip(abs(turn), 1.0 / MOST_SCALED, MOST_SCALED) / abs(turn)
        linear = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
        move = after.mean(axis=0) - linear @ (before.mean(axis=0) - np.array(fault.corner))
        height, width = shape
        matrix = np.column_stack([linear, move])
        return np.asarray(
            cv2.warpAffine(fault.area, matrix, (width, height), flags=cv2.INTER_NEAREST), np.uint8
        )

    def shares(self) -> tuple[FaultShares, ...]:
        """How much is wrong, by camera, over the frames that were measured."""
        frames = max(1, len(self._measured))
        by_camera: list[FaultShares] = []
        for view, camera in enumerate(self._cameras):
            empty = sum(at == view for _, at in self._empty)
            touched = sum(at == view for _, at in self._faults) + empty
            false, holes = self._sums[view] / frames
            by_camera.append(
                FaultShares(camera.name, float(holes), float(false), empty / frames, touched / frames)
            )
        return tuple(by_camera)


def _lines_of(body: BodyModel, cameras: Sequence[Camera], poses: Array) -> Array:
    ends = limb_ends(body, poses)
    return np.stack([project(camera, ends)[0] for camera in cameras], axis=1)


def _disc(across: int) -> Bytes:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (across, across)), np.uint8)


def _nearest_line(lines: Array, point: Array) -> int:
    """The line of (L, 2, 2) nearest to a point (2,); -1 where none is seen."""
    along = lines[:, 1] - lines[:, 0]
    share = np.sum((point - lines[:, 0]) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-9)
    away = np.linalg.norm(lines[:, 0] + np.clip(share, 0.0, 1.0)[:, None] * along - point, axis=1)
    return -1 if np.isnan(away).all() else int(np.nanargmin(away))
