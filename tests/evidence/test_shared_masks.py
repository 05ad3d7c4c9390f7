"""A mask shared among subjects by who explains which pixel."""

import numpy as np

from studio.evidence.shared_masks import shared_mask
from studio.foundations.arrays import Bytes


def box(left: int, right: int, top: int = 2, bottom: int = 18) -> Bytes:
    mask = np.zeros((20, 60), np.uint8)
    mask[top:bottom, left:right] = 255
    return mask


def test_what_one_explains_is_his_what_several_explain_is_everyones_and_the_rest_is_the_nearest_ones() -> (
    None
):
    whole = box(5, 55)
    one, other = shared_mask(whole, [box(10, 30), box(25, 50)])
    assert (one[5, 5:30] == 255).all()
    assert (one[5, 30:] == 0).all()
    assert (other[5, 25:55] == 255).all()
    assert (other[5, :25] == 0).all()


def test_nothing_outside_the_mask_is_anybodys() -> None:
    whole = box(5, 20)
    one, other = shared_mask(whole, [box(10, 40), box(30, 50)])
    assert not one[5, 20:].any()
    assert not other.any()


def test_what_lies_out_of_reach_is_nobodys() -> None:
    one, _ = shared_mask(box(0, 60), [box(10, 20), box(50, 60)], reach=3.0)
    assert (np.flatnonzero(one[10]) == np.arange(7, 23)).all()


def test_a_subject_that_is_not_in_the_picture_gets_nothing() -> None:
    one, other = shared_mask(box(5, 55), [box(10, 30), np.zeros((20, 60), np.uint8)])
    assert (one == box(5, 55)).all()
    assert not other.any()


def test_a_pixel_that_is_as_near_to_two_is_both_ones_and_reach_is_the_last_that_counts() -> None:
    whole = np.ones((20, 60), np.uint8)
    silhouettes = [(box(10, 20) > 0).astype(np.uint8), (box(30, 40) > 0).astype(np.uint8)]
    one, other = shared_mask(whole, silhouettes, reach=6.0)
    assert {int(value) for value in np.unique([one, other])} == {0, 255}
    assert np.flatnonzero(one[10]).tolist() == [*range(4, 25)]
    assert np.flatnonzero(other[10]).tolist() == [*range(25, 46)]
    one, other = shared_mask(whole, [box(10, 20), box(31, 40)])
    assert np.flatnonzero(one[10]).tolist() == [*range(26)]
    assert np.flatnonzero(other[10]).tolist() == [*range(25, 60)]
