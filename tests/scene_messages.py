"""What viser's server sends to a browser: the messages inside its packed windows, and a window that keeps them."""

import time
from collections.abc import Callable

import msgspec
import numpy as np
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

HEAD = 16
ALIGNMENT = 8
PATIENCE = 60.0


def decoded(content: bytes) -> list[dict]:
    """The messages of one window: zstd-compressed msgpack, then the arrays that it points to, each aligned."""
    packed = int.from_bytes(content[8:HEAD], "little")
    plain = zstandard.ZstdDecompressor().decompress(
        content[HEAD : HEAD + packed], max_output_size=int.from_bytes(content[:8], "little")
    )
    window = msgspec.msgpack.decode(plain)
    place, buffers = HEAD + packed, []
    for length in window["binaryBufferLengths"]:
        place += -place % ALIGNMENT
        buffers.append(content[place : place + length])
        place += length
    return [_with_arrays(message, buffers) for message in window["messages"]]


def _with_arrays(value: object, buffers: list[bytes]) -> dict:
    if isinstance(value, dict):
        if "__binary_index" in value:
            return np.frombuffer(buffers[value["__binary_index"]], value["dtype"])  # pyright: ignore[reportReturnType]
        return {key: _with_arrays(entry, buffers) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_with_arrays(entry, buffers) for entry in value]  # pyright: ignore[reportReturnType]
    return value  # pyright: ignore[reportReturnType]


class PanelReader:
    """What a window's panel and scene say, read off its socket without a browser."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.words = ""
        self._labels: dict[str, str] = {}
        self._values: dict[str, object] = {}
        self._words: dict[str, str] = {}

    def knob(self, label: str) -> object:
        """The value of the control with a label (a changed one has a dot before it), None without one."""
        found = [entry for entry, said in self._labels.items() if said.removeprefix("• ") == label]
        return self._values.get(found[-1]) if found else None

    def until(self, condition: Callable[["PanelReader"], object]) -> None:
        """Read on until a condition over this reader holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition(self):
            assert time.monotonic() < deadline, f"it never came about; the panel says {self.words!r}"
            self.read()

    def read(self, patience: float = 0.2) -> None:
        """Take in what comes next, if anything comes."""
        try:
            content = self.socket.recv(timeout=patience)
        except TimeoutError:
            return
        assert isinstance(content, bytes)
        for message in decoded(content):
            self._take(message)
        self.words = " ".join(self._words.values())

    def has_ended(self) -> bool:
        """Whether the studio closed the connection."""
        try:
            self.read()
        except ConnectionClosed:
            return True
        return False

    def _take(self, message: dict) -> None:
        name, changes = message.get("uuid", ""), message.get("props") or message.get("updates") or {}
        if message.get("type") == "GuiRemoveMessage":
            for kept in (self._labels, self._values, self._words):
                kept.pop(name, None)
        elif str(message.get("type", "")).startswith("Gui") and isinstance(changes, dict):
            for kept, key in ((self._labels, "label"), (self._words, "content")):
                if key in changes:
                    kept[name] = str(changes[key])
            for source in (message, changes):
                if "value" in source:
                    self._values[name] = source["value"]
