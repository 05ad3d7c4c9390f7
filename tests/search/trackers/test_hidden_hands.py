"""Hands and collar-bones that no silhouette shows lie as people usually hold them."""

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import load_body
from studio.evidence.distance_maps import distances_of
from studio.search.trackers.refinement import RefinementSettings, Refiner

CAMERAS = ring_of_cameras(4, 480, 360)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_wrist_of_a_hand_that_no_silhouette_shows_is_hardly_bent(side: str) -> None:
    """The search ended with a wrist bent by 60 degrees. What holds the start, 40 mm per radian, and 15 mm at the usual
    deviation from rest, 15 degrees, are balanced at 60 · 40² / (40² + (15 / 15°)²).
    """
    body = load_body("human35")
    start, wrist = body.neutral.copy(), [entry.name for entry in body.parameters].index(f"{side}_wrist")
    start[wrist] += np.radians(60.0)
    left = start.copy()
    left[wrist] = np.radians(60.0 * 40.0**2 / (40.0**2 + (15.0 / np.radians(15.0)) ** 2))
    gradient = Refiner(body, CAMERAS, RefinementSettings()).frame_loss(start, ())(left)[1]
    assert gradient[wrist] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_shoulder_before_the_chest_comes_back_beside_it(side: str) -> None:
    """Arms hang beside the trunk in all views, and the search has drawn a shoulder 25 degrees forwards."""
    body = load_body("human35")
    truth = body.neutral.copy()
    truth[2] = 950.0
    views = drawn_evidence(body, truth, CAMERAS).views
    start = truth.copy()
    forward = [entry.name for entry in body.parameters].index(f"{side}_clavicle_forward")
    start[forward] += np.radians(25.0)
    found = Refiner(body, CAMERAS, RefinementSettings()).refine(start, [distances_of(v.mask) for v in views])
    assert abs(np.degrees(found.pose[forward])) < 5.0
