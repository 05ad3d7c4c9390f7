"""Masks of a person from the network, for all frames of a session: without a picture of the empty room, and without
movement.

Frame by frame the network looks where each camera last saw the person. Cameras must agree on where he is: the middles
of his shoulders, hips, knees and ankles, which left and right exchanged do not move, are triangulated, and a camera
that saw another person, or none, looks again where the others' points lie in its picture. In the first frame, and
where he is lost, all pictures are searched; of several persons the one is followed that most cameras see, then the
largest; after he was lost, first of all the one who is where he was.
"""

import itertools
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import cv2
import numpy as np

from studio.evidence.person_network import HIPS_ROW, PRESENT, SHOULDERS_ROW, Crop, Detection, PersonNetwork
from studio.footage.calibration.floor import triangulated
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import CalibrationError, FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.progress import Progress

FOLLOWING = "cutting the person out"
SEARCHED_EVERY = 0.25
"""Seconds between two searches of whole pictures."""
SAME_PLACE = 1000.0
"""Distance (mm) from where the person was last within which a person is taken for the same one."""
APART = 0.12
"""Mean distance of a camera's points from the others', as a share of its crop's side, from which it sees another
person. On the balancing man the right person's lie within 0.05, the bystander's beyond 0.3.
"""

BESIDE, SIZE_RATIO = 0.2, 1.6
"""Of a person who is looked for where the others' points lie: distance of the crops' middles as a share of their side,
and the ratio of their sides. Points of a person upside down are too coarse for `APART`."""
PRESENT_BESIDE = 0.2
"""Presence from which he counts as seen where the others' points lie, in the better of two looks: that of people upside
down falls, while their masks stay good."""

Detections = dict[str, Detection]
Made = TypeVar("Made")


@dataclass(frozen=True, slots=True, eq=False)
class PersonMasks:
    """One frame. masks : (H, W) uint8, 0 or 255, by camera. unseen : cameras that see no person (empty masks)."""

    frame: int
    masks: Mapping[str, Bytes]
    unseen: tuple[str, ...]


def person_masks(cameras: Sequence[Camera], footage: Footage, progress: Progress) -> Iterator[PersonMasks]:
    """The masks of one person in every frame, in the order in which they are found.

    Where he is lost, the frames ahead are searched every `SEARCHED_EVERY` seconds, and from the one that shows him he
    is followed backwards too. Raises FootageError if no camera sees anybody in any frame.
    """
    with _network_threads(cameras) as threads:
        anybody = False
        for done, (frame, pictures, seen) in enumerate(_follow_all(cameras, footage, threads, progress), 1):
            anybody = anybody or bool(seen)
            masks = _each(threads, seen, partial(_mask, seen, pictures))
            absent = footage.absent(frame)
            for camera in cameras:
                if camera.name not in seen:
                    width, height = footage.size(camera.name)
                    masks[camera.name] = np.zeros((height, width), np.uint8)
            unseen = tuple(
                camera.name for camera in cameras if camera.name not in seen and camera.name not in absent
            )
            yield PersonMasks(frame, masks, unseen)
            progress(FOLLOWING, done, footage.frame_count)
        if not anybody:
            raise FootageError(
                "No camera sees a person in any frame.",
                "Paint strokes, or use a picture of the empty room: the network knows people only.",
            )


def followed_person(
    cameras: Sequence[Camera], footage: Footage, progress: Progress
) -> Iterator[tuple[int, Detections]]:
    """Of every frame who is seen in each camera, frames in the order in which that is known."""
    with _network_threads(cameras) as threads:
        for done, (frame, _, seen) in enumerate(_follow_all(cameras, footage, threads, progress), 1):
            yield frame, seen
            progress(FOLLOWING, done, footage.frame_count)


def _network_threads(cameras: Sequence[Camera]) -> ThreadPoolExecutor:
    """A thread a camera at most; OpenCV starts none of its own."""
    cv2.setNumThreads(1)
    return ThreadPoolExecutor(min(len(cameras), os.cpu_count() or 1), "person network")


Followed = tuple[int, Mapping[str, Bytes], Detections]
"""A frame, its pictures by camera, and who is seen in them."""


