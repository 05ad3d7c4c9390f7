"""Where each limb of a body can be while what it hangs from stays where it is, and the other views show silhouette.

Only there does what a silhouette leaves bare contradict the limb in a check. A lump of shadow, droppings or a
reflection lies bare beside a limb in one view; whatever hides in the ray through it the others see through. A mouse
arches its back above its haunches: no haunch gets there. A run, which draws limbs again where it names them, asks what
no limb at all can reach (of silhouettes `reach`, of what changed in the pictures the cubes of all limbs here,
`limb_places`): by each limb's own reach a rearing mouse was searched worse (16 and 17 instead of 10 mm in the second
labelled frame).

Poses are drawn within the limits. For each limb the cubes that it lies in are kept, in the frame of what it hangs from.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.model import BodyModel, moving_joint
from studio.body.scale import scale_of
from studio.evidence.cells import cell_at, numbers_of
from studio.foundations.arrays import Array, Bytes, Floats
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import directions
from studio.foundations.numba_in_threads import EXACT, njit
from studio.search.trackers.reach import drawn_within_limits, places_along, seen_from, thickness_of
from studio.search.trackers.refinement import Distances

CUBES, AROUND = 24, 1.5
"""Along each side of the box around what a limb reaches, and up to how many from one that was drawn in it may lie: what
was drawn has gaps."""
ALONG = np.linspace(0.0, 1.0, 9)
"""Of a limb's axis, places that are drawn."""
STEP_MM, NEAR_MM = 15.0, 30.0
"""mm at a person's size, between places along a ray, and up to which beside a silhouette one is taken to lie on it."""
LEAST_AGREEING = 2.0 / 3.0
"""Share of the other views that see a place, of which it must lie on the silhouette: of three one may lack the limb, of
two neither."""


class Placed(NamedTuple):
    """The reach of G limbs of a pose. frames : (G, 3, 4) world from box. halves : (G,) mm, half a box's side, 0 of what
    reaches nowhere. cubes : (G, N, N, N) 1 in those of a box that the limb may lie in.
    """

    frames: Array
    halves: Array
    cubes: Bytes


class LimbReach:
    """What the limbs of one body reach; immutable. limbs : (G,) names, in the order of the drawn ones. moves : (G,)
    whether a limb can move while the root does not.
    """

    def __init__(self, body: BodyModel, names: Sequence[str]) -> None:
        self._body, self.limbs = body, tuple(dict.fromkeys(names))
        poses = drawn_within_limits(body)[1]
        frames, ends = joint_frames(body, poses), limb_ends(body, poses)
        self._hung_from = [_hung_from(body, names, limb) for limb in self.limbs]
        count = len(self.limbs)
        self._centres: Array = np.zeros((count, 3))
        self._halves: Array = np.zeros(count)
        self._cubes = np.zeros((count, CUBES, CUBES, CUBES), np.uint8)
        for number, (limb, joint) in enumerate(zip(self.limbs, self._hung_from, strict=True)):
            if joint < 0:
                continue
            parts = [part for part, name in enumerate(names) if name == limb]
            places = places_along(seen_from(frames[:, joint], ends[:, parts]), ALONG)
            thick = max(thickness_of(body.drawn[part]) for part in parts)
            self._keep(number, places.reshape(-1, 3), thick)
        self.moves = self._halves > 0.0

    def _keep(self, number: int, places: Array, thick: float) -> None:
        """Keep the cubes in which a limb's axis (N, 3) lies, and those around. thick : mm, its radius."""
        low, high = places.min(axis=0), places.max(axis=0)
        centre, half = 0.5 * (low + high), 0.5 * float((high - low).max()) + thick
        side = 2.0 * half / CUBES
        at = np.minimum((places - centre + half) / side, CUBES - 1).astype(np.int64)
        free = np.ones((CUBES, CUBES, CUBES), np.bool_)
        free[tuple(at.T)] = False
        away: Array = np.asarray(scipy.ndimage.distance_transform_edt(free))
        self._cubes[number] = (away <= max(thick / side, AROUND)).astype(np.uint8)
        self._centres[number], self._halves[number] = centre, half

    def placed(self, pose: Array) -> Placed:
        """The reach around a pose (D,)."""
        joints = joint_frames(self._body, pose)[0, self._hung_from].copy()
        joints[:, :, 3] += np.einsum("gij,gj->gi", joints[:, :, :3], self._centres)
        return Placed(joints, self._halves, self._cubes)

    def limbs_there(
        self,
        pose: Array,
        cameras: Sequence[Camera],
        silhouettes: Sequence[Distances],
        pixels: Sequence[Array],
        mm: Sequence[float],
    ) -> list[NDArray[np.bool_]]:
        """(K, G) of each view's pixels (K, 2) which limbs may lie there; of a limb that cannot move whether any other
        may.

        pose : (D,). silhouettes : one a camera. mm : size of a pixel at the body, by view, at a person's size.
        """
        maps, corners = np.zeros((2, len(cameras), 4), np.int64)
        begin = 0
        for own, box, silhouette in zip(maps, corners, silhouettes, strict=True):
            own[:] = (begin, silhouette.size[1], silhouette.size[0], 1)
            box[:] = (*silhouette.corner, *silhouette.signed.shape[::-1])
            begin += silhouette.signed.size
        signed = np.concatenate([silhouette.signed.ravel() for silhouette in silhouettes])
        views, near = np.array([numbers_of(camera) for camera in cameras]), NEAR_MM / np.array(mm)
        seen = signed, corners, maps, views, near
        placed, step = self.placed(pose), STEP_MM * scale_of(self._body)
        found = list[NDArray[np.bool_]]()
        for view, (camera, own) in enumerate(zip(cameras, pixels, strict=True)):
            there = np.zeros((len(own), len(self.limbs)), np.bool_)
            rays = directions(camera, own) @ camera.rotation
            rays /= np.linalg.norm(rays, axis=1, keepdims=True)
            fill_limbs_there(*seen, view, camera.centre, rays, *placed, step, LEAST_AGREEING, there)
            there[:, ~self.moves] = np.any(there, axis=1, keepdims=True)
            found.append(there)
        return found


