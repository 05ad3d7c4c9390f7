"""The outline kernel against the kinematics' and geometry's own code."""

import numba
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from weighting_scene import CENTRE, looking_at, scattered, true_corners

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import MOVE, TURN, KinematicTables
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import outward_limit
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project
from studio.search.likelihood.kinematic_program import compile_program
from studio.search.likelihood.outlines import BLOCKS_A_THREAD, OutlineProjector


@pytest.mark.parametrize("name", list_bodies())
def test_every_body_projects_as_in_its_kinematics(name, ring):
    body = load_body(name)
    middle = limb_ends(body, body.neutral[None]).reshape(-1, 3).mean(axis=0)
    cameras = tuple(
        looking_at(camera.name, camera.centre - CENTRE + middle, middle, (camera.width, camera.height))
        for camera in ring
    )
    poses = scattered(body, 21)
    corners, seen = OutlineProjector.of_body(body, cameras).corners(poses)
    assert corners.shape == (21, 4, len(body.drawn), 4, 2)
    for view, camera in enumerate(cameras):
        expected, depth = true_corners(body, camera, poses)
        assert (depth > 10).all()
        # Single precision: 3e-7 of some metres, a few times over, is a few thousandths of a pixel here.
        np.testing.assert_allclose(corners[:, view], expected, atol=0.01)
        limit = np.array([camera.width, camera.height]) - 0.5
        wholly = ((expected > -0.47) & (expected < limit - 0.03)).all(axis=(2, 3))
        partly = ((expected < -0.5) | (expected > limit)).any(axis=(2, 3))
        assert (seen[:, view][wholly] == 1).all()
        assert (seen[:, view][partly] == 0).all()


def test_any_tree_compiles(ring):
    """Folded constants, joints without limbs, factors other than one, moves in the middle, large angles."""
    steps = [
        (0, MOVE, 0, -1, 40.0),
        (0, TURN, 2, -1, 0.3),
        (0, MOVE, 1, 2, -2.0),
        (0, TURN, 0, 0, 1.5),
        (1, TURN, 1, 3, 1.0),
        (2, TURN, 0, -1, -0.4),
        (2, TURN, 1, -1, 0.9),
        (2, MOVE, 2, -1, 150.0),
        (2, TURN, 2, 1, -1.0),
        (2, MOVE, 0, -1, 30.0),
    ]
    tables = KinematicTables(
        parent=np.array([-1, 0, 0]),
        first_step=np.array([0, 4, 5, 10]),
        step_kind=np.array([step[1] for step in steps]),
        step_axis=np.array([step[2] for step in steps]),
        step_parameter=np.array([step[3] for step in steps]),
        step_value=np.array([step[4] for step in steps]),
        limb_joint=np.array([0, 2]),
        limb_shape=np.array([[300.0, 60, 40, 1, 0.7], [-250.0, 50, 20, 0.8, 1]]),
    )
    program = compile_program(tables)
    assert len(program.parent) == 2, "the joint without a limb is left out"
    assert program.dimension == 3
    poses = np.random.default_rng(5).uniform(-60, 60, (9, 4))
    frames = np.array([[chain(steps, (0,), pose), chain(steps, (0, 2), pose)] for pose in poses])
    camera = looking_at("c", np.array([2500.0, 300.0, 800.0]), np.zeros(3))
    expected, _ = project(camera, limb_outlines(tables.limb_shape, frames, camera))
    corners, _ = OutlineProjector(tables, (camera,)).corners(poses)
    np.testing.assert_allclose(corners[:, 0], expected, atol=0.02)


def chain(steps, joints, pose):
    """(3, 4) world_from_joint by multiplying 4 × 4 matrices, with rotations from SciPy."""
    world = np.eye(4)
    for joint in joints:
        for _, kind, axis, parameter, value in (step for step in steps if step[0] == joint):
            amount = value if parameter < 0 else value * pose[parameter]
            motion = np.eye(4)
            if kind == MOVE:
                motion[axis, 3] = amount
            else:
                motion[:3, :3] = Rotation.from_euler("xyz"[axis], amount).as_matrix()
            world = world @ motion
    return world[:3]


def test_outlines_depend_neither_on_other_poses_nor_on_threads(human, ring):
    projector = OutlineProjector.of_body(human, ring)
    poses = scattered(human, 2 * 16 * BLOCKS_A_THREAD + 3)
    numba.set_num_threads(1)
    together, _ = projector.corners(poses)
    alone = np.concatenate([projector.corners(pose[None])[0] for pose in poses[:5]])
    np.testing.assert_array_equal(together[:5], alone)
    np.testing.assert_array_equal(projector.corners(poses[::-1].copy())[0][::-1], together)
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    np.testing.assert_array_equal(projector.corners(poses)[0], together)


