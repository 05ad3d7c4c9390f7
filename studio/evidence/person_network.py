"""Where a person is in a picture, and which pixels show him, without a picture of the empty room.

The network is Google's pose landmark model (MediaPipe Pose, "full"; `models/README.md`), run by OpenCV. It sees a
square crop of 256 pixels around one person and gives whether there is one, 39 points of him, and for each pixel how
likely it shows him. Two of the points, the middle of the hips and one above it at the body's reach, say where the next
crop lies, so that a person is followed from frame to frame; in the first, crops of several sizes are tried (`found`).
The points are coarse (several centimetres) and left and right are at times exchanged: they show where a person is and
which way is up, they are no pose.

The mask is refined at its border by the guided filter (`evidence.guided_filter`), so that it ends where the picture's
colour does.
"""

import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib import resources

import cv2
import numpy as np

from studio.evidence.guided_filter import guided
from studio.foundations.arrays import Array, Bytes, Floats

MODEL = "pose_landmark_full.tflite"
INPUT = 256
"""Pixels: side of the network's input and of its mask."""
SHOULDERS, HIPS, KNEES, ANKLES, NOSE = (11, 12), (23, 24), (25, 26), (27, 28), (0,)
MIDDLES = (NOSE, SHOULDERS, HIPS, KNEES, ANKLES)
SHOULDERS_ROW, HIPS_ROW = MIDDLES.index(SHOULDERS), MIDDLES.index(HIPS)
MIDDLE, TOP = 33, 34
"""The points that place the next crop."""
REACH = 1.25
"""Half the side of a crop, in distances between these two points."""
PRESENT = 0.5
"""Presence from which a crop counts as showing the person who is followed."""
FOUND = 0.99
"""Presence from which a new person is accepted, in two consecutive looks. People in rendered
rooms have 0.9995 and more; furniture passes for a person at 0.5 to 0.998, mostly in one look of two."""
SIZES = (1.1, 0.8, 0.55, 0.4)
"""Sides of the crops that are tried, as shares of the picture's longer side."""
STEP = 0.35
"""Distance between tried crops, as a share of their side."""
MOST_FOUND = 4
SAME_PERSON = 0.3
"""Two detections whose middles are nearer than this share of the larger one's side are of one person."""
GUIDED_RADIUS = 6
"""Of the guided filter: pixels of the network's mask. By the overlap with the true masks of three rendered clips (walk,
dance, kick of the choosing half): 3 or 6 pixels, ε of 1e-5 or 1e-4 differ by 0.003."""


@dataclass(frozen=True, slots=True)
class Crop:
    """A square of a picture. x, y : its middle, side : pixels. angle : radians, clockwise, of its upper side."""

    x: float
    y: float
    side: float
    angle: float = 0.0

    def to_picture(self) -> Array:
        """(2, 3) pixels of the picture from those of the network's input."""
        scale, middle = self.side / INPUT, (INPUT - 1) / 2.0
        turn = scale * np.array(
            [[math.cos(self.angle), -math.sin(self.angle)], [math.sin(self.angle), math.cos(self.angle)]]
        )
        return np.column_stack([turn, np.array([self.x, self.y]) - turn @ np.array([middle, middle])])


@dataclass(frozen=True, eq=False)
class Detection:
    """What the network sees in a crop.

    presence : 0 to 1. logits : (256, 256), above 0 where a pixel of the crop rather shows the person. points : (39, 2)
    pixels of the picture. crop : where it was looked.
    """

    presence: float
    logits: Floats
    points: Array
    crop: Crop

    @cached_property
    def next_crop(self) -> Crop:
        """Where to look for the same person again."""
        middle, up = self.points[MIDDLE], self.points[TOP] - self.points[MIDDLE]
        side = 2.0 * REACH * float(np.hypot(*up))
        return Crop(float(middle[0]), float(middle[1]), side, math.atan2(up[0], -up[1]))

    def is_person(self, least: float = PRESENT) -> bool:
        """Whether it shows a person of a plausible size. least : presence."""
        return self.presence >= least and self.next_crop.side > 16.0 and bool((self.logits > 0.0).any())

    def middles(self) -> Array:
        """(5, 2) nose and the middles of shoulders, hips, knees and ankles: the same with left and right exchanged."""
        return np.stack([self.points[list(pair)].mean(axis=0) for pair in MIDDLES])

    def mask(self, picture: Bytes) -> Bytes:
        """(H, W) uint8, 255 where the picture (H, W, 3) shows the person, refined at the border."""
        height, width = picture.shape[:2]
        out = np.zeros((height, width), np.uint8)
        place = self._place(width, height)
        if place is None:
            return out
        left, top, right, bottom = place
        part = picture[top:bottom, left:right]
        shift = self.crop.to_picture() - np.array([[0.0, 0.0, left], [0.0, 0.0, top]])
        share = 1.0 / (1.0 + np.exp(-np.clip(self.logits, -20.0, 20.0)))
        share = cv2.warpAffine(
            share.astype(np.float32), shift, (right - left, bottom - top), flags=cv2.INTER_LINEAR
        )
        radius = GUIDED_RADIUS * self.crop.side / INPUT
        out[top:bottom, left:right] = np.where(
            guided(part, np.asarray(share, np.float32), radius) > 0.5, 255, 0
        )
        return out

    def _place(self, width: int, height: int) -> tuple[int, int, int, int] | None:
        """Left, top, right, bottom (exclusive) of what the filter has to look at: the person's pixels and a margin, in
        a picture of this size; None if he is not in it.
        """
        rows, columns = np.nonzero(self.logits > 0.0)
        if not len(rows):
            return None
        low = np.array([columns.min(), rows.min()]) - 3.0 * GUIDED_RADIUS
        high = np.array([columns.max(), rows.max()]) + 3.0 * GUIDED_RADIUS
        corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        to_picture = self.crop.to_picture()
        square = corners @ to_picture[:, :2].T + to_picture[:, 2]
        left, top = np.maximum(np.floor(square.min(axis=0)), 0).astype(int)
        right, bottom = np.minimum(np.ceil(square.max(axis=0)) + 1, (width, height)).astype(int)
        if right - left < 2 or bottom - top < 2:
            return None
        return int(left), int(top), int(right), int(bottom)


