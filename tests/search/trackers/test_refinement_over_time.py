"""Frames refined together: slopes, the banded equations, windows, and a consistent movement."""

import itertools

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.evidence.distance_maps import SilhouetteDistances, silhouette_distances
from studio.search.trackers.banded_solving import solve_banded
from studio.search.trackers.refinement import FrameLoss, RefinementSettings, Refiner
from studio.search.trackers.refinement_over_time import (
    OVERLAP,
    WINDOW,
    MovementRefiner,
    Window,
    body_points,
    place_block,
    windows,
)
from studio.search.trackers.smoothing import rms_second_difference

Array = np.ndarray
CAMERAS = ring_of_cameras(3, 320, 240)
FPS, FRAMES = 30.0, 12


@pytest.fixture(scope="module")
def movement(body: BodyModel) -> Array:
    """(F, D): arms and a leg swing for a third of a second, the body leans."""
    names = [entry.name for entry in body.parameters]
    time = np.arange(FRAMES) / FPS
    poses = np.repeat(body.neutral[None], FRAMES, axis=0)
    poses[:, names.index("pelvis_z")] = 950.0
    poses[:, names.index("pelvis_x")] = 900.0 * time
    poses[:, names.index("left_shoulder_ry")] -= 0.6 + 0.5 * np.sin(6.0 * time)
    poses[:, names.index("right_shoulder_rx")] += 0.6 + 0.4 * np.sin(5.0 * time)
    poses[:, names.index("left_hip_ry")] += 0.5 * np.sin(5.0 * time)
    poses[:, names.index("pelvis_ry")] += 0.15 * np.sin(4.0 * time)
    return poses


@pytest.fixture(scope="module")
def seen(body: BodyModel, movement: Array) -> list[tuple[SilhouetteDistances, ...]]:
    return [silhouette_distances(drawn_evidence(body, pose, CAMERAS)) for pose in movement]


@pytest.fixture(scope="module")
def found_by_a_search(body: BodyModel, movement: Array) -> Array:
    """Poses as from a search: every frame a little off, independently."""
    rng = np.random.default_rng(5)
    unit = np.array([1.0 if entry.kind == "angle" else 250.0 for entry in body.parameters])
    return movement + 0.07 * unit * rng.standard_normal(movement.shape)


def losses(refiner: Refiner, starts: Array, seen: list[tuple[SilhouetteDistances, ...]]) -> list[FrameLoss]:
    return [refiner.frame_loss(start, views) for start, views in zip(starts, seen, strict=True)]


def off(body: BodyModel, poses: Array, truth: Array) -> float:
    apart = marker_points(body, poses) - marker_points(body, truth)
    return float(np.linalg.norm(apart, axis=2).mean())


def test_movement_weighs_by_the_square_of_the_frame_rate_over_the_acceleration(body: BodyModel) -> None:
    refiner = Refiner(body, CAMERAS, RefinementSettings())
    usual, gentle, slow = (
        MovementRefiner(refiner, fps, acceleration)._weight
        for fps, acceleration in ((30.0, 2.0), (30.0, 1.0), (15.0, 2.0))
    )
    assert (gentle / usual, slow / usual) == pytest.approx((4.0, 1.0 / 16.0))


def test_frames_refined_together_move_as_one_and_lie_as_near(
    body: BodyModel, movement: Array, seen: list[tuple[SilhouetteDistances, ...]], found_by_a_search: Array
) -> None:
    refiner = Refiner(body, CAMERAS, RefinementSettings())
    alone = np.array(
        [refiner.refine(pose, views).pose for pose, views in zip(found_by_a_search, seen, strict=True)]
    )
    mover = MovementRefiner(refiner, FPS, 20.0)
    none = np.zeros((0, len(body.parameters)))
    together = mover.refine(Window(found_by_a_search, losses(refiner, found_by_a_search, seen), none))
    own = rms_second_difference(marker_points(body, movement))
    jitters = [rms_second_difference(marker_points(body, poses)) for poses in (alone, together)]
    assert jitters[0] > own + 5.0
    assert jitters[1] < own + 3.0
    assert off(body, together, movement) < off(body, alone, movement)
    assert off(body, together, movement) < 0.6 * off(body, found_by_a_search, movement)


def test_a_frame_without_evidence_follows_its_neighbours(
    body: BodyModel, movement: Array, seen: list[tuple[SilhouetteDistances, ...]]
) -> None:
    refiner = Refiner(body, CAMERAS, RefinementSettings())
    starts = movement.copy()
    starts[5, 6:] += 0.3
    of_frames = losses(refiner, starts, seen)
    of_frames[5] = refiner.frame_loss(starts[5], ())
    none = np.zeros((0, len(body.parameters)))
    found = MovementRefiner(refiner, FPS, 20.0).refine(Window(starts, of_frames, none))
    before, after = off(body, starts[5:6], movement[5:6]), off(body, found[5:6], movement[5:6])
    assert before > 60.0
    assert after < 0.5 * before


