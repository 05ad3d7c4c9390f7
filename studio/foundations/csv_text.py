"""Rows, and poses, as CSV text."""

import csv
import io
from collections.abc import Iterable

from studio.foundations.arrays import Array, Indices

FRAME = "frame"


def poses_csv(names: tuple[str, ...], frames: Indices, poses: Array) -> str:
    """Poses as CSV text: a column `frame`, then one a parameter. frames : (K,). poses : (K, D) radians and mm."""
    rows = [
        [str(int(frame)), *(repr(float(value)) for value in pose)]
        for frame, pose in zip(frames, poses, strict=True)
    ]
    return as_csv([[FRAME, *names], *rows])


def as_csv(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV text; a line ends with a line feed."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()
