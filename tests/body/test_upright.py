"""A body as it stands upright, limb by limb."""

import numpy as np

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.upright import limb_drawings


def test_each_drawn_limb_stands_where_it_rests_and_names_what_sets_its_length() -> None:
    body = load_body("human31")
    drawings = limb_drawings(body)
    assert [one.name for one in drawings] == [limb.name for limb in body.drawn]
    assert [one.side for one in drawings] == [limb.side for limb in body.drawn]
    assert [one.radii for one in drawings] == [(limb.radius_start, limb.radius_end) for limb in body.drawn]
    ends = limb_ends(body, body.neutral)[0]
    np.testing.assert_array_equal([one.start for one in drawings], ends[:, 0])
    np.testing.assert_array_equal([one.end for one in drawings], ends[:, 1])
    assert next(one for one in drawings if one.name == "left thigh").dimension == "left_thigh_length"
    arm = load_body("planar_arm4")
    assert [one.dimension for one in limb_drawings(arm)] == [
        entry.length.lstrip("-") if isinstance(entry.length, str) else "" for entry in arm.definition.limbs
    ]
