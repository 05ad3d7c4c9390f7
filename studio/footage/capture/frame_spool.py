"""Pictures spooled to a temporary file, to be read together, a band of rows at a time.

Twenty full-HD pictures are 125 MB. What needs all of them at once, pixel by pixel, as a median does, needs them only
for the pixel it is at.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError

BAND_BYTES = 8_000_000
"""Of all pictures together that are held at a time."""


class FrameSpool:
    """Pictures of one size in a file that vanishes when the spool is closed, or the program ends."""

    def __init__(self, folder: Path) -> None:
        """folder : on a disk with room for the pictures, uncompressed."""
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed by __exit__
        self.shape: tuple[int, ...] = (0, 0, 0)
        self.count = 0

    def put(self, picture: Bytes) -> None:
        """Lay a picture (H, W, 3) uint8 aside. Raises FootageError where the disk is full."""
        if self.count and picture.shape != self.shape:
            raise ValueError(picture.shape)
        self.shape = picture.shape
        try:
            self._file.write(np.ascontiguousarray(picture).data)
        except OSError as problem:
            raise FootageError(
                f"Pictures cannot be laid aside on the disk ({problem.strerror}).",
                "Make room on the disk that the session lies on.",
            ) from None
        self.count += 1

    def bands(self) -> Iterator[tuple[int, Bytes]]:
        """The first row of each band, from the top, and the band of all pictures (K, rows, W, 3)."""
        height, row_bytes = self.shape[0], int(np.prod(self.shape[1:]))
        rows = max(1, BAND_BYTES // max(1, self.count * row_bytes))
        for top in range(0, height, rows):
            bottom = min(top + rows, height)
            band = np.empty((self.count, bottom - top, *self.shape[1:]), np.uint8)
            for index, part in enumerate(band):
                self._file.seek((index * height + top) * row_bytes)
                self._file.readinto(part.data)
            yield top, band

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
