"""The fitness of edges and silhouette against plain NumPy twins."""

import dataclasses

import numba
import numpy as np
import pytest
from pixel_centres import union
from weighting_scene import (
    four_cameras,
    inside_outline,
    looking_at,
    plain_evidence,
    read,
    scattered,
    smooth_evidence,
)

from studio.body.catalogue import list_bodies, load_body
from studio.evidence.edges import proximity_edges
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.evidence.settings import EvidenceSettings
from studio.footage.capture.calibration_files import read_calibration
from studio.footage.capture.pictures import read_picture
from studio.foundations.errors import BodyError
from studio.search.likelihood.edge_silhouette import EdgeSilhouetteLikelihood, EdgeSilhouetteSettings
from studio.search.likelihood.outline_kernels import DEPTH_ROW, LANES, ROWS
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY
from studio.search.likelihood.visible_edges import BLOCKS_A_THREAD, body_edges

ONE_SAMPLE = 1 / 100
"""A sample within rounding of a nearer limb's outline may count on one side only: one of 100 or more."""


def problem_of(body, cameras, evidence, **knobs):
    return EdgeSilhouetteLikelihood(body, cameras, EdgeSilhouetteSettings(**knobs)).problem(evidence)


def edges_by_name(body, stage):
    """(limb index, first corner, last corner) written out from the paper's words."""
    found = []
    trunk = [index for index, limb in enumerate(body.drawn) if limb.part == "trunk"]
    for index, limb in enumerate(body.drawn):
        if limb.part != "head" and (stage == WHOLE_BODY or index in trunk or not trunk):
            found += [(index, 0, 1), (index, 3, 2)]
    return found + [(index, 1, 2) for index in trunk[-1:]]


def twin(body, cameras, evidence, poses, stage=WHOLE_BODY, samples=16):
    """(N, V) f_e, sample by sample; limbs are ordered by the kernel's depth of their middle."""
    projector = EdgeSilhouetteLikelihood(body, cameras, EdgeSilhouetteSettings()).projector
    corners, seen = projector.corners(poses)
    blocks = projector.blocks(poses)
    rows = blocks.reshape(*blocks.shape[:3], ROWS, LANES)[..., DEPTH_ROW, :]
    depth = rows.transpose(0, 3, 1, 2).reshape(-1, *blocks.shape[1:3])
    along = ((np.arange(samples) + 0.5) / samples)[:, None]
    found = np.zeros((len(poses), len(cameras)))
    for n in range(len(poses)):
        for v, view in enumerate(evidence.views):
            values = []
            for limb, first, last in edges_by_name(body, stage):
                if seen[n, v, limb] < 0:
                    values.append(np.zeros(samples))
                    continue
                outline = corners[n, v, limb]
                points = (1 - along) * outline[first] + along * outline[last]
                shown = np.ones(samples, dtype=bool)
                for other in range(corners.shape[2]):
                    if seen[n, v, other] >= 0 and depth[n, v, other] < depth[n, v, limb]:
                        shown &= ~inside_outline(points, corners[n, v, other])
                values.append(read(view.edges, points[shown], 0.0) / 255)
            values = np.concatenate(values)
            found[n, v] = values.mean() if len(values) else 0.0
    return found


@pytest.mark.parametrize("stage", [WHOLE_BODY, TRUNK_FIRST])
@pytest.mark.parametrize("name", ["human31", "human29", "dog", "planar_arm4", "branched_arms6"])
def test_the_edge_term_equals_the_twin(name, stage):
    body, cameras = load_body(name), four_cameras()
    evidence = smooth_evidence(cameras, seed=5)
    poses = scattered(body, 20)
    _, edge = problem_of(body, cameras, evidence).terms(poses, stage)
    expected = twin(body, cameras, evidence, poses, stage)
    np.testing.assert_allclose(edge, expected, atol=ONE_SAMPLE)
    assert np.median(np.abs(edge - expected)) < 1e-4
    assert np.ptp(expected) > 0.1


@pytest.mark.parametrize("samples", [32, 64])
def test_more_samples_an_edge(human, ring, smooth, samples):
    poses = scattered(human, 6)
    _, edge = problem_of(human, ring, smooth, samples_per_edge=samples).terms(poses)
    np.testing.assert_allclose(edge, twin(human, ring, smooth, poses, samples=samples), atol=ONE_SAMPLE)


