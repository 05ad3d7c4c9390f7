"""The world drawn over a camera's picture, to see whether it is right: floor, axes, a pole of the subject's size."""

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

PERSON_MM = 1800.0
"""Height of the pole where the subject is a person."""
LINES, AXIS_STEPS, STEPS_A_POLE = 4, 2, 3.6
"""Lines of the grid on each side of the origin, steps of the grid in an axis, and about how many in the pole."""
NEAREST_SHARE = 1 / 18
"""What lies nearer to the camera than this share of the pole is left out."""
PIECES = 24
FINE = 4
"""Binary digits of a pixel in which ends of lines are given."""
RED, GREEN, BLUE, WHITE, GREY = (70, 70, 235), (90, 190, 60), (240, 130, 50), (250, 250, 250), (205, 205, 205)
HALO = (15, 15, 15)
FONT = cv2.FONT_HERSHEY_SIMPLEX


def world_picture(
    picture: Bytes,
    camera: Camera,
    points: Sequence[Sequence[float]] = (),
    height: int = 720,
    *,
    pole: float = PERSON_MM,
    bare: bool = False,
) -> Bytes:
    """(h, w, 3) BGR upright: a grid on the floor, two of its steps of each axis (X red, Y green, Z blue), a pole at the
    origin, and `points` (mm) with their numbers; `bare` draws nothing. picture : (H, W, 3) BGR of the camera's own
    size. pole : mm; the grid's step follows (`grid_step`), half a metre beside a person.
    """
    across = camera.height if camera.quarter_turns % 2 == 0 else camera.width
    scale = height / across
    size = (max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))
    drawn = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR)
    pen = _Pen(np.array(drawn, dtype=np.uint8), camera, scale, NEAREST_SHARE * pole)
    if bare:
        return np.ascontiguousarray(np.rot90(pen.picture, -camera.quarter_turns))
    step = grid_step(pole)
    reach, long = LINES * step, AXIS_STEPS * step
    for number in range(-LINES, LINES + 1):
        at = number * step
        pen.line((at, -reach, 0.0), (at, reach, 0.0), GREY, 1)
        pen.line((-reach, at, 0.0), (reach, at, 0.0), GREY, 1)
    pen.line((0.0, 0.0, 0.0), (0.0, 0.0, pole), WHITE, 2)
    for axis, colour in enumerate((RED, GREEN, BLUE)):
        end = np.zeros(3)
        end[axis] = long
        pen.line((0.0, 0.0, 0.0), tuple(end), colour, 3)
    turned = np.ascontiguousarray(np.rot90(pen.picture, -camera.quarter_turns))
    labels = [((long, 0, 0), "X", RED), ((0, long, 0), "Y", GREEN), ((0, 0, long), "Z", BLUE)]
    labels += [((0.0, 0.0, pole), f"{pole / 1000:.1f} m" if pole >= 1000 else f"{pole:.0f} mm", WHITE)]
    labels += [(tuple(point), str(number), WHITE) for number, point in enumerate(points, 1)]
    for place, text, colour in labels:
        _label(turned, pen.upright(np.array(place, dtype=np.float64)), text, colour, dot=text.isdigit())
    return turned


def grid_step(pole: float) -> float:
    """mm between the grid's lines: about a quarter of the pole, and 1, 2 or 5 times a power of ten."""
    wanted = pole / STEPS_A_POLE
    power = 10.0 ** math.floor(math.log10(wanted))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1.0 + 1e-9))


class _Pen:
    """Draws lines of the world on a picture; what lies behind the camera or far beside it is left out."""

    def __init__(self, picture: Bytes, camera: Camera, scale: float, nearest: float) -> None:
        self.picture, self._camera, self._scale, self._nearest = picture, camera, scale, nearest

    def line(
        self, start: Sequence[float], end: Sequence[float], colour: tuple[int, int, int], width: int
    ) -> None:
        share = np.linspace(0.0, 1.0, PIECES)[:, None]
        points = (1.0 - share) * np.array(start) + share * np.array(end)
        pixels, seen = self._pixels(points)
        fine = (np.where(seen[:, None], pixels, 0.0) * 2**FINE).round().astype(int).tolist()
        pieces = [pair for pair in range(PIECES - 1) if seen[pair] and seen[pair + 1]]
        for shade, wide in ((HALO, width + 2), (colour, width))[width == 1 :]:
            for first in pieces:
                cv2.line(self.picture, fine[first], fine[first + 1], shade, wide, cv2.LINE_AA, FINE)

    def upright(self, point: Array) -> tuple[int, int] | None:
        """Where a point lies in the upright picture, None if it is not seen."""
        pixels, seen = self._pixels(point[None])
        if not seen[0]:
            return None
        x, y = pixels[0]
        height, width = self.picture.shape[:2]
        for _ in range(self._camera.quarter_turns % 4):
            x, y, height, width = height - 1 - y, x, width, height
        return round(float(x)), round(float(y))

    def _pixels(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        pixels, depth = project(self._camera, points)
        size = np.array([self._camera.width, self._camera.height])
        near = np.all(np.abs(pixels - size / 2) < 0.75 * size, axis=1)
        return (pixels + 0.5) * self._scale - 0.5, near & (depth > self._nearest)


def _label(
    picture: Bytes, at: tuple[int, int] | None, text: str, colour: tuple[int, int, int], dot: bool
) -> None:
    if at is None:
        return
    if dot:
        cv2.circle(picture, at, 5, HALO, -1, cv2.LINE_AA)
        cv2.circle(picture, at, 4, (80, 220, 250), -1, cv2.LINE_AA)
    place = (at[0] + 7, at[1] - 5)
    cv2.putText(picture, text, place, FONT, 0.5, HALO, 3, cv2.LINE_AA)
    cv2.putText(picture, text, place, FONT, 0.5, colour, 1, cv2.LINE_AA)
