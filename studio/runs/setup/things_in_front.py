"""Things that stand in front of the subject's place: a table, a pole, a plant. Found in the masks, before any run.

What such a thing hides is no background, it is unknown; a mask says background. Two witnesses, each in one camera
where the masks of all others agree that something is there:

- a gap within the silhouette, filled by the other cameras' hull: a pole. A gap between limbs looks alike, but goes with
  the subject; it counts where the subject passed, so far that the place was hidden by several parts of it;
- a place that all other cameras see, without which the rest of two silhouettes or more stays unexplained: a table that
  hides both legs.

A place counts that several frames say, and that never shows silhouette. What one round finds lets the next see more:
where two cameras have a thing in front, none of them agrees with all others at first. What the subject never came
behind is not found, and need not be.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.scale import scale_of
from studio.evidence.frame_evidence import ViewEvidence
from studio.evidence.masks import cleaned, disc, reduced, uncleaned
from studio.evidence.settings import EvidenceSettings
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.reconstruction import Reconstructor
from studio.evidence.volume.tracking_space import Box
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import nearest_pixels
from studio.foundations.progress import Progress, no_progress
from studio.runs.setup.mask_quality import without
from studio.runs.setup.person_hull import covered, large_hull, person_box, spread_frames
from studio.runs.setup.session_settings import masks_of
from studio.sessions.session import Session

FEWEST_CAMERAS = 3
FRAMES, SIDE = 40, 240
"""Evenly spread, and the least shorter side (pixels) of the masks that are compared."""
CARVING = HullSettings(hull_depth=6, hull_edge_share=0.5, hull_least_views=2)
ROUNDS = 3
LEAST_FRAMES = 4
"""That say that something is there."""
SHOWN, SHOWN_OF_SAID = 0.03, 0.1
"""Shares of all frames, and of those that say so, in which a place may show silhouette: masks are noisy."""
PASSED = 0.25
"""Of the root of the silhouette's area, about half a standing person's breadth: how far the subject must have moved
while a place was a gap in it."""
WIDEST_GAP = 0.25
"""Of that root: half the breadth of a gap."""
LEAST_SHARE = 0.015
"""Of a silhouette's area (median): smaller finds are noise."""
GROWN = 0.15
"""Of the root of a silhouette's area: how far a find grows into what never shows silhouette. The subject comes behind
other parts of the thing in the frames that were not looked at; elsewhere it costs nothing."""
NEAR = np.ones((3, 3), np.uint8)
SMALL = np.ones((2, 2), np.uint8)

Flags = NDArray[np.bool_]


def find_things_in_front(
    session: Session, painted: Collection[str] = (), progress: Progress = no_progress
) -> dict[str, Bytes]:
    """(H, W) 255 where a thing stands in front, of each camera in which one is found in the session's masks.

    painted : cameras whose things were painted by hand; in these none are looked for. What was found before is
    forgotten. Nothing is found with fewer than three cameras. Raises FootageError.
    """
    cameras = session.cameras()
    if len(cameras) < FEWEST_CAMERAS:
        return {}
    small = {camera.name: camera.reduced(SIDE) for camera in cameras}
    frames = spread_frames(session.manifest.frame_count, FRAMES)
    seen: dict[int, list[Bytes]] = {frame: [] for frame in frames}

    def report(done: int, total: int) -> None:
        # Masks are made first, then compared: about half the time each.
        progress("looking for things in front", done, 2 * total)

    nothing = {name: np.zeros((lens.height, lens.width), np.uint8) for name, lens in small.items()}
    with masks_of(session) as maker:
        before = {name: maker.in_front(name) for name in small}
        for name, frame, view in maker.views(tuple(small), frames, report):
            seen[frame].append(reduced(_possible(view, before[name]), small[name]))
    known = {name: reduced(one, small[name]) for name in painted if (one := before[name]) is not None}
    found = things_in_front(
        tuple(small.values()),
        list(seen.values()),
        [known.get(name, none) for name, none in nothing.items()],
        scale_of(session.body()),
        progress,
    )
    return {
        camera.name: _enlarged(thing, camera)
        for camera, thing in zip(cameras, found, strict=True)
        if thing.any() and camera.name not in painted
    }