def test_partly_outside_equals_the_twin(human, ring, smooth):
    poses = scattered(human, 30)
    poses[:, 3:6] += np.random.default_rng(4).uniform(-1500, 1500, (30, 3))
    problem = problem_of(human, ring, smooth)
    assert (problem.likelihood.projector.corners(poses)[1] == 0).sum() > 100, "many limbs are partly outside"
    _, edge = problem.terms(poses)
    np.testing.assert_allclose(edge, twin(human, ring, smooth, poses), atol=2 * ONE_SAMPLE)


def test_which_edges_count(human):
    edges = body_edges(human)
    names = [limb.name for limb in human.drawn]
    assert len(edges.whole) == 2 * 9 + 1
    assert names.index("head") not in edges.whole[:, 0]
    torso = names.index("torso")
    np.testing.assert_array_equal(edges.trunk, [[torso, 0, 1], [torso, 3, 2], [torso, 1, 2]])


@pytest.mark.parametrize("name", list_bodies())
def test_every_body_has_edges_in_both_stages(name):
    body = load_body(name)
    edges = body_edges(body)
    limbs = {limb.part for limb in body.drawn}
    assert len(edges.trunk) > 0
    assert (len(edges.trunk) < len(edges.whole)) == ("trunk" in limbs)
    assert (edges.whole[:, 1:] == (1, 2)).all(axis=1).sum() == ("trunk" in limbs)


def test_the_upper_edge_is_the_shoulders(human, ring):
    """The far end of the torso's cone is its upper one, so the sample points lie above its middle."""
    corners = EdgeSilhouetteLikelihood(human, ring, EdgeSilhouetteSettings()).projector.corners(
        human.neutral[None]
    )[0][0]
    limb, first, last = body_edges(human).trunk[-1]
    for view in corners[:, limb]:
        assert view[[first, last], 1].max() < view[:, 1].mean(), "up is towards smaller y in these cameras"


def test_the_first_stage_uses_the_whole_silhouette(human, ring, smooth):
    poses = scattered(human, 5)
    problem = problem_of(human, ring, smooth)
    whole, first = problem.terms(poses), problem.terms(poses, TRUNK_FIRST)
    np.testing.assert_array_equal(whole[0], first[0])
    assert (whole[1] != first[1]).all()


def silhouettes_of(body, cameras, pose):
    """Evidence whose masks are the body's own pixels, with edges on their border."""
    corners, _ = EdgeSilhouetteLikelihood(body, cameras, EdgeSilhouetteSettings()).projector.corners(
        pose[None]
    )
    views = []
    for camera, outlines in zip(cameras, corners[0], strict=True):
        mask = union(outlines, camera.width, camera.height)[0]
        picture = np.where(mask, np.uint8(200), np.uint8(60))[:, :, None].repeat(3, axis=2)
        edges = proximity_edges(picture, 6.0, 2.0)
        views.append(ViewEvidence(camera.name, picture, np.where(mask, np.uint8(255), np.uint8(0)), edges))
    return FrameEvidence(0, tuple(views))


def test_the_pose_that_made_the_pictures_fits_best(human, ring):
    problem = problem_of(
        human, ring, silhouettes_of(human, ring, human.neutral), silhouette_resolution="full"
    )
    silhouette, edge = problem.terms(human.neutral[None])
    np.testing.assert_array_equal(silhouette, 1.0)
    assert (edge > 0.4).all(), "edges inside the silhouette are not in these pictures"
    fitness = problem.fitness(np.concatenate([human.neutral[None], scattered(human, 60, spread=2.0)]))
    assert fitness[0] > fitness[1:].max()
    assert ((fitness >= 0) & (fitness <= 2)).all()


def test_fitness_is_the_sum_of_the_means_and_the_log_weight_its_multiple(human, ring, smooth):
    poses = scattered(human, 9)
    problem = problem_of(human, ring, smooth, fitness_scale=3.5)
    silhouette, edge = problem.terms(poses)
    fitness = problem.fitness(poses)
    np.testing.assert_allclose(fitness, silhouette.mean(axis=1) + edge.mean(axis=1))
    np.testing.assert_allclose(problem.log_likelihood(poses), 3.5 * fitness)
    assert dataclasses.replace(problem.likelihood.settings).fitness_scale == 3.5