@lru_cache(maxsize=16)
def limb_reach_of(body: BodyModel, names: tuple[str, ...]) -> LimbReach:
    """The reach of a body's limbs, kept: it takes half a second. names : (L,) limb that each drawn one belongs to."""
    return LimbReach(body, names)


def _hung_from(body: BodyModel, names: Sequence[str], limb: str) -> int:
    """The joint that a limb hangs from; -1 of what hangs from the world."""
    at = moving_joint(body, body.drawn[list(names).index(limb)].joint)
    while at >= 0:
        above = body.joints[at].parent
        moving = moving_joint(body, above)
        if moving < 0 or body.parameters[body.joints[moving].parameters[-1]].limb != limb:
            return above
        at = moving
    return -1


@njit(**EXACT)
def is_reached(frames: Array, halves: Array, cubes: Bytes, limb: int, x: float, y: float, z: float) -> bool:
    """Whether a limb may lie at a place, mm. Others : as of `Placed`."""
    half, frame = halves[limb], frames[limb]
    dx, dy, dz = x - frame[0, 3], y - frame[1, 3], z - frame[2, 3]
    a = frame[0, 0] * dx + frame[1, 0] * dy + frame[2, 0] * dz + half
    b = frame[0, 1] * dx + frame[1, 1] * dy + frame[2, 1] * dz + half
    c = frame[0, 2] * dx + frame[1, 2] * dy + frame[2, 2] * dz + half
    whole = 2.0 * half
    if not (0.0 <= a < whole and 0.0 <= b < whole and 0.0 <= c < whole):
        return False
    count = cubes.shape[1]
    each = count / whole
    i, j, k = min(int(a * each), count - 1), min(int(b * each), count - 1), min(int(c * each), count - 1)
    return cubes[limb, i, j, k] > 0


@njit(**EXACT)
def is_reached_by_any(frames: Array, halves: Array, cubes: Bytes, x: float, y: float, z: float) -> bool:
    """Whether any limb may lie at a place, mm; anywhere, where no limb has cubes. Others : as of `Placed`."""
    some = False
    for limb in range(len(halves)):
        if is_reached(frames, halves, cubes, limb, x, y, z):
            return True
        some |= halves[limb] > 0.0
    return not some


@njit(**EXACT)
def is_agreed(
    signed: Floats,
    corners: NDArray[np.int64],
    maps: NDArray[np.int64],
    views: Array,
    near: Array,
    owner: int,
    place: tuple[float, float, float],
    least: float,
) -> bool:
    """Whether a share `least` of the other views that see a place, or more, show silhouette there."""
    seen = agreeing = 0
    for other in range(len(maps)):
        left, top, wide, high = corners[other]
        if other == owner or wide == 0:
            continue
        row, column = cell_at(maps, views, other, place[0], place[1], place[2])
        if row < 0:
            continue
        seen += 1
        row, column = row - top, column - left
        mapped = 0 <= row < high and 0 <= column < wide
        agreeing += mapped and signed[maps[other, 0] + row * wide + column] <= near[other]
    return agreeing >= least * seen


@njit(**EXACT)
def fill_limbs_there(
    signed: Floats,
    corners: NDArray[np.int64],
    maps: NDArray[np.int64],
    views: Array,
    near: Array,
    owner: int,
    eye: Array,
    rays: Array,
    frames: Array,
    halves: Array,
    cubes: Bytes,
    step: float,
    least: float,
    found: NDArray[np.bool_],
) -> None:
    """Set in (K, G) which limbs may lie on a view's rays (K, 3), of unit length.

    signed : of all silhouettes; corners : (V, 4) left, top, width and height of each one's map. maps : (V, 4) where it
    begins, rows and columns of the picture, and 1. views : as of `cell_at`. near : (V,) pixels. owner : the view. eye :
    (3,) mm. frames, halves, cubes : as of `Placed`. step : mm. least : as of `is_agreed`.
    """
    entry, leaving, new = np.zeros(len(halves)), np.zeros(len(halves)), np.zeros(len(halves), np.bool_)
    for ray in range(len(rays)):
        x, y, z = rays[ray]
        first, last = np.inf, -np.inf
        for limb in range(len(halves)):
            dx, dy, dz = frames[limb, 0, 3] - eye[0], frames[limb, 1, 3] - eye[1], frames[limb, 2, 3] - eye[2]
            along = dx * x + dy * y + dz * z
            rest = 3.0 * halves[limb] ** 2 - (dx * dx + dy * dy + dz * dz - along * along)
            half = np.sqrt(rest) if rest > 0.0 else -1.0
            entry[limb], leaving[limb] = along - half, along + half
            if half >= 0.0:
                first, last = min(first, entry[limb]), max(last, leaving[limb])
        if first > last:
            continue
        for number in range(int(np.ceil(max(first, step) / step)), int(np.floor(max(last, 0.0) / step)) + 1):
            depth = number * step
            px, py, pz = eye[0] + depth * x, eye[1] + depth * y, eye[2] + depth * z
            for limb in range(len(halves)):
                new[limb] = entry[limb] <= depth <= leaving[limb] and not found[ray, limb]
                new[limb] = new[limb] and is_reached(frames, halves, cubes, limb, px, py, pz)
            if new.any() and is_agreed(signed, corners, maps, views, near, owner, (px, py, pz), least):
                found[ray] |= new
