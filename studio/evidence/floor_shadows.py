# pyright: standard
"""Which pixels that look like a shadow cannot be one: the floor that they would lie on is seen empty from elsewhere.

The shadow test of one camera (`background`) cannot tell a forearm on a floor of its own colour from a darker floor. The
other cameras can. A shadow on the floor z = 0 is changed for the cameras that see that place of the floor, and as dark
for them: a floor scatters light to all sides. Where none sees the place so, what hides it from the first camera may
stand above the floor: on the pixel's ray, at a place that every camera sees changed. Pixels for which both holds are
the subject's; where only one does, nobody can tell. All is decided on cells of some pixels.

Where the floor is not at z = 0, as on a table or a stage, shadows would be taken for the subject. So where all that
changed stays clearly above z = 0, the floor is what is lowest of it. Lengths are shares of the distance between the
cameras and what they look at, so that a mouse's cage is treated as a hall. A shadow on a thing that stands on the floor
may be taken for the subject: on one drawn clip of thirteen, with a stool, by 1.3 per cent of the body's area.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.cells import cell_at, cell_size, numbers_of
from studio.foundations.arrays import Array, Bytes, Floats
from studio.foundations.geometry.camera import Camera
from studio.foundations.numba_in_threads import EXACT, njit

CHANGED_SHARE, SHADOW_SHARE = 0.375, 0.5
"""Of a cell's area, so that it counts as changed; of what changed in it, so that it counts as like a shadow."""
SAME, CHANGED, LIKE_SHADOW = 0, 1, 2
STEP, FARTHEST = 0.012, 1.5
"""Shares of the distance: between places on a ray, of the farthest from what the cameras look at."""
ABOVE, CLEARLY_ABOVE = 0.03, 0.08
"""Shares of the distance, above the floor, of the lowest place that may hide it: where brightness is compared, and
where it is not, so that a shadow that some camera does not see is taken for one that lies there."""
ALIKE = 0.01
"""Least mean square sine between the cameras' axes and any direction: below it, within 6 degrees, all look one way."""
SEEING = 2
"""Other cameras that see a place changed, at least; of two cameras the other one."""
PART = 0.06
"""Of a piece that looks like a shadow, so that any of it is the subject's: of a real shadow some places are hidden from
the other cameras by things that stand on the floor."""
NO_SHADOW, HIDDEN, SHADOW = 0, 1, 2
"""What a camera sees of a place of the floor."""
DENIED, BARELY_SEEN, DOUBTED, SEEN_ONCE, LIES_THERE = range(5)
"""What all cameras together say of a shadow on the floor. Two of them wait for what is said around: only one other
camera sees it, and others see bare floor (BARELY_SEEN) or do not (SEEN_ONCE)."""
CONFIRMING, DENYING = 2, 2
"""Other cameras that see a shadow, without which it is doubted, and that see bare floor, so that one alone that sees a
shadow does not count. Of twelve drawn people in the colours of their rooms, what one camera confirms and something
above the floor may hide is the subject's by three parts of seven; what two confirm, by one part of twenty."""
WINDOW, SEEN_AROUND = 7, 0.97
"""Cells along a side, around one that only one other camera confirms; of those in it that look like a shadow, the
share that is confirmed too, so that this one is a shadow: a thing that stands on the floor keeps a camera from seeing
the whole of it. Of those twelve and twelve in other clothes, such cells are the subject's by one part of forty, and the
others that one camera confirms by three of ten."""
SUBJECT, UNKNOWN = 1, 2
"""Of cells that look like a shadow: what they are instead, and where that cannot be told."""
SAMPLED, LOWER, AROUND = 800, 0.03, 0.05
"""About so many changed cells tell where the scene is; which of their lowest places, in order of height, is the floor
at most; share of the distance by which the scene is larger."""
FLOORS = -0.06, 0.06, 0.005
"""Shares of the distance, above what is lowest, at which a floor is looked for: first, last, step."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """A picture's cells. kinds : (h, w) SAME, CHANGED or LIKE_SHADOW. size : pixels along a cell's side. brightness :
    (h, w) of what passes for shadow in a cell, as a share of the background's; 0 where it is not known.
    """

    kinds: Bytes
    size: int
    brightness: Floats


def cells_of(mask: Bytes, shadow: Bytes | None, brightness: Floats | None = None) -> Cells:
    """mask : (H, W) 0 or 255. shadow : (H, W) 255 where a pixel changed but passes for shadow; None: nowhere.
    brightness : as in `Cells`; None: it is not known.
    """
    height, width = mask.shape
    size = cell_size(height, width)
    kinds = np.zeros((-(-height // size), -(-width // size)), np.uint8)
    if brightness is None:
        brightness = np.zeros(kinds.shape, np.float32)
    changed = mask if shadow is None else mask | shadow
    left, top, across, down = cv2.boundingRect(changed)
    if not across:
        return Cells(kinds, size, brightness)
    # Whole cells around all that changed: a picture is mostly empty.
    left, top, right, bottom = (
        left // size,
        top // size,
        -(-(left + across) // size),
        -(-(top + down) // size),
    )

    def shares(picture: Bytes) -> NDArray[np.float32]:
        part = picture[top * size : bottom * size, left * size : right * size]
        beyond = (bottom - top) * size - part.shape[0], (right - left) * size - part.shape[1]
        whole = (
            cv2.copyMakeBorder(part, 0, beyond[0], 0, beyond[1], cv2.BORDER_CONSTANT) if any(beyond) else part
        )
        small = cv2.resize(whole, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.float32) / np.float32(255.0)

    everything = shares(changed)
    passing = np.zeros_like(everything) if shadow is None else shares(shadow)
    kinds[top:bottom, left:right] = np.where(
        everything < CHANGED_SHARE,
        SAME,
        np.where(passing >= SHADOW_SHARE * everything, LIKE_SHADOW, CHANGED),
    )
    return Cells(kinds, size, brightness)


def pixels_of(shadow: Bytes, chosen: NDArray[np.bool_], size: int) -> Bytes | None:
    """(H, W) what passes for shadow, of it only what lies in some cells; None where no cell is chosen. shadow : (H, W).
    chosen : (h, w). size : of a cell, pixels.
    """
    if not chosen.any():
        return None
    whole = cv2.resize(chosen.view(np.uint8), None, fx=size, fy=size, interpolation=cv2.INTER_NEAREST)
    return np.where(whole[: shadow.shape[0], : shadow.shape[1]] > 0, shadow, np.uint8(0))


@functools.lru_cache(maxsize=8)
def floor_shadows(cameras: tuple[Camera, ...]) -> "FloorShadows":
    """That of some cameras, kept."""
    return FloorShadows(cameras)


class FloorShadows:
    """Tells floor shadows from what only looks like one, in all pictures of a frame; immutable.

    usable : whether there are cameras that look from several sides, all above z = 0.
    """

    def __init__(self, cameras: Sequence[Camera]) -> None:
        self._cameras = tuple(cameras)
        self._views = np.array([(*numbers_of(camera), *camera.centre) for camera in cameras])
        centres = np.array([camera.centre for camera in cameras])
        self._middle, self._distance = _middle_seen(
            centres, np.array([camera.rotation[2] for camera in cameras])
        )
        self.usable = bool((centres[:, 2] > CLEARLY_ABOVE * self._distance).all())
        self._rays = functools.cache(self._rays_of)

    def unexplained(self, seen: Sequence[Cells], tolerance: float = 0.0, doubts: bool = False) -> list[Bytes]:
        """For each camera (h, w) SUBJECT where a cell looks like a shadow and cannot be one, UNKNOWN where that cannot
        be told, else 0. seen : one a camera. tolerance : by which the logarithms of a shadow's brightness differ
        between cameras at most, where it is known. doubts : whether any may be unknown; else such a one is a shadow.
        """
        kinds = [cells.kinds.ravel() for cells in seen]
        chosen = [np.zeros_like(cells.kinds) for cells in seen]
        like = [np.flatnonzero(own == LIKE_SHADOW) for own in kinds]
        owners, rays = self._rays_through(seen, like)
        if not len(owners):
            return chosen
        everything, maps = np.concatenate(kinds), _maps(seen)
        scene, least = self._scene(everything, seen, maps), min(SEEING, len(seen) - 1)
        if scene is None:
            return chosen
        bright = np.concatenate([cells.brightness.ravel() for cells in seen])
        each: Floats = np.concatenate(
            [cells.brightness.ravel()[at] for cells, at in zip(seen, like, strict=True)]
        )

        def shadows_at(height: float) -> NDArray[np.uint8]:
            given = everything, bright, maps, self._views, owners, rays, each, tolerance, height, doubts
            return on_floor(*given)

        explained = shadows_at(0.0)
        if scene[0, 2] > 0.0:
            # The lowest of what changed is where the floor may be, give or take what no camera sees below it; where
            # z = 0 explains more, what stands on it is hidden, or calibrations are off.
            heights = scene[0, 2] + self._distance * np.arange(*FLOORS)
            others = [shadows_at(height) for height in heights]
            counts = [np.count_nonzero(other > BARELY_SEEN) for other in others]
            most, at_zero = int(np.argmax(counts)), np.count_nonzero(explained > BARELY_SEEN)
            if counts[most] > at_zero:
                explained, scene[0, 2] = others[most], heights[most]
            elif counts[most] < at_zero:
                scene[0, 2] = 0.0
        scene[0, 2] += (ABOVE if tolerance else CLEARLY_ABOVE) * self._distance
        if doubts:
            for number, (own, cells) in enumerate(zip(like, seen, strict=True)):
                mine = owners == number
                explained[mine] = _settled(explained[mine], own, cells.kinds.shape)
        certain = explained == LIES_THERE
        places = lowest_changed(
            everything, maps, self._views, owners, rays, certain, scene, STEP * self._distance, least
        )
        anywhere, denied = np.isfinite(places[:, 2]), explained == DENIED
        unknown = doubts & (denied | (~certain & anywhere))
        for number, (own, cells) in enumerate(zip(like, seen, strict=True)):
            mine, cell = owners == number, chosen[number].ravel()
            cell[own[(denied & anywhere)[mine]]] = SUBJECT
            _drop_lesser_parts(chosen[number], cells.kinds)
            open_cells = own[unknown[mine]]
            cell[open_cells[cell[open_cells] != SUBJECT]] = UNKNOWN
        return chosen

    def _scene(self, kinds: Bytes, seen: Sequence[Cells], maps: NDArray[np.int64]) -> Array | None:
        """(2, 3) mm, a box around what changed, upwards from the floor; None without any. The floor is at 0, or, where
        all that changed stays clearly above, at what is lowest of it.
        """
        changed = [np.flatnonzero(cells.kinds) for cells in seen]
        stride = 1 + sum(map(len, changed)) // SAMPLED
        changed = [own[::stride] for own in changed]
        owners, rays = self._rays_through(seen, changed)
        reach = FARTHEST * self._distance
        anywhere = np.array([[-reach, -reach, 0.0], [reach, reach, reach]]) + self._middle * (1.0, 1.0, 0.0)
        places = lowest_changed(
            kinds,
            maps,
            self._views,
            owners,
            rays,
            np.zeros(len(rays), np.bool_),
            anywhere,
            STEP * self._distance,
            min(SEEING, len(seen) - 1),
        )
        places = places[np.isfinite(places[:, 2])]
        if not len(places):
            return None
        around = AROUND * self._distance
        box = np.stack([places.min(axis=0) - around, places.max(axis=0) + around])
        lowest = float(np.quantile(places[:, 2], LOWER))
        box[0, 2] = lowest if lowest > CLEARLY_ABOVE * self._distance else 0.0
        return box

    def _rays_through(
        self, seen: Sequence[Cells], chosen: Sequence[NDArray[np.int64]]
    ) -> tuple[NDArray[np.int64], Array]:
        """(K,) numbers of the cameras and (K, 3) directions of some cells. chosen : of each camera."""
        rays = [
            self._rays(number, *cells.kinds.shape, cells.size)[own]
            for number, (cells, own) in enumerate(zip(seen, chosen, strict=True))
        ]
        return np.repeat(np.arange(len(seen)), [len(own) for own in chosen]), np.concatenate(rays)

    def _rays_of(self, number: int, high: int, wide: int, size: int) -> Array:
        """(h * w, 3) directions of unit length through a camera's cells."""
        camera = self._cameras[number]
        rows, columns = np.indices((high, wide))
        places = np.stack([columns.ravel(), rows.ravel()], axis=1) * float(size) + 0.5 * (size - 1)
        flat = cv2.undistortPoints(places[:, None], camera.matrix, camera.distortion)[:, 0]
        rays = np.column_stack([flat, np.ones(len(flat))]) @ camera.rotation
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _settled(explained: Bytes, own: NDArray[np.int64], shape: tuple[int, ...]) -> Bytes:
    """(K,) DENIED, DOUBTED or LIES_THERE: a camera's cells that one other camera confirms are as those around them.
    explained : (K,) what is said of the cells own (K,), numbers in a picture of cells of that shape.
    """
    once = (explained == BARELY_SEEN) | (explained == SEEN_ONCE)
    around = np.zeros((2, *shape), np.float32)
    around[0].ravel()[own] = 1.0
    around[1].ravel()[own] = once | (explained == LIES_THERE)
    like, confirmed = (cv2.boxFilter(each, -1, (WINDOW, WINDOW)).ravel()[own] for each in around)
    said = np.where(explained == BARELY_SEEN, DENIED, np.where(explained == SEEN_ONCE, DOUBTED, explained))
    return np.where(once & (confirmed >= SEEN_AROUND * like), LIES_THERE, said).astype(np.uint8)