def _follow_all(
    cameras: Sequence[Camera], footage: Footage, threads: ThreadPoolExecutor, progress: Progress
) -> Iterator[Followed]:
    step = max(1, round(SEARCHED_EVERY * footage.fps))
    follower = _Follower(tuple(cameras), threads, step)
    count, frame = footage.frame_count, 0
    while frame < count:
        pictures = follower.pictures(footage, frame)
        seen = follower.follow(frame, pictures)
        if seen:
            yield frame, pictures, seen
            frame += 1
            continue
        lost = frame
        for frame in range(lost, count, step):
            progress(FOLLOWING, lost, count)
            pictures = follower.pictures(footage, frame)
            seen = follower.search(frame, pictures)
            if seen:
                break
        if not seen:
            yield from ((rest, {}, {}) for rest in range(lost, count))
            return
        yield frame, pictures, seen
        backwards = follower.copy()
        for before in range(frame - 1, lost - 1, -1):
            earlier = {} if not seen else follower.pictures(footage, before)
            seen = backwards.follow(before, earlier, searches=False) if earlier else {}
            yield before, earlier, seen
        frame += 1


class _Follower:
    """Follows one person through the frames of all cameras. step : frames between two searches."""

    def __init__(self, cameras: tuple[Camera, ...], threads: ThreadPoolExecutor, step: int) -> None:
        self._cameras = {camera.name: camera for camera in cameras}
        self._networks = {camera.name: PersonNetwork() for camera in cameras}
        self._threads, self._step = threads, step
        self._crops: dict[str, Crop] = {}
        self._place: Array | None = None
        """(3,) mm: his hips, where two cameras saw him last."""
        self._searched = -step

    def copy(self) -> "_Follower":
        """A copy that continues from here independently, with the same networks."""
        other = copy(self)
        other._crops = dict(self._crops)
        return other

    def pictures(self, footage: Footage, frame: int) -> dict[str, Bytes]:
        """The frame's pictures, of the cameras that have one."""
        absent = footage.absent(frame)
        names = [name for name in self._cameras if name not in absent]
        return _each(self._threads, names, partial(footage.picture, frame=frame))

    def follow(self, frame: int, pictures: Mapping[str, Bytes], searches: bool = True) -> Detections:
        """Where each camera sees the person near where it saw him last; cameras that do not are missing.

        searches : whether all pictures are searched, now and then, while only one of several cameras sees him.
        """
        seen = self._look(pictures, {name: crop for name, crop in self._crops.items() if name in pictures})
        agreed, points = _agreeing(self._cameras, seen)
        if len(seen) == 1 and not agreed:
            if searches and len(pictures) > 1 and frame - self._searched >= self._step:
                persons = self.search(frame, pictures)
                if len(persons) > 1:
                    return persons
            agreed = dict(seen)
        return self._complete(pictures, agreed, points)

    def search(self, frame: int, pictures: Mapping[str, Bytes]) -> Detections:
        """The person in new pictures: the one at the last place, then whom most cameras see, then the largest."""
        self._searched = frame

        def find(name: str) -> list[Detection]:
            return self._networks[name].find(pictures[name], self._cameras[name].quarter_turns)

        persons = _each(self._threads, pictures, find)
        if len(pictures) == 1:
            ((name, candidates),) = persons.items()
            largest = max(candidates, key=lambda one: _share_of(one, pictures[name]), default=None)
            return self._complete(pictures, {} if largest is None else {name: largest}, None)
        best: tuple[tuple[bool, int, float], Detections, Array | None] = ((False, 0, 0.0), {}, None)
        for one, other in itertools.combinations(pictures, 2):
            for pair in itertools.product(persons[one], persons[other]):
                seen = {one: pair[0], other: pair[1]}
                points = _triangulated(self._cameras, seen)
                if points is None:
                    continue
                seen = {
                    name: nearest
                    for name in pictures
                    if (nearest := _nearest(self._cameras[name], points, persons[name])) is not None
                }
                near = (
                    self._place is not None
                    and float(np.linalg.norm(points[HIPS_ROW] - self._place)) < SAME_PLACE
                )
                score = near, len(seen), sum(_share_of(one, pictures[name]) for name, one in seen.items())
                if len(seen) >= 2 and score > best[0]:
                    best = score, seen, points
        return self._complete(pictures, best[1], best[2])

    def _complete(
        self, pictures: Mapping[str, Bytes], agreed: Detections, points: Array | None
    ) -> Detections:
        """These detections, and new ones at the others' points (5, 3) where a camera saw no person, or another."""
        if points is not None:
            size = _size(self._cameras, agreed, points)
            again = {
                name: crop
                for name in pictures
                if name not in agreed and (crop := _projected(self._cameras[name], points, size)) is not None
            }
            rough = self._look(pictures, again, 0.0)
            fine = self._look(pictures, {name: one.next_crop for name, one in rough.items()}, 0.0)
            for name, one in fine.items():
                better = max(rough[name], one, key=lambda look: look.presence)
                if better.presence >= PRESENT_BESIDE and _beside(better.next_crop, again[name]):
                    agreed = {**agreed, name: better}
            self._place = points[HIPS_ROW]
        self._crops = {name: one.next_crop for name, one in agreed.items()}
        return {name: agreed[name] for name in pictures if name in agreed}

    def _look(
        self, pictures: Mapping[str, Bytes], crops: Mapping[str, Crop], least: float = PRESENT
    ) -> Detections:
        def look(name: str) -> Detection:
            return self._networks[name].look(pictures[name], crops[name])

        looks = _each(self._threads, crops, look)
        return {name: one for name, one in looks.items() if one.is_person(least)}


