"""One frame's evidence: pictures, masks and edge maps of all cameras.

A maker is cheap to build (a changed knob builds another one); the fitted background models are
expensive, so they are shared in `Backgrounds`. Cameras are independent: with an executor of two threads a frame
takes half the time.
"""

import functools
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from studio.evidence.backgrounds import Backgrounds, FittedKind
from studio.evidence.edges import bodytrack_edges, proximity_edges
from studio.evidence.frame_evidence import EDGE_KINDS, FrameEvidence, ViewEvidence
from studio.evidence.masks import cleaned
from studio.evidence.settings import EvidenceSettings
from studio.evidence.threshold import between_thresholds
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.tracing import span

KINDS: dict[str, FittedKind] = {"median": "median", "combined": "combined", "mog2": "mog2", "knn": "knn"}
"""Models by the knob's value; all others are Gaussians."""


@dataclass(frozen=True, slots=True, eq=False)
class RawMask:
    """A camera's mask (H, W), 0 or 255, before its clean-up. to_clean : whether it is to be cleaned."""

    mask: Bytes
    to_clean: bool


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
    ) -> None:
        """cameras : in the order of the views. edge_kind : one of EDGE_KINDS. executor : threads to use."""
        if edge_kind not in EDGE_KINDS:
            raise ValueError(edge_kind)
        cv2.setNumThreads(1)
        self.cameras = tuple(camera.name for camera in cameras)
        self.settings, self.edge_kind = settings, edge_kind
        self.footage, self._backgrounds, self._executor = footage, backgrounds, executor
        self.hull_of_pixels = edge_kind == "hull" and self._from_pixels()

    def release(self, camera: str) -> None:
        """Give a camera's video and background models back; they are opened again when needed."""
        self.footage.release(camera)
        self._backgrounds.release(camera)

    def evidence(self, frame: int) -> FrameEvidence:
        """The evidence of a frame, views in the order of the cameras. Raises FootageError, NotFoundError."""
        if self._executor is None:
            views = [self.view(camera, frame) for camera in self.cameras]
        else:
            views = list(self._executor.map(partial(self.view, frame=frame), self.cameras))
        return FrameEvidence(frame, tuple(views))

    def view(self, camera: str, frame: int) -> ViewEvidence:
        with span("decode", frame):
            picture = self.footage.picture(camera, frame)
        if self.hull_of_pixels:
            nothing = _nothing(picture.shape[0], picture.shape[1])
            background = self._backgrounds.yuv(camera, self.settings.hull_noise)
            return ViewEvidence(camera, picture, nothing, nothing, background)
        with span("mask", frame):
            mask = self.finished_mask(camera, self.raw_mask(camera, frame, picture))
        given = self.settings.background_model in ("auto", "mask")
        return self.of_mask(camera, frame, mask, self.footage.hidden(camera, frame) if given else None)

    def of_mask(self, camera: str, frame: int, mask: Bytes, hidden: Bytes | None) -> ViewEvidence:
        """One camera's evidence with a given mask (H, W), 0 or 255. hidden : as in `ViewEvidence`."""
        picture = self.footage.picture(camera, frame)
        with span("edges", frame):
            return ViewEvidence(camera, picture, mask, self._edges(picture, mask), hidden=hidden)

    def _from_pixels(self) -> bool:
        """Whether a hull is carved from pixels: by the knob; "auto": if all cameras have an empty view, none masks."""
        if self.settings.hull_evidence != "auto":
            return self.settings.hull_evidence == "pixels"
        return self.settings.background_model in ("auto", "gaussian") and all(
            self.footage.background_path(camera) is not None
            and not self.footage.has_masks(camera)
            and self._backgrounds.exclusion(camera) is None
            for camera in self.cameras
        )

    def raw_mask(self, camera: str, frame: int, picture: Bytes) -> RawMask:
        """The mask that came with the data, or the difference from a background model, before any clean-up."""
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
        return RawMask(model.foreground(picture, self.settings), True)

    def finished_mask(self, camera: str, raw: RawMask) -> Bytes:
        """(H, W) 0 or 255: a raw mask, cleaned if `to_clean`, without excluded areas."""
        excluded = self._backgrounds.exclusion(camera)

        def without(mask: Bytes) -> Bytes:
            return mask if excluded is None else np.where(excluded > 0, np.uint8(0), mask)

        # Before cleaning too: what does not count is not the largest piece.
        return without(cleaned(without(raw.mask), self.settings)) if raw.to_clean else without(raw.mask)

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


@functools.lru_cache(maxsize=16)
def _nothing(height: int, width: int) -> Bytes:
    """An empty map, shared and read-only."""
    empty = np.zeros((height, width), np.uint8)
    empty.setflags(write=False)
    return empty
