"""Exact areas against a rasteriser by pixel centres, and the bidirectional silhouette in closed form."""

import numba
import numpy as np
import pytest
from pixel_centres import union
from scipy.stats import spearmanr
from weighting_scene import four_cameras, looking_at, scattered

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.footage.capture.calibration_files import read_calibration
from studio.footage.capture.pictures import read_picture
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.silhouette_areas import (
    BLOCKS_A_THREAD,
    FULL,
    HALF,
    Silhouettes,
    halved,
    silhouettes_of,
)

SCALES = {FULL: 1.0, HALF: 0.5}


def with_masks(masks):
    views = [
        ViewEvidence(f"c{k}", np.zeros((0, 0, 3), np.uint8), mask, np.zeros(mask.shape, np.uint8))
        for k, mask in enumerate(masks)
    ]
    return FrameEvidence(0, tuple(views))


def speckled(cameras, seed=0):
    """Half of all pixels, at random: every pixel of a union matters to what is shared."""
    rng = np.random.default_rng(seed)
    return [np.where(rng.random((c.height, c.width)) > 0.5, 255, 0).astype(np.uint8) for c in cameras]


def observed(mask, resolution):
    return halved(mask >= 128) if resolution == HALF else mask >= 128


def compare_with_oracle(body, cameras, masks, poses, resolution):
    """Assert equality but for pixels near an edge; returns the share of (pose, view)s that are equal outright."""
    projector = OutlineProjector.of_body(body, cameras)
    silhouettes = Silhouettes(with_masks(masks), resolution)
    areas = silhouettes.areas(projector.blocks(poses), len(poses))
    corners, _ = projector.corners(poses)
    equal = 0
    for v, mask in enumerate(masks):
        seen = observed(mask, resolution)
        height, width = seen.shape
        assert tuple(silhouettes.sizes[v]) == (width, height)
        assert areas.observed[v] == seen.sum()
        for n in range(len(poses)):
            drawn, surely, perhaps = union(corners[n, v], width, height, SCALES[resolution])
            assert surely.sum() <= areas.projected[n, v] <= perhaps.sum()
            assert (surely & seen).sum() <= areas.both[n, v] <= (perhaps & seen).sum()
            equal += (drawn.sum(), (drawn & seen).sum()) == (areas.projected[n, v], areas.both[n, v])
    return equal / (len(poses) * len(masks))


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize("resolution", [pytest.param(FULL, marks=pytest.mark.slow), HALF])
def test_a_thousand_poses_in_the_real_cameras(real_data, resolution):
    lee = real_data / "lee-walk"
    body, cameras = load_body("human31"), read_calibration(lee / "CALIB").cameras
    masks = [read_picture(lee / f"FG{k}" / "image0000.bmp")[:, :, 0] for k in (1, 2, 3, 4)]
    start = np.array((lee / "InitialPose.txt").read_text().split(), dtype=float)
    poses = start + scattered(body, 1000, spread=12.0) - body.neutral
    poses[::5, 3:5] += np.random.default_rng(3).uniform(-2500, 2500, (200, 2))
    assert (OutlineProjector.of_body(body, cameras).corners(poses)[1] < 1).sum() > 500, (
        "some leave the pictures"
    )
    assert compare_with_oracle(body, cameras, masks, poses, resolution) > 0.999


@pytest.mark.parametrize("name", ["human31", "dog", "branched_arms6"])
@pytest.mark.parametrize("resolution", [FULL, HALF])
def test_areas_equal_the_oracle(name, resolution):
    body = load_body(name)
    middle = limb_ends(body, body.neutral[None]).reshape(-1, 3).mean(axis=0)
    cameras = (
        looking_at("front", middle + np.array([2600.0, 100.0, 50.0]), middle, (161, 120), 110.0),
        looking_at("near", middle + np.array([150.0, 600.0, 250.0]), middle, (63, 201), 70.0),
        looking_at("wide", middle + np.array([900.0, -900.0, 150.0]), middle, (640, 31), 300.0),
    )
    poses = scattered(body, 25, spread=30.0)
    assert compare_with_oracle(body, cameras, speckled(cameras), poses, resolution) > 0.999


