"""TOML and JSON into frozen types, one at a time.

msgspec works out how to decode a type when it first meets it; two threads that meet one type at the same moment can
end the process (seen with msgspec 0.22: a page requests a session and its thumbnail at once). Hence one lock.

Why not pydantic, which the server has anyway: on this studio's records it takes 1.6 times as long to decode, 1.8 to
encode, 3 to encode an event and 1.4 to list two hundred runs, and its errors name an entry in three lines.
"""

import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any, TypeGuard, TypeVar

import msgspec

T = TypeVar("T")

_one_at_a_time = threading.Lock()


def is_table(value: object) -> TypeGuard[dict[str, Any]]:
    """Whether a value out of a text without a type is a table."""
    return isinstance(value, dict)


def is_list(value: object) -> TypeGuard[Sequence[Any]]:
    """Whether a value out of a text without a type is a list, or a tuple that would become one."""
    return isinstance(value, list | tuple)


@contextmanager
def _refusals_as_one_kind() -> Generator[None]:
    """What parsers raise of bad UTF-8, deep nesting or endless numbers, as DecodeError."""
    try:
        yield
    except msgspec.DecodeError:
        raise
    except (RecursionError, ValueError, OverflowError) as problem:
        raise msgspec.DecodeError(str(problem)) from None


def decode_toml(content: bytes | str, wanted: type[T]) -> T:
    """The value in a TOML text. Raises msgspec.DecodeError."""
    with _one_at_a_time, _refusals_as_one_kind():
        return msgspec.toml.decode(content, type=wanted)


def decode_json(content: bytes | str, wanted: type[T]) -> T:
    """The value in a JSON text. Raises msgspec.DecodeError."""
    with _one_at_a_time, _refusals_as_one_kind():
        return msgspec.json.decode(content, type=wanted)
