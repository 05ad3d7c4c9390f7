"""One frame's evidence: pictures, masks and edge maps of all cameras.

A maker is cheap to build (a changed knob builds another one); the fitted background models are
expensive, so they are shared in `Backgrounds`. Cameras are independent but for what looks like a shadow
(`floor_shadows`): with an executor of two threads a frame takes half the time.
"""

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from cachetools import LRUCache

from studio.evidence.backgrounds import Backgrounds, FittedKind
from studio.evidence.edges import bodytrack_edges, proximity_edges
from studio.evidence.floor_shadows import (
    SUBJECT,
    UNKNOWN,
    Cells,
    FloorShadows,
    cells_of,
    floor_shadows,
    pixels_of,
)
from studio.evidence.frame_evidence import EDGE_KINDS, FrameEvidence, ViewEvidence
from studio.evidence.masks import PackedMask, cleaned
from studio.evidence.settings import EvidenceSettings
from studio.evidence.threshold import between_thresholds
from studio.footage.capture.footage import REGIONS, Footage
from studio.foundations.arrays import Bytes, Floats
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.tracing import span

KINDS: dict[str, FittedKind] = {"median": "median", "combined": "combined", "mog2": "mog2", "knn": "knn"}
"""Models by the knob's value, beside the Gaussian one."""
KEPT_CELLS = 512
"""Pictures whose cells are kept: what asks for one camera after the other needs those of all."""
_T = TypeVar("_T")
_U = TypeVar("_U")


@dataclass(frozen=True, slots=True, eq=False)
class RawMask:
    """A camera's mask (H, W), 0 or 255, before its clean-up.

    to_clean : whether it is to be cleaned. shadow : (H, W), 255 where a pixel changed but passes for a shadow; None:
    nowhere. brightness : of shadows, by cell, as in `Foreground`. unknown : (H, W), above 0 where it cannot be told
    whether it is one; None: nowhere.
    """

    mask: Bytes
    to_clean: bool
    shadow: Bytes | None = None
    brightness: Floats | None = None
    unknown: Bytes | None = None


class PackedRaw:
    """A raw mask in an eighth of its bytes."""

    def __init__(self, raw: RawMask) -> None:
        self._mask, self._to_clean = PackedMask(raw.mask), raw.to_clean
        self._shadow = None if raw.shadow is None else PackedMask(raw.shadow)
        self._brightness = raw.brightness

    def unpacked(self) -> RawMask:
        shadow = None if self._shadow is None else self._shadow.unpacked()
        return RawMask(self._mask.unpacked(), self._to_clean, shadow, self._brightness)


