"""The arms' pictures: all in view, upright, of the right size, and best explained by their own pose."""

import numpy as np
import pytest

from studio.body.forward_kinematics import limb_ends
from studio.body.model import kinematic_tables
from studio.foundations.geometry.projection import project
from studio.garden.reproduction.deutscher_reid import arms
from studio.garden.reproduction.deutscher_reid.arms import (
    TRUE_PART,
    TemplateArm,
    localise,
    silhouette,
    template_arm,
    true_pose,
)

BODIES = ("planar_arm4", "branched_arms6")


@pytest.fixture(scope="module", params=BODIES)
def arm(request: pytest.FixtureRequest) -> TemplateArm:
    """Each of the two bodies."""
    return template_arm(request.param)


def test_every_pose_lies_in_the_picture_and_in_the_picture_plane(arm: TemplateArm) -> None:
    space = arm.space
    poses = np.random.default_rng(5).uniform(space.lower, space.upper, (300, len(space.lower)))
    pixels, depth = project(arm.camera, limb_ends(arm.body, poses).reshape(-1, 3))
    assert np.all(pixels > 0)
    assert np.all(pixels < np.array([arm.camera.width - 1, arm.camera.height - 1]))
    assert np.ptp(depth) < 1e-6 * depth.mean()


def test_up_in_the_world_is_up_in_the_picture(arm: TemplateArm) -> None:
    low, high = np.zeros(3), np.array([0.0, 0.0, 100.0])
    pixels, _ = project(arm.camera, np.stack([low, high]))
    assert pixels[1, 1] < pixels[0, 1] - 1
    assert pixels[1, 0] == pytest.approx(pixels[0, 0], abs=1e-6)
    assert np.linalg.det(arm.camera.rotation) == pytest.approx(1.0)


def test_silhouette_has_the_area_of_its_limbs() -> None:
    arm = template_arm("planar_arm4")
    mask = silhouette(arm.body, arm.camera, arm.body.neutral)
    _, depth = project(arm.camera, np.zeros((1, 3)))
    scale = arm.camera.matrix[0, 0] / depth[0]
    shapes = kinematic_tables(arm.body).limb_shape
    # Straight limbs one after the other do not overlap: trapezoids of length × (r0 + r1).
    area = scale**2 * np.sum(shapes[:, 0] * (shapes[:, 1] + shapes[:, 2]))
    assert set(np.unique(mask)) == {0, 255}
    # Pixel centres on a border about 2 · 4 · 250 mm long: half a pixel's share of them either way.
    assert np.count_nonzero(mask) == pytest.approx(area, abs=0.25 * scale * 2000)


@pytest.mark.parametrize("seed", range(5))
def test_the_true_pose_explains_its_picture_best(arm: TemplateArm, seed: int) -> None:
    truth = true_pose(arm.space, seed)
    problem = arm.observed(truth)
    around = truth + 0.1 * np.random.default_rng(seed).standard_normal((200, len(truth)))
    there = problem.log_likelihood(truth[None])[0]
    assert there == pytest.approx(0.0, abs=1e-3)
    assert np.all(problem.log_likelihood(around) < there)


def test_true_poses_keep_away_from_the_limits(arm: TemplateArm) -> None:
    poses = np.array([true_pose(arm.space, seed) for seed in range(200)])
    half = (arm.space.upper - arm.space.lower) / 2
    reach = np.abs(poses - (arm.space.upper + arm.space.lower) / 2) / half
    assert reach.max() <= TRUE_PART
    assert reach.max() > 0.95 * TRUE_PART


def test_the_arm_is_found(arm: TemplateArm) -> None:
    errors = []
    for seed in range(3):
        result, records, truth = localise(arm, seed, layers=15, particles=200, survival=0.4)
        assert len(records) == 15
        errors.append(np.abs(result.estimate.pose - truth).max())
    # A link's width (about 5 of its 19 pixels' length) is 0.26 rad; one pixel at its end 0.05.
    assert np.median(errors) < 0.05


@pytest.mark.parametrize(
    ("body", "before"), [("planar_arm4", [-1, 0, 1, 2]), ("branched_arms6", [-1, 0, 1, -1, 3, 4])]
)
def test_absolute_angles_keep_the_links_beyond_a_cut_where_they_point(body: str, before: list[int]) -> None:
    arm = arms.template_arm(body)
    places = arms.links_before(arm.body)
    assert places.tolist() == before
    pose = arms.true_pose(arm.space, 3)
    frame = arms.AbsoluteAngles(arm.observed(pose), places)
    turned = arms.absolute(pose, places)
    assert frame.relative(turned[None])[0] == pytest.approx(pose)
    assert frame.log_likelihood(turned[None]) == pytest.approx(arm.observed(pose).log_likelihood(pose[None]))
    turned[0] += 0.2
    moved = limb_ends(arm.body, frame.relative(turned[None]))[0] - limb_ends(arm.body, pose[None])[0]
    beyond = [column for column in range(1, len(before)) if before[column] >= 0]
    for column in beyond:
        assert moved[column, 1] - moved[column, 0] == pytest.approx(np.zeros(3), abs=1e-6)