def test_a_limb_right_across_the_picture():
    """Spans of many words, and edges far outside the picture."""
    body = load_body("planar_arm4")
    middle = limb_ends(body, body.neutral[None]).reshape(-1, 3).mean(axis=0)
    for distance in (60.0, 150.0, 400.0):
        camera = looking_at("close", middle + np.array([0.3, 1.0, 0.2]) * distance, middle, (500, 333), 400.0)
        masks = speckled((camera,))
        compare_with_oracle(body, (camera,), masks, scattered(body, 30, spread=20.0), FULL)
        compare_with_oracle(body, (camera,), masks, scattered(body, 30, spread=20.0), HALF)


@pytest.mark.parametrize("resolution", [FULL, HALF])
def test_a_mask_is_silhouette_from_half_of_its_values_on(resolution):
    mask = np.full((6, 8), 127, np.uint8)
    mask[2:4, 4:8] = 128
    found = Silhouettes(with_masks([mask]), resolution)
    assert found.scale == SCALES[resolution]
    np.testing.assert_array_equal(found.pixels, [8 * SCALES[resolution] ** 2])
    np.testing.assert_array_equal(found.sizes, [[8 * SCALES[resolution], 6 * SCALES[resolution]]])


def test_a_frames_silhouettes_are_made_once_for_each_resolution():
    evidence, other = (with_masks(speckled(four_cameras())) for _ in range(2))
    half = silhouettes_of(evidence, HALF)
    assert silhouettes_of(evidence, HALF) is half
    assert silhouettes_of(evidence, FULL).scale == 1.0
    assert silhouettes_of(evidence, HALF) is half
    assert silhouettes_of(other, HALF) is not half


