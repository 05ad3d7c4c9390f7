"""Local refinement: slopes against differences, the true pose found again, limits kept, never worse."""

import dataclasses

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel, free_ends, rigid_limbs
from studio.evidence.distance_maps import SilhouetteDistances, silhouette_distances
from studio.results.drawing_footage.recipe_file import RECIPES
from studio.search.trackers.refinement import (
    RefinementSettings,
    Refiner,
    hidden_angles,
)
from studio.search.trackers.refinement_kernels import MARGIN, look_at_limbs

CAMERAS = ring_of_cameras(4, 480, 360)
SETTINGS = RefinementSettings()


@pytest.fixture(scope="module")
def truth(body: BodyModel) -> np.ndarray:
    """Standing with arms and a leg away from the trunk, so that every limb has border."""
    rng = np.random.default_rng(4)
    pose = body.neutral.copy()
    names = [entry.name for entry in body.parameters]
    pose[names.index("left_shoulder_rx")] += 0.5
    pose[names.index("right_shoulder_rx")] += 0.5
    pose[names.index("left_hip_ry")] += 0.3
    pose[6:] += 0.03 * rng.standard_normal(len(pose) - 6)
    pose[names.index("pelvis_z")] = 950.0
    lower = np.array([entry.lower for entry in body.parameters])
    upper = np.array([entry.upper for entry in body.parameters])
    return np.clip(pose, lower + 0.05, upper - 0.05)


@pytest.fixture(scope="module")
def seen(body: BodyModel, truth: np.ndarray) -> tuple[SilhouetteDistances, ...]:
    return silhouette_distances(drawn_evidence(body, truth, CAMERAS))


