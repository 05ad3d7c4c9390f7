"""A refinement's scales, pulls, steps and decisions on losses that are known in closed form."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_people import ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, limb_frames
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.search.trackers.refinement import (
    RefinementSettings,
    Refiner,
    _about_the_border,
    hidden_angles,
    mm_at,
    mm_per_pixel,
)
from studio.search.trackers.refinement_over_time import (
    CHANGE,
    HELD,
    MovementEquations,
    MovementRefiner,
    Window,
    body_points,
    windows,
)

Array = np.ndarray
CAMERAS = ring_of_cameras(2, 160, 120)


@pytest.fixture(scope="module")
def refiner(body: BodyModel) -> Refiner:
    return Refiner(body, CAMERAS, RefinementSettings())


def test_a_pixel_is_as_large_as_the_depth_over_the_focal_length() -> None:
    camera = replace(
        CAMERAS[0],
        matrix=np.array([[400.0, 0.0, 80.0], [0.0, 900.0, 60.0], [0.0, 0.0, 1.0]]),
        rotation=np.eye(3)[[1, 0, 2]],
        translation=np.array([5.0, 6.0, 250.0]),
    )
    assert mm_per_pixel(camera, np.array([7.0, 8.0, 50.0])) == pytest.approx(300.0 / 600.0)
    # Nothing is taken to be nearer than 100 mm.
    assert mm_per_pixel(camera, np.array([7.0, 8.0, -190.0])) == pytest.approx(100.0 / 600.0)


def test_pixels_are_measured_at_the_middle_of_the_body_at_a_persons_size() -> None:
    for name in ("human31", "mouse"):
        own = load_body(name)
        middle = limb_ends(own, own.neutral[None])[0].mean(axis=(0, 1))
        expected = [mm_per_pixel(camera, middle) / scale_of(own) for camera in CAMERAS]
        assert mm_at(own, CAMERAS, own.neutral) == pytest.approx(expected)


def test_units_and_pulls_are_those_of_lengths_angles_and_hidden_joints() -> None:
    for name in ("human31", "mouse"):
        own = load_body(name)
        found = Refiner(own, CAMERAS, RefinementSettings())
        hidden, usual = hidden_angles(own), np.isfinite(own.spread)
        for at, entry in enumerate(own.parameters):
            assert found.unit[at] == (1.0 if entry.kind == "angle" else 300.0 * scale_of(own))
            if usual[at]:
                pull = 15.0 / own.spread[at]
            elif entry.kind == "angle" and np.isfinite([entry.lower, entry.upper]).all():
                pull = 100.0 if hidden[at] else 20.0
            else:
                pull = 0.0
            assert found.stiffness[at] == pytest.approx(pull**2), entry.name
        assert set(found.slack) <= {0.0, 50.0}


def test_without_silhouettes_a_loss_is_the_pull_to_the_start_and_to_rest(refiner: Refiner) -> None:
    rng = np.random.default_rng(0)
    size = len(refiner.neutral)
    start, pose = (refiner.neutral + refiner.unit * rng.normal(size=size) for _ in range(2))
    loss, gradient, matrix = refiner.frame_loss(start, ())(pose)
    away, bent = (pose - start) / refiner.unit, (pose - refiner.neutral) / refiner.unit
    assert loss == pytest.approx(40.0**2 * away @ away + refiner.stiffness @ bent**2)
    np.testing.assert_allclose(gradient, 40.0**2 * away + refiner.stiffness * bent)
    np.testing.assert_allclose(matrix, np.diag(40.0**2 + refiner.stiffness))


def test_poses_of_different_valleys_are_compared_with_the_pull_to_rest(
    refiner: Refiner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refiner, "loss", lambda pose, silhouettes: (3.0, None, None))
    pose = refiner.neutral + 0.1 * refiner.unit
    assert refiner.loss_with_pull(pose, ()) == pytest.approx(3.0 + 0.01 * refiner.stiffness.sum())


def test_a_damped_step_stays_within_limits_and_leaves_what_presses_against_them(refiner: Refiner) -> None:
    rng = np.random.default_rng(1)
    size = len(refiner.neutral)
    square = rng.normal(size=(size, size))
    matrix, gradient = square @ square.T + np.eye(size), rng.normal(size=size)
    pose = np.where(refiner.bounded, np.where(rng.random(size) < 0.5, refiner.lower, refiner.upper), 1.0)
    pose[6:12] = refiner.neutral[6:12]
    outwards = ((pose <= refiner.lower) & (gradient > 0.0)) | ((pose >= refiner.upper) & (gradient < 0.0))
    assert 0 < outwards.sum() < refiner.bounded.sum()
    free = ~outwards
    lift = np.diag(0.5 * np.diag(matrix) + 1e-9 * np.trace(matrix) / size)
    expected = pose.copy()
    expected[free] -= refiner.unit[free] * np.linalg.solve(
        (matrix + lift)[np.ix_(free, free)], gradient[free]
    )
    expected = np.clip(expected, refiner.lower, refiner.upper)
    np.testing.assert_allclose(refiner._stepped(pose, gradient, matrix, 0.5), expected, rtol=1e-8, atol=1e-10)


@dataclass
class Bowl:
    """Half of a loss with this curvature in every parameter and its minimum `at`; poses that were asked for."""

    refiner: Refiner
    at: Array
    curvature: float = 1e4

    def __post_init__(self) -> None:
        self.asked: list[Array] = []

    def __call__(self, pose: Array) -> tuple[float, Array, Array]:
        self.asked.append(pose)
        away = (pose - self.at) / self.refiner.unit
        return self.curvature * float(away @ away), self.curvature * away, self.curvature * np.eye(len(away))


def descended(refiner: Refiner, of_frame: Bowl, steps: int = 20) -> tuple[Array, int, Array]:
    one = Refiner(refiner.body, CAMERAS, RefinementSettings(refinement_steps=steps))
    return one._descended_by(refiner.neutral, of_frame)


def test_a_descent_takes_damped_steps_that_are_eased_where_they_gain(refiner: Refiner) -> None:
    """In a bowl a step leaves the share damping / (1 + damping) of the way, which is 1/100, then 3/1000, …."""
    wanted = refiner.neutral.copy()
    wanted[:3] += refiner.unit[:3]
    pose, steps, matrix = descended(refiner, Bowl(refiner, wanted))
    left = [1e-2 * 0.3**number / (1.0 + 1e-2 * 0.3**number) for number in range(3)]
    # 1, then 0.01, then 3e-5: the third is a step that is too small to go on.
    assert steps == 3
    np.testing.assert_allclose(((wanted - pose) / refiner.unit)[:3], np.prod(left), rtol=1e-3)
    np.testing.assert_allclose(matrix, np.diag(1e4 - 40.0**2 - refiner.stiffness))
    pose, steps, _ = descended(refiner, Bowl(refiner, wanted), steps=1)
    assert steps == 1
    np.testing.assert_allclose(((wanted - pose) / refiner.unit)[:3], left[0], rtol=1e-6)


def test_steps_that_gain_nothing_are_damped_eight_times_as_much_until_they_are_too_small(
    refiner: Refiner,
) -> None:
    class Wrong(Bowl):
        """Its equations point the wrong way."""

        def __call__(self, pose: Array) -> tuple[float, Array, Array]:
            loss, gradient, matrix = super().__call__(pose)
            return loss, -gradient, matrix

    wanted = refiner.neutral.copy()
    wanted[0] += 100.0 * refiner.unit[0]
    bowl = Wrong(refiner, wanted)
    pose, steps, _ = descended(refiner, bowl)
    np.testing.assert_array_equal(pose, refiner.neutral)
    moved = np.array([refiner.neutral[0] - asked[0] for asked in bowl.asked[1:]]) / refiner.unit[0]
    dampings = 1e-2 * 8.0 ** np.arange(len(moved))
    np.testing.assert_allclose(moved, 100.0 / (1.0 + dampings), rtol=1e-6)
    # 0.01 x 8^6 is 2621, the next one 20972 ends it.
    assert steps == len(moved) == 7
    wanted[0] = refiner.neutral[0] + 1.9e-4 * refiner.unit[0]
    assert descended(refiner, Wrong(refiner, wanted))[1] == 1
    wanted[0] = refiner.neutral[0] + 2.1e-4 * refiner.unit[0]
    assert descended(refiner, Wrong(refiner, wanted))[1] == 2


@dataclass
class Weighted:
    """A likelihood that weighs by rows of what it is asked."""

    weights: list[float]

    def log_likelihood(self, poses: Array) -> Array:
        self.poses = poses
        return np.array(self.weights)


@pytest.mark.parametrize(
    ("weights", "share", "moved", "gain"),
    [
        ([1.0, 1.0, 5.0], 1.0, True, 0.0),
        ([1.0, 3.0, 0.0], 1.0, True, 2.0),
        ([1.0, 0.9, 1.5], 0.5, True, 0.5),
        ([1.0, 0.9, 0.9], 0.0, False, 0.0),
    ],
)
def test_half_of_a_step_or_none_is_taken_where_the_log_weight_would_fall(
    refiner: Refiner,
    monkeypatch: pytest.MonkeyPatch,
    weights: list[float],
    share: float,
    moved: bool,
    gain: float,
) -> None:
    start = refiner.neutral
    monkeypatch.setattr(refiner, "_descended", lambda pose, views: (pose + 2.0, 6, np.eye(3)))
    problem = Weighted(weights)
    found = refiner.refine(start, [SimpleNamespace(border=[1])], problem)
    np.testing.assert_allclose(found.pose, start + 2.0 * share)
    assert (found.moved, found.steps) == (moved, 6)
    assert found.gain == pytest.approx(gain)
    assert found.matrix is None
    np.testing.assert_allclose(problem.poses, [start, start + 2.0, start + 1.0])
    free = refiner.refine(start, [SimpleNamespace(border=[]), SimpleNamespace(border=[1])])
    assert (free.moved, free.gain, free.steps, free.matrix.shape) == (True, 0.0, 6, (3, 3))
    none = refiner.refine(start, [SimpleNamespace(border=[])])
    assert (none.moved, none.gain, none.steps, none.matrix) == (False, 0.0, 0, None)


def part_of(border: list[list[float]], margin: float) -> tuple[tuple[int, int], Array]:
    signed = np.arange(30.0 * 20.0).reshape(20, 30)
    view = SimpleNamespace(border=np.array(border).reshape(-1, 2), corner=(100, 50), signed=signed)
    return _about_the_border(view, margin)


@pytest.mark.parametrize(
    ("border", "margin", "columns", "rows"),
    [
        ([[110.0, 60.0], [112.0, 63.0]], 2.0, (8, 15), (8, 16)),
        ([[110.0, 60.0], [112.0, 63.0]], 2.5, (7, 16), (7, 17)),
        ([[101.0, 51.0], [128.0, 68.0]], 3.0, (0, 30), (0, 20)),
        ([[103.0, 53.0], [126.0, 66.0]], 3.0, (0, 30), (0, 20)),
        ([[104.0, 54.0], [125.0, 65.0]], 3.0, (1, 29), (1, 19)),
    ],
)
def test_a_map_is_kept_about_the_border_only(
    border: list[list[float]], margin: float, columns: tuple[int, int], rows: tuple[int, int]
) -> None:
    corner, part = part_of(border, margin)
    assert corner == (100 + columns[0], 50 + rows[0])
    whole = np.arange(30.0 * 20.0).reshape(20, 30)
    np.testing.assert_array_equal(part, whole[slice(*rows), slice(*columns)])
    assert part.dtype == np.float32


def test_a_map_without_border_is_empty() -> None:
    corner, part = part_of([], 3.0)
    assert corner == (0, 0)
    assert part.shape == (0, 0)


def test_frames_are_prepared_one_after_the_other_with_their_own_scale(
    refiner: Refiner, body: BodyModel
) -> None:
    rng = np.random.default_rng(0)

    def view(left: int, top: int, points: int) -> SimpleNamespace:
        places = rng.uniform(20.0, 30.0, (points, 2)) + np.array([left, top])
        signed = rng.normal(size=(50, 60)).astype(np.float32)
        return SimpleNamespace(
            border=places,
            outward=rng.normal(size=(points, 2)),
            corner=(left, top),
            signed=signed,
            size=(160, 120),
        )

    views, pose = [view(5, 7, 4), view(30, 20, 3)], standing(body)
    mm = np.array(mm_at(body, CAMERAS, pose))
    for pixels, scales in ((0.0, np.maximum(50.0, 3.0 * mm)), (2.0, 2.0 * mm)):
        found = refiner._prepared(pose, views, pixels)
        np.testing.assert_allclose(found.scales, scales)
        np.testing.assert_allclose(found.mm, mm)
        assert found.sizes.tolist() == [[160, 120]] * 2
        borders, maps = found.by_view()
        for number, own in enumerate(views):
            np.testing.assert_array_equal(borders[number], np.hstack([own.border, own.outward]))
            (left, top), part = _about_the_border(own, 4.0 * max(50.0, 3.0 * mm[number]) / mm[number])
            np.testing.assert_array_equal(maps[number][0], part)
            assert maps[number][1].tolist() == [left, top]


# ------------------------------------------------------------------ movements


@dataclass
class Parabola:
    """A frame's loss in place of silhouettes: so much times the square of how far a pose lies from `at`."""

    refiner: Refiner
    at: Array
    curvature: float = 1.0

    def __call__(self, pose: Array) -> tuple[float, Array, Array]:
        away = (pose - self.at) / self.refiner.unit
        return self.curvature * float(away @ away), self.curvature * away, self.curvature * np.eye(len(away))