def things_in_front(
    cameras: tuple[Camera, ...],
    seen: Sequence[Sequence[Bytes]],
    known: Sequence[Bytes],
    scale: float = 1.0,
    progress: Progress = no_progress,
) -> list[Bytes]:
    """(H, W) 255 where a thing stands in front of the subject's place, one picture a camera.

    seen : masks (H, W) of all cameras, frame by frame, with all that may be the subject's. known : things already
    known, of each camera; they are not found again. scale : of the body (`scale_of`).
    """
    spaces = [_space(masks, cameras, scale) for masks in seen]
    looked = [(masks, space) for masks, space in zip(seen, spaces, strict=True) if space is not None]
    if not looked:
        return [np.zeros_like(one) for one in known]
    shown = [
        np.sum([cv2.dilate(masks[at], NEAR) > 0 for masks, _ in looked], axis=0) for at in range(len(cameras))
    ]
    areas = [
        float(np.median([np.count_nonzero(masks[at]) for masks, _ in looked])) for at in range(len(cameras))
    ]
    hidden, total = list(known), ROUNDS * len(looked)
    for turn in range(ROUNDS):
        tallies = [_Tally.empty(one.shape) for one in known]
        for number, (masks, space) in enumerate(looked):
            progress("looking for things in front", total + turn * len(looked) + number, 2 * total)
            frame = _Frame(cameras, masks, hidden, Reconstructor(cameras, space, CARVING))
            for at, tally in enumerate(tallies):
                frame.count(at, tally)
        hidden = [
            before | tally.things(times, len(looked))
            for before, tally, times in zip(hidden, tallies, shown, strict=True)
        ]
    return [
        _grown(_large(now & ~before, LEAST_SHARE * area), times > SHOWN * len(looked), GROWN * area**0.5)
        for now, before, times, area in zip(hidden, known, shown, areas, strict=True)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Tally:
    """What the frames of a round say of one camera, by pixel.

    said : frames that say a thing is in front. needed : those of them that need it for two other silhouettes. first,
    last : (H, W, 2) least and greatest place of the silhouette's middle in those that see a gap. sizes : roots of the
    silhouettes' areas.
    """

    said: NDArray[np.int32]
    needed: NDArray[np.int32]
    first: NDArray[np.float32]
    last: NDArray[np.float32]
    sizes: list[float]

    @classmethod
    def empty(cls, shape: tuple[int, ...]) -> "_Tally":
        far = np.full((*shape, 2), np.inf, np.float32)
        return cls(np.zeros(shape, np.int32), np.zeros(shape, np.int32), far, -far, [])

    def add(self, gap: Flags, needed: Flags, silhouette: Bytes) -> None:
        """One frame. silhouette : of the others' hull."""
        rows, columns = np.nonzero(silhouette)
        if not len(rows):
            return
        middle = np.array([columns.mean(), rows.mean()], np.float32)
        self.sizes.append(float(np.sqrt(len(rows))))
        self.first[gap] = np.minimum(self.first[gap], middle)
        self.last[gap] = np.maximum(self.last[gap], middle)
        self.needed[needed] += 1
        self.said[gap | needed] += 1

    def things(self, shown: Array, frames: int) -> Bytes:
        """shown : (H, W) in how many of the frames there is silhouette."""
        if not self.sizes:
            return np.zeros(self.said.shape, np.uint8)
        passed = np.hypot(*np.moveaxis(self.last - self.first, 2, 0)) > PASSED * np.median(self.sizes)
        said = (self.said >= LEAST_FRAMES) & (passed | (self.needed >= LEAST_FRAMES))
        there = said & (shown <= SHOWN * frames) & (shown <= SHOWN_OF_SAID * self.said)
        opened = cv2.morphologyEx(there.astype(np.uint8) * 255, cv2.MORPH_OPEN, SMALL)
        return np.asarray(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, NEAR), dtype=np.uint8)