def test_leaving_the_pictures_is_never_rewarded(human, ring):
    """Where the pictures match everywhere, only the visible part of a pose gains weight."""
    problem = problem_of(human, ring, plain_evidence(ring, 255, 255))
    rising = np.repeat(human.neutral[None], 40, axis=0)
    rising[:, 5] += np.linspace(0, 20000, 40)
    silhouette, edge = problem.terms(rising)
    np.testing.assert_allclose(edge[0], 1.0)
    assert (np.diff(silhouette[2:, 0]) <= 0).all(), (
        "once it leaves, the further the worse, in the first camera"
    )
    fitness = problem.fitness(rising)
    assert fitness[-1] == 0.0, "seen by none: the worst"
    assert ((fitness >= 0.0) & (fitness <= 2.0)).all()


def test_behind_a_camera_is_worth_nothing_in_that_view_alone(human, ring):
    away = looking_at(ring[1].name, ring[1].centre, 2 * ring[1].centre - np.array([0, 0, 900.0]), (301, 257))
    cameras = (ring[0], away, *ring[2:])
    silhouette, edge = problem_of(human, cameras, plain_evidence(cameras, 255, 255)).terms(
        human.neutral[None]
    )
    assert silhouette[0, 1] == edge[0, 1] == 0.0
    assert (np.delete(silhouette[0], 1) > 0.5).all()
    np.testing.assert_allclose(np.delete(edge[0], 1), 1.0)


def test_empty_pictures_and_wild_poses_are_numbers(human, ring, smooth):
    poses = np.repeat(human.neutral[None], 12, axis=0)
    poses[np.arange(12), np.arange(12)] = 10.0 ** np.arange(0, 300, 25)
    poses[:, 5] *= -(10.0 ** np.arange(12))
    for evidence in (smooth, plain_evidence(ring, 0, 0)):
        for stage in (WHOLE_BODY, TRUNK_FIRST):
            fitness = problem_of(human, ring, evidence).fitness(poses, stage)
            assert ((fitness >= 0.0) & (fitness <= 2.0)).all()
    assert (
        problem_of(human, ring, plain_evidence(ring, 0, 0)).log_likelihood(scattered(human, 5)) == 0.0
    ).all()
    with pytest.raises(BodyError):
        problem_of(human, ring, smooth).fitness(np.full((1, 31), np.nan))


def test_a_fitness_depends_neither_on_other_poses_nor_on_threads(human, ring, smooth):
    poses = scattered(human, 2 * 16 * BLOCKS_A_THREAD + 3)
    problem = problem_of(human, ring, smooth)
    numba.set_num_threads(1)
    together = problem.fitness(poses)
    np.testing.assert_array_equal(problem.fitness(poses[40:41]), together[40:41])
    np.testing.assert_array_equal(problem.fitness(poses[::-1]), together[::-1])
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    np.testing.assert_array_equal(problem.fitness(poses), together)


@pytest.mark.real_data
def test_the_initial_pose_of_the_lee_walk_fits_best(real_data):
    """Among poses around it, in the real masks and pictures of the first frame."""
    lee = real_data / "lee-walk"
    body, cameras = load_body("human31"), read_calibration(lee / "CALIB").cameras
    start = np.array((lee / "InitialPose.txt").read_text().split(), dtype=float)
    knobs, views = EvidenceSettings(), []
    for number, camera in enumerate(cameras, start=1):
        picture = read_picture(lee / f"CAM{number}" / "image0000.bmp")
        mask = read_picture(lee / f"FG{number}" / "image0000.bmp")[:, :, 0]
        edges = proximity_edges(picture, knobs.edge_threshold, knobs.edge_smoothing)
        views.append(ViewEvidence(camera.name, picture, mask, edges))
    problem = problem_of(body, cameras, FrameEvidence(0, tuple(views)))
    for spread, beaten in ((3.0, 0.99), (8.0, 1.0), (20.0, 1.0)):
        others = start + scattered(body, 200, spread=spread) - body.neutral
        fitness = problem.fitness(np.concatenate([start[None], others]))
        assert np.mean(fitness[1:] < fitness[0]) >= beaten
