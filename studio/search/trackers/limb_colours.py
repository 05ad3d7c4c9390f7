"""The colours of limbs, learnt where a limb shows by itself and used where silhouettes say nothing.

A hand before a trouser leg is in no silhouette. The picture's colours say whether it is there: at the points where a
limb lies in front of another, they are likelier its own or the other's. The sum of the logarithms of both
probabilities' ratio is the limb's *gain*. A limb that lies before nothing, or before one of its own colours, gains
nothing; what lies outside the silhouettes says nothing here.

Colours are learnt of limbs whose own projection is explained by what changed (`limbs_elsewhere`), where no other limb
lies and in the middle of their breadth: a limb that is lost before the trunk lies nowhere by itself, and does not teach
the trunk's colours as its own. Twins share theirs. Counts by colour fade from frame to frame; they are part of the
frame's state, so that a resumed run, or a frame that is searched again, has them.

Chosen on the two clips of others with a camera left out, and on four clips of the choosing half. A gain far below what
is expected does not name a lost limb: arms beside the head have it, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.mirroring import name_twins
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Bytes, Mask
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.trackers.agreement import GRID_MM, limb_names
from studio.search.trackers.limb_colour_kernels import NOTHING, add_gains, front_limbs
from studio.search.trackers.limb_places import CHANGED
from studio.search.trackers.limbs_elsewhere import SURELY_EXPLAINED, Change, Elsewhere
from studio.search.trackers.refinement import mm_at
from studio.search.trackers.tracker import MOVED

COLOURS = f"{MOVED}colours"
BRIGHT, TINTS = 6, 12
"""Steps of brightness, and of both differences of colours."""
COUNT = BRIGHT * TINTS * TINTS
WIDEST = 0.36
"""Range of the differences of two colours, beside their sum, that are told from larger ones."""
DARK = 30.0
"""Added to the sum of the three colours (of 765): below it their differences are noise."""
MIDDLE, WITHIN = 0.6, 0.8
"""Shares of a limb's breadth in which its colours are learnt, and in which they are compared."""
FADING = 0.97
"""Share of the counts that is left in the next frame."""
FEWEST = 300.0
"""Points, of all views and frames, from which colours are known."""
FLOOR = 2e-3
"""Added to each probability: of a colour that a limb never had."""
MOST = 2.0
"""Largest logarithm of a single point's ratio."""

Codes = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ColouredView:
    """codes : (h, w) colours of a grid's points (`code_of`), NOTHING outside the silhouette. step : pixels between
    points.
    """

    codes: Codes
    step: int


class Gain(NamedTuple):
    """Of a limb in N poses. gain : (N,) its gain. expected : (N,) what it gains at the points at which it lies in front
    of another, of all views, where it is there.
    """

    gain: Array
    expected: Array


@dataclass(frozen=True, slots=True, eq=False)
class KnownColours:
    """What was learnt. kinds : (L,) number of each drawn limb's colours, NOTHING where too few were seen. logs, usual :
    as of `_logarithms`.
    """

    kinds: Codes
    logs: Array
    usual: Array