class EvidenceMaker:
    """Makes the evidence of any frame of a session's footage."""

    def __init__(
        self,
        cameras: tuple[Camera, ...],
        footage: Footage,
        backgrounds: Backgrounds,
        settings: EvidenceSettings,
        edge_kind: str = "proximity",
        executor: Executor | None = None,
        *,
        with_empty: bool = False,
    ) -> None:
        """cameras : in the order of the views. edge_kind : one of EDGE_KINDS. executor : threads to use. with_empty :
        whether views have what the camera sees without the subject.
        """
        if edge_kind not in EDGE_KINDS:
            raise ValueError(edge_kind)
        cv2.setNumThreads(1)
        self.cameras = tuple(camera.name for camera in cameras)
        self.settings, self.edge_kind = settings, edge_kind
        self.footage, self._backgrounds, self._executor = footage, backgrounds, executor
        self.hull_of_pixels = edge_kind == "hull" and self._from_pixels()
        self._filmed_by, self._with_empty = {camera.name: camera for camera in cameras}, with_empty
        self._cells = LRUCache[tuple[str, int], Cells](KEPT_CELLS)

    def release(self, camera: str) -> None:
        """Give a camera's video and background models back; they are opened again when needed."""
        self.footage.release(camera)
        self._backgrounds.release(camera)

    def evidence(self, frame: int) -> FrameEvidence:
        """The evidence of a frame, views in the order of the cameras. Raises FootageError, NotFoundError."""
        if self.hull_of_pixels:
            return FrameEvidence(
                frame, tuple(self._each(lambda camera: self.view(camera, frame), self.cameras))
            )

        def raw_mask(camera: str) -> RawMask:
            with span("decode", frame):
                picture = self.footage.picture(camera, frame)
            with span("mask", frame):
                return self.raw_mask(camera, frame, picture)

        raw = dict(zip(self.cameras, self._each(raw_mask, self.cameras), strict=True))
        with span("floor shadows", frame):
            raw = self.without_false_shadows(raw)

        def finished(camera: str) -> ViewEvidence:
            return self._view_of(camera, frame, raw[camera])

        return FrameEvidence(frame, tuple(self._each(finished, self.cameras)))

    def view(self, camera: str, frame: int) -> ViewEvidence:
        """One camera's evidence of a frame, as in that of all."""
        if self.hull_of_pixels:
            with span("decode", frame):
                picture = self.footage.picture(camera, frame)
            nothing = _nothing(picture.shape[0], picture.shape[1])
            background = self._backgrounds.yuv(camera, self.settings.hull_noise)
            return ViewEvidence(camera, picture, nothing, nothing, background)
        return self._view_of(camera, frame, self._raw_as_of_all(camera, frame))

    def mask(self, camera: str, frame: int) -> Bytes:
        """(H, W) 0 or 255: one camera's mask of a frame, as in the evidence of all."""
        return self.finished(camera, self._raw_as_of_all(camera, frame))[0]

    def _raw_as_of_all(self, camera: str, frame: int) -> RawMask:
        raw = self.raw_mask(camera, frame, self.footage.picture(camera, frame))
        if raw.shadow is not None and self._tests_floor():
            self.note(camera, frame, raw)
            present = [name for name in self.cameras if name not in self.footage.absent(frame)]
            for other in present:
                if (other, frame) not in self._cells:
                    self.note(other, frame)
            seen = {name: self._cells[name, frame] for name in present}
            raw = self._without({camera: raw}, seen)[camera]
        return raw

    def _view_of(self, camera: str, frame: int, raw: RawMask) -> ViewEvidence:
        with span("mask", frame):
            mask, unknown = self.finished(camera, raw)
        given = self._hidden(camera, frame)
        if given is not None:
            unknown = with_things_in_front(mask, given, self.in_front(camera))
        view = self.of_mask(camera, frame, mask, unknown)
        if self._with_empty:
            view = replace(view, empty=self._backgrounds.empty(camera))
        if raw.shadow is None:
            return view
        return replace(view, shadow=_not_excluded(raw.shadow, self._backgrounds.region("exclusions", camera)))

    def views(
        self, cameras: Sequence[str], frames: Sequence[int], progress: Callable[[int, int], None]
    ) -> Iterator[tuple[str, int, ViewEvidence]]:
        """Camera, frame and evidence of some views, camera by camera: only one camera's pictures are held. progress :
        pictures done and their number.
        """
        looks = [*self.cameras, *cameras] if self._tests_floor() and not self.hull_of_pixels else [*cameras]
        noted, total = len(looks) - len(cameras), len(looks) * len(frames)
        for place, camera in enumerate(looks):
            for number, frame in enumerate(frames):
                progress(place * len(frames) + number, total)
                if place >= noted:
                    yield camera, frame, self.view(camera, frame)
                elif camera not in self.footage.absent(frame):
                    self.note(camera, frame)
            self.release(camera)

    def note(self, camera: str, frame: int, raw: RawMask | None = None) -> None:
        """Keep what the other cameras' masks of the frame need of a camera, so that these can be made without it."""
        if self._tests_floor():
            raw = raw or self.raw_mask(camera, frame, self.footage.picture(camera, frame))
            self._cells[camera, frame] = cells_of(raw.mask, raw.shadow, raw.brightness)

    def without_false_shadows(self, raw: Mapping[str, RawMask]) -> dict[str, RawMask]:
        """A frame's masks by camera, with what looked like shadows but cannot be any on the floor, and where that
        cannot be told.
        """
        if not self._tests_floor() or all(one.shadow is None for one in raw.values()):
            return dict(raw)
        return self._without(
            raw, {name: cells_of(one.mask, one.shadow, one.brightness) for name, one in raw.items()}
        )

    def _tests_floor(self) -> bool:
        return self.settings.mask_shadow_test and self.settings.mask_shadow_floor

    def _without(self, raw: Mapping[str, RawMask], seen: Mapping[str, Cells]) -> dict[str, RawMask]:
        """The same of some masks. seen : cells of all cameras."""
        cameras = tuple(self._filmed_by[name] for name in seen)
        tells = floor_shadows(cameras)
        # Where pictures and calibration differ in size, no place is known.
        if not tells.usable or any(
            one.mask.shape != (self._filmed_by[name].height, self._filmed_by[name].width)
            for name, one in raw.items()
        ):
            return dict(raw)
        return with_shadows_decided(raw, seen, tells, self.settings)

    def _hidden(self, camera: str, frame: int) -> Bytes | None:
        given = self.settings.background_model in ("auto", "mask")
        return self.footage.hidden(camera, frame) if given else None

    def _each(self, make: Callable[[_T], _U], items: Iterable[_T]) -> list[_U]:
        return (
            [make(one) for one in items] if self._executor is None else list(self._executor.map(make, items))
        )

    def of_mask(self, camera: str, frame: int, mask: Bytes, unknown: Bytes | None) -> ViewEvidence:
        """One camera's evidence with a given mask (H, W), 0 or 255. unknown : as in `ViewEvidence`."""
        picture = self.footage.picture(camera, frame)
        with span("edges", frame):
            around = mask if unknown is None else mask | unknown
            return ViewEvidence(camera, picture, mask, self._edges(picture, around), unknown=unknown)

    def _from_pixels(self) -> bool:
        """Whether a hull is carved from pixels: by the knob; "auto": if all cameras have an empty view, none masks."""
        if self.settings.hull_evidence != "auto":
            return self.settings.hull_evidence == "pixels"
        return self.settings.background_model in ("auto", "gaussian") and all(
            self.footage.background_path(camera) is not None
            and not self.footage.has_masks(camera)
            and all(self._backgrounds.region(kind, camera) is None for kind in REGIONS)
            for camera in self.cameras
        )

    def raw_mask(self, camera: str, frame: int, picture: Bytes) -> RawMask:
        """Before any clean-up: the camera's mask file, given with the footage or made in set-up, else what brightness
        and colour or the difference from a background model say.
        """
        choice = self.settings.background_model
        given = self.footage.has_masks(camera)
        if choice == "mask" and not given:
            raise FootageError(
                f"Camera {camera} has no masks.", "Choose another background model, such as 'gaussian'."
            )
        if choice == "mask" or (choice == "auto" and given):
            mask = self.footage.mask(camera, frame)
            if mask is not None:
                return RawMask(mask, self.settings.mask_clean_given)
        if choice == "threshold":
            return RawMask(between_thresholds(picture, self.settings), True)
        kind: FittedKind = KINDS.get(choice, "gaussian")
        model = self._backgrounds.model(camera, kind)
        found = model.foreground(picture, self.settings)
        shadow = found.shadow if self.settings.mask_shadow_test else None
        return RawMask(found.mask, True, shadow, found.brightness)

    def finished(self, camera: str, raw: RawMask) -> tuple[Bytes, Bytes | None]:
        """A camera's raw mask and what is unknown of it, as by `finished`, things in front of the subject too."""
        mask, unknown = finished(raw, self.settings, self._backgrounds.region("exclusions", camera))
        return mask, with_things_in_front(mask, unknown, self.in_front(camera))

    def in_front(self, camera: str) -> Bytes | None:
        """(H, W) 255 where a thing stands in front of the subject's place; None without any."""
        return self._backgrounds.region("in_front", camera)

    def _edges(self, picture: Bytes, mask: Bytes) -> Bytes:
        """The edge map that the weighting uses."""
        if self.edge_kind == "bodytrack":
            return bodytrack_edges(picture)
        if self.edge_kind in ("none", "hull"):
            return _nothing(picture.shape[0], picture.shape[1])
        knobs = self.settings
        return proximity_edges(
            picture, knobs.edge_threshold, knobs.edge_smoothing, mask, knobs.edge_near_mask
        )


