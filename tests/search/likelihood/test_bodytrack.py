"""The benchmark's score against the figures printed with its data, and against a plain twin."""

import cv2
import numba
import numpy as np
import pytest
from weighting_scene import looking_at, on_grid, plain_evidence, read, scattered, true_corners

from studio.body.catalogue import load_body
from studio.evidence.edges import bodytrack_edges
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.bodytrack import BLOCKS_A_THREAD, BodytrackLikelihood, BodytrackSettings, score
from studio.search.likelihood.bodytrack_kernels import MOST_ROWS, score_blocks
from studio.search.likelihood.outline_kernels import LANES


@pytest.mark.real_data
def test_the_initial_pose_scores_as_printed(real_data):
    """Lee-walk README, "The benchmark's score": E 0.30678, edge 0.24451, inside 0.06227; 899 + 1076 samples."""
    walk = real_data / "lee-walk"
    cameras, views = [], []
    for number in range(1, 5):
        one = read_calibration(walk / "CALIB" / f"Camera{number}.cal").cameras[0]
        name = f"camera{number}"
        cameras.append(Camera(name, 640, 480, one.matrix, one.distortion, one.rotation, one.translation))
        picture = cv2.imread(str(walk / f"CAM{number}" / "image0000.bmp"))
        mask = cv2.imread(str(walk / f"FG{number}" / "image0000.bmp"), cv2.IMREAD_GRAYSCALE)
        views.append(ViewEvidence(name, picture, mask, bodytrack_edges(picture)))
    pose = np.array((walk / "InitialPose.txt").read_text().split(), dtype=np.float64)
    found = score(load_body("human31"), tuple(cameras), FrameEvidence(0, tuple(views)), pose)
    assert found.total == pytest.approx(0.30678, abs=1e-5)
    assert found.edge == pytest.approx(0.24451, abs=1e-5)
    assert found.inside == pytest.approx(0.06227, abs=1e-5)
    assert (found.edge_samples, found.inside_samples) == (899, 1076)


def twin(body, cameras, evidence, pose):
    """E_edge, E_inside and the samples of each, straight from the README."""
    edge, inside = [], []
    for camera, view in zip(cameras, evidence.views, strict=True):
        corners, depth = true_corners(body, camera, pose[None])
        for outline, deep in zip(corners[0], depth[0], strict=True):
            if (deep <= 10).any():
                continue
            for side, start, end in ((0.0, 0, 1), (1.0, 3, 2)):
                n = max(4, int(np.linalg.norm(outline[end] - outline[start]) / 5 + 0.5))
                points = on_grid(outline, np.arange(n + 1) / n, np.array([side]))
                edge.append(read(view.edges, points, np.nan))
            rows = max(4, int(np.linalg.norm(outline[1] - outline[0]) / 10 + 0.5))
            middle = (outline[3] + outline[2] - outline[0] - outline[1]) / 2
            columns = max(4, int(np.linalg.norm(middle) / 10 + 0.5))
            points = on_grid(outline, np.arange(rows + 1) / rows, np.arange(columns) / columns)
            inside.append(read(view.mask, points, np.nan))
    edge, inside = np.concatenate(edge), np.concatenate(inside)
    edge, inside = edge[np.isfinite(edge)], inside[np.isfinite(inside)]
    return (
        ((255 - edge) / 255 @ ((255 - edge) / 255)) / len(edge),
        (inside == 0).mean(),
        len(edge),
        len(inside),
    )


@pytest.mark.parametrize("spread", [2.0, 60.0])
def test_terms_equal_the_twins(human, ring, smooth, spread):
    """With the larger spread many limbs are partly outside, and their samples are not counted."""
    views = tuple(
        ViewEvidence(v.camera, v.picture, np.where(v.mask > 110, 255, 0).astype(np.uint8), v.edges)
        for v in smooth.views
    )
    evidence = FrameEvidence(0, views)
    poses = scattered(human, 20, spread=spread)
    problem = BodytrackLikelihood(human, ring, BodytrackSettings()).problem(evidence)
    edge, inside, counts = problem.terms(poses)
    if spread > 10:
        assert (problem.likelihood.projector.corners(poses)[1] < 1).sum() > 20
    for n, pose in enumerate(poses):
        expected_edge, expected_inside, *expected_counts = twin(human, ring, evidence, pose)
        # A length may round to one interval more or less where it lies within 0.01 px of half a step.
        np.testing.assert_allclose(counts[n], expected_counts, atol=12)
        assert edge[n] == pytest.approx(expected_edge, abs=0.003)
        assert inside[n] == pytest.approx(expected_inside, abs=0.005)
    np.testing.assert_allclose(problem.log_likelihood(poses), -(edge + inside), rtol=1e-12)


