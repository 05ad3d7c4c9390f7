"""Dragging limbs: the target is reached within the limits, the rest follows only where needed."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from studio.body.catalogue import list_bodies, load_body
from studio.body.dragging import REACHED, Dragger, root_joint
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.model import extremities
from studio.body.reader import parse_body
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


def test_an_arms_pose_is_the_nearest_that_reaches_its_outer_joints_first() -> None:
    """Against scipy's own least squares of the stated sum: 0.3 mm a radian at the wrist, 3 at the shoulder."""
    body = load_body("planar_arm4")
    dragger = Dragger(body)
    start = np.array([0.2, 0.3, -0.2, 0.4])
    pulls = np.array([3.0, 2.1, 1.2, 0.3])
    for name, moved in (("link 4", 4), ("link 2", 2)):
        limb = dragger.grip(name).limb
        goal = dragger.points(start + np.array([0.3, -0.2, 0.25, -0.4]))[limb]
        pull = pulls if moved == 4 else np.array([3.0, 0.3])

        def residuals(values: np.ndarray, limb=limb, goal=goal, moved=moved, pull=pull) -> np.ndarray:
            pose = np.concatenate([values, start[moved:]])
            return np.concatenate([dragger.points(pose)[limb] - goal, pull * (values - start[:moved])])

        wanted = least_squares(residuals, start[:moved], xtol=1e-12, ftol=1e-12, gtol=1e-12).x
        found = dragger.dragged(start, name, goal)
        np.testing.assert_allclose(found.pose[:moved], wanted, atol=2e-4)
        np.testing.assert_array_equal(found.pose[moved:], start[moved:])
        assert found.left_mm == pytest.approx(np.linalg.norm(dragger.points(found.pose)[limb] - goal))


def test_the_whole_body_follows_as_little_as_its_ends_its_joints_and_its_root_are_held() -> None:
    """Other ends count a fifth, joints 3 mm a radian, the root 20 mm a radian or 400 mm."""
    body = load_body("human25")
    dragger = Dragger(body)
    start = np.clip(body.neutral + 0.05, body.lower, body.upper)
    grip = dragger.grip("right forearm")
    goal = dragger.points(start)[grip.limb] + [200.0, 100.0, 100.0]
    root = np.arange(6)
    pull = np.where(np.isin(np.arange(len(start)), root), 20.0, 3.0)
    np.testing.assert_array_equal(dragger._whole_pull(), pull)
    scale = np.where(body.angles, 1.0, 400.0)
    held = [at for at in extremities(body) if at != grip.limb]

    def residuals(values: np.ndarray) -> np.ndarray:
        away = dragger.points(values * scale) - dragger.points(start)
        reached = dragger.points(values * scale)[grip.limb] - goal
        return np.concatenate([reached, 0.2 * away[held].ravel(), pull * (values - start / scale)])

    everything = np.arange(len(start))
    found = dragger._fit(start, start, everything, pull, grip, goal, extremities(body))
    limits = (body.lower / scale - 1e-9, body.upper / scale + 1e-9)
    wanted = least_squares(residuals, start / scale, bounds=limits, xtol=1e-7)
    assert 0.5 * (residuals(found / scale) ** 2).sum() == pytest.approx(wanted.cost, rel=1e-4)


def test_what_the_chain_moves_starts_at_the_root_and_leaves_it_out() -> None:
    body = load_body("human31")
    dragger = Dragger(body)
    names = [entry.name for entry in body.parameters]
    chain = [names[at] for at in dragger._chains[dragger.grip("left shin").limb]]
    assert sorted(chain) == ["left_hip_rx", "left_hip_ry", "left_hip_rz", "left_knee_ry"]
    assert chain[-1] == "left_knee_ry"
    trunk = next(grip for grip in dragger.grips if grip.root)
    assert not len(dragger._chains[trunk.limb])
    assert [grip.name for grip in dragger.grips] == [limb.name for limb in body.drawn]
    assert [grip.limb for grip in dragger.grips] == list(range(len(body.drawn)))
    assert [grip.side for grip in dragger.grips] == [limb.side for limb in body.drawn]


def test_a_limb_that_the_root_alone_moves_takes_the_body_along() -> None:
    body = load_body("human31")
    dragger = Dragger(body)
    trunk = next(grip for grip in dragger.grips if grip.root)
    goal = dragger.points(body.neutral)[trunk.limb] + [30.0, 40.0, 0.0]
    found = dragger.dragged(body.neutral, trunk.name, goal)
    assert found.left_mm < 2.0
    assert np.abs(found.pose[:6] - body.neutral[:6]).max() > 10.0


