"""Checksums of what a results store holds, and what of it this process has found to be as it was written.

A frame's checksums lie in one row: of its numbers and pose ("row"), of its result's blob ("result") and of each layer's
("layers"). Rows of stores that were written before there were checksums have none: they count as unchecked.
"""

import json
import threading
import zlib
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from pathlib import Path

FRAME, PARTIAL, SETTINGS = "frame", "partial", "settings"
"""What a row of checksums is of."""
GIVEN_UP = "damaged"
"""Stands in place of the checksums of a frame without any whose content cannot be read: it is to be tracked again."""
STORES_REMEMBERED = 64


def checksum(values: Iterable[object]) -> int:
    """CRC-32 of values as SQLite gives them back: whole and real numbers, texts, bytes, None."""
    total = 0
    for value in values:
        content = value if isinstance(value, bytes) else repr(value).encode()
        total = zlib.crc32(content, zlib.crc32(f"{len(content)} ".encode(), total))
    return total


def sums_text(row: Iterable[object], blobs: Mapping[str, bytes], layers: Mapping[int, bytes]) -> str:
    """The checksums of one row and of the blobs that belong to it, as they are stored."""
    sums: dict[str, object] = {"row": checksum(row)}
    sums |= {name: checksum([blob]) for name, blob in blobs.items()}
    return json.dumps(sums | {"layers": {str(layer): checksum([blob]) for layer, blob in layers.items()}})


class Sums:
    """Stored checksums, read back. A text that is damaged itself fits nothing."""

    def __init__(self, text: str) -> None:
        try:
            found = json.loads(text)
            self._sums: dict[str, object] = found if isinstance(found, dict) else {}
        except ValueError:
            self._sums = {}

    def row_fits(self, row: Iterable[object]) -> bool:
        """Whether a row is as it was written."""
        return self._sums.get("row") == checksum(row)

    def fits(self, name: str, blob: bytes) -> bool:
        """Whether a blob is as it was written."""
        return self._sums.get(name) == checksum([blob])

    def wrong_layers(self, blobs: Mapping[int, bytes]) -> list[int]:
        """The layers that are missing, too many, or not as they were written."""
        sums = self._sums.get("layers")
        known = sums if isinstance(sums, dict) else {}
        found = {str(layer): checksum([blob]) for layer, blob in blobs.items()}
        return sorted(
            int(layer) for layer in known.keys() | found.keys() if known.get(layer) != found.get(layer)
        )


class Verified:
    """Which frames of which stores were found whole, so that a list need not read every blob again. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stores: OrderedDict[Path, dict[int, int]] = OrderedDict()

    def holds(self, path: Path, frame: int, text: str) -> bool:
        """Whether the frame was found to fit these checksums."""
        with self._lock:
            return self._stores.get(path, {}).get(frame) == hash(text)

    def add(self, path: Path, frame: int, text: str) -> None:
        """The frame fits these checksums."""
        with self._lock:
            self._stores.setdefault(path, {})[frame] = hash(text)
            self._stores.move_to_end(path)
            if len(self._stores) > STORES_REMEMBERED:
                self._stores.popitem(last=False)

    def forget(self, path: Path) -> None:
        """Something in the store was found damaged after all."""
        with self._lock:
            self._stores.pop(path, None)


VERIFIED = Verified()