def off(body: BodyModel, pose: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance of the markers, mm."""
    apart = marker_points(body, pose[None]) - marker_points(body, truth[None])
    return float(np.linalg.norm(apart, axis=2).mean())


def shaken(body: BodyModel, truth: np.ndarray, seed: int, size: float = 0.08) -> np.ndarray:
    rng = np.random.default_rng(seed)
    unit = np.array([1.0 if entry.kind == "angle" else 250.0 for entry in body.parameters])
    return truth + size * unit * rng.standard_normal(len(truth))


class Judge:
    """A weighting that prefers poses near a given one."""

    def __init__(self, liked: np.ndarray) -> None:
        self.liked = liked

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return -np.linalg.norm(poses - self.liked, axis=1)

    fitness = log_likelihood

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        return np.ones(len(poses), dtype=bool)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_shaken_pose_comes_back_to_the_silhouettes(
    body: BodyModel, truth: np.ndarray, seen: tuple[SilhouetteDistances, ...], seed: int
) -> None:
    refiner = Refiner(body, CAMERAS, SETTINGS)
    start = shaken(body, truth, seed)
    found = refiner.refine(start, seen)
    floor = off(body, refiner.refine(truth, seen).pose, truth)
    before, after = off(body, start, truth), off(body, found.pose, truth)
    assert floor < 15.0
    assert before > 25.0
    assert after - floor < 0.5 * (before - floor)
    assert refiner.loss(found.pose, seen)[0] < refiner.loss(start, seen)[0]


def test_the_gradient_is_that_of_the_loss(
    body: BodyModel, truth: np.ndarray, seen: tuple[SilhouetteDistances, ...]
) -> None:
    refiner = Refiner(body, CAMERAS, SETTINGS)
    pose = shaken(body, truth, 3, 0.03)
    gradient = refiner.loss(pose, seen)[1]
    step = 0.004 * np.diag(refiner.unit)
    by_differences = [
        (refiner.loss(pose + row, seen)[0] - refiner.loss(pose - row, seen)[0]) / 0.016 for row in step
    ]
    agreement = np.corrcoef(gradient, by_differences)[0, 1]
    # Which outline explains a point changes with the pose, so the loss has kinks.
    assert agreement > 0.97
    assert np.dot(gradient, by_differences) / np.dot(gradient, gradient) == pytest.approx(1.0, abs=0.15)


def test_limits_hold(body: BodyModel, truth: np.ndarray, seen: tuple[SilhouetteDistances, ...]) -> None:
    narrow = dataclasses.replace(
        body,
        parameters=tuple(
            dataclasses.replace(entry, upper=min(entry.upper, value - 0.05))
            if entry.kind == "angle"
            else entry
            for entry, value in zip(body.parameters, truth, strict=True)
        ),
    )
    upper = np.array([entry.upper for entry in narrow.parameters])
    found = Refiner(narrow, CAMERAS, SETTINGS).refine(np.minimum(truth, upper), seen).pose
    assert np.all(found <= upper)
    assert np.isfinite(found).all()


def test_refinement_never_lowers_the_log_weight(
    body: BodyModel, truth: np.ndarray, seen: tuple[SilhouetteDistances, ...]
) -> None:
    refiner, start = Refiner(body, CAMERAS, SETTINGS), shaken(body, truth, 1)
    free = refiner.refine(start, seen).pose
    kept = refiner.refine(start, seen, Judge(start))
    assert not kept.moved
    assert np.array_equal(kept.pose, start)
    assert np.array_equal(refiner.refine(start, seen, Judge(free)).pose, free)
    half = refiner.refine(start, seen, Judge(start + 0.45 * (free - start)))
    assert np.allclose(half.pose, start + 0.5 * (free - start))
    assert half.gain > 0.0


def test_without_silhouettes_nothing_moves(body: BodyModel, truth: np.ndarray) -> None:
    seen = silhouette_distances(drawn_evidence(body, None, CAMERAS))
    found = Refiner(body, CAMERAS, SETTINGS).refine(truth, seen)
    assert not found.moved
    assert np.array_equal(found.pose, truth)
    at_rest = Refiner(body, CAMERAS, SETTINGS).frame_loss(body.neutral, ())(body.neutral)
    assert at_rest[0] == 0.0
    assert not at_rest[1].any()


def test_refining_twice_gives_the_same(
    body: BodyModel, truth: np.ndarray, seen: tuple[SilhouetteDistances, ...]
) -> None:
    refiner, start = Refiner(body, CAMERAS, SETTINGS), shaken(body, truth, 2)
    assert np.array_equal(refiner.refine(start, seen).pose, refiner.refine(start, seen).pose)


def test_limbs_are_looked_at_with_their_boxes_turns_and_sides() -> None:
    """Two quadrilaterals, one way round and the other, and one that is not seen."""
    quad = np.array([[2.0, 1.0], [6.0, 2.0], [7.0, 9.0], [3.0, 8.0]])
    quads = np.stack([quad, quad[::-1], np.full((4, 2), np.nan)])
    usable, turns = np.zeros(3, np.bool_), np.zeros(3)
    sides, boxes = np.zeros((3, 4, 3)), np.zeros((3, 4))
    look_at_limbs(quads, np.zeros((3, 4, 2, 5)), usable, turns, sides, boxes)
    assert usable.tolist() == [True, True, False]
    assert boxes[:2].tolist() == [[2.0, 1.0, 7.0, 9.0]] * 2
    assert turns[0] == -turns[1]
    for own, turn, side in zip(quads[:2], turns[:2], sides[:2], strict=True):
        along = np.roll(own, -1, axis=0) - own
        np.testing.assert_allclose(side[:, :2], turn * along)
        np.testing.assert_allclose(side[:, 2], MARGIN * np.linalg.norm(along, axis=1))
        # Inside is on the left.
        to_middle = own.mean(axis=0) - own
        assert (side[:, 0] * to_middle[:, 1] - side[:, 1] * to_middle[:, 0] > 0.0).all()


def test_free_ends_are_crown_fingers_and_toes(body: BodyModel) -> None:
    names = [limb.name for limb, free in zip(body.drawn, free_ends(body), strict=True) if free]
    assert "head" in names
    assert "torso" not in names
    # A shin or forearm ends freely only where no foot or hand could hang from it.
    assert not any("thigh" in name or "shin" in name or "arm" in name for name in names)


def test_limbs_on_fixed_joints_are_borne_by_what_moves_them() -> None:
    """A robot's housings and an animal's head lie on joints that only place them: they show how what bears them is
    turned, and are no hands that may be a little off.
    """
    arm = load_body(str(RECIPES / "robot_arm.urdf"))
    assert not hidden_angles(arm).any()
    assert not rigid_limbs(arm).any()
    mouse = load_body("mouse")
    assert not hidden_angles(mouse).any()
    assert not rigid_limbs(mouse).any()
    person = load_body("human25")
    rigid = [limb.name for limb, one in zip(person.drawn, rigid_limbs(person), strict=True) if one]
    assert rigid == ["left hand", "right hand"]
    other = load_body("human34")
    hidden = [entry.name for entry, one in zip(other.parameters, hidden_angles(other), strict=True) if one]
    assert hidden == ["neck_nod"]
