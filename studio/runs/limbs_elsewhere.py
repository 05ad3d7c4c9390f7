"""Where else a limb may be: a place within its reach that changed in all views, and that the pose leaves bare in some.

The silhouettes cannot witness against a limb that they lack, as where the shadow test has taken bare arms for the
floor's shadow. What differs from the background at all, shadows too, still has them. A grid of points is projected into
all views: a point within a limb's reach that lies on changed pixels in every view that sees it, and in two views or
more far from all limbs of the pose, is something that the pose does not explain. A shadow on the floor is none: only
points well above the floor count. Of the limbs in whose reach such points lie the one is elsewhere whose own projection
explains least: a limb that is where it seems covers changed pixels that no other limb covers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import nearest_pixels
from studio.search.trackers.agreement import Agreement, limb_names

SPACING = 35.0
"""mm at a person's size, between the grid's points."""
ABOVE_FLOOR = 300.0
"""mm at a person's size: lower points may be a shadow on the floor, z = 0."""
BARE_MM = 30.0
"""mm at a person's size: farther from all limbs something is bare."""
BARE_VIEWS = 2
LEAST_PIXELS = 30
"""Of a limb's projection alone, a view: with fewer it is hidden by others, and nothing is said of what it explains."""
LEAST_EXPLAINED, SOME_UNEXPLAINED, MOST_UNEXPLAINED = 0.86, 0.01, 0.45
"""A limb is elsewhere whose projection explains less than the first, if more than the second is unexplained (a limb
that is hidden leaves nothing unexplained), or of which more than the third is. Chosen on losses planted in clips of the
choosing half and the two of others (`studio reproduce planted-losses`); shadows on wood leave up to 0.43."""
REACH = 1.05
"""Times a limb's length: how far from its root it may end."""


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Of one limb.

    unexplained : volume within its reach that changed and that the pose leaves bare, as a share of the limb's own.
    explained : share of its projection, where no other limb lies, that changed; 1 without such a projection.
    """

    unexplained: float
    explained: float


def changed_pixels(evidence: FrameEvidence, with_shadows: FrameEvidence) -> list[Bytes]:
    """(H, W) above 0 where a frame's pictures are not the background: its masks, and those without a shadow test."""
    return [
        np.maximum(view.mask, other.mask)
        for view, other in zip(evidence.views, with_shadows.views, strict=True)
    ]


class LimbsElsewhere:
    """Looks for the limbs of a body in what changed in the pictures; immutable."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self._body, self._cameras, self._agreement = body, cameras, Agreement(body, cameras)
        self._names, self._scale = np.array(limb_names(body)), scale_of(body)

    def of(self, pose: Array, changed: Sequence[Bytes]) -> dict[str, Elsewhere]:
        """By limb, as named in the body's parameters. pose : (D,). changed : (H, W) above 0 where a camera's picture is
        not its background, whatever the reason.
        """
        corners, sizes = self._agreement.corners(pose), self._agreement.mm_per_pixel(pose)
        ends = limb_ends(self._body, pose[None])[0]
        points = self._grid(ends)
        bare, seen = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
        own = {name: np.zeros(2) for name in dict.fromkeys(self._names.tolist())}
        for camera, picture, quads, mm in zip(self._cameras, changed, corners, sizes, strict=True):
            drawn, near = _covered(quads, self._names, picture.shape, BARE_MM / mm)
            times = np.sum(list(drawn.values()), axis=0, dtype=np.uint8)
            for name, limb in drawn.items():
                alone = (times == 1) & (limb > 0)
                own[name] += (np.count_nonzero(alone), np.count_nonzero(alone & (picture > 0)))
            cells, inside = nearest_pixels(camera, points)
            rows, columns = cells[inside, 1], cells[inside, 0]
            seen += inside
            bare[inside] += (picture[rows, columns] > 0) & ~near[rows, columns]
            kept = ~inside
            kept[inside] = picture[rows, columns] > 0
            points, bare, seen = points[kept], bare[kept], seen[kept]
        points = points[(seen >= BARE_VIEWS) & (bare >= BARE_VIEWS)]
        return {name: self._elsewhere(name, ends, points, own[name]) for name in own}

    def lost(self, pose: Array, changed: Sequence[Bytes]) -> tuple[str, ...]:
        """The limbs that are probably elsewhere, of those with a joint of their own within them."""
        limbs = self.of(pose, changed)
        bending = [name for name in limbs if np.count_nonzero(self._names == name) > 1]
        lost = {
            name
            for name in bending
            if limbs[name].explained < LEAST_EXPLAINED and limbs[name].unexplained > SOME_UNEXPLAINED
        }
        by_place = [name for name in bending if limbs[name].unexplained > MOST_UNEXPLAINED]
        if by_place and not lost:
            lost.add(min(by_place, key=lambda name: limbs[name].explained))
        return tuple(name for name in bending if name in lost)

    def _grid(self, ends: Array) -> Array:
        """(N, 3) points around a pose, above the floor."""
        spacing, reach = SPACING * self._scale, max(map(self._length, dict.fromkeys(self._names.tolist())))
        low, high = ends.min(axis=(0, 1)) - reach, ends.max(axis=(0, 1)) + reach
        low[2] = max(low[2], ABOVE_FLOOR * self._scale)
        axes = [
            np.arange(one, max(other, one + spacing), spacing) for one, other in zip(low, high, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def _length(self, name: str) -> float:
        return sum(abs(limb.length) for limb in np.array(self._body.drawn, object)[self._names == name])

    def _elsewhere(self, name: str, ends: Array, points: Array, own: Array) -> Elsewhere:
        mine = np.flatnonzero(self._names == name)
        limbs = [self._body.drawn[limb] for limb in mine]
        volume = sum(
            np.pi
            * abs(limb.length)
            * (limb.radius_start**2 + limb.radius_start * limb.radius_end + limb.radius_end**2)
            / 3.0
            for limb in limbs
        )
        root = ends[mine[0], 0]
        within = np.linalg.norm(points - root, axis=1) < REACH * self._length(name)
        share = float(np.count_nonzero(within) * (SPACING * self._scale) ** 3 / volume) if volume else 0.0
        return Elsewhere(
            share, float(own[1] / own[0]) if own[0] >= LEAST_PIXELS * len(self._cameras) else 1.0
        )


def _covered(
    quads: Array, names: NDArray[np.str_], shape: tuple[int, ...], far: float
) -> tuple[dict[str, Bytes], NDArray[np.bool_]]:
    """By limb (H, W) 1 where it covers a pixel; (H, W) whether one lies within `far` pixels. quads : (L, 4, 2)."""
    drawn = {name: np.zeros(shape, np.uint8) for name in dict.fromkeys(names.tolist())}
    for name, quad in zip(names.tolist(), quads, strict=True):
        if np.isfinite(quad).all():
            cv2.fillPoly(drawn[name], [np.rint(quad.clip(-1e4, 1e4)).astype(np.int32)], (1,))
    side = 2 * max(1, round(far)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return drawn, np.asarray(cv2.dilate(np.maximum.reduce(list(drawn.values())), disc)) > 0
