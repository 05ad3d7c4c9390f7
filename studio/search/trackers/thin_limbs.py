"""Thin limbs, such as tails, as lines in the pictures: masks hold only pieces of what is three pixels wide.

A limb gains by the lines (`line_strength`) along its axis, in the direction that it has there, so that what crosses it
counts for nothing. Where other limbs of the pose lie, or a mask is broader than the limb, nothing is said. Under the
floor a limb shows nowhere, whatever is reflected there.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Floats, Mask
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.trackers.agreement import limb_names
from studio.search.trackers.limbs_elsewhere import Change
from studio.search.trackers.line_strength import DIRECTIONS, LONG, free_of, is_broad, line_strength
from studio.search.trackers.refinement import mm_per_pixel

WIDTHS = 3, 9
"""Pixels: the narrowest line that is looked for, and the broadest; broader limbs are in the masks."""
NOTHING, UNSEEN = 0.4, 0.15
"""How plain a line is expected where there is no limb, in clutter, and what is added to both: a limb may be faint in a
view. The logarithm of their ratio counts: what two views show and the third one surely does not is no limb."""
POINTS = 8
"""Along each part of a limb."""
BEND = 0.1
"""Gain that is lost per radian² of the joints within a limb."""
UNDER_MM = 30.0
"""mm at a person's size: what lies lower is under the floor."""
HALF_PLAIN = 0.05
"""Mean log odds along a thin limb that is as likely lost as not."""
LEAST_SEEN = 0.3
"""Share of a limb's points, of all views, that other limbs leave free, at least: hardly a tail is hidden from all."""
NEVER = float(np.log(UNSEEN / (UNSEEN + NOTHING)))
"""The log odds without a line."""


class Lines(NamedTuple):
    """What a view shows around a limb. odds : (DIRECTIONS, h, w) log odds for a limb of each direction, as of a line.
    free : (h, w) where no other limb lies. corner : its first pixel, x and y. lowest : mm, height of what is not under
    the floor.
    """

    odds: Floats
    free: Mask
    corner: tuple[int, int]
    lowest: float


