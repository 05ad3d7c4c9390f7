"""The steps by which sizes and poses are found: a population's layers, limbs sought one by one, and equations without
poses, beside plain computations.
"""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_people import ring_of_cameras

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.scale import scale_of
from studio.body.shape_space import ShapeSpace, shape_space
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.shape_silhouettes import ShapePrograms
from studio.search.trackers import shape_refinement, shape_search
from studio.search.trackers.lost_limbs import lost_limbs_found
from studio.search.trackers.refinement import mm_at
from studio.search.trackers.shape_prior import ShapePrior, ShapeSpreads
from studio.search.trackers.shape_refinement import ShapeRefiner, _State
from studio.search.trackers.shape_search import ShapeSearch, ShapeSearchSettings, _Population, tempered

Array = np.ndarray
CAMERAS = ring_of_cameras(2, 160, 120)


@pytest.fixture(scope="module")
def space() -> ShapeSpace:
    return shape_space(load_body("human31"))


# ------------------------------------------------------------------ limbs one by one


LIMITS = np.array(
    [[-1.0, 0.0, -2.0, -1.0, -1.0, -np.inf, 0.0, 0.0], [1.0, 4.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0]]
)
OWN = (np.array([0, 1, 2]), np.array([3, 4]), np.array([5, 6, 7]))
REST = np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5])


def test_limbs_of_three_angles_or_more_are_drawn_wide_and_then_near() -> None:
    """Of 64 tries all, then a quarter about the best at a width of 0.3 of the range, then of 0.1; and all once more."""
    tried, start = (
        [],
        np.array([[0.9, 0.2, -1.9, 0.3, 0.3, 0.3, 0.3, 0.3], [0.1, 1.0, 1.0, 0.2, 0.2, 0.2, 0.2, 0.2]]),
    )
    best = np.array([0.4, 3.0, 1.0])

    def fitness(poses: Array) -> Array:
        tried.append(poses.copy())
        return -((poses[..., :3] - best) ** 2).sum(axis=2)

    found = lost_limbs_found(np.random.default_rng(0), fitness, start, OWN, LIMITS, REST, 64)
    assert [one.shape for one in tried] == 2 * [(64, 2, 8), (16, 2, 8), (16, 2, 8)]
    reach = LIMITS[1, :3] - LIMITS[0, :3]
    np.testing.assert_array_equal(tried[0][0], start)
    for number, width in enumerate((1.0, 0.3, 0.1, 1.0, 0.3, 0.1)):
        poses = tried[number]
        np.testing.assert_array_equal(poses[..., 3:], np.broadcast_to(start[:, 3:], poses[..., 3:].shape))
        assert (poses[..., :3] >= LIMITS[0, :3]).all()
        assert (poses[..., :3] <= LIMITS[1, :3]).all()
        around = LIMITS[:, :3].mean(axis=0) if width == 1.0 else poses[0, :, :3]
        away = np.abs((poses[1:, :, :3] - around) / reach)
        assert away.max() <= 0.5 * width + 1e-12
        assert away.max() > 0.4 * width
        # What was best is kept, and beside it a hundredth of how far from rest a limb is.
        far = (((poses[..., :3] - REST[:3]) / reach) ** 2).mean(axis=2)
        chosen = np.argmax(-((poses[..., :3] - best) ** 2).sum(axis=2) - 0.01 * far, axis=0)
        following = tried[number + 1][0] if number < 5 else found
        np.testing.assert_array_equal(following, poses[chosen, [0, 1]])


def test_too_few_tries_draw_nothing_and_of_equal_fits_the_one_nearest_to_rest_is_taken() -> None:
    start = np.full((1, 8), 0.9)
    asked = []

    def alike(poses: Array) -> Array:
        asked.append(len(poses))
        return np.zeros(poses.shape[:2])

    assert np.array_equal(
        lost_limbs_found(np.random.default_rng(0), alike, start, OWN, LIMITS, REST, 0), start
    )
    assert asked == []
    found = lost_limbs_found(np.random.default_rng(0), alike, start, OWN, LIMITS, REST, 32)
    # Round down to whole sixteens: a quarter of 32 is none.
    assert asked == [32, 32]
    reach = LIMITS[1] - LIMITS[0]
    assert np.abs((found - REST) / reach)[0, :3].max() < np.abs((start - REST) / reach)[0, :3].max()


# ------------------------------------------------------------------ the population