class LimbColours:
    """Compares limbs of a body with their colours in some cameras; immutable."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self._body, self._cameras = body, cameras
        names, drawn = limb_names(body), [limb.name for limb in body.drawn]
        self._limbs = tuple(dict.fromkeys(names))
        self._owners = np.array([self._limbs.index(name) for name in names])
        _, self._kinds = np.unique(np.minimum(np.arange(len(drawn)), name_twins(drawn)), return_inverse=True)
        """(L,) number of each drawn limb's colours: twins have the same."""
        self._radii = np.array([(limb.radius_start, limb.radius_end) for limb in body.drawn])

    def views(self, pose: Array, changed: Sequence[Change]) -> list[ColouredView]:
        """The colours of a frame's pictures, one a camera, on a grid as fine as a pose (D,) needs it; [] without
        pictures.
        """
        if not all(view.picture.size for view in changed):
            return []
        sizes = mm_at(self._body, self._cameras, pose)
        return [_coloured(view, max(1, round(GRID_MM / mm))) for view, mm in zip(changed, sizes, strict=True)]

    def known(self, memory: Mapping[str, Array]) -> KnownColours | None:
        """The colours that are known of limbs; None before any were learnt. memory : at the frame's start."""
        counts = memory.get(COLOURS)
        if counts is None:
            return None
        enough = counts.sum(axis=1) >= FEWEST
        return KnownColours(np.where(enough[self._kinds], self._kinds, NOTHING), *_logarithms(counts))

    def gains(
        self, poses: Array, limb: str, views: Sequence[ColouredView], known: KnownColours | None
    ) -> Gain:
        """The gain of a limb in poses (N, D) that differ in it alone; 0 where its colours are not known."""
        found, own = Gain(np.zeros(len(poses)), np.zeros(len(poses))), self._owners == self._limbs.index(limb)
        if known is None or not views or not (known.kinds[own] != NOTHING).any():
            return found
        kinds, logs, usual = known.kinds, known.logs, known.usual
        ends = limb_ends(self._body, poses)
        for camera, view in zip(self._cameras, views, strict=True):
            front, depths, _ = _front_of(self._parts(camera, ends[:1])[0], self._owners, own, view, 1.0)
            moving = self._parts(camera, ends[:, own], own)
            seen = view.codes, front, depths
            add_gains(moving, kinds[own], *seen, kinds, logs, usual, view.step, WITHIN, MOST, *found)
        return found

    def learnt(
        self,
        pose: Array,
        views: Sequence[ColouredView],
        elsewhere: Mapping[str, Elsewhere],
        memory: Mapping[str, Array],
    ) -> dict[str, Array]:
        """What is to be remembered of colours after a frame; nothing new without pictures. pose : (D,) its result.
        elsewhere : what it explains, by limb (`LimbsElsewhere.of`). memory : at the frame's start.
        """
        if not views:
            return {}
        counts = FADING * memory.get(COLOURS, np.zeros((int(self._kinds.max()) + 1, COUNT)))
        shows = {limb: one.explained >= SURELY_EXPLAINED for limb, one in elsewhere.items()}
        teaches = np.array([shows.get(limb, True) for limb in self._limbs])[self._owners]
        ends, everything = limb_ends(self._body, pose[None]), np.zeros(len(self._owners), np.bool_)
        for camera, view in zip(self._cameras, views, strict=True):
            parts = self._parts(camera, ends)[0]
            whole, _, alone = _front_of(parts, self._owners, everything, view, 1.0)
            front, _, _ = _front_of(parts, self._owners, everything, view, MIDDLE)
            taught = alone & (front == whole) & (front != NOTHING) & (view.codes != NOTHING) & teaches[front]
            np.add.at(counts, (self._kinds[front[taught]], view.codes[taught]), 1.0)
        return {COLOURS: counts}

    def _parts(self, camera: Camera, ends: Array, which: Mask | slice = slice(None)) -> Array:
        """(N, M, 8) as of `front_limbs`, of the ends (N, M, 2, 3) of some drawn limbs."""
        radii = self._radii[which]
        pixels = project(camera, ends.reshape(-1, 3))[0].reshape(*ends.shape[:2], 4)
        away = ends @ camera.rotation[2] + camera.translation[2]
        breadths = float(camera.matrix[0, 0]) * radii / np.maximum(away, 1.0)
        return np.concatenate([pixels, away - radii, breadths], axis=2)


def code_of(colours: Bytes) -> Codes:
    """(...) a number below COUNT for each colour (..., 3), BGR."""
    blue, green, red = (colours[..., channel].astype(np.int64) for channel in range(3))
    total = blue + green + red
    code = np.minimum(total * BRIGHT // 766, BRIGHT - 1)
    for difference in (red - green, green - blue):
        share = difference / (total + DARK)
        code = code * TINTS + np.clip((share / WIDEST + 0.5) * TINTS, 0, TINTS - 1).astype(np.int64)
    return code


def _coloured(view: Change, step: int) -> ColouredView:
    colours: Bytes = view.picture[::step, ::step]
    rows, columns = (
        np.minimum(step * np.arange(points, dtype=np.int64) // view.size, cells - 1)
        for points, cells in ((len(colours), len(view.kinds)), (colours.shape[1], view.kinds.shape[1]))
    )
    kinds: Bytes = view.kinds[rows][:, columns]
    codes, shows = np.full(colours.shape[:2], NOTHING), np.nonzero(kinds == CHANGED)
    codes[shows] = code_of(colours[shows])
    return ColouredView(codes, step)


def _front_of(
    parts: Array, owners: NDArray[np.int64], left_out: Mask, view: ColouredView, breadth: float
) -> tuple[Codes, Array, Mask]:
    """What `front_limbs` fills in."""
    shape = view.codes.shape
    front, depths, alone = np.empty(shape, np.int64), np.empty(shape), np.empty(shape, np.bool_)
    front_limbs(parts, owners, left_out, view.step, breadth, front, depths, alone)
    return front, depths, alone


def _logarithms(counts: Array) -> tuple[Array, Array]:
    """(K, COUNT) logarithms of each colour's probability, and (K, K) the mean of what a point of the first kind gains
    before the second. counts : (K, COUNT).
    """
    smooth: Array = counts.reshape(-1, BRIGHT, TINTS, TINTS)
    for axis in (1, 2, 3):
        wide: Array = scipy.ndimage.convolve1d(smooth, (0.25, 0.5, 0.25), axis=axis, mode="nearest")
        smooth = wide
    shares = smooth.reshape(counts.shape) / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    logs = np.log(shares + FLOOR)
    usual = np.stack([(shares * np.clip(logs - other, -MOST, MOST)).sum(axis=1) for other in logs], axis=1)
    return logs, usual
