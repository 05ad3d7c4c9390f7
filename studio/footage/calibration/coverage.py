"""Where in the picture a board's corners were seen: a share, and a picture of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from studio.footage.calibration.boards import Detection
from studio.foundations.arrays import Bytes, Indices

CELLS_ACROSS = 10
ENOUGH = 8
"""So many corners in a cell are drawn as full coverage."""
WIDTH = 480
"""Pixels of the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """counts : (rows, columns) corners seen in each cell of a grid over the picture. share : of the cells with any."""

    counts: Indices
    size: tuple[int, int]

    @property
    def share(self) -> float:
        """Share of the picture in which corners were seen, 0..1."""
        return float(np.mean(self.counts > 0))

    @property
    def empty_parts(self) -> tuple[str, ...]:
        """Parts of the picture, in words, in which not a quarter of the cells saw a corner."""
        rows, columns = self.counts.shape
        down, across = (np.arange(int(count)) * 3 // count for count in (rows, columns))
        names = (("top left", "top", "top right"), ("left", "centre", "right"))
        names = (*names, ("bottom left", "bottom", "bottom right"))
        return tuple(
            names[row][column]
            for row in range(3)
            for column in range(3)
            if np.mean(self.counts[np.ix_(down == row, across == column)] > 0) < 0.25
        )


def coverage_of(detections: Sequence[Detection], size: tuple[int, int]) -> Coverage:
    """Count the corners of one camera's detections in cells as square as can be. size : width, height."""
    cell = max(size) / CELLS_ACROSS
    columns, rows = max(3, round(size[0] / cell)), max(3, round(size[1] / cell))
    counts = np.zeros((rows, columns), np.int64)
    for detection in detections:
        across = np.clip(detection.pixels[:, 0] * columns // size[0], 0, columns - 1).astype(int)
        down = np.clip(detection.pixels[:, 1] * rows // size[1], 0, rows - 1).astype(int)
        np.add.at(counts, (down, across), 1)
    return Coverage(counts, size)


def coverage_picture(
    coverage: Coverage, detections: Sequence[Detection], dropped: Sequence[Detection] = ()
) -> Bytes:
    """(H, W, 3) BGR: cells from dark (none) to green (enough), used corners as white dots, dropped ones red."""
    scale = WIDTH / coverage.size[0]
    height = max(1, round(coverage.size[1] * scale))
    full = np.clip(coverage.counts / ENOUGH, 0.0, 1.0).astype(np.float32)
    shade = cv2.resize(full, (WIDTH, height), interpolation=cv2.INTER_NEAREST)[..., None]
    low, high = np.array([46.0, 38.0, 34.0]), np.array([96.0, 150.0, 60.0])
    picture = np.ascontiguousarray((low + shade * (high - low)).astype(np.uint8))
    for group, colour in ((detections, (245, 245, 245)), (dropped, (60, 60, 230))):
        for detection in group:
            for x, y in detection.pixels * scale:
                cv2.circle(picture, (round(float(x)), round(float(y))), 2, colour, -1, cv2.LINE_AA)
    return picture