def test_windows_overlap_by_twelve_of_forty_frames() -> None:
    assert windows(40) == [(0, 40, 40)]
    assert windows(41) == [(0, 40, 28), (28, 41, 41)]
    assert windows(69) == [(0, 40, 28), (28, 68, 56), (56, 69, 69)]
    assert windows(0) == []
    # As many frames before a window hold it as an acceleration reaches back.
    assert len(CHANGE) - 1 == HELD


def test_movement_is_measured_at_both_ends_of_limbs_and_beside_them(body: BodyModel) -> None:
    for own in (body, load_body("mouse")):
        poses = np.stack([own.neutral, own.neutral + 0.2])
        frames = limb_frames(own, poses)
        found = body_points(own, poses).reshape(2, len(own.drawn), 3, 3)
        for limb, entry in enumerate(own.drawn):
            frame = frames[:, limb]
            np.testing.assert_allclose(found[:, limb, 0], frame[:, :, 3])
            np.testing.assert_allclose(found[:, limb, 1], frame[:, :, 3] + entry.length * frame[:, :, 2])
            side = (
                frame[:, :, 3] + 0.5 * entry.length * frame[:, :, 2] + 100.0 * scale_of(own) * frame[:, :, 0]
            )
            np.testing.assert_allclose(found[:, limb, 2], side)


