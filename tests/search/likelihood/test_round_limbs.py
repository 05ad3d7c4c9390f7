"""Limbs of ball joints reach beyond the joint in the image by a share of their radius; all others stay."""

import numpy as np

from studio.body.catalogue import load_body
from studio.search.likelihood.shape_silhouettes import POSES, limbs_of_ball_joints, round_off


def test_upper_arms_and_thighs_are_round_and_the_head_is_not() -> None:
    body = load_body("human31")
    names = {body.drawn[number].name for number in limbs_of_ball_joints(body)}
    assert names == {"left thigh", "right thigh", "left upper arm", "right upper arm"}


def test_the_near_end_moves_back_along_the_limb() -> None:
    """A limb from (10, 20) to (10, 80) pixels, 8 wide at its start and 4 at its end."""
    corners = np.array([[6, 20], [8, 80], [12, 80], [14, 20]], dtype=np.float32)
    rows = np.zeros((1, 1, 2, 10, POSES), dtype=np.float32)
    rows[0, 0, :, :8] = corners.reshape(8, 1)
    outlines = rows.reshape(1, 1, 2, -1)
    before = outlines.copy()
    round_off(outlines, np.array([1]), depth=0.5)
    moved = outlines.reshape(rows.shape)[0, 0, 1, :8, 3].reshape(4, 2)
    assert np.allclose(moved, [[6, 18], [8, 80], [12, 80], [14, 18]])
    assert (outlines[0, 0, 0] == before[0, 0, 0]).all()


def test_a_limb_that_points_at_the_camera_stays_finite() -> None:
    outlines = np.full((1, 1, 1, 160), 5.0, dtype=np.float32)
    round_off(outlines, np.array([0]))
    assert np.isfinite(outlines).all()