def _drop_lesser_parts(chosen: Bytes, kinds: Bytes) -> None:
    """Clear the chosen cells (h, w) of pieces like a shadow of which they are too small a part. kinds : (h, w)."""
    count, labelled = cv2.connectedComponents((kinds == LIKE_SHADOW).astype(np.uint8))
    pieces = np.asarray(labelled, np.int64)
    whole = np.bincount(pieces.ravel(), minlength=count)
    part = np.bincount(pieces[chosen > 0], minlength=count)
    chosen[part[pieces] < PART * whole[pieces]] = 0


def _middle_seen(centres: Array, axes: Array) -> tuple[Array, float]:
    """(3,) mm, the place that the axes (V, 3) of cameras at (V, 3) come nearest to, and their median distance from it;
    infinite for a single camera and where all look the same way.
    """
    across = (np.eye(3) - axes[:, :, None] * axes[:, None, :]).mean(axis=0)
    if np.linalg.eigvalsh(across)[0] < ALIKE:
        return np.zeros(3), np.inf
    along = np.einsum("vi,vi->v", axes, centres)[:, None] * axes
    place: Array = np.linalg.solve(across, (centres - along).mean(axis=0))
    return place, float(np.median(np.linalg.norm(centres - place, axis=1)))


def _maps(seen: Sequence[Cells]) -> NDArray[np.int64]:
    """(V, 4) where a camera's cells begin among all, their rows and columns, and their size, pixels."""
    begin, maps = 0, np.zeros((len(seen), 4), np.int64)
    for own, cells in zip(maps, seen, strict=True):
        own[:] = (begin, *cells.kinds.shape, cells.size)
        begin += cells.kinds.size
    return maps