def test_an_acceleration_weighs_as_errors_of_a_hundred_and_fifty_millimetres(refiner: Refiner) -> None:
    points = len(body_points(refiner.body, refiner.neutral[None])[0])
    found = MovementRefiner(refiner, 20.0, 8.0)._weight
    assert found == pytest.approx((150.0 / (8.0 * 1000.0 / 400.0)) ** 2 / points)


def dense(equations: MovementEquations) -> Array:
    """(F D, F D) the whole matrix of three block diagonals."""
    _, count, size, _ = equations.blocks.shape
    whole = np.zeros((count, size, count, size))
    for apart in range(3):
        for t in range(apart, count):
            whole[t, :, t - apart] = equations.blocks[apart, t]
            whole[t - apart, :, t] = equations.blocks[apart, t].T
    return whole.reshape(count * size, count * size)


def test_the_equations_matrix_is_that_of_the_slopes_of_all_accelerations(refiner: Refiner) -> None:
    """Of four frames behind two that are held: all products of slopes, by one large Jacobian."""
    rng = np.random.default_rng(2)
    size, weight = len(refiner.neutral), 0.7
    poses = refiner.neutral + 0.05 * refiner.unit * rng.normal(size=(4, size))
    held = refiner.neutral + 0.05 * refiner.unit * rng.normal(size=(2, size))
    mover = MovementRefiner(refiner, 30.0, 5.0)
    window = Window(poses, [Parabola(refiner, refiner.neutral, 1.0 + t) for t in range(4)], held)
    found = mover.equations(poses, window, weight)
    points, slopes = mover._points(np.concatenate([held, poses]))
    jacobian = np.zeros((4, points.shape[1], 6, size))
    for first in range(4):
        for k, share in enumerate((1.0, -2.0, 1.0)):
            jacobian[first, :, first + k] = share * slopes[first + k]
    jacobian = jacobian[:, :, 2:].reshape(-1, 4 * size)
    bends = np.diff(points, 2, axis=0).ravel()
    own = np.kron(np.diag([1.0, 2.0, 3.0, 4.0]), np.eye(size))
    np.testing.assert_allclose(dense(found), weight * jacobian.T @ jacobian + own, rtol=1e-8, atol=1e-6)
    pulls = np.concatenate(
        [(1.0 + t) * (pose - refiner.neutral) / refiner.unit for t, pose in enumerate(poses)]
    )
    np.testing.assert_allclose(
        found.gradient.ravel(), weight * jacobian.T @ bends + pulls, rtol=1e-8, atol=1e-6
    )
    # Slopes are those of the points over each parameter's unit.
    step = 1e-5 * refiner.unit[9] * np.eye(size)[9]
    ahead, back = (body_points(refiner.body, (poses[0] + sign * step)[None])[0] for sign in (1.0, -1.0))
    np.testing.assert_allclose(slopes[2][:, 9], (ahead - back) / 2e-5, rtol=1e-3, atol=0.1)


