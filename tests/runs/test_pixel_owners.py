"""Whose a pixel is, of several bodies in a picture, and where a mask says nothing of one."""

import numpy as np

from studio.foundations.arrays import Bytes
from studio.runs.setup.pixel_owners import LimbColours, LimbMap, learn_colours, owners

HEIGHT, WIDTH = 40, 80
LIGHT, DARK = 200, 60


def standing(left: int, right: int, depth: float) -> LimbMap:
    """A body of one limb in columns left to right."""
    inside = np.zeros((HEIGHT, WIDTH), np.bool_)
    inside[:, left:right] = True
    columns = np.arange(WIDTH)
    apart = np.maximum(np.maximum(left - columns, columns - right + 1), 0)
    return LimbMap(
        inside,
        np.zeros((HEIGHT, WIDTH), np.int64),
        np.broadcast_to(apart, inside.shape).astype(np.float32),
        np.full(inside.shape, depth, np.float32),
        2.0,
    )


def seen(border: int) -> tuple[Bytes, Bytes]:
    """A picture, light left of a column and dark from it on, and the mask of both bodies."""
    picture = np.full((HEIGHT, WIDTH, 3), 130, np.uint8)
    picture[:, 10:border], picture[:, border:70] = LIGHT, DARK
    whole = np.zeros((HEIGHT, WIDTH), np.uint8)
    whole[:, 10:70] = 255
    return picture, whole


def known() -> list[LimbColours]:
    """Colours learnt while the two were apart: the first is light, the second dark."""
    maps = [standing(2, 22, 3000.0), standing(58, 78, 3000.0)]
    picture = np.full((HEIGHT, WIDTH, 3), 130, np.uint8)
    picture[:, 2:22], picture[:, 58:78] = LIGHT, DARK
    colours = [LimbColours(1), LimbColours(1)]
    learn_colours(picture, np.full((HEIGHT, WIDTH), 255, np.uint8), maps, colours)
    return colours


def test_colours_say_where_one_ends_better_than_where_he_was_expected() -> None:
    picture, whole = seen(border=44)
    one, other = owners(picture, whole, [standing(10, 40, 3000.0), standing(36, 70, 4000.0)], known())
    assert (one.mask[:, 10:42] == 255).all()
    assert not one.mask[:, 46:].any()
    assert (other.mask[:, 46:70] == 255).all()


def test_who_stands_behind_is_not_denied_what_the_other_hides_and_who_stands_in_front_is() -> None:
    picture, whole = seen(border=44)
    front, behind = owners(picture, whole, [standing(10, 44, 3000.0), standing(30, 70, 4000.0)], known())
    # Behind the first, the second's own silhouette stays, and his mask says nothing of him.
    assert (behind.mask[:, 31:43] == 255).all()
    assert (behind.hidden[:, 12:43] == 255).all()
    assert not behind.hidden[:, 46:].any()
    # The first would be seen in front of the second.
    assert not front.hidden[:, 47:70].any()
    assert not front.mask[:, 47:].any()


def test_nothing_is_hidden_where_nobody_is() -> None:
    picture, whole = seen(border=44)
    for share in owners(picture, whole, [standing(10, 44, 3000.0), standing(44, 70, 4000.0)], known()):
        assert not share.hidden[whole == 0].any()
        assert not share.mask[whole == 0].any()


def test_one_who_is_not_in_the_picture_has_no_share() -> None:
    picture, whole = seen(border=70)
    one, other = owners(picture, whole, [standing(10, 70, 3000.0), None], known())
    assert (one.mask == whole).all()
    assert not one.hidden.any()
    assert not other.mask.any()
