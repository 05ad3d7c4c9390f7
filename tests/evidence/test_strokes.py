"""Strokes as pixels: where they lie in a smaller picture, and what they enclose."""

import msgspec
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


def test_the_thinnest_stroke_is_a_pixel_wide() -> None:
    assert np.argwhere(painted([stroke((4, 2), (4, 6), width=0.2)], (9, 9))).tolist() == [
        [y, 4] for y in range(2, 7)
    ]


def test_a_stroke_says_all_of_itself_and_stays_as_it_is() -> None:
    one = stroke((1, 2))
    with pytest.raises(AttributeError):
        one.width = 3.0
    with pytest.raises(TypeError):
        Stroke("a", 0, "inside", 1.0, ((1.0, 2.0),))
    with pytest.raises(msgspec.ValidationError, match="unknown"):
        msgspec.convert({**msgspec.to_builtins(one), "hardness": 1.0}, Stroke)