class Planned(ShapeSearch):
    """Layers whose shapes are their numbers, with a fitness that falls from particle to particle."""

    def __init__(self, settings: ShapeSearchSettings) -> None:
        self._settings, self._sigma, self.told = settings, np.ones(1), []
        self._rng = np.random.default_rng(0)
        self._prior = SimpleNamespace(log=lambda shapes: -0.1 * shapes[:, 0])
        self._progress = lambda done, total: self.told.append(("progress", done, total))

    def fitness(self, shape: Array, poses: Array) -> Array:
        return np.array([0.25])

    def draw_limbs(self, poses: Array) -> Array:
        return poses + 1.0

    def _moved(self, now: _Population, layer: int, heat: float) -> _Population:
        self.told.append(("moved", layer, heat, now.poses[:, 0, 0].tolist()))
        count = len(now.shapes)
        order = (np.arange(count) + 2) % count
        return _Population(
            100.0 * layer + np.arange(count)[:, None], order[:, None, None] * np.ones((count, 2, 3))
        )

    def _improve(self, now: _Population, heat: float) -> None:
        self.told.append(("improved", heat))
        now.fitness = 0.001 * now.poses[:, :, 0]

    def _answer(self, now: _Population, kept: list[tuple[Array, Array]], before: Array) -> tuple:
        return now, kept, before


def test_layers_move_improve_weigh_and_draw_and_the_last_quarter_is_kept() -> None:
    search = Planned(ShapeSearchSettings(particles=4, layers=8, survival=0.5, pose_steps=3))
    now, kept, before = search.run(np.zeros((2, 3)))
    assert before == 0.25
    heats = [1.0 - layer / 8.0 for layer in range(8)]
    assert [one for one in search.told if one[0] == "progress"] == [
        ("progress", layer, 8) for layer in range(8)
    ]
    assert [one[1:3] for one in search.told if one[0] == "moved"] == list(enumerate(heats))
    assert [one[1] for one in search.told if one[0] == "improved"] == [
        heat for heat in heats for _ in range(3)
    ]
    # The first set is the poses with their limbs drawn, then always the best particle comes first: 3, of order 1.
    sets = [one[3] for one in search.told if one[0] == "moved"]
    assert sets[0] == [1.0] * 4
    assert [one[0] for one in sets[1:]] == [3.0] * 7
    assert len(kept) == 2
    for layer, (weights, shapes) in zip((6, 7), kept, strict=True):
        own = 100.0 * layer + np.arange(4)
        np.testing.assert_array_equal(shapes[:, 0], own)
        total = 250.0 * 2.0 * 0.001 * np.array([2.0, 3.0, 0.0, 1.0]) - 0.1 * own
        np.testing.assert_allclose(weights, tempered(total, 0.5))
    assert now.shapes[0, 0] == 701.0
    np.testing.assert_allclose(now.fitness[0], 0.003)


def search_in(space: ShapeSpace, **parts: object) -> ShapeSearch:
    body = space.body
    limbs = {
        name: number for number, name in enumerate(dict.fromkeys(entry.limb for entry in body.parameters))
    }
    silhouettes = SimpleNamespace(programs=SimpleNamespace(space=space), **parts)
    return ShapeSearch(
        silhouettes,
        np.stack([body.lower, body.upper]),
        np.where(body.angles, 0.3, 60.0),
        np.array([limbs[entry.limb] for entry in body.parameters]),
        ShapePrior(space, ShapeSpreads(), None),
        seed=3,
    )


def test_poses_follow_a_shape_by_least_squares_with_a_small_ridge(space: ShapeSpace) -> None:
    search, body = search_in(space), space.body
    shape, pose = np.full(len(space.groups), 0.02), body.neutral + 0.1
    scale = np.where(body.angles, 0.3, 60.0)

    def slopes(steps: Array, at: Callable[[Array], Array]) -> Array:
        return np.array([(at(step) - at(-step)).ravel() / 2e-5 for step in steps]).T

    by_pose = slopes(1e-5 * np.diag(scale), lambda step: limb_ends(space.body_of(shape), (pose + step)[None]))
    by_shape = slopes(
        1e-5 * np.eye(len(shape)), lambda step: limb_ends(space.body_of(shape + step), pose[None])
    )
    ridge = 0.02**2 * (by_pose**2).sum() / len(pose)
    expected = -np.linalg.solve(by_pose.T @ by_pose + ridge * np.eye(len(pose)), by_pose.T @ by_shape)
    np.testing.assert_allclose(
        search.carried(shape, pose), scale[:, None] * expected, rtol=0.02, atol=1e-3 * 60.0
    )


