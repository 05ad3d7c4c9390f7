"""Brush strokes over a camera's picture: inside the subject, or outside."""

from collections.abc import Sequence
from typing import Annotated, Literal

import cv2
import msgspec
import numpy as np

from studio.foundations.arrays import Bytes
from studio.foundations.declaring import Web

StrokeKind = Literal["inside", "outside"]


class Stroke(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """camera, frame : of the picture. kind : what its pixels are. width : of the brush, pixels. points : of the line,
    at least one, (x, y) pixels of the picture as the footage gives it, (0, 0) the middle of the first one.
    """

    camera: Annotated[str, Web(left_out=True)]
    frame: int
    kind: StrokeKind
    width: float
    points: tuple[tuple[float, float], ...]


def painted(strokes: Sequence[Stroke], size: tuple[int, int], factor: float = 1.0) -> Bytes:
    """(H, W) uint8: 1 inside, 2 outside, 0 where nothing was painted; later strokes paint over earlier ones.

    size : (W, H) of a picture that is `factor` times smaller than that of the strokes.
    """
    out = np.zeros((size[1], size[0]), np.uint8)
    for stroke in strokes:
        points = (np.array(stroke.points, np.float64) + 0.5) / factor - 0.5
        line = np.round(16.0 * points).astype(np.int32).reshape(-1, 1, 2)
        value = 1 if stroke.kind == "inside" else 2
        width = max(1, round(stroke.width / factor))
        # A line of one point is drawn as a dot of the brush's width.
        ends = line if len(line) > 1 else np.repeat(line, 2, axis=0)
        cv2.polylines(out, [ends], False, value, width, cv2.LINE_8, 4)
    return out