def test_a_step_of_all_frames_is_the_dense_solution_within_limits(refiner: Refiner) -> None:
    rng = np.random.default_rng(4)
    size, count, damping = len(refiner.neutral), 3, 0.5
    mover = MovementRefiner(refiner, 30.0, 5.0)
    poses = np.clip(refiner.neutral + 0.3 * rng.normal(size=(count, size)), refiner.lower, refiner.upper)
    at = np.flatnonzero(refiner.bounded)
    poses[0, at[::3]], poses[1, at[1::3]] = refiner.lower[at[::3]], refiner.upper[at[1::3]]
    losses = [
        Parabola(refiner, refiner.neutral + rng.normal(size=size) * refiner.unit, 300.0) for _ in range(count)
    ]
    here = mover.equations(poses, Window(poses, losses, poses[:0]), 0.001)
    stuck = ((poses <= refiner.lower) & (here.gradient > 0.0)) | (
        (poses >= refiner.upper) & (here.gradient < 0.0)
    )
    assert 0 < stuck.sum() < 20
    free = ~stuck.ravel()
    whole = dense(here)
    whole += np.diag(damping * np.diag(whole) + 1e-9 * np.diag(whole).mean())
    step = np.zeros(count * size)
    step[free] = -np.linalg.solve(whole[np.ix_(free, free)], here.gradient.ravel()[free])
    expected = np.clip(poses + step.reshape(count, size) * refiner.unit, refiner.lower, refiner.upper)
    np.testing.assert_allclose(mover._stepped(poses, here, damping), expected, rtol=1e-7, atol=1e-9)


