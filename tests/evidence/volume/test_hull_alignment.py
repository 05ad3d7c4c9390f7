"""Position and heading from a hull alone."""

import numpy as np
import pytest
from posed_hulls import empty_hull, hull_of, near
from scipy.spatial.transform import Rotation

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, marker_points
from studio.evidence.volume.alignment import (
    Axes,
    _axis_turns,
    _headings,
    axes_of_hull,
    axes_of_pose,
    root_candidates,
    root_parameters,
)


def test_axes_of_a_slanted_box_of_voxels() -> None:
    body = load_body("human25")
    hull = hull_of(body, body.neutral)
    turn = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    axes = axes_of_hull(
        type(hull)(hull.centres @ turn.T, hull.edges, hull.colours, hull.view_colours, hull.depth, hull.box)
    )
    own = axes_of_hull(hull)
    np.testing.assert_allclose(axes.mean, turn @ own.mean)
    edge = hull.edges[0] ** 2 / 12.0
    np.testing.assert_allclose(
        axes.covariance - edge * np.eye(3), turn @ (own.covariance - edge * np.eye(3)) @ turn.T, atol=1e-6
    )
    principal = axes.principal()
    assert np.linalg.det(principal) == pytest.approx(1.0)
    spread = np.diag(principal.T @ axes.covariance @ principal)
    assert (np.diff(spread) < 0.0).all()


def test_a_hull_of_the_cones_has_the_cones_axes() -> None:
    body = load_body("human25")
    pose = near(body, body.neutral, 2, frames=6)
    seen, own = axes_of_hull(hull_of(body, pose, spacing=12.0)), axes_of_pose(body, pose)
    # Limbs overlap at their joints, which the cones count twice.
    np.testing.assert_allclose(seen.mean, own.mean, atol=12.0)
    assert np.sqrt(seen.covariance[2, 2]) == pytest.approx(np.sqrt(own.covariance[2, 2]), rel=0.05)


@pytest.mark.parametrize(("name", "heading"), [("human25", "heading"), ("human31", "pelvis_rz")])
@pytest.mark.parametrize("seed", range(5))
def test_one_candidate_stands_where_the_person_stands(name: str, heading: str, seed: int) -> None:
    body = load_body(name)
    rng = np.random.default_rng(seed)
    names = [entry.name for entry in body.parameters]
    truth = body.neutral.copy()
    truth[names.index("pelvis_x")], truth[names.index("pelvis_y")] = rng.uniform(-1500, 1500, 2)
    truth[names.index(heading)] = rng.uniform(-np.pi, np.pi)
    candidates = root_candidates(body, hull_of(body, truth), body.neutral)
    assert len(candidates) in (2, 4)
    off = np.linalg.norm(marker_points(body, candidates) - marker_points(body, truth), axis=2).mean(axis=1)
    assert off[:2].min() < 40.0
    # The other facing: the same place, turned half round.
    assert off.max() > 150.0
    assert np.abs(candidates[:, :3].std(axis=0)).max() < 400.0


def test_lying_down_needs_all_three_axes() -> None:
    body = load_body("human25")
    lying = body.neutral.copy()
    names = [entry.name for entry in body.parameters]
    lying[names.index("lean_forward")] = np.pi / 2
    lying[names.index("pelvis_z")] = 150.0
    lying[names.index("heading")] = 0.8
    hull = hull_of(body, lying)
    free = root_candidates(body, hull, body.neutral, upright=False)
    assert len(free) == 4
    markers = marker_points(body, lying)
    off = np.linalg.norm(marker_points(body, free) - markers, axis=2).mean(axis=1)
    upright = root_candidates(body, hull, body.neutral)
    stood = np.linalg.norm(marker_points(body, upright) - markers, axis=2).mean(axis=1)
    assert off.min() < 60.0
    assert stood.min() > 250.0
    frames = joint_frames(body, free)[:, 0, :, :3]
    for one in range(4):
        for other in range(one):
            assert np.abs(frames[one] - frames[other]).max() > 0.5