def test_a_limb_that_reaches_behind_the_camera_is_not_seen(human, ring):
    ends = limb_ends(human, human.neutral[None])[0]
    torso = ends[0].mean(axis=0)
    within = looking_at("within", torso + np.array([0, 20.0, 0]), torso + np.array([500.0, 20.0, 0]))
    away = looking_at("away", ring[0].centre, 2 * ring[0].centre - CENTRE)
    corners, seen = OutlineProjector.of_body(human, (within, away)).corners(human.neutral[None])
    assert seen[0, 0, 0] == -1
    assert np.isnan(corners[0, 0, 0]).all()
    assert (seen[0, 1] == -1).all()
    assert np.isnan(corners[0, 1]).all()


def test_distortion_that_folds_back_draws_nothing_into_the_picture(human):
    """With k1 = -0.5 the polynomial turns at tan = 0.816; a limb beyond would come back into the picture."""
    camera = looking_at("c", np.array([1600.0, 0.0, 900.0]), CENTRE, (640, 640), 150.0)
    folding = Camera(
        "c",
        640,
        640,
        camera.matrix,
        np.array([-0.5, 0, 0, 0, 0.0]),
        camera.rotation,
        camera.translation,
    )
    head = [limb.name for limb in human.drawn].index("head")
    pose = human.neutral.copy()
    z = [entry.name for entry in human.parameters].index("pelvis_z")
    pose[z] += 1500.0
    naive, depth = true_corners(human, folding, pose[None])
    inside = (naive[0, head] > 0).all() and (naive[0, head] < 640).all()
    assert inside, "some points fold back"
    assert (depth[0, head] > 0).all()
    _, seen = OutlineProjector.of_body(human, (folding,)).corners(pose[None])
    assert seen[0, 0, head] == -1


def limit_of(k1: float, k2: float, k3: float) -> float:
    lens = np.array([k1, k2, 0.0, 0.0, k3])
    return outward_limit(Camera("c", 640, 480, np.eye(3), lens, np.eye(3), np.zeros(3)))


@pytest.mark.parametrize(
    ("k1", "k2", "k3"), [(-0.5, 0, 0), (-0.3, -0.1, 0), (0.1, -0.2, 0.01), (-0.6, 0.1, -0.02)]
)
def test_the_fold_is_found_where_the_polynomial_turns(k1, k2, k3):
    r = np.linspace(0, 5, 2_000_001)
    turned = np.diff(r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6)) < 0
    np.testing.assert_allclose(np.sqrt(limit_of(k1, k2, k3)), r[np.argmax(turned)], atol=1e-5)


def test_no_fold_means_no_limit_but_the_widest_view():
    assert limit_of(0.0, 0.0, 0.0) == 1e6
    assert limit_of(-0.32, 0.14, 0.0) == 1e6, "the Lee walk's cameras"


def test_looking_along_a_limb_gives_numbers(human):
    frame = limb_ends(human, human.neutral[None])[0, 0]
    above = frame[0] + 4000.0 * (frame[1] - frame[0]) / np.linalg.norm(frame[1] - frame[0])
    rotation = Rotation.from_euler("x", np.pi).as_matrix()
    camera = Camera(
        "c",
        320,
        240,
        np.array([[260.0, 0, 160], [0, 260, 120], [0, 0, 1]]),
        np.zeros(5),
        rotation,
        -rotation @ above,
    )
    corners, _ = OutlineProjector.of_body(human, (camera,)).corners(human.neutral[None])
    expected, _ = true_corners(human, camera, human.neutral[None])
    assert np.isfinite(corners).all()
    width = np.linalg.norm(corners[0, 0, 0, 0] - corners[0, 0, 0, 3])
    assert width == pytest.approx(np.linalg.norm(expected[0, 0, 0] - expected[0, 0, 3]), rel=0.2)


def test_no_poses_are_no_outlines(human, ring):
    corners, seen = OutlineProjector.of_body(human, ring).corners(np.zeros((0, 31)))
    assert corners.shape == (0, 4, 10, 4, 2)
    assert seen.shape == (0, 4, 10)


def test_poses_that_do_not_fit_are_refused(human, ring):
    projector = OutlineProjector.of_body(human, ring)
    with pytest.raises(BodyError, match=r"shape \(3, 20\)"):
        projector.corners(np.zeros((3, 20)))
    with pytest.raises(BodyError, match=r"shape \(31,\)"):
        projector.corners(np.zeros(31))
    poses = np.zeros((4, 31))
    poses[2, 7] = np.inf
    with pytest.raises(BodyError, match="Parameter 7 of pose 2 is inf"):
        projector.corners(poses)
    poses[2, 7] = np.nan
    with pytest.raises(BodyError, match="Parameter 7 of pose 2 is nan"):
        projector.corners(poses)


def test_slopes_are_differences_of_corners_in_each_parameter(ring):
    body = load_body("human25")
    projector, pose = OutlineProjector.of_body(body, ring), scattered(body, 1)[0]
    steps = np.where([entry.kind == "angle" for entry in body.parameters], 1e-2, 2.0)
    corners, slopes = projector.slopes(pose, steps, 0.5)
    np.testing.assert_array_equal(corners, projector.corners(pose[None])[0][0])
    for entry, step in enumerate(np.diag(steps)):
        (ahead, behind), _ = projector.corners(np.stack([pose + step, pose - step]))
        np.testing.assert_allclose(slopes[..., entry], ahead - behind, atol=1e-3)