def _each(threads: ThreadPoolExecutor, names: Iterable[str], make: Callable[[str], Made]) -> dict[str, Made]:
    chosen = list(names)
    return dict(zip(chosen, threads.map(make, chosen), strict=True))


def _mask(seen: Detections, pictures: Mapping[str, Bytes], name: str) -> Bytes:
    return seen[name].mask(pictures[name])


def _agreeing(cameras: Mapping[str, Camera], seen: Detections) -> tuple[Detections, Array | None]:
    """The largest set of detections that are of one person, and his points; all of them where there is one camera."""
    if len(cameras) == 1:
        return dict(seen), None
    best: tuple[tuple[int, float], Detections, Array | None] = ((0, 0.0), {}, None)
    for names in [tuple(seen), *itertools.combinations(seen, 2)]:
        points = _triangulated(cameras, {name: seen[name] for name in names}) if len(names) > 1 else None
        if points is None:
            continue
        distances = {name: _distance(cameras[name], points, one) for name, one in seen.items()}
        near = {name: seen[name] for name, distance in distances.items() if distance < APART}
        score = len(near), -sum(distances[name] for name in near)
        if len(near) >= 2 and score > best[0]:
            best = score, near, points
            if len(near) == len(seen):
                break
    return best[1], best[2]


def _triangulated(cameras: Mapping[str, Camera], seen: Detections) -> Array | None:
    """(5, 3) `Detection.middles` in the world, None if they are nowhere."""
    try:
        points = triangulated(
            [cameras[name] for name in seen], {name: one.middles() for name, one in seen.items()}
        )
    except CalibrationError:
        return None
    return points if np.isfinite(points).all() else None


def _distance(camera: Camera, points: Array, seen: Detection) -> float:
    """Mean distance of points (5, 3) from those a camera sees, as a share of its crop; inf behind the camera."""
    pixels, depths = project(camera, points)
    if (depths <= 0.0).any():
        return float("inf")
    return float(np.linalg.norm(pixels - seen.middles(), axis=1).mean()) / seen.next_crop.side


def _nearest(camera: Camera, points: Array, persons: Sequence[Detection]) -> Detection | None:
    """The one whose points lie nearest to points (5, 3) of the world, None if none is near."""
    nearest = min(persons, key=lambda one: _distance(camera, points, one), default=None)
    return nearest if nearest is not None and _distance(camera, points, nearest) < APART else None


def _size(cameras: Mapping[str, Camera], seen: Detections, points: Array) -> float:
    """Side (mm) of a crop around the person whose points (5, 3) these are, by those who see him."""
    sizes: list[float] = []
    for name, one in seen.items():
        depth = float(project(cameras[name], points[HIPS_ROW : HIPS_ROW + 1])[1][0])
        sizes.append(one.next_crop.side * depth / float(cameras[name].matrix[0, 0]))
    return float(np.median(sizes))


def _projected(camera: Camera, points: Array, size: float) -> Crop | None:
    """Where a camera should see points (5, 3), in a crop of `size` mm; None if outside its picture."""
    pixels, depths = project(camera, points)
    if (depths <= 0.0).any() or not np.isfinite(pixels).all():
        return None
    inside = ((pixels >= 0.0) & (pixels < [camera.width, camera.height])).all(axis=1)
    if not inside.any():
        return None
    middle, up = pixels[HIPS_ROW], pixels[SHOULDERS_ROW] - pixels[HIPS_ROW]
    side = size * float(camera.matrix[0, 0] / depths[HIPS_ROW])
    return Crop(float(middle[0]), float(middle[1]), side, math.atan2(up[0], -up[1]))


def _beside(one: Crop, expected: Crop) -> bool:
    """Whether a crop lies where it is expected, at about its size."""
    apart = math.hypot(one.x - expected.x, one.y - expected.y) / expected.side
    return apart < BESIDE and abs(math.log(one.side / expected.side)) < math.log(SIZE_RATIO)


def _share_of(seen: Detection, picture: Bytes) -> float:
    return float((seen.logits > 0.0).mean()) * seen.crop.side**2 / (picture.shape[0] * picture.shape[1])
