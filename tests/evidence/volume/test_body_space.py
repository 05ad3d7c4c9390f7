"""The box around all that a fixed body reaches."""

import numpy as np
from posed_cones import ring

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.evidence.volume.body_space import MARGIN, space_of


def test_a_fixed_body_stays_in_its_box_which_is_hardly_larger() -> None:
    body = load_body("planar_arm4")
    box = space_of(body, ring(4))
    drawn = np.random.default_rng(1).random((20_000, len(body.parameters)))
    lower, upper = np.maximum(body.lower, -np.pi), np.minimum(body.upper, np.pi)
    ends = limb_ends(body, lower + drawn * (upper - lower)).reshape(-1, 3)
    thickest = max(max(limb.radius_start, limb.radius_end) for limb in body.drawn)
    low, high = ends.min(axis=0) - thickest, ends.max(axis=0) + thickest
    assert (box.lower <= low + 0.02 * (high - low)).all()
    assert (box.upper >= high - 0.02 * (high - low)).all()
    assert (box.upper - box.lower <= 1.02 * MARGIN * (high - low)).all()