class Planned(MovementRefiner):
    """Losses by the number of a step: what is offered gets the next one."""

    def __init__(self, refiner: Refiner, losses: list[float]) -> None:
        super().__init__(refiner, 30.0, 5.0)
        self.losses, self.dampings, self.weights = losses, [], []

    def equations(self, poses: Array, window: Window, weight: float) -> MovementEquations:
        self.weights.append(weight)
        return MovementEquations(self.losses[int(poses[0, 0])], np.zeros(1), np.zeros(1))

    def _stepped(self, poses: Array, here: MovementEquations, damping: float) -> Array:
        self.dampings.append(damping)
        return np.full((1, 1), len(self.dampings))


def planned(refiner: Refiner, losses: list[float], steps: int = 20) -> tuple[float, Planned]:
    one = Refiner(refiner.body, CAMERAS, RefinementSettings(refinement_steps=steps))
    mover = Planned(one, losses)
    return float(
        mover._descended(np.zeros((1, 1)), Window(np.zeros((1, 1)), (), np.zeros((0, 1))), 1.0)[0, 0]
    ), mover


def test_a_movements_descent_keeps_what_gains_and_ends_where_little_is_gained(refiner: Refiner) -> None:
    kept, mover = planned(refiner, [100.0, 90.0, 95.0, 80.0, 80.0 - 0.0079])
    assert kept == 4.0
    np.testing.assert_allclose(mover.dampings, [0.01, 0.003, 0.024, 0.0072])
    # A ten-thousandth is enough to go on, and a step that gains nothing at all ends it, too.
    kept, mover = planned(refiner, [100.0, 100.0 - 0.0101, 50.0, 50.0])
    assert (kept, len(mover.dampings)) == (3.0, 3)
    kept, mover = planned(refiner, [1.0] + [2.0] * 9)
    assert (kept, len(mover.dampings)) == (0.0, 7)
    kept, mover = planned(refiner, [9.0, 8.0, 7.0, 6.0], steps=2)
    assert (kept, len(mover.dampings)) == (2.0, 2)


