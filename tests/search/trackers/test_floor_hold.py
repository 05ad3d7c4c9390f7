"""Nothing of a person lies below the floor: the pull against its definition, and what it does to poses and shapes."""

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, rigid_limbs
from studio.body.shape_space import shape_space
from studio.body.subject import Subject, fit_subject
from studio.evidence.distance_maps import silhouette_distances
from studio.foundations.arrays import Array
from studio.search.trackers.floor_hold import FloorHold, FloorHoldOfShapes, Heights, has_floor, pull_of
from studio.search.trackers.refinement import RefinementSettings, Refiner

BODY = load_body("human35")
UNIT = np.where(BODY.angles, 1.0, 300.0)
CAMERAS = ring_of_cameras(4, 480, 360)
STEP = 0.004


def sunk(by: float, **angles: float) -> Array:
    """A standing pose with its lowest point so far below the floor, mm."""
    pose = standing(BODY, **angles)
    pose[2] -= lowest(BODY, pose) + by
    return pose


def lowest(body: BodyModel, pose: Array) -> float:
    return float(Heights(body, 1.0).of(pose[None]).min())


def test_an_upright_cone_ends_at_its_axis_and_a_lying_one_a_radius_below() -> None:
    pose = standing(BODY)
    heights = Heights(BODY, 1.0).of(pose[None])[0].reshape(-1, 2)
    ends = limb_ends(BODY, pose)[0]
    names = [limb.name for limb in BODY.drawn]
    shin, foot = names.index("left shin"), names.index("left foot")
    assert heights[shin] == pytest.approx(ends[shin, :, 2], abs=4.0)  # A shin leans a little.
    radii = BODY.drawn[foot].radius_start, BODY.drawn[foot].radius_end
    assert heights[foot] == pytest.approx(ends[foot, :, 2] - radii, abs=2.0)


def test_the_pull_is_robust_and_twenty_times_the_square_of_small_depths() -> None:
    slopes = np.ones((1, 1))
    assert pull_of(np.array([-1.0]), slopes).loss == pytest.approx(20.0, rel=2e-3)
    assert pull_of(np.array([-1.0]), slopes).gradient == pytest.approx([-20.0], rel=3e-3)
    assert pull_of(np.array([-1e5]), slopes).loss == pytest.approx(20.0 * 30.0**2, rel=1e-3)
    assert abs(pull_of(np.array([-300.0]), slopes).gradient[0]) < 1.0


def test_where_the_floor_is_elsewhere_nothing_is_pulled() -> None:
    """One foot lies far below z = 0, and the other one, in the air, just below it."""
    hold, names = FloorHold(BODY, UNIT, STEP), [limb.name for limb in BODY.drawn]
    pose = sunk(200.0, left_knee=1.2)
    heights = Heights(BODY, 1.0).of(pose[None])[0].reshape(-1, 2)
    pose[2] -= heights[names.index("left foot")].min() + 20.0
    low = Heights(BODY, 1.0).of(pose[None])[0].reshape(-1, 2)
    assert low[names.index("left foot")].min() == pytest.approx(-20.0, abs=1.0)
    assert low[names.index("right foot")].min() < -100.0
    assert hold.of(pose) is None
    assert hold.of(sunk(20.0)) is not None


@pytest.mark.parametrize("depth", [5.0, 60.0])
def test_the_gradient_is_that_of_half_the_loss(depth: float) -> None:
    hold, pose = FloorHold(BODY, UNIT, STEP), sunk(depth, left_hip_swing=0.2, left_ankle=0.3)
    found = hold.of(pose)
    assert found is not None
    for number in np.flatnonzero(np.abs(found.gradient) > 1.0).tolist():
        losses: list[float] = []
        for sign in (1.0, -1.0):
            moved = pose.copy()
            moved[number] += sign * 1e-4 * UNIT[number]
            held = hold.of(moved)
            losses.append(held.loss if held else 0.0)
        slope = (losses[0] - losses[1]) / 2e-4
        assert 0.5 * slope == pytest.approx(found.gradient[number], rel=0.03, abs=3.0)


def test_nothing_is_pulled_above_the_floor() -> None:
    assert FloorHold(BODY, UNIT, STEP).of(sunk(-1.0)) is None


def test_a_foot_that_cannot_bend_is_left_in_the_floor() -> None:
    """With a heel lifted the toe of a foot that is fixed to its shin lies below the floor, and nothing is wrong."""
    papers, _ = fit_subject(load_body("human31"), Subject(height_mm=1760.0))
    assert [limb.name for limb, one in zip(papers.drawn, rigid_limbs(papers), strict=True) if one][:1] == [
        "left foot"
    ]
    pose = standing(papers, left_knee_ry=-0.9, right_knee_ry=-0.9)  # On tiptoe, the shins leaning.
    toe = [limb.name for limb in papers.drawn].index("left foot"), 1
    pose[[entry.name for entry in papers.parameters].index("pelvis_z")] -= (
        limb_ends(papers, pose)[0][toe][2] + 40.0
    )
    assert limb_ends(papers, pose)[0][toe][2] == pytest.approx(-40.0)
    hold = FloorHold(papers, np.where(papers.angles, 1.0, 300.0), STEP)
    assert hold.of(pose) is None


def test_only_who_is_sized_by_a_height_has_a_floor() -> None:
    assert has_floor(BODY)
    assert has_floor(load_body("dog"))
    assert has_floor(load_body("human31"))
    assert not has_floor(load_body("mouse31"))
    assert not has_floor(load_body("hand25"))


@pytest.mark.parametrize("on", [True, False])
def test_a_foot_whose_outline_is_missing_is_lifted_out_of_the_floor(on: bool) -> None:
    truth = sunk(0.0, left_shoulder_swing=0.5, right_shoulder_swing=0.5)
    evidence = drawn_evidence(BODY, truth, CAMERAS)
    for view in evidence.views:
        rows = np.flatnonzero((view.mask > 0).any(axis=1))
        view.mask[rows[-1] - 26 :] = 0  # Feet are lost in a shadow.
    start = truth.copy()
    for name in ("left_ankle", "right_ankle"):
        start[[entry.name for entry in BODY.parameters].index(name)] -= 0.4
    assert lowest(BODY, start) < -30.0
    settings = RefinementSettings(refinement_floor=on)
    found = Refiner(BODY, CAMERAS, settings).refine(start, silhouette_distances(evidence)).pose
    assert lowest(BODY, found) > -7.0 if on else lowest(BODY, found) < -20.0


def test_the_pull_on_shapes_is_that_on_poses_of_the_body_of_the_shape() -> None:
    space = shape_space(BODY)
    shape = 0.05 * np.random.default_rng(2).standard_normal(len(space.groups))
    poses = np.stack([sunk(20.0), sunk(-200.0)])
    hold = FloorHoldOfShapes(space, UNIT, STEP)
    low, high = hold.of(shape, poses)
    assert low is not None
    assert high is None
    own = FloorHold(space.body_of(shape), UNIT, STEP).of(poses[0])
    assert own is not None
    size = poses.shape[1]
    assert low.loss == pytest.approx(own.loss)
    np.testing.assert_allclose(low.gradient[:size], own.gradient, atol=1e-6)
    for number in np.argsort(-np.abs(low.gradient[size:]))[:4].tolist():
        losses: list[float] = []
        for sign in (1.0, -1.0):
            moved = shape.copy()
            moved[number] += sign * 1e-4
            held = hold.of(moved, poses)[0]
            losses.append(held.loss if held else 0.0)
        assert 0.5 * (losses[0] - losses[1]) / 2e-4 == pytest.approx(low.gradient[size + number], rel=0.03)
