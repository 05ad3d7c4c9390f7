"""Where else a limb may be: a place within its reach that changed in all views, and that the pose leaves bare in some.

The silhouettes cannot witness against a limb that they lack, as where the shadow test has taken bare arms for the
floor's shadow. What differs from the background at all, shadows too, still has them. A grid of points is projected into
all views: a point within a limb's reach that lies on changed cells in every view that sees it, and in two views or more
far from all limbs of the pose, is something that the pose does not explain. Where no limb's joints let it lie
(`limb_reach`) none is looked for: behind a hand the forearm goes on that the body has not. A shadow on the floor is
none: only points well above the floor count. Of the limbs in whose reach such points lie those are elsewhere whose own
projection explains little: a limb that is where it seems covers changed cells that no other limb covers, and a lost one
lies outside them, or on other limbs.

The other way round, a limb that explains enough by itself is not missed, whatever silhouettes the pose leaves bare
beside it: a shadow under a runner's foot. Where all do none is: a shadow on a stool is changed in all views, as is the
stool that somebody pushed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, Limb
from studio.body.scale import scale_of
from studio.evidence.cells import cell_size, numbers_of
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array, Bytes, Indices
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.trackers.agreement import Agreement, Disagreement, limb_names, without_bare
from studio.search.trackers.hidden_areas import FRAMES
from studio.search.trackers.hidden_areas import cell_size as hidden_size
from studio.search.trackers.limb_places import (
    BLOCK,
    OPEN,
    ROUGH,
    SAME,
    cells_of,
    count_alone,
    cover,
    places_left_bare,
    squares_of,
)
from studio.search.trackers.limb_reach import limb_reach_of
from studio.search.trackers.tracker import HIDDEN

SPACING = 35.0
"""mm at a person's size, between the grid's points."""
ABOVE_FLOOR = 300.0
"""mm at a person's size: lower points may be a shadow on the floor, z = 0."""
BARE_MM = 30.0
"""mm at a person's size: farther from all limbs something is bare."""
LEAST_VIEWS = 3
"""Fewer see nearly every place in all of them."""
FILLED = 0.375
"""Share of a cell that changed, or cannot be told, if it counts as that."""
LEAST_MM2 = 900.0
"""mm² at a person's size, of a limb's projection alone, a view: with less it is hidden by others, and nothing is said
of what it explains."""
LEAST_EXPLAINED, SOME_UNEXPLAINED = 0.86, 0.1
"""A limb is elsewhere if its projection explains less than the first and more than the second is unexplained: a limb
that is hidden leaves nothing unexplained."""
LEAST_SHOWN, MORE_UNEXPLAINED = 0.35, 0.12
"""The same of a limb that lies on others, by what it alone explains. Chosen on 335 losses planted in six clips of the
choosing half and the two of others (`studio reproduce planted-losses`), of whose frames before they were planted none
is named, and on six sitting people drawn for it alone, of neither half: arms that lie right on a lap show 0.35 to 0.39
beside the shadow on their stool. Of 1521 losses planted in all clips 83.8 % of the limbs are named, 84.7 % with 0.39;
of the limbs of those six falsely 6 %, 15 % with 0.39."""
SURELY_EXPLAINED, SURELY_SHOWN = 0.93, 0.39
"""A limb that explains and shows more is not missed."""
MOSTLY_EXPLAINED = 0.8
"""With at least this a limb has not jumped away from where it shows. Without it six of 63 frames of *hard*, whose
cameras moved, are no longer named."""
AROUND_MM, MOST_PLACES = 45.0, 4096
"""mm at a person's size, up to which what changed beside a place is a limb's that is elsewhere; the most places."""
REACH = 1.05
"""Times a limb's length: how far from its root it may end."""
WIDER = 1.2
"""Times a block's radius in pixels, for a lens that distorts."""


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Of one limb.

    unexplained : volume within its reach that changed and that the pose leaves bare, as a share of the limb's own.
    explained : share of its projection, where no other limb lies, that changed; 1 without such a projection.
    shown : area that it alone explains, as a share of its whole projection.
    """

    unexplained: float
    explained: float
    shown: float


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """What changed in a view. kinds : (h, w) SAME, CHANGED or OPEN, of cells. size : pixels along a cell's
    side. picture, empty : (H, W, 3) BGR; the latter and mask (H, W) as in `ViewEvidence`.
    """

    kinds: Bytes
    size: int
    picture: Bytes
    empty: Bytes | None = None
    mask: Bytes | None = None


_known: WeakKeyDictionary[FrameEvidence, Mapping[str, Change]] = WeakKeyDictionary()


def changes_by_camera(evidence: FrameEvidence) -> Mapping[str, Change]:
    """What changed in a frame's pictures, by camera; kept as long as the evidence is."""
    if evidence not in _known:
        _known[evidence] = {view.camera: change_of(view) for view in evidence.views}
    return _known[evidence]


