# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
# What a pickle holds is of any type.
"""Python pickles of other programs, read without running anything of them: tables, lists, texts, numbers and arrays.

A pickle may call any function when it is opened. Here the few names that NumPy's arrays ask for stand for plain records
of what the pickle says; an array is made of its bytes afterwards. Any other name is refused.
"""

import io
import itertools
import math
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 1 << 20
DEEPEST, MOST_VALUES, LONGEST_KEY = 8, 100_000, 200
KINDS = frozenset("fiubUS")
ARRAYS = frozenset(
    f"numpy{'.' if core else ''}{core}"
    for core in ("core.multiarray", "_core.multiarray", "core.numeric", "_core.numeric", "")
)


class _Named:
    """Something that a pickle makes by one of NumPy's names: what it was made of, and its state."""

    def __init__(self, *given: Any) -> None:  # noqa: ANN401 - of any pickle
        self.given, self.state = given, ()

    def __setstate__(self, state: Any) -> None:  # noqa: ANN401
        self.state = state if isinstance(state, tuple) else ()


class _Array(_Named):
    pass


class _FromBuffer(_Named):
    pass


class _Kind(_Named):
    pass


class _Scalar(_Named):
    pass


class _Encoded(_Named):
    pass


class _Class(_Named):
    pass


NUMPY_NAMES = {
    "_reconstruct": _Array,
    "_frombuffer": _FromBuffer,
    "ndarray": _Class,
    "dtype": _Kind,
    "scalar": _Scalar,
}


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str, /) -> Any:  # noqa: ANN401
        if module in ARRAYS and name in NUMPY_NAMES:
            return NUMPY_NAMES[name]
        if (module, name) == ("_codecs", "encode"):
            return _Encoded
        raise pickle.UnpicklingError(f"it asks for {module[:40]}.{name[:40]}")

    def persistent_load(self, pid: Any, /) -> Any:  # noqa: ANN401
        raise pickle.UnpicklingError("it asks for something outside")


def read_plain_pickle(content: bytes) -> Any:  # noqa: ANN401 - tables, lists, tuples, texts, numbers, arrays
    """What a pickle holds. Raises ValueError for what is larger, deeper, or made of anything but plain values."""
    if len(content) > MOST_BYTES:
        raise ValueError(f"a pickle of more than {MOST_BYTES >> 20} MB")
    try:
        return _plain(_Reader(io.BytesIO(content)).load(), 0, itertools.count())
    except ValueError:
        raise
    except Exception as problem:
        raise ValueError(f"a pickle that is not of plain values ({problem})") from None


def _plain(value: Any, depth: int, counted: Iterator[int]) -> Any:  # noqa: ANN401
    if depth > DEEPEST or next(counted) > MOST_VALUES:
        raise ValueError("a pickle that is nested too deep, or of too many values")
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return value
    if isinstance(value, dict):
        return {str(key)[:LONGEST_KEY]: _plain(entry, depth + 1, counted) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, depth + 1, counted) for entry in value]
    if isinstance(value, _Array) and len(value.state) == 5:
        _, shape, kind, by_column, content = value.state
        return _array(content, kind, shape, bool(by_column))
    if isinstance(value, _FromBuffer) and len(value.given) == 4:
        content, kind, shape, order = value.given
        return _array(content, kind, shape, order == "F")
    if isinstance(value, _Scalar) and len(value.given) == 2:
        kind, content = value.given
        return np.frombuffer(_bytes(content), _kind(kind), 1)[0].item()
    raise ValueError("a pickle of something else than plain values")


def _array(content: object, kind: object, shape: object, by_column: bool) -> NDArray[Any]:
    dtype = _kind(kind)
    if not isinstance(shape, tuple) or not all(type(size) is int and size >= 0 for size in shape):
        raise ValueError("an array without a shape")
    if math.prod(shape) * dtype.itemsize != len(_bytes(content)):
        raise ValueError("an array that is not of its size")
    return np.frombuffer(_bytes(content), dtype).reshape(shape, order="F" if by_column else "C").copy()


def _kind(made: object) -> np.dtype[Any]:
    name = made.given[0] if isinstance(made, _Kind) and made.given else ""
    if not isinstance(name, str) or name[:1] not in KINDS or not name[1:].isdigit():
        raise ValueError("an array of something else than numbers and texts")
    order = made.state[1] if isinstance(made, _Kind) and len(made.state) > 1 else "|"
    return np.dtype((order if order in ("<", ">") else "") + name)


def _bytes(content: object) -> bytes:
    """Bytes, in old pickles a text of as many characters."""
    if isinstance(content, _Encoded) and content.given[1:] in ((), ("latin1",)):
        return str(content.given[0]).encode("latin1")
    if not isinstance(content, bytes | bytearray):
        raise ValueError("an array without bytes")
    return bytes(content)