def test_a_stretched_chain_is_bent_part_of_the_way_to_the_middle_of_its_limits() -> None:
    body = load_body("human31")
    dragger = Dragger(body)
    start = np.clip(body.neutral + 0.1, body.lower, body.upper)
    grip = dragger.grip("left forearm")
    chain = dragger._chains[grip.limb]
    bent = dragger._bend(start, grip)
    bounded = [at for at in chain if np.isfinite(body.lower[at]) and np.isfinite(body.upper[at])]
    wanted = start.copy()
    for at in bounded:
        wanted[at] = 0.6 * start[at] + 0.4 * (body.lower[at] + body.upper[at]) / 2.0
    np.testing.assert_allclose(bent, wanted)
    assert bounded


def test_a_chain_with_a_limit_on_one_side_alone_is_not_bent_to_its_middle() -> None:
    text = CART.format(kind="angle", limits="", joint="hinge", word="turn")
    body = parse_body(
        text.replace('limb = "x", max_step = 1 }', 'limb = "x", max_step = 1, lower = -9 }'), "c", "c.toml"
    )
    found = Dragger(body).dragged(np.zeros(2), "arm", np.array([0.0, 0.0, 500.0]))
    assert np.isfinite(found.pose).all()
    assert found.left_mm == pytest.approx(400.0, abs=1e-3)


CART = """
title = "A cart on rails"
parameters = [
    {{ name = "a", kind = "{kind}", limb = "x", max_step = 1{limits} }},
    {{ name = "b", kind = "angle", limb = "x", max_step = 1 }},
]
joints = [
    {{ name = "stand", parent = "world", type = "fixed" }},
    {{ name = "cart", parent = "stand", type = "{joint}", sequence = [{{ {word} = "x", by = "a" }}] }},
    {{ name = "arm", parent = "cart", type = "hinge", sequence = [{{ turn = "y", by = "b" }}] }},
]
limbs = [{{ name = "arm", joint = "arm", length = 100, radius_start = 1, radius_end = 1 }}]
"""


@pytest.mark.parametrize(
    ("kind", "limits", "root"),
    [
        ("length", "", 1),
        ("length", ", upper = 9", 1),
        ("length", ", lower = -9, upper = 9", -1),
        ("angle", "", -1),
    ],
)
def test_the_root_is_the_first_joint_that_moves_if_it_goes_anywhere(
    kind: str, limits: str, root: int
) -> None:
    joint, word = ("slide", "move") if kind == "length" else ("hinge", "turn")
    body = parse_body(CART.format(kind=kind, limits=limits, joint=joint, word=word), "cart", "cart.toml")
    assert root_joint(body) == root
    found = Dragger(body).dragged(np.zeros(2), "arm", np.array([5.0, 0.0, 99.0]))
    assert found.left_mm < 5.0


@pytest.mark.parametrize(
    ("pose", "target"),
    [(np.zeros((1, 4)), np.zeros(3)), (np.zeros(4), np.zeros(2)), (np.full(4, np.inf), np.zeros(3)),
     (np.zeros(4), np.array([0.0, 0.0, 2e7]))],
)  # fmt: skip
def test_what_is_no_pose_or_no_place_is_refused(pose: np.ndarray, target: np.ndarray) -> None:
    with pytest.raises(BodyError, match="4 numbers and a place"):
        Dragger(load_body("planar_arm4")).dragged(pose, "link 1", target)


def test_a_pose_beyond_its_limits_is_dragged_from_within() -> None:
    body = load_body("human29")
    found = Dragger(body).dragged(body.neutral + 0.5, "left forearm", np.array([200.0, 300.0, 1000.0]))
    assert within(body, found.pose)


def test_wrong_input_is_refused() -> None:
    dragger = Dragger(load_body("planar_arm4"))
    with pytest.raises(BodyError, match="no limb 'wing'") as refusal:
        dragger.dragged(np.zeros(4), "wing", np.zeros(3))
    assert "link 1" in refusal.value.hint
    with pytest.raises(BodyError, match="4 numbers"):
        dragger.dragged(np.zeros(3), "link 1", np.zeros(3))
    with pytest.raises(BodyError, match="4 numbers"):
        dragger.dragged(np.zeros(4), "link 1", np.array([np.nan, 0.0, 0.0]))