def test_weights_of_the_terms(human, ring, smooth):
    poses = scattered(human, 3)
    edge, inside, _ = BodytrackLikelihood(human, ring, BodytrackSettings()).problem(smooth).terms(poses)
    settings = BodytrackSettings(score_edge_weight=2.0, score_inside_weight=0.5)
    weights = BodytrackLikelihood(human, ring, settings).problem(smooth).log_likelihood(poses)
    np.testing.assert_allclose(weights, -(2.0 * edge + 0.5 * inside), rtol=1e-12)


def test_a_pose_weighs_the_same_on_any_number_of_threads(human, ring, smooth):
    problem = BodytrackLikelihood(human, ring, BodytrackSettings()).problem(smooth)
    poses = scattered(human, 2 * 16 * BLOCKS_A_THREAD + 3)
    numba.set_num_threads(1)
    weights = problem.log_likelihood(poses)
    np.testing.assert_array_equal(problem.log_likelihood(poses[100:101]), weights[100:101])
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    np.testing.assert_array_equal(problem.log_likelihood(poses), weights)


def test_seen_by_no_camera_is_the_worst(human, ring):
    problem = BodytrackLikelihood(human, ring, BodytrackSettings()).problem(plain_evidence(ring, 255, 255))
    assert problem.log_likelihood(human.neutral[None])[0] == 0.0
    away = human.neutral.copy()
    away[5] += 20000.0
    assert problem.log_likelihood(away[None])[0] == -2.0
    found = problem.score(away)
    assert (found.edge_samples, found.inside_samples) == (0, 0)


def close_cameras(*factors: int) -> tuple[Camera, ...]:
    """Cameras in front of a body's middle, 200 mm away, whose lenses magnify so many times."""
    camera = looking_at("c", np.array([200.0, 0.0, 1000.0]), np.array([0.0, 0.0, 1000.0]), (640, 480), 500.0)
    return tuple(
        Camera(
            f"c{k}",
            640,
            480,
            camera.matrix * np.array([[k], [k], [1.0]]),
            np.zeros(5),
            camera.rotation,
            camera.translation,
        )
        for k in factors
    )


@pytest.mark.slow
def test_a_camera_within_reach_of_the_body_breaks_nothing(human):
    """Limbs that fill many pictures: more samples than there is room for are left out, not written."""
    cameras = close_cameras(1, 30, 1000)
    problem = BodytrackLikelihood(human, cameras, BodytrackSettings()).problem(
        plain_evidence(cameras, 255, 0)
    )
    weights = problem.log_likelihood(scattered(human, 40))
    assert ((weights >= -2.0) & (weights <= 0.0)).all()


def test_a_pose_weighs_the_same_beside_fifteen_others(human, ring):
    """One whose limbs fill a picture leaves no room in the common buffer: then each has a buffer of its own."""
    cameras = (*close_cameras(1), *ring)
    rng = np.random.default_rng(3)
    evidence = FrameEvidence(
        0,
        tuple(
            ViewEvidence(
                camera.name,
                np.zeros((camera.height, camera.width, 3), np.uint8),
                np.where(rng.random((camera.height, camera.width)) < 0.5, 255, 0).astype(np.uint8),
                rng.integers(0, 256, (camera.height, camera.width), dtype=np.uint8),
            )
            for camera in cameras
        ),
    )
    problem = BodytrackLikelihood(human, cameras, BodytrackSettings()).problem(evidence)
    poses = scattered(human, 32, spread=30.0)
    together = problem.terms(poses)
    assert together[2].max() > 2 * together[2].min()
    for n in range(len(poses)):
        for found, alone in zip(together, problem.terms(poses[n : n + 1]), strict=True):
            np.testing.assert_array_equal(found[n], alone[0])
    # Without any room in the common buffer.
    outlines = problem.likelihood.projector.blocks(poses)
    common, own = (np.zeros((len(outlines), LANES, 4), np.int64) for _ in range(2))
    score_blocks(0, len(outlines), outlines, problem.maps, problem._capacity, MOST_ROWS, common)
    score_blocks(0, len(outlines), outlines, problem.maps, problem._capacity, 8, own)
    np.testing.assert_array_equal(common, own)