@njit(**EXACT)
def seen_at(
    kinds: Bytes, maps: NDArray[np.int64], views: Array, owner: int, x: float, y: float, z: float, most: int
) -> tuple[int, int]:
    """How many other cameras than `owner` see a place (mm) changed, and how many unchanged, `most` of which end it.
    maps, views : as of `cell_at`.
    """
    changed = unchanged = 0
    for other in range(len(maps)):
        if other == owner:
            continue
        row, column = cell_at(maps, views, other, x, y, z)
        if row < 0:
            continue
        if kinds[maps[other, 0] + row * maps[other, 2] + column] == SAME:
            unchanged += 1
            if unchanged == most:
                break
        else:
            changed += 1
    return changed, unchanged


@njit(**EXACT)
def is_shadow_there(
    kinds: Bytes,
    brightness: Floats,
    cells: NDArray[np.int64],
    row: int,
    column: int,
    own: float,
    tolerance: float,
) -> int:
    """What a camera sees of a place of the floor in its cell and in those around it, as no calibration is exact.

    SHADOW : one that leaves a share `own` of the light, between the darkest and the lightest around give or take a
    tolerance of logarithms; any where brightness is not known (0). HIDDEN : something else that changed, in the cell
    itself or, where `own` is not known, around it. NO_SHADOW : neither. cells : row of `_maps`.
    """
    begin, high, wide, _ = cells
    least, most, hidden = np.inf, 0.0, kinds[begin + row * wide + column] == CHANGED
    for j in range(max(0, row - 1), min(high, row + 2)):
        for i in range(max(0, column - 1), min(wide, column + 2)):
            at = begin + j * wide + i
            if kinds[at] == LIKE_SHADOW:
                if own == 0.0 or brightness[at] == 0.0:
                    return SHADOW
                least, most = min(least, brightness[at]), max(most, brightness[at])
            elif kinds[at] == CHANGED:
                hidden |= own == 0.0
    if most > 0.0 and np.log(least) - tolerance <= np.log(own) <= np.log(most) + tolerance:
        return SHADOW
    return HIDDEN if hidden else NO_SHADOW