def test_half_a_mask_is_the_majority_of_each_four():
    mask = np.random.default_rng(1).random((31, 47)) > 0.5
    half = halved(mask)
    assert half.shape == (16, 24)
    for row in range(16):
        for column in range(24):
            four = mask[2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
            tie = (row + column) % 2 == 0
            assert half[row, column] == (tie if four.mean() == 0.5 else four.mean() > 0.5)


def test_half_a_disc_keeps_area_and_place():
    y, x = np.mgrid[:300, :300]
    for centre in (150.0, 150.5, 151.0):
        disc = np.hypot(x - centre, y - centre) < 60.3
        half = halved(disc)
        rows, columns = np.nonzero(half)
        assert half.sum() == pytest.approx(disc.sum() / 4, rel=6e-3)
        assert [columns.mean(), rows.mean()] == pytest.approx([(centre - 0.5) / 2] * 2, abs=0.03)


def facing_arm(size=(160, 120)):
    """The planar arm before one camera, and the pixels of its silhouette at full resolution."""
    body = load_body("planar_arm4")
    root = limb_ends(body, body.neutral[None])[0, 0, 0]
    ends = limb_ends(body, scattered(body, 50, spread=30.0)).reshape(-1, 3)
    normal = np.linalg.svd(ends - root, full_matrices=False)[2][2]
    camera = looking_at("front", root + 4000.0 * normal, root, size, 150.0)
    projector = OutlineProjector.of_body(body, (camera,))
    drawn, _, _ = union(projector.corners(body.neutral[None])[0][0, 0], *size)
    return body, projector, drawn


def silhouette_fitness(projector, poses, mask, resolution=FULL):
    shown = np.where(mask, 255, 0).astype(np.uint8)
    return Silhouettes(with_masks([shown]), resolution).areas(projector.blocks(poses), len(poses)).fitness()


def test_the_bidirectional_silhouette_in_closed_form():
    body, projector, drawn = facing_arm()
    pose, area = body.neutral[None], drawn.sum()
    assert silhouette_fitness(projector, pose, drawn) == 1.0
    assert silhouette_fitness(projector, pose, ~drawn) == 0.0
    assert silhouette_fitness(projector, pose, np.ones_like(drawn)) == pytest.approx(
        0.5 + 0.5 * area / drawn.size
    )
    part = drawn & (np.cumsum(drawn.ravel()).reshape(drawn.shape) <= area // 3)
    assert silhouette_fitness(projector, pose, part) == pytest.approx(0.5 * part.sum() / area + 0.5)
    extra = drawn.copy()
    extra[:5] = True
    assert silhouette_fitness(projector, pose, extra) == pytest.approx(0.5 + 0.5 * area / extra.sum())


def test_zero_over_zero_is_zero():
    body, projector, drawn = facing_arm()
    pose = body.neutral[None]
    assert silhouette_fitness(projector, pose, np.zeros_like(drawn)) == 0.0
    camera = projector.cameras[0]
    away = looking_at("front", camera.centre, camera.centre - 100 * camera.rotation[2], (160, 120))
    behind = OutlineProjector.of_body(body, (away,))
    assert silhouette_fitness(behind, pose, drawn) == 0.0
    assert silhouette_fitness(behind, pose, np.zeros_like(drawn)) == 0.0


@pytest.mark.parametrize("resolution", [FULL, HALF])
def test_cutting_off_a_mismatch_gains_nothing(resolution):
    """The right half shows no silhouette; whether the picture ends there must not change the fitness."""
    _, wide, drawn = facing_arm((320, 240))
    body = load_body("planar_arm4")
    poses = np.concatenate([body.neutral[None], scattered(body, 40, spread=20.0)])
    columns = np.flatnonzero(drawn.any(axis=0))
    cut = int(columns.mean()) // 2 * 2
    mask = drawn.copy()
    mask[:, cut:] = False
    camera = wide.cameras[0]
    narrow_camera = Camera(
        camera.name, cut, camera.height, camera.matrix, camera.distortion, camera.rotation, camera.translation
    )
    narrow = OutlineProjector.of_body(body, (narrow_camera,))
    assert (narrow.corners(poses)[1] == 0).sum() > 20
    whole = silhouette_fitness(wide, poses, mask, resolution)
    short = silhouette_fitness(narrow, poses, mask[:, :cut], resolution)
    # Areas outside are the outlines' own, not counted pixels, and overlaps count twice: never a gain but rounding.
    assert (short <= whole + 0.02).all()
    assert np.median(whole - short) < 0.02


def test_areas_depend_neither_on_other_poses_nor_on_threads():
    body, cameras = load_body("human31"), four_cameras()
    silhouettes = Silhouettes(with_masks(speckled(cameras)), HALF)
    projector = OutlineProjector.of_body(body, cameras)
    poses = scattered(body, 2 * LANES * BLOCKS_A_THREAD + 5, spread=20.0)
    poses[::7, 3:5] += 1500.0
    numba.set_num_threads(1)
    together = silhouettes.areas(projector.blocks(poses), len(poses))
    alone = silhouettes.areas(projector.blocks(poses[40:41]), 1)
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    again = silhouettes.areas(projector.blocks(poses), len(poses))
    for name in ("both", "projected", "outside"):
        np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[40])
        np.testing.assert_array_equal(getattr(again, name), getattr(together, name))


def test_half_resolution_orders_poses_as_full_does():
    body, cameras = load_body("human31"), four_cameras()
    projector = OutlineProjector.of_body(body, cameras)
    corners, _ = projector.corners(body.neutral[None])
    masks = [
        np.where(union(corners[0, v], camera.width, camera.height)[0], 255, 0).astype(np.uint8)
        for v, camera in enumerate(cameras)
    ]
    poses = scattered(body, 300, spread=2.0)
    found = [
        Silhouettes(with_masks(masks), resolution).areas(projector.blocks(poses), 300).fitness().mean(axis=1)
        for resolution in (FULL, HALF)
    ]
    assert spearmanr(*found).statistic > 0.995