class ThinLimb:
    """Compares a limb that is a chain of parts with the lines in the pictures; immutable.

    own : the angles that bend it. on_floor : whether it stays above z = 0.
    """

    def __init__(
        self, body: BodyModel, cameras: Sequence[Camera], limb: str, own: Sequence[int], on_floor: bool
    ) -> None:
        self._on_floor, self._under = on_floor, UNDER_MM * scale_of(body)
        self._body, self._cameras, self.own = body, tuple(cameras), list(own)
        self._parts = [number for number, name in enumerate(limb_names(body)) if name == limb]
        parts = [body.drawn[number] for number in self._parts]
        self._length = sum(abs(part.length) for part in parts)
        self._breadth = float(np.mean([part.radius_start + part.radius_end for part in parts]))
        first = next(joint for joint in body.joints if set(joint.parameters) & set(own))
        self._inner, self._neutral = [n for n in own if n not in first.parameters], body.neutral

    def lines(self, pose: Array, changes: Mapping[str, Change], corners: Array) -> list[Lines | None]:
        """What each view shows around the limb's root in a pose (D,); None of a view without an empty one, or in which
        the limb is too broad. corners : (V, L, 4, 2) the pose's outlines.
        """
        ends = limb_ends(self._body, pose[None])[0]
        root, others = ends[self._parts[0], 0], np.delete(ends, self._parts, axis=0)
        lowest = min(float(others[..., 2].min()), 0.0) - self._under if self._on_floor else -np.inf
        return [
            self._lines_of(camera, changes.get(camera.name), root, quads, lowest)
            for camera, quads in zip(self._cameras, corners, strict=True)
        ]

    def gains(self, poses: Array, lines: Sequence[Lines | None], parts: int | None = None) -> Array:
        """(N,) what the lines say for poses (N, D), summed over the views. parts : only so many, from the root."""
        shown, _ = self._along(poses, lines, parts)
        bent = ((poses[:, self._inner] - self._neutral[self._inner]) ** 2).sum(axis=1)
        return shown.sum(axis=0) / (POINTS * len(self._parts)) - BEND * bent

    def support(self, pose: Array, lines: Sequence[Lines | None]) -> float | None:
        """The mean log odds along the limb in a pose (D,), little where other limbs hide nearly all of it; None without
        lines.
        """
        shown, counted = self._along(pose[None], lines)
        possible = POINTS * len(self._parts) * sum(one is not None for one in lines)
        return float(shown.sum() / max(counted.sum(), LEAST_SEEN * possible)) if possible else None

    def _along(
        self, poses: Array, lines: Sequence[Lines | None], parts: int | None = None
    ) -> tuple[Array, Array]:
        """(V, N) summed log odds, and how many points were counted."""
        ends = limb_ends(self._body, poses)[:, self._parts[:parts]]
        share = (np.arange(POINTS) + 1.0) / POINTS
        points = ends[:, :, 0, None] + (ends[:, :, 1] - ends[:, :, 0])[:, :, None] * share[:, None]
        shown, counted = np.zeros((2, len(lines), len(poses)))
        for number, (camera, view) in enumerate(zip(self._cameras, lines, strict=True)):
            if view is not None:
                shown[number], counted[number] = _odds_along(camera, view, ends, points)
        return shown, counted

    def _lines_of(
        self, camera: Camera, change: Change | None, root: Array, quads: Array, lowest: float
    ) -> Lines | None:
        if change is None or change.empty is None or change.picture.shape != change.empty.shape:
            return None
        height, width = change.picture.shape[:2]
        mm = mm_per_pixel(camera, root)
        broad = max(WIDTHS[0], 2 * (round(self._breadth / mm) // 2) + 1)
        middle, reach = project(camera, root)[0], self._length / mm + LONG * broad
        if (height, width) != (camera.height, camera.width) or broad > WIDTHS[1] or np.isnan(middle).any():
            return None
        low = np.clip(np.floor(middle - reach), 0, (width, height)).astype(int)
        high = np.clip(np.ceil(middle + reach), 0, (width, height)).astype(int)
        if (high - low < LONG * broad).any():
            return None
        part = np.s_[low[1] : high[1], low[0] : high[0]]
        others = np.delete(quads, self._parts, axis=0) - low
        odds = _odds_of(line_strength(change.picture[part], change.empty[part], broad))
        free = free_of(others, *odds.shape[1:])
        if change.mask is not None:
            free &= ~is_broad(change.mask[part], broad)
        return Lines(odds, free, (int(low[0]), int(low[1])), lowest)


def lines_along(
    limbs: Mapping[str, ThinLimb], pose: Array, lines: Mapping[str, Sequence[Lines | None]]
) -> dict[str, float]:
    """By thin limb of a pose (D,) how plainly lines run along it, where they are seen. lines : by limb, as of
    `ThinLimb.lines`.
    """
    found = {limb: limbs[limb].support(pose, own) for limb, own in lines.items()}
    return {limb: plain for limb, plain in found.items() if plain is not None}


def _odds_along(camera: Camera, view: Lines, ends: Array, points: Array) -> tuple[Array, Array]:
    """(N,) summed log odds, and how many points were counted, of the axes of N limbs. ends : (N, P, 2, 3). points :
    (N, P, K, 3) along them.
    """
    pixels, along = project(camera, points)[0], project(camera, ends)[0]
    way = along[:, :, 1] - along[:, :, 0]
    with np.errstate(invalid="ignore"):
        angles = np.arctan2(way[..., 1], way[..., 0])
    known = np.isfinite(pixels).all(axis=-1) & np.isfinite(angles)[..., None]
    direction = np.rint(np.nan_to_num(angles) / np.pi * DIRECTIONS).astype(np.int64) % DIRECTIONS
    places = np.rint(np.nan_to_num(pixels) - view.corner).astype(np.int64)
    height, width = view.free.shape
    inside = (places >= 0).all(axis=-1) & (places[..., 0] < width) & (places[..., 1] < height) & known
    x, y = (np.where(inside, places[..., axis], 0) for axis in (0, 1))
    under = points[..., 2] < view.lowest
    counts = inside & view.free[y, x] | under
    odds = np.where(under, NEVER, view.odds[np.broadcast_to(direction[..., None], x.shape), y, x])
    return np.where(counts, odds, 0.0).sum(axis=(1, 2)), counts.sum(axis=(1, 2)).astype(float)


def _odds_of(strength: Floats) -> Floats:
    return np.log((UNSEEN + strength) / np.float32(UNSEEN + NOTHING))