@pytest.mark.parametrize("together", [True, False])
def test_parameters_that_stay_still_stay_and_the_others_take_that_into_account(
    body: BodyModel,
    movement: Array,
    seen: list[tuple[SilhouetteDistances, ...]],
    found_by_a_search: Array,
    together: bool,
) -> None:
    still = [number for number, entry in enumerate(body.parameters) if entry.limb == "left arm"]
    assert still
    refiner = Refiner(body, CAMERAS, RefinementSettings(), still)
    starts = found_by_a_search.copy()
    starts[:, still] = movement[:, still]
    if together:
        window = Window(starts, losses(refiner, starts, seen), np.zeros((0, len(body.parameters))))
        found = MovementRefiner(refiner, FPS, 20.0).refine(window)
    else:
        found = np.array(
            [refiner.refine(start, views).pose for start, views in zip(starts, seen, strict=True)]
        )
    assert (found[:, still] == starts[:, still]).all()
    assert off(body, found, movement) < 0.6 * off(body, starts, movement)


def test_held_frames_hold_a_windows_beginning(
    body: BodyModel, movement: Array, seen: list[tuple[SilhouetteDistances, ...]]
) -> None:
    refiner = Refiner(body, CAMERAS, RefinementSettings())
    mover = MovementRefiner(refiner, FPS, 1.0)
    aside = movement[:2].copy()
    aside[:, 3] -= 80.0
    part = slice(2, 5)
    free, held = (
        mover.refine(Window(movement[part], losses(refiner, movement[part], seen[part]), before))
        for before in (aside[:0], aside)
    )
    assert held[0, 3] < free[0, 3] - 20.0


def test_the_gradient_is_that_of_the_acceleration(body: BodyModel, movement: Array) -> None:
    """With a pull for each frame's loss, the remaining loss is smooth, so differences are an exact oracle."""
    refiner = Refiner(body, CAMERAS, RefinementSettings(refinement_pull=30.0))
    mover = MovementRefiner(refiner, FPS, 15.0)
    starts, poses = movement[2:5], movement[2:5] + 0.02
    poses[1] += 0.03
    window = Window(starts, [refiner.frame_loss(start, ()) for start in starts], movement[:2])
    equations = mover.equations(poses, window, 2.0)
    rng = np.random.default_rng(0)
    for _ in range(6):
        way = rng.standard_normal(poses.shape)
        step = 1e-4 * way * refiner.unit
        ahead, back = (mover.equations(poses + sign * step, window, 2.0).loss for sign in (1.0, -1.0))
        assert np.sum(equations.gradient * way) == pytest.approx((ahead - back) / 4e-4, rel=1e-3)
    # Every three frames in a row count, those before the window too.
    bends = np.diff(body_points(body, np.concatenate([movement[:2], poses])), 2, axis=0)
    more = equations.loss - mover.equations(poses, window, 1.0).loss
    assert more == pytest.approx(np.sum(bends**2), rel=1e-9)


def test_blocks_lie_where_the_solver_expects_them() -> None:
    rng = np.random.default_rng(3)
    count, size = 5, 3
    whole, rows = np.zeros((15, 15)), np.zeros((15, 9))
    for t, k in itertools.product(range(count), range(3)):
        if t >= k:
            block = rng.standard_normal((size, size))
            block = block @ block.T + 20.0 * np.eye(size) if k == 0 else block
            whole[t * size : (t + 1) * size, (t - k) * size : (t - k + 1) * size] = block
            place_block(rows, block, t * size, (t - k) * size)
    whole = np.tril(whole) + np.tril(whole, -1).T
    right = rng.standard_normal(15)
    np.testing.assert_allclose(solve_banded(rows, right), np.linalg.solve(whole, right), rtol=1e-10)


def test_a_matrix_that_is_not_positive_is_refused() -> None:
    with pytest.raises(FloatingPointError):
        solve_banded(np.array([[0.0, 1.0], [2.0, 1.0]]), np.ones(2))


@pytest.mark.parametrize("count", [1, WINDOW, WINDOW + 1, 3 * WINDOW + 7])
def test_windows_keep_every_frame_once_and_look_ahead(count: int) -> None:
    found = windows(count)
    kept = np.concatenate([np.arange(first, until) for first, _, until in found])
    assert kept.tolist() == list(range(count))
    for first, after, until in found:
        assert after - first <= WINDOW
        assert after == count or after - until == OVERLAP


def test_points_show_a_twist_that_moves_no_marker(body: BodyModel) -> None:
    """A straight arm that turns about its own axis."""
    names = [entry.name for entry in body.parameters]
    poses = np.repeat(body.neutral[None], 2, axis=0)
    poses[:, names.index("left_elbow_ry")] = 0.0
    poses[1, names.index("left_shoulder_rz")] += 0.5
    markers = marker_points(body, poses)
    assert np.abs(markers[1] - markers[0]).max() < 1e-6
    points = body_points(body, poses)
    assert np.abs(points[1] - points[0]).max() > 30.0
