"""Cameras at other places, a grid of these, and which of the grid tell most."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.cameras import placed_camera
from studio.results.rig.bound import LinearMotion, ViewInformation, errors_of, total, view_information
from studio.results.uncertainty.twin import TwinCamera

Place = tuple[float, float, float]
ALONG_SIDE = 11
"""Places of a grid along the longer side of the room, unless they are asked for closer."""
MOST_PLACES = 600
NEAREST = 0.75
"""Of the distance at which the nearest camera stands now: nearer to the subject's path is no place."""
SEEN = 0.5
"""A place from which less of the body is in the picture is not chosen."""
FARTHEST = 1e6
"""Of a place from the origin, mm."""
APART_HEIGHT = 250.0
MOST_EXCHANGES = 3


def camera_at(
    name: str, place: Place, subject: Place, cameras: Sequence[Camera], lens: str = ""
) -> TwinCamera:
    """A camera at a place that looks at the subject. lens : the camera of whose kind it is, and whose masks its own
    resemble; by default the one from which the subject looks most alike.

    Raises CalibrationError for a place right above or below the subject.
    """

    def towards(point: Array) -> Array:
        away = point - np.array(subject)
        return away / max(float(np.linalg.norm(away)), 1e-9)

    own = [one for one in cameras if one.name == lens] or sorted(
        cameras, key=lambda one: -float(towards(one.centre) @ towards(np.array(place)))
    )
    like = own[0]
    aimed = placed_camera(
        name,
        place,
        subject,
        size=(like.width, like.height),
        focal_px=1.0,
        roll=like.quarter_turns * math.pi / 2.0,
    )
    camera = replace(like, name=name, rotation=aimed.rotation, translation=aimed.translation)
    return TwinCamera(camera, like.name)


def grid_of(
    cameras: Sequence[Camera], path: Array, heights: Sequence[float], spacing: float | None, scale: float
) -> tuple[list[Place], float]:
    """Places on a grid over the floor that the cameras and the subject's path, (F, 3), take up, at each height, and how
    far apart they are. heights : mm, those of the cameras by default.

    Raises RunError for more than MOST_PLACES, and for a height that is none.
    """
    if wrong := [height for height in heights if not abs(height) <= FARTHEST]:
        raise RunError(f"{wrong[0]:g} mm is no height.", "Write heights over the floor in mm, such as 2400.")
    centres = np.stack([camera.centre for camera in cameras])
    floor = np.concatenate([centres, path])[:, :2]
    low, high = floor.min(axis=0), floor.max(axis=0)
    step = spacing or float((high - low).max()) / (ALONG_SIDE - 1)
    counts = [int(side / step + 1e-6) for side in (high - low).tolist()]
    levels = tuple(heights) or _levels(sorted(centres[:, 2].tolist()), APART_HEIGHT * scale)
    number = (counts[0] + 1) * (counts[1] + 1) * len(levels)
    if number > MOST_PLACES:
        raise RunError(
            f"A grid of {step:.0f} mm has {number} places, and at most {MOST_PLACES} are looked at.",
            "Take a wider spacing, or fewer heights.",
        )
    # In the middle of the room, whatever is left over along a side.
    begin = low + 0.5 * (high - low - step * np.array(counts))
    nearest = NEAREST * min(float(np.linalg.norm(path - centre, axis=1).min()) for centre in centres)
    places = [
        (float(begin[0] + step * column), float(begin[1] + step * row), float(level))
        for level in levels
        for row in range(counts[1] + 1)
        for column in range(counts[0] + 1)
    ]
    return [
        place for place in places if float(np.linalg.norm(path - np.array(place), axis=1).min()) >= nearest
    ], step


def _levels(heights: Sequence[float], apart: float) -> tuple[float, ...]:
    """The lowest, the middle and the highest, those that are alike once."""
    levels: list[float] = []
    for height in (heights[-1], heights[len(heights) // 2], heights[0]):
        if all(abs(height - other) >= apart for other in levels):
            levels.append(height)
    return tuple(levels)


Weigh = Callable[[Array], Array]
"""weigh(errors) of errors (…, M), of points in mm by the bound, is what is to be small, (…)."""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """Places of a grid. chosen : by number, in the order in which they were. seen : share of the body in the picture of
    each. added : what is to be small, with each added to the rig.
    """

    chosen: tuple[int, ...]
    seen: tuple[float, ...]
    added: Array


def choose(
    motion: LinearMotion,
    kept: Sequence[ViewInformation],
    present: Sequence[ViewInformation],
    candidates: Sequence[Camera],
    count: int,
    weigh: Weigh,
    progress: Callable[[int, int], None],
) -> Choice:
    """The `count` candidates with which the errors are least, beside `kept` cameras: one after the other, then each
    exchanged for a better one until none is (Fedorov 1972). present : the rig, to which each is added for comparison.

    Raises RunError where too few see the subject.
    """
    views: list[ViewInformation] = []
    for at, camera in enumerate(candidates):
        progress(at, len(candidates))
        views.append(view_information(motion, camera))
    usable = [at for at, one in enumerate(views) if one.sees >= SEEN]
    if len(usable) < count:
        raise RunError(
            f"Only {len(usable)} of {len(views)} places of the grid have half of the body in their picture.",
            "Take a closer spacing, places that are farther away, or a lens that sees more.",
        )

    def least(base: Array, among: Sequence[int]) -> tuple[int, float]:
        values = [float(weigh(errors_of(motion, base + views[at].information))) for at in among]
        best = int(np.argmin(values))
        return among[best], values[best]

    base, chosen, reached = total(kept, motion), list[int](), math.inf
    for number in range(count):
        progress(number, count)
        at, reached = least(base + total([views[one] for one in chosen], motion), _others(usable, chosen))
        chosen.append(at)
    for _ in range(MOST_EXCHANGES if count > 1 else 0):
        before = tuple(chosen)
        for place in range(count):
            rest = [one for number, one in enumerate(chosen) if number != place]
            at, value = least(base + total([views[one] for one in rest], motion), _others(usable, rest))
            if value < reached - 1e-9:
                chosen[place], reached = at, value
        if tuple(chosen) == before:
            break
    now = total(present, motion)
    added = np.array([float(weigh(errors_of(motion, now + one.information))) for one in views])
    return Choice(tuple(chosen), tuple(one.sees for one in views), added)


def _others(usable: Sequence[int], chosen: Sequence[int]) -> list[int]:
    return [at for at in usable if at not in chosen]


def parsed_place(text: str) -> Place:
    """A place as "X,Y,Z", mm. Raises RunError for any other text."""
    parts = text.split(",")
    try:
        x, y, z = (float(part) for part in parts)
    except ValueError:
        x = y = z = math.nan
    if not all(abs(one) <= FARTHEST for one in (x, y, z)):
        raise RunError(f"'{text[:60]}' is no place.", "Write X,Y,Z in mm, such as 2500,-1200,1800.")
    return (x, y, z)


def names_beside(count: int, taken: Sequence[str], stem: str = "new") -> list[str]:
    """Names of `count` new cameras that no other has."""
    free = (name for number in itertools.count(1) if (name := f"{stem}{number}") not in taken)
    return list(itertools.islice(free, count))
