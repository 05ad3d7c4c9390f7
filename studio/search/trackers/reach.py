"""Where the limbs of a body can be at all while its root stays where it is.

What no limb reaches is no lost limb, however much silhouette lies there: a forearm goes on where a hand's body ends, a
shadow lies beside. Poses are drawn within the joints' limits; what their limbs cover is kept as one point for each cube
that they lie in, in the root's frame. Of two views alone a limb can be anywhere before a forearm; so only places count
that other views show as silhouette, too: half of them, as a mask may lack a limb.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.model import BodyModel, Limb
from studio.body.scale import scale_of
from studio.evidence.volume.alignment import root_parameters
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.trackers.refinement import Distances

DRAWS = 400
"""Poses of each kind: angles apart; all at the same share of their ranges, as chains curl; some of these the other
way."""
CUBE_MM = 100.0
"""mm at a person's size."""
ALONG = np.linspace(0.0, 1.0, 5)
"""Places of a limb that are kept."""
SEED = 0x2EAC4


class Reach:
    """What the limbs of one body reach; immutable."""

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self._root = next(number for number, joint in enumerate(body.joints) if joint.parent < 0)
        rest, drawn = drawn_within_limits(body)
        poses = np.concatenate([rest[None], drawn])
        own = seen_from(joint_frames(body, poses)[:, self._root], limb_ends(body, poses))
        moved = np.abs(own[1:] - own[:1]).max(axis=(0, 2, 3)) > 1e-6
        sizes = [thickness_of(limb) for limb in body.drawn]
        side = CUBE_MM * scale_of(body)
        places = places_along(own[:, moved], ALONG)
        self._points = _one_a_cube(places.reshape(-1, 3), side)
        self._thick = max((size for size, moves in zip(sizes, moved, strict=True) if moves), default=0.0)
        self._within = 0.5 * np.sqrt(3.0) * side

    def beyond(
        self,
        pose: Array,
        cameras: Sequence[Camera],
        silhouettes: Sequence[Distances],
        pixels: Sequence[Array],
        mm: Sequence[float],
        far: float,
    ) -> list[NDArray[np.bool_]]:
        """(K,) of each view's pixels (K, 2) which are farther than `far` from every place that a limb reaches and that
        half of the other views show as silhouette, or more; none where no limb can move.

        pose : (D,) whose root it is. silhouettes : one a camera. mm : size of a pixel at the body, by view, at a
        person's size. far : mm at a person's size.
        """
        if not len(self._points):
            return [np.zeros(len(own), np.bool_) for own in pixels]
        frame, scale = joint_frames(self._body, pose)[0, self._root], scale_of(self._body)
        points = self._points @ frame[:, :3].T + frame[:, 3]
        seen, shown = np.zeros((2, len(cameras), len(points)), np.bool_)
        places = list[Array]()
        views = zip(cameras, silhouettes, mm, seen, shown, strict=True)
        for camera, silhouette, size, in_picture, on_silhouette in views:
            at = project(camera, points)[0]
            places.append(at)
            in_picture[:] = ((at >= 0.0) & (at < silhouette.size)).all(axis=1)
            on_silhouette[in_picture] = _near(silhouette, at[in_picture], (far + self._within / scale) / size)
        found = list[NDArray[np.bool_]]()
        for view, (own, at, size) in enumerate(zip(pixels, places, mm, strict=True)):
            others = np.arange(len(cameras)) != view
            agreed = 2 * shown[others].sum(axis=0) >= seen[others].sum(axis=0)
            possible = at[agreed & np.isfinite(at).all(axis=1)]
            if not len(possible) or not len(own):
                found.append(np.ones(len(own), np.bool_))
                continue
            radius = (far + (self._thick + self._within) / scale) / size
            found.append(~np.isfinite(cKDTree(possible).query(own, distance_upper_bound=radius)[0]))
        return found


def _near(silhouette: Distances, pixels: Array, reach: float) -> NDArray[np.bool_]:
    """(K,) which pixels (K, 2) of a view lie on its silhouette or not farther than `reach` pixels from it."""
    cells = np.rint(pixels).astype(np.int64) - silhouette.corner
    height, width = silhouette.signed.shape
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    near = np.zeros(len(pixels), np.bool_)
    near[inside] = silhouette.signed[cells[inside, 1], cells[inside, 0]] <= reach
    return near


@lru_cache(maxsize=16)
def reach_of(body: BodyModel) -> Reach:
    """The reach of a body, kept: it takes a quarter of a second."""
    return Reach(body)


def thickness_of(limb: Limb) -> float:
    """mm, the largest radius of a drawn limb."""
    return max(limb.radius_start, limb.radius_end) * max(limb.scale_x, limb.scale_y)


def seen_from(frames: Array, ends: Array) -> Array:
    """(N, L, 2, 3) ends of limbs, mm in frames (N, 3, 4) of the world. ends : (N, L, 2, 3) mm, world."""
    return np.einsum("nji,nlej->nlei", frames[:, :, :3], ends - frames[:, None, None, :, 3])


def places_along(ends: Array, shares: Array) -> Array:
    """(N, L, K, 3) at shares (K,) of the way between ends (N, L, 2, 3)."""
    return ends[:, :, :1] + shares[:, None] * (ends[:, :, 1:] - ends[:, :, :1])


def drawn_within_limits(body: BodyModel) -> tuple[Array, Array]:
    """(D,) the body at rest with its root nowhere, and poses (N, D) over the limits of what is not its root's."""
    rng, rest = np.random.default_rng(SEED), body.neutral.copy()
    free = np.ones(len(rest), np.bool_)
    free[root_parameters(body)] = False
    rest[~free] = 0.0
    lower, upper = body.lower.copy(), body.upper.copy()
    round_about = body.angles & ~(np.isfinite(lower) & np.isfinite(upper))
    lower[round_about], upper[round_about] = -np.pi, np.pi
    free &= np.isfinite(lower) & np.isfinite(upper)
    lower, upper = np.where(free, lower, rest), np.where(free, upper, rest)
    apart, alike = rng.random((DRAWS, len(rest))), np.repeat(rng.random((DRAWS, 1)), len(rest), axis=1)
    some = np.where(rng.random(alike.shape) < 0.5, alike, 1.0 - alike)
    shares = np.concatenate([apart, alike, some])
    return rest, lower + shares * (upper - lower)


def _one_a_cube(points: Array, side: float) -> Array:
    """(K, 3) the mean of the points (N, 3) of each cube."""
    if not len(points):
        return points
    _, own, counts = np.unique(
        np.floor(points / side).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    means = np.zeros((len(counts), 3))
    np.add.at(means, own.reshape(-1), points)
    return means / counts[:, None]
