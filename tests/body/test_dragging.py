"""Dragging limbs: the target is reached within the limits, the rest follows only where needed."""

import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.body.dragging import REACHED, Dragger
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.foundations.errors import BodyError
from studio.foundations.geometry.rotations import rotation_from_vector

PERSONS = ["human25", "human29", "human31", "human34"]


def within(body, pose) -> bool:
    return all(
        entry.lower - 1e-9 <= value <= entry.upper + 1e-9
        for entry, value in zip(body.parameters, pose, strict=True)
    )


@pytest.mark.parametrize("name", PERSONS)
def test_a_dragged_wrist_reaches_the_target_within_limits(name: str) -> None:
    """The target is where the wrist is in another pose of the arm, so it can be reached."""
    body = load_body(name)
    dragger = Dragger(body)
    grip = dragger.grip("left forearm")
    rng = np.random.default_rng(4)
    arm = [at for at, entry in enumerate(body.parameters) if entry.limb == "left arm"]
    wrist = [marker.name for marker in body.markers].index("LWrist")
    for _ in range(6):
        other = body.neutral.copy()
        for at in arm:
            entry = body.parameters[at]
            other[at] = rng.uniform(
                0.8 * entry.lower + 0.2 * entry.upper, 0.2 * entry.lower + 0.8 * entry.upper
            )
        target = dragger.points(other)[grip.limb]
        found = dragger.dragged(body.neutral, "left forearm", target)
        assert found.left_mm < REACHED
        assert within(body, found.pose)
        # An independent measure of the wrist's position: the marker's kinematics.
        at_wrist = marker_points(body, np.stack([found.pose, other]))[:, wrist]
        assert np.linalg.norm(at_wrist[0] - at_wrist[1]) < 1.5 * REACHED
        right = [
            at for at, entry in enumerate(body.parameters) if entry.limb.startswith(("right", "left leg"))
        ]
        assert np.array_equal(found.pose[right], body.neutral[right]), "the other limbs stay as they are"


def test_out_of_the_arms_reach_the_body_follows_and_the_feet_stay() -> None:
    body = load_body("human31")
    dragger = Dragger(body)
    grip, foot = dragger.grip("right forearm"), dragger.grip("left shin")
    before = dragger.points(body.neutral)
    target = before[grip.limb] + [0.0, 0.0, -250.0]
    target = target + np.array([200.0, 0.0, 0.0])
    found = dragger.dragged(body.neutral, grip.name, target)
    assert found.left_mm < 5.0
    assert within(body, found.pose)
    after = dragger.points(found.pose)
    assert np.linalg.norm(after[foot.limb] - before[foot.limb]) < 120.0
    far = dragger.dragged(body.neutral, grip.name, before[grip.limb] + [1500.0, 0.0, 0.0])
    assert far.left_mm < 5.0, "a far drag takes the body along"
    assert within(body, far.pose)


def test_a_fixed_body_comes_as_near_as_it_can() -> None:
    body = load_body("planar_arm4")
    dragger = Dragger(body)
    reach = sum(limb.length for limb in body.drawn)
    found = dragger.dragged(body.neutral, "link 4", np.array([10.0 * abs(reach), 0.0, 0.0]))
    assert found.left_mm > abs(reach)
    assert within(body, found.pose)


def test_small_drags_move_smoothly() -> None:
    """The pose of a drag in many steps never jumps."""
    body = load_body("human34")
    dragger = Dragger(body)
    pose = body.neutral.copy()
    at = dragger.grip("right shin").limb
    start = dragger.points(pose)[at]
    for step in range(1, 16):
        found = dragger.dragged(pose, "right shin", start + step * np.array([15.0, 0.0, 10.0]))
        assert np.abs(limb_ends(body, found.pose) - limb_ends(body, pose)).max() < 90.0
        pose = found.pose
    assert np.linalg.norm(dragger.points(pose)[at] - start - 15 * np.array([15.0, 0.0, 10.0])) < 5.0


def test_every_limb_of_every_body_can_be_dragged() -> None:
    for name in list_bodies():
        body = load_body(name)
        dragger = Dragger(body)
        points = dragger.points(body.neutral)
        for grip in dragger.grips:
            found = dragger.dragged(body.neutral, grip.name, points[grip.limb])
            assert found.left_mm < REACHED, (name, grip.name)


@pytest.mark.parametrize("name", ["human25", "human31", "dog"])
def test_the_root_moves_to_its_frame(name: str) -> None:
    body = load_body(name)
    dragger = Dragger(body)
    before = dragger.root_frame(body.neutral)
    turn = rotation_from_vector(np.array([0.2, -0.1, 0.9]))
    goal = np.column_stack([turn @ before[:, :3], before[:, 3] + [300.0, -200.0, 50.0]])
    found = dragger.with_root(body.neutral, goal)
    after = dragger.root_frame(found)
    assert after is not None
    np.testing.assert_allclose(after, goal, atol=1e-3)
    assert np.array_equal(found[6:], body.neutral[6:])
    assert Dragger(load_body("planar_arm4")).root_frame(np.zeros(4)) is None


def test_wrong_input_is_refused() -> None:
    dragger = Dragger(load_body("planar_arm4"))
    with pytest.raises(BodyError, match="no limb 'wing'") as refusal:
        dragger.dragged(np.zeros(4), "wing", np.zeros(3))
    assert "link 1" in refusal.value.hint
    with pytest.raises(BodyError, match="4 numbers"):
        dragger.dragged(np.zeros(3), "link 1", np.zeros(3))
    with pytest.raises(BodyError, match="4 numbers"):
        dragger.dragged(np.zeros(4), "link 1", np.array([np.nan, 0.0, 0.0]))