class PersonNetwork:
    """The network, for one thread at a time."""

    def __init__(self) -> None:
        # OpenCV 5's new engine cannot load it; OpenCV 4 has only the classic one, and no word for it.
        engine = {"engine": cv2.dnn.ENGINE_CLASSIC} if hasattr(cv2.dnn, "ENGINE_CLASSIC") else {}
        with resources.as_file(resources.files("studio.evidence") / "models" / MODEL) as path:
            self._net = cv2.dnn.readNetFromTFLite(str(path), **engine)
        self._lock = threading.Lock()

    def look(self, picture: Bytes, crop: Crop) -> Detection:
        """What a crop of a picture (H, W, 3) BGR shows."""
        to_picture = crop.to_picture()
        square = cv2.warpAffine(
            picture, to_picture, (INPUT, INPUT), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        )
        with self._lock:
            self._net.setInput(cv2.dnn.blobFromImage(square, 1.0 / 255.0, swapRB=True))
            landmarks, presence, logits = self._net.forward(("Identity", "Identity_1", "Identity_2"))
        points = np.asarray(landmarks, np.float64).reshape(-1, 5)[:, :2]
        return Detection(
            float(np.asarray(presence).ravel()[0]),
            np.asarray(logits, np.float32)[0, 0],
            points @ to_picture[:, :2].T + to_picture[:, 2],
            crop,
        )

    def find(self, picture: Bytes, quarter_turns: int = 0) -> list[Detection]:
        """The persons of a picture (H, W, 3), at most four, the most certain first; each looked at in its own crop.

        quarter_turns : as of the camera; the tried crops are upright in the picture turned by them.
        """
        crops = _crops_over(picture.shape[1], picture.shape[0], -0.5 * math.pi * quarter_turns)
        first = [seen for seen in (self.look(picture, crop) for crop in crops) if seen.presence >= PRESENT]
        persons: list[Detection] = []
        # How much of a crop the person fills tells a crop around him from one that cuts him off.
        for seen in sorted(first, key=lambda one: -one.presence * float((one.logits > 0.0).mean())):
            if len(persons) == MOST_FOUND:
                break
            if any(_same(seen, other) for other in persons):
                continue
            first_look = self.look(picture, self.look(picture, seen.next_crop).next_crop)
            seen = self.look(picture, first_look.next_crop)
            sure = seen.is_person() and min(first_look.presence, seen.presence) >= FOUND
            if sure and not any(_same(seen, other) for other in persons):
                persons.append(seen)
        return persons


def _crops_over(width: int, height: int, angle: float) -> Iterator[Crop]:
    """Crops of several sizes over a picture; along a side that a crop spans there is one."""
    for share in SIZES:
        side = share * max(width, height)
        places = [
            np.arange(STEP * side, extent - STEP * side + 1.0, STEP * side)
            if extent > 2 * STEP * side
            else [extent / 2]
            for extent in (width, height)
        ]
        for y in places[1]:
            for x in places[0]:
                yield Crop(float(x), float(y), side, angle)


def _same(one: Detection, other: Detection) -> bool:
    apart = math.hypot(one.next_crop.x - other.next_crop.x, one.next_crop.y - other.next_crop.y)
    return apart < SAME_PERSON * max(one.next_crop.side, other.next_crop.side)
