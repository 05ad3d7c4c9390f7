"""Disagreement of limbs and silhouettes, per limb and in both directions."""

import dataclasses

import cv2
import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouette_distances
from studio.foundations.geometry.projection import project
from studio.search.trackers.agreement import Agreement, limb_names, without_bare
from studio.search.trackers.tracker import LIMB_LOST_SHARE

CAMERAS = ring_of_cameras(4, 480, 360)


def place(body: BodyModel, **angles: float) -> np.ndarray:
    """Standing with limbs apart, some angles more."""
    apart = {"left_shoulder_rx": 0.5, "right_shoulder_rx": -0.5, "left_hip_ry": 0.4, "right_hip_ry": -0.4}
    return standing(body, **{**apart, **angles})


def shares(body: BodyModel, pose: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    agreement = Agreement(body, CAMERAS)
    return agreement.of(pose, silhouette_distances(drawn_evidence(body, truth, CAMERAS))).shares()


def test_the_true_pose_agrees_everywhere(body: BodyModel) -> None:
    truth = place(body)
    assert max(shares(body, truth, truth).values()) < 0.5 * LIMB_LOST_SHARE


@pytest.mark.parametrize(
    ("limb", "angle", "by"), [("left arm", "left_shoulder_ry", 0.9), ("right leg", "right_hip_ry", -0.7)]
)
def test_a_misplaced_limb_is_the_one_that_disagrees(
    body: BodyModel, limb: str, angle: str, by: float
) -> None:
    truth = place(body)
    found = shares(body, place(body, **{angle: by}), truth)
    assert found[limb] > LIMB_LOST_SHARE
    assert max(found, key=found.__getitem__) == limb


def test_both_legs_on_one_leave_the_other_uncovered(body: BodyModel) -> None:
    """Little of the model is outside the silhouettes: only the uncovered silhouette shows the error."""
    truth = place(body)
    names = [entry.name for entry in body.parameters]
    both = truth.copy()
    both[names.index("left_hip_ry")] = truth[names.index("right_hip_ry")]
    agreement = Agreement(body, CAMERAS)
    found = agreement.of(both, silhouette_distances(drawn_evidence(body, truth, CAMERAS)))
    legs = np.isin(found.limbs, ["left leg", "right leg"])
    assert found.bare[:, legs].sum() > 1.5 * found.outside[:, legs].sum()
    by_limb = found.shares()
    assert max(by_limb["left leg"], by_limb["right leg"]) > LIMB_LOST_SHARE
    assert by_limb["left arm"] < LIMB_LOST_SHARE


def test_drawn_limbs_belong_to_the_limbs_of_the_parameters(body: BodyModel) -> None:
    found = dict(zip((limb.name for limb in body.drawn), limb_names(body), strict=True))
    assert found["left forearm"] == found["left upper arm"] == "left arm"
    assert found["torso"] == "root"


def test_an_empty_view_leaves_every_limb_outside(body: BodyModel) -> None:
    truth = place(body)
    agreement = Agreement(body, CAMERAS)
    found = agreement.of(truth, silhouette_distances(drawn_evidence(body, None, CAMERAS)))
    assert np.array_equal(found.outside, found.area)
    assert not found.bare.any()


def test_what_lies_bare_beside_the_trunk_is_in_an_arms_reach(body: BodyModel) -> None:
    """An arm that hangs, and is thought to be folded: most of what it leaves bare is nearer to the trunk."""
    truth, folded = (standing(body, right_shoulder_rx=0.1, right_elbow_ry=bend) for bend in (0.0, -2.2))
    agreement = Agreement(body, ring_of_cameras(3, 480, 360))
    found = agreement.of(folded, silhouette_distances(drawn_evidence(body, truth, agreement.cameras)))
    own = np.array(found.limbs) == "right arm"
    whole, area = found.bare.sum(), found.area[:, own].sum()
    assert found.bare[:, own].sum() < 0.3 * whole
    assert found.within["right arm"] > 0.9 * whole
    assert "root" not in found.within
    in_reach, shares = found.shares_in_reach(), found.shares()
    expected = (found.outside[:, own].sum() + found.within["right arm"]) / area
    assert in_reach["right arm"] == pytest.approx(expected, rel=1e-6)
    assert in_reach["right arm"] > 3.0 * shares["right arm"]
    assert in_reach["root"] == shares["root"]
    # Where the masks show much more than the body, they do not say which limb is off.
    smeared = dataclasses.replace(found, bare=0.021 * found.area.sum() / whole * found.bare)
    assert smeared.shares_in_reach() == smeared.shares()
    assert not without_bare(found).within


def test_a_lump_that_one_view_alone_shows_is_no_limbs(body: BodyModel) -> None:
    """Above a shoulder, within the arm's reach; in all views it would be the arm's."""
    truth = place(body)
    agreement = Agreement(body, ring_of_cameras(3, 480, 360))
    shoulder = limb_ends(body, truth[None])[0, [limb.name for limb in body.drawn].index("left upper arm"), 0]
    beside = shoulder + np.array([0.0, 330.0, 130.0])
    for views, is_named in ((1, False), (3, True)):
        evidence = drawn_evidence(body, truth, agreement.cameras)
        for view in evidence.views[:views]:
            camera = next(one for one in agreement.cameras if one.name == view.camera)
            at = np.round(project(camera, beside)[0]).astype(int)
            cv2.circle(view.mask, tuple(at.tolist()), 12, 255, -1)
        seen = silhouette_distances(evidence)
        off = agreement.of(truth, seen)
        assert off.shares()["left arm"] > LIMB_LOST_SHARE
        named = agreement.confirmed(off, truth, seen).shares()
        assert (named["left arm"] > LIMB_LOST_SHARE) == is_named