def test_a_fixed_body_stays_in_place() -> None:
    body = load_body("planar_arm4")
    assert len(root_parameters(body)) == 0
    hull = hull_of(body, body.neutral, spacing=10.0)
    np.testing.assert_array_equal(root_candidates(body, hull, body.neutral), body.neutral[None])
    assert len(root_parameters(load_body("dog"))) == 6


def test_an_empty_hull_is_refused() -> None:
    with pytest.raises(ValueError, match="empty hull"):
        root_candidates(load_body("human25"), empty_hull(), load_body("human25").neutral)


def of_spread(long: float, short: float, angle: float) -> Axes:
    """A volume whose longer horizontal axis points at an angle; upright it is longest."""
    turn = Rotation.from_euler("z", angle).as_matrix()
    return Axes(np.zeros(3), turn @ np.diag([long, short, 9000.0]) @ turn.T)


def test_a_volume_heads_along_its_longer_horizontal_axis() -> None:
    for angle in (-1.2, 0.0, 0.4, 1.5):
        axes = of_spread(500.0, 200.0, angle)
        assert axes.heading() == pytest.approx(angle)
        assert axes.roundness() == pytest.approx(0.4)
        principal = axes.principal()
        assert np.linalg.det(principal) == pytest.approx(1.0)
        np.testing.assert_allclose(np.diag(principal.T @ axes.covariance @ principal), (9000.0, 500.0, 200.0))


def test_a_heading_is_tried_both_ways_and_across_where_one_of_the_two_is_nearly_round() -> None:
    for rounder, quarters in ((0.59, (0, 2)), (0.61, (0, 2, 1, 3))):
        for seen, own in ((rounder, 0.3), (0.3, rounder)):
            turns = _headings(of_spread(500.0, 500.0 * seen, 0.9), of_spread(300.0, 300.0 * own, 0.2))
            wanted = [
                Rotation.from_euler("z", 0.7 + quarter * np.pi / 2.0).as_matrix() for quarter in quarters
            ]
            np.testing.assert_allclose(turns, wanted, atol=1e-9)


def test_principal_axes_are_aligned_in_four_ways() -> None:
    seen, own = of_spread(500.0, 200.0, 0.9), of_spread(400.0, 300.0, -0.5)
    turns = _axis_turns(seen, own)
    for turn in turns:
        assert np.linalg.det(turn) == pytest.approx(1.0)
        np.testing.assert_allclose(np.abs(turn @ own.principal()), np.abs(seen.principal()), atol=1e-9)
    assert len({tuple(np.round(turn.ravel(), 6)) for turn in turns}) == 4


@pytest.mark.parametrize("name", ["human25", "human31", "dog"])
def test_candidates_have_the_hulls_mean_and_turn(name: str) -> None:
    body = load_body(name)
    hull = hull_of(body, body.neutral, spacing=40.0)
    moved = type(hull)(
        hull.centres @ Rotation.from_euler("z", 0.8).as_matrix().T + (300.0, -200.0, 50.0),
        hull.edges, hull.colours, hull.view_colours, hull.depth, hull.box,
    )  # fmt: skip
    seen, own = axes_of_hull(moved), axes_of_pose(body, body.neutral)
    first = joint_frames(body, body.neutral)[0, 0]
    candidates = root_candidates(body, moved, body.neutral)
    for pose, turn in zip(candidates, _headings(seen, own), strict=True):
        frame = joint_frames(body, pose)[0, 0]
        np.testing.assert_allclose(frame[:, :3], turn @ first[:, :3], atol=1e-4)
        np.testing.assert_allclose(frame[:, 3], turn @ (first[:, 3] - own.mean) + seen.mean, atol=0.1)
        others = np.setdiff1d(np.arange(len(pose)), root_parameters(body))
        np.testing.assert_array_equal(pose[others], body.neutral[others])
