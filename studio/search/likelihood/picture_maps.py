"""A frame's maps as the kernels read them: those of all views one after another."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.foundations.numba_in_threads import KERNEL, njit


class Maps(NamedTuple):
    """values : flat. views : (V, 4) int64: where a view's first and second map begin, width, height."""

    values: NDArray[Any]
    views: NDArray[np.int64]


def joined_maps(
    views: Sequence[Sequence[tuple[NDArray[Any], NDArray[Any] | None]]],
    padding: Sequence[int],
    dtype: type[np.generic],
) -> Maps:
    """The maps of every view, one or two, all of its picture's size. A map is a picture (H, W) uint8 and the table
    (256,) that its values are looked up in, None for the values themselves; `padding` follows each.
    """
    size = sum(picture.size + len(padding) for view in views for picture, _ in view)
    values: NDArray[Any] = np.empty(size, dtype=dtype)
    places = np.zeros((len(views), 4), dtype=np.int64)
    start = 0
    for row, view in zip(places, views, strict=True):
        for column, (picture, table) in enumerate(view):
            row[column], row[3], row[2] = start, *picture.shape
            end = start + picture.size
            if table is None:
                values[start:end] = picture.ravel()
            else:
                look_up(table, picture.ravel(), values[start:end])
            values[end : end + len(padding)] = padding
            start = end + len(padding)
    return Maps(values, places)


@njit(**KERNEL)
def look_up(table: NDArray[Any], picture: NDArray[np.uint8], values: NDArray[Any]) -> None:
    """Fill values (K,) with the entries of a table (256,) at a picture (K,)."""
    for k in range(picture.shape[0]):
        values[k] = table[picture[k]]