@njit(**EXACT)
def on_floor(
    kinds: Bytes,
    brightness: Floats,
    maps: NDArray[np.int64],
    views: Array,
    owners: NDArray[np.int64],
    rays: Array,
    own: Floats,
    tolerance: float,
    height: float,
    doubts: bool,
) -> NDArray[np.uint8]:
    """(K,) whether what is behind a cell on the floor, at a height (mm), may be shadow (DENIED to LIES_THERE):
    some other camera sees one as dark there, or the place is hidden from all that see it; where a cell's own brightness
    is not known that it is hidden from one is enough. kinds, brightness : of all cells. maps, views : as of `cell_at`.
    owners : (K,) the cells' cameras. rays : (K, 3). own : (K,) the cells' brightness. tolerance : as of
    `is_shadow_there`. doubts : whether to doubt, where brightness is known, what fewer than CONFIRMING see of those
    that look there, and to deny what one sees and DENYING do not.
    """
    explained = np.zeros(len(rays), np.uint8)
    for k in range(len(rays)):
        ray, centre = rays[k], views[owners[k], 23:]
        if ray[2] >= 0.0:
            continue
        along = (height - centre[2]) / ray[2]
        x, y = centre[0] + along * ray[0], centre[1] + along * ray[1]
        hidden = bare = shadows = 0
        asks = doubts and own[k] > 0.0
        for other in range(len(maps)):
            if other == owners[k]:
                continue
            row, column = cell_at(maps, views, other, x, y, height)
            if row < 0:
                continue
            there = is_shadow_there(kinds, brightness, maps[other], row, column, own[k], tolerance)
            shadows += there == SHADOW
            hidden += there == HIDDEN
            bare += there == NO_SHADOW
            if shadows and not asks:
                break
        if shadows:
            if not asks or shadows >= min(CONFIRMING, shadows + hidden + bare):
                explained[k] = LIES_THERE
            else:
                explained[k] = BARELY_SEEN if bare >= DENYING else SEEN_ONCE
        elif hidden > 0 and (own[k] == 0.0 or bare == 0):
            explained[k] = DOUBTED if asks else LIES_THERE
    return explained