def with_shadows_decided(
    raw: Mapping[str, RawMask], seen: Mapping[str, Cells], tells: FloorShadows, settings: EvidenceSettings
) -> dict[str, RawMask]:
    """Raw masks by camera with what looks like a shadow and is none, and with what is unknown. seen : the cells of all
    cameras of `tells`, in their order.
    """
    told = tells.unexplained(tuple(seen.values()), settings.mask_shadow_alike, settings.mask_shadow_doubt)
    cells = dict(zip(seen, told, strict=True))

    def decided(name: str, one: RawMask, shadow: Bytes) -> RawMask:
        size = seen[name].size
        body, unknown = (pixels_of(shadow, cells[name] == kind, size) for kind in (SUBJECT, UNKNOWN))
        return replace(one, mask=one.mask if body is None else one.mask | body, unknown=unknown)

    return {name: one if one.shadow is None else decided(name, one, one.shadow) for name, one in raw.items()}


def finished(
    raw: RawMask, settings: EvidenceSettings, excluded: Bytes | None = None
) -> tuple[Bytes, Bytes | None]:
    """(H, W) 0 or 255: a raw mask, cleaned if `to_clean`; and, as in `ViewEvidence`, where it is unknown whether a
    pixel belongs to it. What is unknown holds the pieces of a mask together. excluded : (H, W) above 0 where nothing is
    the subject's.
    """

    def tidy(mask: Bytes, knobs: EvidenceSettings) -> Bytes:
        # Before cleaning too: what does not count is not the largest piece.
        counted = _not_excluded(mask, excluded)
        return _not_excluded(cleaned(counted, knobs), excluded) if raw.to_clean else counted

    if raw.unknown is None or not raw.unknown.any():
        return tidy(raw.mask, settings), None
    whole = tidy(raw.mask | raw.unknown, settings)
    mask = whole & tidy(raw.mask, replace(settings, mask_min_component=0, mask_keep_components=0))
    unknown = whole - mask
    return mask, unknown if unknown.any() else None


def with_things_in_front(mask: Bytes, unknown: Bytes | None, in_front: Bytes | None) -> Bytes | None:
    """(H, W) what is unknown, with what a thing in front may hide of the subject; None where nothing is."""
    if in_front is None:
        return unknown
    behind = in_front & ~mask
    return behind if unknown is None else unknown | behind


def _not_excluded(mask: Bytes, excluded: Bytes | None) -> Bytes:
    return mask if excluded is None else np.where(excluded > 0, np.uint8(0), mask)


@functools.lru_cache(maxsize=16)
def _nothing(height: int, width: int) -> Bytes:
    """An empty map, shared and read-only."""
    empty = np.zeros((height, width), np.uint8)
    empty.setflags(write=False)
    return empty
