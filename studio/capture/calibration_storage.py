"""OpenCV's own files (YAML, XML, JSON) read through `cv2.FileStorage`, which runs nothing that stands in them."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.errors import CalibrationError

Array = NDArray[np.float64]

STORAGE_SUFFIXES = frozenset((".yml", ".yaml", ".xml"))
LARGEST_FILE = 10_000_000


class Storage:
    """The entries of one file by name. Raises CalibrationError if it is not of OpenCV's making."""

    def __init__(self, path: Path) -> None:
        self.where = f"'{path.name}'"
        text = storage_text(path)
        if text is None:
            raise CalibrationError(f"{self.where} cannot be read as text.", "Copy or export it again.")
        try:
            self._storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
            self._root = self._storage.root()
            self.names = tuple(self._root.keys()) if self._root.isMap() else ()
        except (cv2.error, SystemError):
            self.names = ()
        if not self.names:
            raise CalibrationError(
                f"{self.where} is not a file that OpenCV's FileStorage wrote.",
                "Export it again; YAML begins with '%YAML:1.0'.",
            )

    def first(self, *names: str) -> str:
        """The first of these names that the file has, "" if none."""
        return next((name for name in names if name in self.names), "")

    def numbers(self, name: str) -> Array:
        """An entry as an array: a matrix, a list of numbers, or one number. Raises CalibrationError."""
        node = self._storage.getNode(name)
        found: object = None
        try:
            if node.isSeq():
                found = [node.at(index).real() for index in range(node.size())]
            elif node.isInt() or node.isReal():
                found = node.real()
            else:
                found = node.mat()
        except cv2.error:
            found = None
        if found is None:
            raise CalibrationError(f"{self.where} has no numbers in '{name}'.", "Export the file again.")
        values = np.asarray(found, dtype=np.float64)
        if not np.all(np.isfinite(values)):
            raise CalibrationError(
                f"{self.where}: '{name}' holds a number that is not finite.", "Calibrate again."
            )
        return values

    def shaped(self, name: str, *shape: int) -> Array:
        """An entry of so many numbers as an array of that shape. Raises CalibrationError."""
        values = self.numbers(name)
        if values.size != int(np.prod(shape)):
            raise CalibrationError(
                f"{self.where}: '{name}' has {values.size} numbers, not {int(np.prod(shape))}.",
                "Export it again.",
            )
        return values.reshape(shape)

    def text(self, name: str) -> str:
        """An entry's text, "" if it is none or not there."""
        node = self._storage.getNode(name)
        return node.string() if node.isString() else ""


def storage_text(path: Path) -> str | None:
    """The file's text, None where it is none, too large, or not readable."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            return None
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return None