def change_of(view: ViewEvidence) -> Change:
    """What changed in a view, shadows too."""
    height, width = view.mask.shape
    size = cell_size(height, width)
    kinds = np.zeros((-(-height // size), -(-width // size)), np.uint8)
    shadow, unknown = (view.mask if one is None else one for one in (view.shadow, view.unknown))
    cells_of(
        view.mask, shadow, unknown, size, FILLED, kinds, view.shadow is not None, view.unknown is not None
    )
    return Change(kinds, size, view.picture, view.empty, view.mask)


class LimbsElsewhere:
    """Looks for the limbs of a body in what changed in the pictures; immutable.

    usable : whether there are cameras enough.
    """

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self._body, self._cameras, self._agreement = body, cameras, Agreement(body, cameras)
        self._scale, names = scale_of(body), limb_names(body)
        self._names, self._limbs = names, tuple(dict.fromkeys(names))
        self._owners = np.array([self._limbs.index(name) for name in names])
        self._bending = tuple(limb for limb in self._limbs if names.count(limb) > 1)
        self._roots = np.array([names.index(limb) for limb in self._limbs])
        lengths, volumes = np.array([(abs(limb.length), _volume(limb)) for limb in body.drawn]).T
        own = np.arange(len(self._limbs))[:, None] == self._owners
        bends = np.array([limb in self._bending for limb in self._limbs])
        self._reaches, self._volumes = np.where(bends, REACH * (own @ lengths), 0.0), own @ volumes
        self._views = np.array([numbers_of(camera) for camera in cameras])
        self.usable = len(cameras) >= LEAST_VIEWS and bool(self._bending)

    def of(
        self, pose: Array, changed: Sequence[Change], memory: Mapping[str, Array] | None = None
    ) -> dict[str, Elsewhere]:
        """By limb with a joint of its own, as named in the body's parameters. pose : (D,). changed : one a camera.
        memory : of the frame's start, with known occlusions.
        """
        bare, own, _ = self._look(pose, changed, memory, self._reaches)
        spacing = SPACING * self._scale
        found = dict[str, Elsewhere]()
        for limb in self._bending:
            at = self._limbs.index(limb)
            whole, alone, explained = own[:, at]
            found[limb] = Elsewhere(
                float(bare[at]) * spacing**3 / max(self._volumes[at], 1e-9),
                float(explained / alone) if alone >= LEAST_MM2 * len(self._cameras) else 1.0,
                float(explained / max(whole, 1.0)),
            )
        return found

    def spots(
        self,
        pose: Array,
        changed: Sequence[Change],
        limbs: Collection[str],
        memory: Mapping[str, Array] | None = None,
    ) -> dict[str, tuple[Indices, float]]:
        """By camera pixels (K, 2), and up to how many pixels from them the pictures show some limbs of a pose that are
        elsewhere. Others : as of `of`.
        """
        reaches = np.where([limb in limbs for limb in self._limbs], self._reaches, 0.0)
        _, _, places = self._look(pose, changed, memory, reaches, MOST_PLACES)
        sizes = self._agreement.mm_per_pixel(pose)
        return {
            camera.name: (_pixels(camera, places), AROUND_MM / mm)
            for camera, mm in zip(self._cameras, sizes, strict=True)
        }

    def _look(
        self,
        pose: Array,
        changed: Sequence[Change],
        memory: Mapping[str, Array] | None,
        reaches: Array,
        most: int = 0,
    ) -> tuple[NDArray[np.int64], Array, Array]:
        """(G,) how many places within a limb's reach changed and are left bare; (3, G) mm² in which each limb lies,
        alone, and of these what changed; (K, 3) the first `most` of the places. reaches : (G,) mm, 0 for limbs that are
        not looked for.
        """
        corners, sizes = self._agreement.corners(pose), self._agreement.mm_per_pixel(pose)
        ends = limb_ends(self._body, pose[None])[0]
        maps, begin = np.zeros((len(changed), 4), np.int64), 0
        kinds, near, own = list[Bytes](), list[Bytes](), np.zeros((3, len(self._limbs)))
        rough, begins = list[Bytes](), np.zeros((len(changed), 2), np.int64)
        roots, spacing = ends[self._roots, 0], SPACING * self._scale
        radius = 0.5 * np.sqrt(3.0) * (BLOCK - 1) * spacing
        for number, (camera, view, mm) in enumerate(zip(self._cameras, changed, sizes, strict=True)):
            seen = _with_hidden(view.kinds, view.size, camera, memory)
            maps[number] = (begin, *seen.shape, view.size)
            begin += seen.size
            beside, counts = self._covered(corners[number], seen, view.size, mm)
            own += counts
            kinds.append(seen.ravel())
            near.append(beside.ravel())
            nearest = (roots @ camera.rotation[2] + camera.translation[2] - reaches).min() - radius
            wide = WIDER * float(camera.matrix[0, 0]) * radius / max(nearest, radius) / view.size
            squares = _squares_around(seen, wide)
            begins[number] = sum(map(len, rough)), squares.shape[1]
            rough.append(squares.ravel())
        free = reaches > 0.0
        low = (roots - reaches[:, None])[free].min(axis=0)
        high = (roots + reaches[:, None])[free].max(axis=0)
        low[2] = max(low[2], ABOVE_FLOOR * self._scale)
        steps = np.maximum(np.ceil((high - low) / (spacing * BLOCK)), 1.0).astype(np.int64)
        places = np.zeros((most, 3))
        bare, filled = places_left_bare(
            np.concatenate(kinds),
            np.concatenate(near),
            np.concatenate(rough),
            begins,
            maps,
            self._views,
            roots,
            reaches,
            low,
            steps,
            spacing,
            *limb_reach_of(self._body, self._names).placed(pose),
            places,
        )
        return bare, own, places[:filled]

    def lost(
        self, pose: Array, changed: Sequence[Change], memory: Mapping[str, Array] | None = None
    ) -> tuple[str, ...]:
        """The limbs that are probably elsewhere."""
        return lost_of(self.of(pose, changed, memory))

    def _covered(self, quads: Array, kinds: Bytes, size: int, mm: float) -> tuple[Bytes, Array]:
        """(h, w) 1 in cells near a limb, and (3, G) mm² in which each limb lies, alone, and of these what changed.
        quads : (L, 4, 2). mm : size of a pixel.
        """
        near, counts = np.zeros(kinds.shape, np.uint8), np.zeros((3, len(self._limbs)))
        bits = np.zeros(kinds.shape, np.uint32)
        cover((quads + 0.5) / size - 0.5, self._owners, BARE_MM / (mm * size), bits, near)
        count_alone(bits, kinds, counts)
        return near, counts * (size * mm) ** 2


def is_sure(one: Elsewhere) -> bool:
    """Whether a limb surely is where the pose has it."""
    return one.explained >= SURELY_EXPLAINED and one.shown >= SURELY_SHOWN


def is_shown(one: Elsewhere) -> bool:
    """Whether a limb shows by itself where the pose has it, and nothing else within its reach does: where it jumped to
    it is.
    """
    sees = one.explained >= MOSTLY_EXPLAINED and one.shown >= SURELY_SHOWN
    return sees and one.unexplained <= SOME_UNEXPLAINED


def none_missed(limbs: Mapping[str, Elsewhere]) -> bool:
    """Whether all limbs are surely where the pose has them; not without any."""
    return bool(limbs) and all(is_sure(one) for one in limbs.values())


def without_sure(off: Disagreement, limbs: Mapping[str, Elsewhere]) -> Disagreement:
    """A pose's disagreement with the silhouettes, without what lies bare beside limbs that surely are where it has
    them; without any that is bare where none is missed.
    """
    return without_bare(
        off, None if none_missed(limbs) else [name for name, one in limbs.items() if is_sure(one)]
    )


def lost_of(limbs: Mapping[str, Elsewhere]) -> tuple[str, ...]:
    """Of limbs those that are probably elsewhere."""
    return tuple(
        name
        for name, one in limbs.items()
        if (one.explained < LEAST_EXPLAINED and one.unexplained > SOME_UNEXPLAINED)
        or (one.shown < LEAST_SHOWN and one.unexplained > MORE_UNEXPLAINED)
    )


def _volume(limb: Limb) -> float:
    """mm³ of a truncated cone."""
    one, other = limb.radius_start, limb.radius_end
    return float(np.pi * abs(limb.length) * (one**2 + one * other + other**2) / 3.0)


def _pixels(camera: Camera, places: Array) -> Indices:
    """(K, 2) pixels in the picture at which places (N, 3) are seen, each once."""
    at = project(camera, places)[0]
    at = np.rint(at[np.isfinite(at).all(axis=1)])
    inside = ((at >= 0.0) & (at < (camera.width, camera.height))).all(axis=1)
    return np.unique(at[inside].astype(np.int64), axis=0)


def _squares_around(kinds: Bytes, radius: float) -> Bytes:
    """Squares of ROUGH cells: 1 where a cell within `radius` cells changed, or may lie beyond the picture."""
    squares = np.zeros([-(-length // ROUGH) for length in kinds.shape], np.uint8)
    squares_of(kinds, squares)
    ring = 1 + int(np.ceil(radius / ROUGH))
    wide: Bytes = scipy.ndimage.maximum_filter(squares, 2 * ring + 1, mode="constant", cval=1)
    return wide


def _with_hidden(kinds: Bytes, size: int, camera: Camera, memory: Mapping[str, Array] | None) -> Bytes:
    """The kinds, OPEN where the body is known to be hidden."""
    counts = None if memory is None else memory.get(HIDDEN + camera.name)
    if counts is None or not (counts >= FRAMES).any():
        return kinds
    high, wide = kinds.shape
    rows, columns = (size * np.arange(length, dtype=np.int64) + size // 2 for length in (high, wide))
    cell = hidden_size(camera)
    below, across = (
        np.minimum(rows // cell, len(counts) - 1),
        np.minimum(columns // cell, counts.shape[1] - 1),
    )
    hidden: NDArray[np.bool_] = counts[below][:, across] >= FRAMES
    return np.where(hidden & (kinds == SAME), np.uint8(OPEN), kinds)