def test_a_window_is_descended_with_less_and_less_stiffness(refiner: Refiner) -> None:
    mover = Planned(refiner, [1.0] * 9)
    start = np.zeros((1, 1))
    mover._descended = lambda poses, window, weight: (mover.weights.append(weight), poses + 1.0)[1]
    assert mover.refine(Window(start, (), start[:0]))[0, 0] == 3.0
    np.testing.assert_allclose(np.array(mover.weights) / mover._weight, [30.0, 5.0, 1.0])
    assert start[0, 0] == 0.0


def test_meshes_are_refined_with_a_wide_loss_and_then_a_narrow_one(
    refiner: Refiner, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, widths = Refiner(refiner.body, CAMERAS, RefinementSettings()), []
    monkeypatch.setattr(own, "meshes", object())
    monkeypatch.setattr(
        own, "frame_loss", lambda pose, views, width=0.0: (widths.append(width), float(pose[0]))[1]
    )
    monkeypatch.setattr(own, "_descended_by", lambda pose, loss: (pose + 1.0, 5, np.full((1, 1), loss)))
    pose, steps, matrix = own._descended(np.zeros(2), ())
    assert widths == [4.0, 1.5]
    assert (pose.tolist(), steps, matrix.tolist()) == ([2.0, 2.0], 10, [[1.0]])
    np.testing.assert_allclose(own._scales(np.array([2.0, 4.0])), [3.0, 6.0])
