"""TOML and JSON into frozen types, one at a time.

msgspec works out how to decode a type when it first meets it; two threads that meet one type at the same moment can
end the process (seen with msgspec 0.22: a page asks for a session and its thumbnail at once). Hence one lock.
"""

import threading
from typing import TypeVar

import msgspec

T = TypeVar("T")

_one_at_a_time = threading.Lock()


def decode_toml(content: bytes | str, wanted: type[T]) -> T:
    """The value in a TOML text. Raises msgspec.DecodeError, UnicodeDecodeError."""
    with _one_at_a_time:
        return msgspec.toml.decode(content, type=wanted)


def decode_json(content: bytes | str, wanted: type[T]) -> T:
    """The value in a JSON text. Raises msgspec.DecodeError, UnicodeDecodeError."""
    with _one_at_a_time:
        return msgspec.json.decode(content, type=wanted)