class _Frame:
    """The masks of one frame, and what they leave unexplained."""

    def __init__(
        self,
        cameras: tuple[Camera, ...],
        masks: Sequence[Bytes],
        hidden: Sequence[Bytes],
        carver: Reconstructor,
    ) -> None:
        """hidden : of each camera, where things are in front by now."""
        self._cameras, self._hidden, self._carver = cameras, hidden, carver
        self._open = [mask | one for mask, one in zip(masks, hidden, strict=True)]
        agreed = large_hull(carver, [_wider(mask) for mask in self._open])
        self._unexplained = [
            cv2.morphologyEx(mask & ~_wider(covered(agreed, camera)), cv2.MORPH_OPEN, SMALL)
            for mask, camera in zip(masks, cameras, strict=True)
        ]
        self._masks = masks

    def count(self, at: int, tally: _Tally) -> None:
        """Add what the other cameras say of one."""
        hull = large_hull(self._carver, without(self._open, at))
        if hull is None:
            return
        silhouette = covered(hull, self._cameras[at])
        gap = (self._gaps(at) > 0) & (cv2.erode(silhouette, NEAR) > 0)
        needed = covered(chosen_voxels(hull, self._needed(hull, at)), self._cameras[at]) > 0
        tally.add(gap, needed, silhouette)

    def _gaps(self, at: int) -> Bytes:
        """(H, W) 255 in gaps of a silhouette, and between its parts."""
        mask, reach = self._open[at], max(2, int(WIDEST_GAP * np.sqrt(np.count_nonzero(self._masks[at]))))
        wide = np.pad(mask, reach)
        closed = np.asarray(cv2.morphologyEx(wide, cv2.MORPH_CLOSE, disc(reach)), dtype=np.uint8)
        return closed[reach:-reach, reach:-reach] & ~_wider(mask)

    def _needed(self, hull: Hull, at: int) -> Flags:
        """Of a hull's voxels, those that all other cameras see as silhouette which is unexplained without them: all
        that can, and two at least.
        """
        needing, able = np.zeros(len(hull.centres), np.int64), np.zeros(len(hull.centres), np.int64)
        for other, camera in enumerate(self._cameras):
            if other != at:
                pixels, inside = nearest_pixels(camera, hull.centres)
                column, row = pixels[inside].T
                needing[inside] += self._unexplained[other][row, column] > 0
                able[inside] += self._hidden[other][row, column] == 0
        return (needing >= 2) & (needing >= able)


def _space(masks: Sequence[Bytes], cameras: tuple[Camera, ...], scale: float) -> Box | None:
    """A box around what all cameras but any one agree on."""
    boxes = [person_box(without(masks, at), cameras, scale) for at in range(len(cameras))]
    kept = [box for box in boxes if box is not None]
    if not kept:
        return None
    return Box(np.min([box.lower for box in kept], axis=0), np.max([box.upper for box in kept], axis=0))


def _possible(view: ViewEvidence, known: Bytes | None) -> Bytes:
    """(H, W) 255 where a view may show the subject, not where a known thing hides it."""
    if view.unknown is None:
        return view.mask
    return view.mask | (view.unknown if known is None else view.unknown & ~known)


def _wider(mask: Bytes) -> Bytes:
    return np.asarray(cv2.dilate(mask, NEAR), dtype=np.uint8)


def _large(mask: Bytes, least: float) -> Bytes:
    """The pieces of a mask with more pixels than `least`."""
    return cleaned(mask, replace(uncleaned(EvidenceSettings()), mask_min_component=int(least) + 1))


def _grown(mask: Bytes, shown: Flags, by: float) -> Bytes:
    """The mask and what lies near it without showing silhouette."""
    hidden = np.where(shown, np.uint8(0), np.uint8(255))
    for _ in range(round(by)):
        mask = _wider(mask) & hidden | mask
    return mask


def _enlarged(mask: Bytes, camera: Camera) -> Bytes:
    size = (camera.width, camera.height)
    return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
