"""Strokes as pixels: where they lie in a smaller picture, and what they enclose."""

import numpy as np
import pytest

from studio.evidence.strokes import Stroke, StrokeKind, painted


def stroke(*points: tuple[float, float], kind: StrokeKind = "inside", width: float = 1.0) -> Stroke:
    return Stroke(camera="a", frame=0, kind=kind, width=width, points=points)


@pytest.mark.parametrize(("place", "pixel"), [(11.375, 5), (9.375, 4), (9.7, 5), (0.0, 0)])
def test_a_point_of_a_smaller_picture_lies_where_its_middle_does(place: float, pixel: int) -> None:
    """Half the size: pixel 5 reaches from 10 to 11 of the large picture, its middle is at 10.5."""
    marks = painted([stroke((place, place))], (12, 12), 2.0)
    assert [tuple(at) for at in np.argwhere(marks)] == [(pixel, pixel)]


def test_a_line_ends_where_its_last_point_is() -> None:
    marks = painted([stroke((2, 2), (20, 2), (20, 20))], (24, 24))
    assert (marks[2, 2:21] == 1).all()
    assert (marks[2:21, 20] == 1).all()
    assert marks[11, 11] == 0


def test_later_strokes_paint_over_earlier_ones() -> None:
    marks = painted([stroke((2, 5), (20, 5), width=4), stroke((10, 5), kind="outside", width=3)], (24, 12))
    assert marks[5, 10] == 2
    assert marks[5, 4] == marks[5, 18] == 1
    assert not marks[9].any()
