"""A frame's maps as the kernels read them: those of all views one after another."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Maps(NamedTuple):
    """values : flat. views : (V, 4) int64: where a view's first and second map begin, width, height."""

    values: NDArray[Any]
    views: NDArray[np.int64]


def joined_maps(
    views: Sequence[Sequence[tuple[NDArray[Any], NDArray[Any] | None]]], padding: Sequence[int], dtype: type
) -> Maps:
    """The maps of every view, one or two, all of its picture's size. A map is a picture (H, W) uint8 and the table
    (256,) that its values are looked up in, None for the values themselves; `padding` follows each.
    """
    size = sum(picture.size + len(padding) for view in views for picture, _ in view)
    values, places = np.empty(size, dtype=dtype), np.zeros((len(views), 4), dtype=np.int64)
    start = 0
    for row, view in zip(places, views, strict=True):
        for column, (picture, table) in enumerate(view):
            row[column], row[3], row[2] = start, *picture.shape
            end = start + picture.size
            if table is None:
                values[start:end] = picture.ravel()
            else:
                np.take(table, picture.ravel(), out=values[start:end])
            values[end : end + len(padding)] = padding
            start = end + len(padding)
    return Maps(values, places)
