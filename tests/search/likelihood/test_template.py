"""The template weighting against a brute pixel-centre test."""

import numba
import numpy as np
import pytest
from weighting_scene import inside_outline, looking_at, scattered

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.search.likelihood.silhouette_areas import BLOCKS_A_THREAD
from studio.search.likelihood.template import TemplateLikelihood, TemplateSettings


def drawn(corners, width, height):
    """(H, W) whether a pixel's centre lies in any of the outlines (L, 4, 2); NaN outlines are not drawn."""
    pixels = np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), axis=-1)
    mask = np.zeros((height, width), dtype=bool)
    for outline in corners:
        mask |= inside_outline(pixels, outline)
    return mask


def with_masks(cameras, masks):
    nothing = [np.zeros(mask.shape, np.uint8) for mask in masks]
    views = [
        ViewEvidence(camera.name, np.repeat(mask[:, :, None], 3, axis=2), mask, empty)
        for camera, mask, empty in zip(cameras, masks, nothing, strict=True)
    ]
    return FrameEvidence(0, tuple(views))


def expected_differences(problem, evidence, poses):
    """(N, V) by drawing every template in full; the kernel's own corners, so that equality is exact."""
    corners, _ = problem.likelihood.projector.corners(poses)
    found = np.zeros((len(poses), len(evidence.views)))
    for v, view in enumerate(evidence.views):
        height, width = view.mask.shape
        for n in range(len(poses)):
            found[n, v] = np.mean(drawn(corners[n, v], width, height) != (view.mask >= 128))
    return found


@pytest.mark.parametrize("name", ["planar_arm4", "branched_arms6", "human31"])
@pytest.mark.parametrize("size", [(128, 96), (161, 120), (63, 200)])
def test_differences_equal_a_brute_drawing(name, size):
    body = load_body(name)
    middle = limb_ends(body, body.neutral[None]).reshape(-1, 3).mean(axis=0)
    cameras = (
        looking_at("front", middle + np.array([2600.0, 100.0, 50.0]), middle, size, 0.9 * min(size)),
        looking_at("near", middle + np.array([150.0, 600.0, 250.0]), middle, size, 0.9 * min(size)),
    )
    rng = np.random.default_rng(2)
    masks = [np.where(rng.random((c.height, c.width)) > 0.6, 255, 0).astype(np.uint8) for c in cameras]
    evidence = with_masks(cameras, masks)
    problem = TemplateLikelihood(body, cameras, TemplateSettings()).problem(evidence)
    poses = scattered(body, 20, spread=30.0)
    assert (problem.likelihood.projector.corners(poses)[1] == 0).any(), "some limbs leave the picture"
    differences = problem.differences(poses)
    np.testing.assert_array_equal(differences, expected_differences(problem, evidence, poses))
    np.testing.assert_allclose(problem.log_likelihood(poses), -differences.sum(axis=1))


def facing_arm():
    """The planar arm before one camera, and its silhouette in a pose."""
    body = load_body("planar_arm4")
    ends = limb_ends(body, scattered(body, 50, spread=30.0)).reshape(-1, 3)
    root = limb_ends(body, body.neutral[None])[0, 0, 0]
    normal = np.linalg.svd(ends - root, full_matrices=False)[2][2]
    camera = looking_at("front", root + 4000.0 * normal, root, (160, 120), 150.0)
    likelihood = TemplateLikelihood(body, (camera,), TemplateSettings())
    corners, _ = likelihood.projector.corners(body.neutral[None])
    mask = np.where(drawn(corners[0, 0], 160, 120), 255, 0).astype(np.uint8)
    return body, camera, likelihood, mask


def test_the_pose_that_made_the_silhouette_weighs_one():
    body, camera, likelihood, mask = facing_arm()
    problem = likelihood.problem(with_masks((camera,), [mask]))
    weights = problem.log_likelihood(np.concatenate([body.neutral[None], scattered(body, 40)]))
    assert weights[0] == 0.0
    assert (weights[1:] < 0.0).all()


def test_both_directions_count():
    """Pixels drawn and not seen cost as much as pixels seen and not drawn (unlike Eq. 15)."""
    body, camera, likelihood, mask = facing_arm()
    half = mask.copy()
    half[:, : int(np.flatnonzero(mask.any(axis=0)).mean())] = 0
    left = mask - half
    assert half.any()
    assert left.any()
    missing = likelihood.problem(with_masks((camera,), [half])).log_likelihood(body.neutral[None])[0]
    assert missing == pytest.approx(-(left > 0).sum() / mask.size)
    extra = mask.copy()
    extra[:3] = 255
    added = ((extra > 0) & (mask == 0)).sum()
    assert likelihood.problem(with_masks((camera,), [extra])).log_likelihood(body.neutral[None])[
        0
    ] == pytest.approx(-added / mask.size)


def test_a_body_behind_the_camera_is_not_drawn():
    body, camera, _, mask = facing_arm()
    away = looking_at("front", camera.centre, camera.centre + 100 * camera.rotation[2] * -1, (160, 120))
    problem = TemplateLikelihood(body, (away,), TemplateSettings()).problem(with_masks((away,), [mask]))
    assert problem.log_likelihood(body.neutral[None])[0] == pytest.approx(-(mask > 0).mean())


def test_any_finite_pose_has_a_finite_weight_on_any_number_of_threads():
    human = load_body("human31")
    middle = limb_ends(human, human.neutral[None]).reshape(-1, 3).mean(axis=0)
    camera = looking_at("c", middle + np.array([1200.0, 0.0, 100.0]), middle, (160, 120), 150.0)
    mask = np.full((120, 160), 255, np.uint8)
    problem = TemplateLikelihood(human, (camera,), TemplateSettings()).problem(with_masks((camera,), [mask]))
    poses = scattered(human, 2 * 16 * BLOCKS_A_THREAD + 3, spread=100.0)
    poses[:12, :12] *= 10.0 ** np.arange(0, 300, 25)[:, None]
    poses[20:40, 3] += np.linspace(900.0, 1250.0, 20)
    numba.set_num_threads(1)
    weights = problem.log_likelihood(poses)
    assert ((weights >= -1.0) & (weights <= 0.0)).all()
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    np.testing.assert_array_equal(problem.log_likelihood(poses), weights)
