"""Root motion of clusters: changes along the heading, Gaussians of them, files and other rates."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from toy_behaviour import toy_model

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.foundations.errors import BehaviourError
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import read_model, write_model
from studio.search.behaviour.model_learning import learn_model
from studio.search.behaviour.root_motion import (
    RootFrame,
    RootMotion,
    gaussians_of,
    learn_root_motion,
    root_frame,
)
from studio.search.behaviour.settings import LearningSettings

FPS = 50.0
TURN, STRIDE = np.radians(18.0), 30.0


def wandering(body: BodyModel, frames: int, seed: int) -> np.ndarray:
    """(F, D) a root that wanders, its angles accumulated."""
    rng = np.random.default_rng(seed)
    poses = np.tile(body.neutral, (frames, 1))
    root = root_frame(body)
    for column in root.columns:
        size = 20.0 if body.parameters[column].kind == "length" else 0.4
        poses[:, column] += np.cumsum(rng.normal(scale=size, size=frames))
    return poses


def turned(body: BodyModel, poses: np.ndarray, angle: float) -> np.ndarray:
    """The same recording seen by an observer turned by `angle` (rad)."""
    root = root_frame(body)
    found, level = poses.copy(), root.columns[root.level]
    found[:, root.heading] += angle
    found[:, level] = Rotation.from_euler("z", angle).apply(np.c_[poses[:, level], np.zeros(len(poses))])[
        :, :2
    ]
    return found


def two_ways(frames: int = 240, begin: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A person who walks straight ahead looking right for 20 frames, then turns on the spot looking left for 20, and so
    on: poses (F, D) of human25 and which of the two (F,).
    """
    body = load_body("human25")
    names = [entry.name for entry in body.parameters]
    poses, turning = np.tile(body.neutral, (frames, 1)), (np.arange(frames) // 20) % 2 == 1
    rng = np.random.default_rng(int(10 * begin))
    heading = begin + np.cumsum(np.where(turning, TURN, 0.0))
    pace = np.where(turning, 0.0, STRIDE)
    way = np.stack([np.cos(heading), np.sin(heading)], axis=1) * pace[:, None]
    poses[:, names.index("heading")] = heading
    poses[:, [names.index("pelvis_x"), names.index("pelvis_y")]] = np.cumsum(way, axis=0)
    poses[:, names.index("head_turn")] = np.where(turning, 0.5, -0.5) + 0.02 * rng.standard_normal(frames)
    return poses, turning


@pytest.fixture(scope="module")
def model() -> BehaviourModel:
    """The behaviour in three such recordings."""
    parts = [two_ways(begin=begin)[0] for begin in (0.0, 1.1, 2.7)]
    settings = LearningSettings(most_clusters=6, reduced_dimensions=2, memory=2, least_probability=0.002)
    return learn_model(parts, load_body("human25"), FPS, settings, np.random.default_rng(0))


@pytest.mark.parametrize("name", ["human25", "human31", "dog"])
def test_adding_a_change_gives_the_next_frame(name: str) -> None:
    body = load_body(name)
    poses, root = wandering(body, 60, 1), root_frame(body)
    again = root.moved(poses[:-1], root.changes(poses)[1:])
    np.testing.assert_allclose(again, poses[1:], atol=1e-9)


def test_the_first_frame_has_the_seconds_change_and_angles_go_the_short_way() -> None:
    body = load_body("human25")
    root = root_frame(body)
    poses = np.tile(body.neutral, (3, 1))
    poses[:, root.heading] = [3.1, -3.1, -3.0]
    changes = root.changes(poses)
    place = int(np.flatnonzero(root.columns == root.heading)[0])
    assert np.array_equal(changes[0], changes[1])
    np.testing.assert_allclose(changes[:, place], [2 * np.pi - 6.2, 2 * np.pi - 6.2, 0.1], atol=1e-12)


@pytest.mark.parametrize("angle", [0.7, -2.0, np.pi])
@pytest.mark.parametrize("name", ["human25", "human31"])
def test_changes_do_not_depend_on_the_heading(name: str, angle: float) -> None:
    body = load_body(name)
    poses, root = wandering(body, 50, 2), root_frame(body)
    other = turned(body, poses, angle)
    assert np.abs(other - poses).max() > 0.5
    np.testing.assert_allclose(root.changes(other), root.changes(poses), atol=1e-9)
    step = root.changes(poses)
    np.testing.assert_allclose(
        root.moved(other, step), turned(body, root.moved(poses, step), angle), atol=1e-9
    )


def test_a_heading_may_be_the_first_parameter_and_none_turns_nothing() -> None:
    columns, turning = np.array([0, 1, 2]), np.array([True, False, False])
    poses = np.array([[0.5 * np.pi, 3.0, 4.0], [0.5 * np.pi, 3.0, 9.0]])
    facing = RootFrame(columns, turning, 0, np.array([1, 2]))
    # Facing +y, 5 mm along y are 5 mm ahead.
    np.testing.assert_allclose(facing.changes(poses)[1], [0.0, 5.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        facing.moved(poses[:1], np.array([[0.1, 5.0, 1.0]])), [[0.5 * np.pi + 0.1, 2.0, 9.0]]
    )
    for nowhere in (
        RootFrame(columns, turning, -1, np.array([1, 2])),
        RootFrame(columns, turning, 0, columns[:0]),
    ):
        np.testing.assert_allclose(nowhere.changes(poses)[1], [0.0, 0.0, 5.0], atol=1e-12)


def test_clusters_vary_at_least_a_little_of_what_all_do() -> None:
    rng = np.random.default_rng(5)
    changes = np.column_stack([rng.normal(size=200), np.full(200, 3.0)])
    # All frames of the second cluster are alike: beyond the least it has two frames of the common covariance.
    changes[150:] = [9.0, 3.0]
    shares = np.repeat(np.eye(2), [150, 50], axis=0)
    found = gaussians_of(changes, shares)
    common = 150 * changes[:150, 0].var() / 200
    least = 1e-3 * changes[:, 0].var()
    np.testing.assert_allclose(found.covariances[1, 0, 0], 2 * common / 52 + least)
    assert 0.0 < found.covariances[1, 1, 1] < 1e-11
    np.testing.assert_allclose(found.means, [[changes[:150, 0].mean(), 3.0], [9.0, 3.0]])


def test_fixed_bodies_have_none(tmp_path: Path) -> None:
    assert root_frame(load_body("planar_arm4")) is None
    fixed = toy_model()
    assert fixed.root is None
    assert learn_root_motion(load_body("planar_arm4"), [np.zeros((5, 4))], np.ones((5, 1))) is None
    write_model(fixed, tmp_path / "arm.behaviour")
    assert read_model(tmp_path / "arm.behaviour").root is None
    assert fixed.at_rate(60.0).root is None


def test_clusters_of_turning_turn_and_those_of_walking_walk(model: BehaviourModel) -> None:
    assert model.root is not None
    root, (poses, turning) = model.root, two_ways(begin=0.4)
    place = int(np.flatnonzero(root.frame.columns == root.frame.heading)[0])
    labels = model.labels(poses)
    # Where the frames before and after are of the same kind.
    inside = np.flatnonzero(np.convolve(turning, np.ones(7), "same") % 7 == 0)
    means = root.changes.means[labels[inside]]
    spins = turning[inside]
    assert np.allclose(means[spins, place], TURN, atol=0.15 * TURN)
    assert np.allclose(means[~spins, place], 0.0, atol=0.15 * TURN)
    # Ahead along its heading, whatever that is in the room.
    assert np.allclose(means[~spins][:, root.frame.level], [STRIDE, 0.0], atol=0.15 * STRIDE)
    assert np.allclose(means[spins][:, root.frame.level], [0.0, 0.0], atol=0.15 * STRIDE)


def test_particles_move_as_their_clusters_with_its_covariance() -> None:
    frame = RootFrame(np.array([0, 1, 2]), np.array([False, False, True]), 2, np.array([0, 1]))
    rng = np.random.default_rng(3)
    mixing = np.array([[4.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.02, 0.03, 0.1]])
    wanted = np.array([9.0, -1.0, 0.3])
    changes = np.concatenate([np.zeros((40, 3)), wanted + rng.standard_normal((4000, 3)) @ mixing.T])
    shares = np.repeat(np.eye(2), [40, 4000], axis=0)
    motion = RootMotion(frame, gaussians_of(changes, shares))
    poses = np.tile([100.0, 200.0, 0.5 * np.pi, 7.0], (20000, 1))
    after = motion.moved(np.random.default_rng(4), poses, np.ones(20000, dtype=np.int64))
    assert np.array_equal(after[:, 3], poses[:, 3])
    # Facing +y: ahead is y, left is -x.
    assert np.allclose(after.mean(axis=0)[:3], [101.0, 209.0, 0.5 * np.pi + 0.3], atol=0.2)
    back = np.stack([after[:, 1] - 200.0, 100.0 - after[:, 0], after[:, 2] - 0.5 * np.pi], axis=1)
    assert np.allclose(np.cov(back.T), mixing @ mixing.T, atol=0.8)
    still = motion.moved(np.random.default_rng(4), poses, np.zeros(20000, dtype=np.int64), spread=0.0)
    assert np.allclose(still, poses, atol=1e-9)
    twice = motion.moved(np.random.default_rng(4), poses, np.ones(20000, dtype=np.int64), spread=2.0)
    assert np.allclose(twice.std(axis=0)[:2], 2.0 * after.std(axis=0)[:2], rtol=0.02)


def test_another_rate_scales_the_changes_of_a_frame(model: BehaviourModel) -> None:
    fast = model.at_rate(2.0 * FPS)
    np.testing.assert_allclose(fast.root.changes.means, 0.5 * model.root.changes.means)
    np.testing.assert_allclose(fast.root.changes.covariances, 0.25 * model.root.changes.covariances)
    back = fast.at_rate(FPS)
    np.testing.assert_allclose(back.root.changes.means, model.root.changes.means)


def test_a_file_keeps_it_and_refuses_what_does_not_fit(model: BehaviourModel, tmp_path: Path) -> None:
    path = tmp_path / "turning.behaviour"
    write_model(model, path)
    back = read_model(path)
    for one, other in ((back.root.frame, model.root.frame), (back.root.changes, model.root.changes)):
        for field in dataclasses.fields(one):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
    poses = np.tile(load_body("human25").neutral, (30, 1))
    labels = np.arange(30) % model.clusters
    after = [motion.moved(np.random.default_rng(5), poses, labels) for motion in (model.root, back.root)]
    np.testing.assert_array_equal(after[0], after[1])
    short = RootMotion(model.root.frame, model.root.changes.chosen(np.arange(model.clusters - 1)))
    write_model(dataclasses.replace(model, root=short), path)
    with pytest.raises(BehaviourError, match=r"'turning\.behaviour' is not a behaviour model"):
        read_model(path)


def test_new_clusters_are_appended(model: BehaviourModel) -> None:
    width = len(model.root.frame.columns)
    more = gaussians_of(np.full((30, width), 2.0), np.ones((30, 1)))
    both = model.root.joined(more)
    assert both.changes.size == model.clusters + 1
    np.testing.assert_array_equal(both.changes.means[:-1], model.root.changes.means)
    np.testing.assert_allclose(both.changes.means[-1], 2.0)
    poses = np.zeros((1, load_body("human25").neutral.size))
    after = both.moved(np.random.default_rng(0), poses, np.array([model.clusters]), spread=0.0)
    np.testing.assert_allclose(after[0, model.root.frame.columns], 2.0)