@njit(**EXACT)
def lowest_changed(
    kinds: Bytes,
    maps: NDArray[np.int64],
    views: Array,
    owners: NDArray[np.int64],
    rays: Array,
    explained: NDArray[np.bool_],
    box: Array,
    step: float,
    least: int,
) -> Array:
    """(K, 3) mm, the lowest place on a cell's ray in a box (2, 3) that all cameras which see it see changed, `least`
    others or more; infinite without one, and where the floor explains the cell. step : mm between places.
    """
    places = np.full((len(rays), 3), np.inf)
    for k in range(len(rays)):
        if explained[k]:
            continue
        ray, centre = rays[k], views[owners[k], 23:]
        first, last = 0.0, np.inf
        for axis in range(3):
            one, other = (box[0, axis] - centre[axis]) / ray[axis], (box[1, axis] - centre[axis]) / ray[axis]
            first, last = max(first, min(one, other)), min(last, max(one, other))
        # From the far end, which is the lower one unless a camera looks up.
        along = last
        while along > first:
            x, y, z = (
                centre[0] + along * ray[0],
                centre[1] + along * ray[1],
                centre[2] + along * ray[2],
            )
            changed, unchanged = seen_at(kinds, maps, views, owners[k], x, y, z, 1)
            if unchanged == 0 and changed >= least:
                places[k, 0], places[k, 1], places[k, 2] = x, y, z
                break
            along -= step
    return places