def test_new_shapes_are_drawn_about_the_old_and_poses_carried_along(
    space: ShapeSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, rng = search_in(space), np.random.default_rng(1)
    size, count = len(space.groups), 5
    follow = rng.normal(size=(2, len(space.body.neutral), size))
    asked = []

    def carried(shape: Array, pose: Array) -> Array:
        asked.append((shape, pose))
        return follow[len(asked) - 1]

    monkeypatch.setattr(search, "carried", carried)
    shapes = 0.1 * rng.normal(size=(count, size))
    poses = space.body.neutral + 0.01 * rng.normal(size=(count, 2, len(space.body.neutral)))
    seeded = np.random.default_rng(np.random.SeedSequence((3, 0x5AB)))
    steps = seeded.normal(size=(count, size)) * search._prior.sigma
    steps[0] = 0.0
    found = search._moved(_Population(shapes, poses), 0, 1.0)
    np.testing.assert_allclose(found.shapes, shapes + steps)
    for frame in range(2):
        expected = poses[:, frame] + steps @ follow[frame].T
        np.testing.assert_allclose(
            found.poses[:, frame], np.clip(expected, space.body.lower, space.body.upper)
        )
        np.testing.assert_allclose(asked[frame][0], shapes.mean(axis=0))
        np.testing.assert_array_equal(asked[frame][1], poses[0, frame])
    asked.clear()
    later = search._moved(_Population(shapes, poses), 1, 0.5)
    np.testing.assert_array_equal(later.shapes[0], shapes[0])
    assert (later.shapes[1:] != shapes[1:]).all()


class Dice:
    """Random numbers by hand, for two particles in one frame: sixteen tries of three limbs."""

    def __init__(self, limb: list[int], other: list[int], borrowed: list[bool]) -> None:
        self.numbers, self.borrowed, self.asked = [limb, other], borrowed, []

    def uniform(self, low: float, high: float, shape: tuple[int, ...]) -> Array:
        self.asked.append((low, high, shape))
        return np.full(shape, -1.0)

    def normal(self, size: tuple[int, ...]) -> Array:
        return np.ones(size)

    def integers(self, low: int, high: int, shape: tuple[int, ...]) -> Array:
        self.asked.append((low, high, shape))
        return np.broadcast_to(self.numbers.pop(0), shape).copy()

    def random(self, shape: tuple[int, ...]) -> Array:
        return np.broadcast_to(np.where(self.borrowed, 0.249, 0.251), shape)


def test_of_sixteen_poses_one_is_as_it_was_and_others_differ_in_a_limb_or_in_all() -> None:
    limb = [0, 0, 1, 2, -1, 0, 1, 2, -1, *[0] * 7]
    borrowed = [False] * 5 + [True] * 4 + [False] * 7
    search = ShapeSearch.__new__(ShapeSearch)
    search._rng = dice = Dice(limb, [1] * 16, borrowed)
    search._spread, search._limits = (
        np.array([1.0, 2.0, 3.0, 4.0]),
        np.array([[-9.0] * 4, [9.0, 9.0, 9.0, 12.05]]),
    )
    search._limbs = [np.array([0]), np.array([1, 2]), np.array([3])]
    tried = []

    def fitness(shapes: Array, poses: Array) -> Array:
        tried.append(poses.copy())
        values = np.zeros(poses.shape[:3])
        values[0, 0, 2], values[1, 0, 9] = 0.7, 0.4
        return values

    search._fitness = fitness
    poses = np.array([[[0.0, 0.0, 0.0, 12.0]], [[5.0, 6.0, 7.0, 8.0]]])
    now = _Population(np.zeros((2, 1)), poses.copy())
    search._improve(now, 0.5)
    assert dice.asked == [(-1.7, -0.35, (2, 1, 16, 1)), (-1, 3, (2, 1, 16)), (0, 2, (2, 1, 16))]
    (seen,) = tried
    assert seen.shape == (2, 1, 16, 4)
    first = seen[0, 0].tolist()
    assert first[:9] == [
        [0.0, 0.0, 0.0, 12.0],
        [pytest.approx(0.1), 0.0, 0.0, 12.0],
        [0.0, pytest.approx(0.2), pytest.approx(0.3), 12.0],
        [0.0, 0.0, 0.0, 12.05],
        [pytest.approx(0.1), pytest.approx(0.2), pytest.approx(0.3), 12.05],
        [5.0, 0.0, 0.0, 12.0],
        [0.0, 6.0, 7.0, 12.0],
        [0.0, 0.0, 0.0, 8.0],
        [0.0, 0.0, 0.0, 12.0],
    ]
    np.testing.assert_allclose(now.poses[0, 0], [0.0, 0.2, 0.3, 12.0])
    np.testing.assert_allclose(now.poses[1, 0], [5.1, 6.0, 7.0, 8.0])
    assert now.fitness.tolist() == [[0.7], [0.4]]


def test_poses_are_weighed_sixteen_at_once_and_counted_as_they_are(space: ShapeSpace) -> None:
    def areas(shapes: Array, poses: Array) -> Array:
        assert poses.shape[2] == 16
        return poses[..., 0] + 100.0 * shapes[:, None, None, 0]

    search = search_in(space, fitness=areas)
    size, shapes = len(space.groups), len(space.body.neutral)
    poses = np.arange(3.0)[:, None] * np.ones(shapes)
    assert search.fitness(np.full(size, 0.1), poses).tolist() == [10.0, 11.0, 12.0]
    assert search.evaluations == 3
    found = search._fitness(np.zeros((2, size)), np.ones((2, 3, 16, shapes)))
    assert found.shape == (2, 3, 16)
    assert search.evaluations == 3 + 2 * 3 * 16


def test_limbs_are_drawn_for_the_usual_shape_with_each_pose_weighed_for_itself(
    space: ShapeSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, given = search_in(space, fitness=lambda shapes, poses: poses[..., 0]), {}

    def found(rng: object, fitness: object, poses: Array, *rest: object) -> Array:
        given.update(fitness=fitness, rest=rest)
        return poses

    monkeypatch.setattr(shape_search, "lost_limbs_found", found)
    poses = np.zeros((3, len(space.body.neutral)))
    search.draw_limbs(poses)
    tried = np.random.default_rng(0).normal(size=(32, *poses.shape))
    np.testing.assert_array_equal(given["fitness"](tried), tried[..., 0])
    limbs, _, rest, tries = given["rest"]
    assert sum(len(own) for own in limbs) == len(space.body.neutral)
    np.testing.assert_array_equal(rest, space.body.neutral)
    assert tries == 4096


def test_the_answer_is_the_mean_shape_of_the_layers_kept_with_the_best_pose_of_each_frame(
    space: ShapeSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, rng, told = search_in(space), np.random.default_rng(2), []
    size, dimensions = len(space.groups), len(space.body.neutral)
    follow = 0.1 * rng.normal(size=(dimensions, size))
    search._progress = lambda *done: told.append(done)
    search.evaluations = 77
    monkeypatch.setattr(search, "carried", lambda shape, pose: follow)

    def improve(now: _Population, heat: float) -> None:
        told.append((heat, now.poses.copy()))
        now.fitness = np.array([[0.1, 0.9], [0.8, 0.2]])

    monkeypatch.setattr(search, "_improve", improve)
    shapes = 0.1 * rng.normal(size=(2, size))
    now = _Population(shapes, space.body.neutral + 0.01 * rng.normal(size=(2, 2, dimensions)))
    kept = [(np.array([0.25, 0.75]), shapes), (np.array([0.5, 0.5]), 2.0 * shapes)]
    found = search._answer(now, kept, np.array([0.3, 0.3]))
    mean = (0.25 * shapes[0] + 0.75 * shapes[1] + shapes[0] + shapes[1]) / 2.0
    np.testing.assert_allclose(found.shape, mean)
    moved = np.clip(now.poses + ((mean - shapes) @ follow.T)[:, None], space.body.lower, space.body.upper)
    np.testing.assert_allclose(told[0][1], moved)
    np.testing.assert_allclose(found.poses, [moved[1, 0], moved[0, 1]])
    assert found.fitness.tolist() == [0.8, 0.9]
    assert [heat for heat, _ in told[:-1]] == [0.0] * 6
    assert told[-1] == (40, 40)
    assert found.evaluations == 77


# ------------------------------------------------------------------ equations of shape and poses


def refiner_of(space: ShapeSpace, known: bool = False) -> ShapeRefiner:
    prior = ShapePrior(space, ShapeSpreads(), None)
    return ShapeRefiner(ShapePrograms(space), CAMERAS, [], prior, lengths_known=known)


def random_state(refiner: ShapeRefiner, frames: int = 3, own: int = 4, seed: int = 0) -> _State:
    """Positive equations at poses some of which are at their limits."""
    rng = np.random.default_rng(seed)
    lower, upper = refiner._limits
    size = len(lower)
    poses = np.clip(refiner._body.neutral + 0.1 * rng.normal(size=(frames, size)), lower, upper)
    bounded = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    poses[0, bounded[::2]], poses[1, bounded[1::2]] = lower[bounded[::2]], upper[bounded[1::2]]
    squares = rng.normal(size=(frames, size + own, size + own))
    matrices = squares @ squares.swapaxes(1, 2) + 2.0 * np.eye(size + own)
    gradients = rng.normal(size=(frames, size + own))
    return _State(
        rng.normal(size=own),
        poses,
        1.0,
        np.ones(frames),
        gradients,
        matrices,
        rng.normal(size=own),
        3.0 * np.eye(own),
    )


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_eliminating_poses_gives_the_shape_that_all_equations_together_give(
    space: ShapeSpace, damping: float
) -> None:
    refiner = refiner_of(space)
    here = random_state(refiner)
    frames, size, own = len(here.poses), here.poses.shape[1], len(here.shape)
    lower, upper = refiner._limits
    pressed = ((here.poses <= lower) & (here.gradients[:, :size] > 0.0)) | (
        (here.poses >= upper) & (here.gradients[:, :size] < 0.0)
    )
    assert 3 < pressed.sum() < 40
    whole, right = np.zeros((frames * size + own,) * 2), np.zeros(frames * size + own)
    shape = slice(frames * size, None)
    whole[shape, shape], right[shape] = here.matrix, here.own
    for k in range(frames):
        at, block = slice(k * size, (k + 1) * size), here.frames[k]
        lift = damping * np.diag(block)[:size] + 1e-9 * np.trace(block) / len(block)
        whole[at, at] = block[:size, :size] + np.diag(lift)
        whole[at, shape], whole[shape, at] = block[:size, size:], block[size:, :size]
        whole[shape, shape] += block[size:, size:]
        right[at] = here.gradients[k, :size]
        right[shape] += here.gradients[k, size:]
    free = np.concatenate([~pressed.ravel(), np.ones(own, bool)])
    inverse = np.linalg.inv(whole[np.ix_(free, free)])
    matrix, gradient, _ = refiner._without_poses(here, damping)
    np.testing.assert_allclose(np.linalg.inv(matrix), inverse[-own:, -own:], rtol=1e-6, atol=1e-10)
    step = -inverse @ right[free]
    np.testing.assert_allclose(-np.linalg.solve(matrix, gradient), step[-own:], rtol=1e-6, atol=1e-9)
    # Damped likewise, the shape's step decides those of the poses.
    shape_step = -np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient)
    found, poses = refiner._stepped(here, damping)
    np.testing.assert_allclose(found, here.shape + shape_step, rtol=1e-6)
    rows = np.flatnonzero(free[:-own])
    of_poses = np.zeros(frames * size)
    of_poses[rows] = -np.linalg.solve(
        whole[np.ix_(rows, rows)], right[rows] + whole[rows, shape] @ shape_step
    )
    expected = np.clip(here.poses + of_poses.reshape(frames, size) * refiner._unit, lower, upper)
    np.testing.assert_allclose(poses, expected, rtol=1e-5, atol=1e-8)


def test_a_state_has_the_borders_loss_by_its_variance_and_the_pulls_of_pose_and_shape(
    space: ShapeSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    refiner, given = refiner_of(space, known=True), []
    rng = np.random.default_rng(0)
    shape, body = 0.05 * rng.normal(size=len(space.groups)), space.body
    poses = body.neutral + 0.05 * rng.normal(size=(2, len(body.neutral)))
    size, own = len(body.neutral), len(shape)

    def equations(corners: Array, slopes: Array, *rest: object) -> float:
        given.append((corners, slopes, rest))
        matrix, gradient = rest[-2:]
        matrix[:], gradient[:] = 2.0 * np.eye(size + own), 3.0
        return 400.0 * len(given)

    monkeypatch.setattr(shape_refinement, "normal_equations", equations)
    views = SimpleNamespace(
        views=np.zeros((2, 7), np.int64), border=np.zeros((0, 4)), mm=np.ones(2), scales=np.ones(2)
    )
    found = refiner._state(shape, poses, [views, views])
    worth = 1.0 / (9.0 * 180.0)
    away = (poses - body.neutral) / refiner._unit
    loss, pull, matrix = refiner._prior.equations(shape)
    assert found.loss == pytest.approx(loss + worth * 1200.0 + (refiner.stiffness * away**2).sum())
    assert found.borders.tolist() == [400.0, 800.0]
    expected = np.full((2, size + own), 3.0 * worth)
    expected[:, :size] += refiner.stiffness * away
    np.testing.assert_allclose(found.gradients, expected)
    diagonal = np.concatenate([2.0 * worth + refiner.stiffness, np.full(own, 2.0 * worth)])
    np.testing.assert_allclose(found.frames, np.stack([np.diag(diagonal)] * 2))
    np.testing.assert_array_equal(found.own, pull)
    np.testing.assert_array_equal(found.matrix, matrix)
    for pose, (corners, slopes, rest) in zip(poses, given, strict=True):

        def seen(other: Array, at: Array) -> Array:
            return OutlineProjector.of_body(space.body_of(other), CAMERAS).corners(at[None])[0][0]

        np.testing.assert_allclose(corners, seen(shape, pose), atol=1e-3)
        assert rest[-3] == 0.0
        assert not rest[1].any()
        still = refiner._still
        for at in (1, 4, 12):
            step = 0.004 * refiner._unit[at] * np.eye(size)[at]
            change = (seen(shape, pose + step) - seen(shape, pose - step)) / 0.008
            change[:, still] = 0.0
            np.testing.assert_allclose(slopes[..., at], change, atol=0.05)
        for at in (0, 3):
            step = 0.004 * np.eye(own)[at]
            change = (seen(shape + step, pose) - seen(shape - step, pose)) / 0.008
            np.testing.assert_allclose(slopes[..., size + at], change, atol=0.05)


def test_a_frames_border_is_taken_where_pixels_end(space: ShapeSpace) -> None:
    refiner, rng = refiner_of(space), np.random.default_rng(0)
    views = [
        SimpleNamespace(border=rng.uniform(10, 90, (count, 2)), outward=rng.normal(size=(count, 2)))
        for count in (4, 3)
    ]
    found = refiner._frame(space.body.neutral, views)
    expected = [np.hstack([view.border + 0.5 * view.outward, view.outward]) for view in views]
    np.testing.assert_allclose(found.border, np.concatenate(expected))
    assert found.views[:, 3:5].tolist() == [[0, 4], [4, 7]]
    mm = np.array(mm_at(space.body, CAMERAS, space.body.neutral))
    np.testing.assert_allclose(found.mm, mm)
    np.testing.assert_allclose(found.scales, np.maximum(50.0, 3.0 * mm))


def test_units_and_pulls_are_those_of_the_body() -> None:
    mouse = shape_space(load_body("mouse"), lengths="untaped")
    refiner, body = refiner_of(mouse), mouse.body
    for at, entry in enumerate(body.parameters):
        angle = entry.kind == "angle"
        assert refiner._unit[at] == (1.0 if angle else 300.0 * scale_of(body))
        assert refiner._shaken[at] == (0.05 if angle else 6.0 * scale_of(body))


def state_of(loss: float, borders: list[float], poses: list[float]) -> _State:
    nothing = np.zeros(0)
    return _State(np.array([loss]), np.array(poses)[:, None], loss, np.array(borders), *[nothing] * 4)


def test_of_two_states_each_frames_better_pose_is_tried_together() -> None:
    refiner, asked = ShapeRefiner.__new__(ShapeRefiner), []
    best, other = (
        state_of(10.0, [1.0, 5.0, 2.0], [0.0, 0.0, 0.0]),
        state_of(9.0, [2.0, 4.0, 2.0], [1.0, 1.0, 1.0]),
    )
    both = state_of(8.0, [1.0, 4.0, 2.0], [7.0, 7.0, 7.0])

    def descended(shape: Array, poses: Array, frames: object) -> _State:
        asked.append((float(shape[0]), poses[:, 0].tolist()))
        return both

    refiner._descended = descended
    assert refiner._better(best, other, ()) is both
    # From the better one's shape.
    assert asked == [(9.0, [0.0, 1.0, 0.0])]
    both = state_of(9.0, [0.0] * 3, [7.0] * 3)
    assert refiner._better(best, other, ()) is other
    assert refiner._better(state_of(8.5, [1.0, 5.0, 2.0], [0.0] * 3), other, ()).loss == 8.5
    asked.clear()
    worse = state_of(9.0, [1.0, 5.0, 2.0], [1.0] * 3)
    assert refiner._better(best, worse, ()) is worse
    assert refiner._better(best, state_of(11.0, [0.0, 0.0, 0.0], [1.0] * 3), ()) is best
    assert asked == []


def test_a_descent_takes_what_gains_and_ends_where_little_is_gained() -> None:
    for losses, kept, dampings in (
        ([100.0, 90.0, 95.0, 80.0, 80.0 - 0.0007], 4, [0.01, 0.003, 0.024, 0.0072]),
        ([100.0, 100.0 - 0.0011, 90.0, 90.0], 3, [0.01, 0.003, 0.0009]),
        ([1.0] + [2.0] * 9, 0, [0.01 * 8.0**n for n in range(7)]),
    ):
        refiner, asked = ShapeRefiner.__new__(ShapeRefiner), []
        refiner._state = lambda shape, poses, frames, losses=losses: state_of(
            losses[int(shape)], [0.0], [float(shape)]
        )

        def stepped(here: _State, damping: float, asked: list[float] = asked) -> tuple[int, Array]:
            asked.append(damping)
            return len(asked), np.zeros(1)

        refiner._stepped = stepped
        assert refiner._descended(0, np.zeros(1), ()).poses[0, 0] == kept
        np.testing.assert_allclose(asked, dampings)


def test_a_fit_estimates_its_variance_and_hops_four_times(space: ShapeSpace) -> None:
    refiner, descents = refiner_of(space), []
    points = [
        SimpleNamespace(border=np.zeros((count, 2)), outward=np.zeros((count, 2))) for count in (30, 10)
    ]
    refiner._silhouettes = [points]
    size, own = len(space.body.neutral), len(space.groups)
    losses = iter([9.0, 8.0, 7.0, 8.0, 6.0, 8.0, 8.0])

    def descended(shape: Array, poses: Array, frames: list) -> _State:
        loss = next(losses)
        descents.append((shape, poses, refiner._variance))
        return _State(
            shape + 0.001, poses, loss, np.array([800.0]), np.zeros((1, size + own)),
            np.eye(size + own)[None], np.zeros(own), 3.0 * np.eye(own),
        )  # fmt: skip

    refiner._descended = descended
    start, other = np.repeat(space.body.neutral[None], 2, axis=0)[:, None]
    found = refiner.refine(np.zeros(own), start, others=(other + 0.01,))
    assert len(descents) == 2 + 1 + 4
    assert [variance for _, _, variance in descents] == [180.0, 180.0] + [20.0] * 5
    assert found.loss == 6.0
    assert found.residual == pytest.approx(np.sqrt(800.0 / 40.0))
    np.testing.assert_allclose(found.deviation, np.sqrt(1.0 / 4.0))
    rng = np.random.default_rng(np.random.SeedSequence((0, 0x5AC)))
    best = descents[2][0] + 0.001
    for hop in range(4):
        shape, poses, _ = descents[3 + hop]
        np.testing.assert_allclose(shape, best + 0.04 * rng.normal(size=own))
        turned = (descents[2][1] if hop < 2 else descents[4][1]) + refiner._shaken * rng.normal(
            size=(1, size)
        )
        np.testing.assert_allclose(poses, np.clip(turned, *refiner._limits))
        if hop == 1:
            best = shape + 0.001
    np.testing.assert_array_equal(found.shape, descents[4][0] + 0.001)


def test_a_variance_is_never_taken_as_too_small(space: ShapeSpace) -> None:
    refiner, seen = refiner_of(space), []
    refiner._silhouettes = [[SimpleNamespace(border=np.zeros((90, 2)), outward=np.zeros((90, 2)))] * 2] * 2
    state = random_state(refiner, 2, len(space.groups))

    def descended(shape: Array, poses: Array, frames: list) -> _State:
        seen.append(refiner._variance)
        return state

    refiner._descended = descended
    refiner.refine(state.shape, state.poses)
    assert seen == [180.0] + [10.0] * 5
