import itertools
from pathlib import Path

import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.body.definition import WORLD
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.model import kinematic_tables
from studio.body.reader import parse_body
from studio.foundations.errors import BodyError

# Parameters and drawn limbs of each body.
COUNTS = {
    "human31": (31, 10),
    "human29": (29, 17),
    "human34": (34, 17),
    "human35": (35, 17),
    "human25": (25, 14),
    "planar_arm4": (4, 4),
    "branched_arms6": (6, 6),
    "dog": (29, 17),
    "mouse": (29, 15),
    "mouse31": (31, 17),
    "fly48": (48, 27),
    "hand25": (25, 20),
}
HUMANS = ("human31", "human29", "human34", "human35", "human25")
MARKERS = {"Hip", "Neck", "Head"} | {
    side + joint for side in "RL" for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist")
}

PENDULUM = """
title = "Pendulum"
parameters = [{ name = "swing", kind = "angle", max_step = 90, limb = "rod" }]
joints = [{ name = "rod", parent = "world", type = "hinge", sequence = [{ turn = "x", by = "swing" }] }]
limbs = [{ name = "rod", joint = "rod", length = %s, radius_start = 10, radius_end = 10 }]
"""


def test_the_shipped_bodies_have_their_parameters_and_limbs() -> None:
    assert set(list_bodies()) == set(COUNTS)
    for name, counts in COUNTS.items():
        body = load_body(name)
        assert (len(body.parameters), len(body.drawn)) == counts, name
        assert body.name == name
        assert kinematic_tables(body).limb_shape.shape == (counts[1], 5)


def test_trunk_and_head_are_named_where_there_are_any() -> None:
    parts = {
        name: {limb.name: limb.part for limb in load_body(name).drawn if limb.part} for name in list_bodies()
    }
    one_torso = {"torso": "trunk", "head": "head"}
    pelvis_and_thorax = {"pelvis": "trunk", "thorax": "trunk", "head": "head"}
    assert parts == {
        "human31": one_torso,
        "human25": one_torso,
        "human29": pelvis_and_thorax,
        "human34": pelvis_and_thorax,
        "human35": pelvis_and_thorax,
        "dog": {"loin": "trunk", "chest": "trunk", "head": "head"},
        "mouse": {"rump": "trunk", "seat": "trunk", "loin": "trunk", "chest": "trunk", "head": "head"},
        "mouse31": {"rump": "trunk", "seat": "trunk", "loin": "trunk", "chest": "trunk", "head": "head"},
        "fly48": {"thorax": "trunk", "head": "head", "abdomen": "trunk"},
        "planar_arm4": {},
        "branched_arms6": {},
        "hand25": {},
    }


def test_a_limb_of_an_unknown_part_is_refused() -> None:
    wrong = PENDULUM.replace("radius_end = 10", 'radius_end = 10, part = "tail"') % 100
    with pytest.raises(BodyError, match=r"limb 'rod', part: .*'tail'"):
        parse_body(wrong, "pendulum", "pendulum.toml")
    right = PENDULUM.replace("radius_end = 10", 'radius_end = 10, part = "trunk"') % 100
    assert parse_body(right, "pendulum", "pendulum.toml").limbs[0].part == "trunk"


@pytest.mark.parametrize("name", HUMANS)
def test_humans_carry_the_fifteen_markers_and_stand_upright_facing_x(name: str) -> None:
    body = load_body(name)
    assert {marker.name for marker in body.markers} == MARKERS
    places = dict(
        zip([marker.name for marker in body.markers], marker_points(body, body.neutral)[0], strict=True)
    )
    for one, two in (
        ("Head", "Neck"),
        ("Neck", "Hip"),
        ("RHip", "RKnee"),
        ("LKnee", "LAnkle"),
        ("RElbow", "RWrist"),
    ):
        assert places[one][2] > places[two][2] + 100.0, (one, two)
    for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist"):
        assert places["L" + joint][1] > 50.0 > -50.0 > places["R" + joint][1]
    assert 0.0 < places["LAnkle"][2] < 100.0
    assert places["LWrist"][1] > places["LShoulder"][1] > places["Neck"][1]
    assert places["LWrist"][0] > places["LElbow"][0]


@pytest.mark.parametrize("name", ["human29", "human34", "human35", "human25"])
def test_humans_with_feet_point_them_forward_with_the_sole_on_the_floor(name: str) -> None:
    body = load_body(name)
    ends = dict(zip([limb.name for limb in body.drawn], limb_ends(body, body.neutral)[0], strict=True))
    for side in ("left", "right"):
        limb = next(entry for entry in body.drawn if entry.name == f"{side} foot")
        heel, toe = ends[f"{side} foot"]
        assert toe[0] - heel[0] > 0.99 * limb.length
        assert heel[2] - limb.radius_start == pytest.approx(0.0, abs=3.0)
        assert toe[2] - limb.radius_end == pytest.approx(0.0, abs=3.0)


@pytest.mark.parametrize("name", ["human29", "human34", "human35", "human25"])
def test_positive_angles_mean_the_same_on_both_sides(name: str) -> None:
    body = load_body(name)
    pose = body.neutral
    rng = np.random.default_rng(1)
    for place, entry in enumerate(body.parameters):
        if entry.name.startswith("left_"):
            value = rng.uniform(0.0, 0.5)
            pose[place] += value
            pose[[other.name for other in body.parameters].index("right_" + entry.name[5:])] += value
    points = dict(zip([marker.name for marker in body.markers], marker_points(body, pose)[0], strict=True))
    for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist"):
        np.testing.assert_allclose(points["L" + joint] * [1.0, -1.0, 1.0], points["R" + joint], atol=1e-9)


@pytest.mark.parametrize(("parameter", "marker", "axis", "sign"), [
    ("left_hip_swing", "LKnee", 0, 1),
    ("left_hip_spread", "LKnee", 1, 1),
    ("left_knee", "LAnkle", 0, -1),
    ("left_shoulder_swing", "LWrist", 0, 1),
    ("left_shoulder_spread", "LWrist", 1, 1),
    ("left_elbow", "LWrist", 0, 1),
    ("lean_forward", "Head", 0, 1),
    ("lean_right", "Head", 1, -1),
])  # fmt: skip
def test_angles_turn_as_their_names_indicate(parameter: str, marker: str, axis: int, sign: int) -> None:
    for name in ("human29", "human34", "human35", "human25"):
        body = load_body(name)
        pose = body.neutral
        pose[[entry.name for entry in body.parameters].index(parameter)] += 0.4
        place = [entry.name for entry in body.markers].index(marker)
        moved = marker_points(body, pose)[0, place] - marker_points(body, body.neutral)[0, place]
        assert sign * moved[axis] > 50.0


def test_human29_couples_its_clavicles_and_human34_does_not() -> None:
    def drivers(name: str, joint: str) -> set[str]:
        body = load_body(name)
        steps = next(entry.steps for entry in body.joints if entry.name == joint)
        return {body.parameters[step.parameter].name for step in steps if step.parameter >= 0}

    assert drivers("human29", "left_clavicle") == drivers("human29", "right_clavicle")
    assert not drivers("human34", "left_clavicle") & drivers("human34", "right_clavicle")
    assert len(drivers("human34", "left_clavicle")) == 2


def test_the_chest_of_human35_twists_against_its_pelvis() -> None:
    """A positive twist turns the chest to the left, hips and head's height stay."""
    body = load_body("human35")
    pose, names = body.neutral, [marker.name for marker in body.markers]
    pose[[entry.name for entry in body.parameters].index("back_twist")] = 0.5
    moved = marker_points(body, pose)[0] - marker_points(body, body.neutral)[0]
    assert moved[names.index("RShoulder"), 0] > 50.0 > -50.0 > moved[names.index("LShoulder"), 0]
    still = [names.index(name) for name in ("Hip", "LHip", "RAnkle", "Neck", "Head")]
    np.testing.assert_allclose(moved[still], 0.0, atol=1e-9)


def test_human25_has_nineteen_bounded_angles_at_most_two_a_joint() -> None:
    body = load_body("human25")
    for joint in body.joints[1:]:
        assert len([step for step in joint.steps if step.parameter >= 0]) <= 2, joint.name
    inner = body.parameters[6:]
    assert len(inner) == 19
    assert all(np.isfinite([entry.lower, entry.upper]).all() and entry.kind == "angle" for entry in inner)


@pytest.mark.parametrize("name", ["planar_arm4", "branched_arms6"])
def test_arms_stay_in_their_plane_and_share_one_range(name: str) -> None:
    body = load_body(name)
    lower = {entry.lower for entry in body.parameters}
    upper = {entry.upper for entry in body.parameters}
    assert len(lower) == len(upper) == 1
    poses = np.random.default_rng(0).uniform(lower.pop(), upper.pop(), (50, len(body.parameters)))
    ends = limb_ends(body, poses)
    np.testing.assert_allclose(ends[..., 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(ends[:, 0, 0], 0.0, atol=1e-12)


def test_the_two_arms_do_not_move_each_other() -> None:
    body = load_body("branched_arms6")
    pose = body.neutral
    pose[:3] += 0.5
    moved = np.abs(limb_ends(body, pose) - limb_ends(body, body.neutral))[0].max(axis=(1, 2))
    assert (moved[:3] > 1.0).all()
    np.testing.assert_array_equal(moved[3:], 0.0)


@pytest.mark.parametrize("name", sorted(COUNTS))
def test_parameters_of_a_limb_are_neighbours_and_every_body_cites_its_source(name: str) -> None:
    body = load_body(name)
    groups = [entry.limb for entry in body.parameters]
    changes = sum(one != two for one, two in itertools.pairwise(groups))
    assert changes == len(set(groups)) - 1
    assert body.definition.source
    assert any(entry.parent == WORLD for entry in body.definition.joints)


def test_a_new_body_is_one_file_in_a_users_folder(tmp_path: Path) -> None:
    (tmp_path / "pendulum.toml").write_text(PENDULUM % 500)
    assert "pendulum" in list_bodies((tmp_path,))
    body = load_body("pendulum", (tmp_path, tmp_path / "missing"))
    np.testing.assert_allclose(limb_ends(body, [np.pi / 2])[0, 0, 1], [0.0, -500.0, 0.0], atol=1e-9)
    assert load_body(str(tmp_path / "pendulum.toml")).name == "pendulum"


def test_a_users_body_goes_before_the_packages(tmp_path: Path) -> None:
    (tmp_path / "planar_arm4.toml").write_text(PENDULUM % 123)
    assert load_body("planar_arm4", (tmp_path,)).drawn[0].length == 123.0


@pytest.mark.parametrize("name", ["human99", "../models/human31", "", "human31/"])
def test_an_unknown_body_is_named_with_the_known_ones(name: str) -> None:
    with pytest.raises(BodyError, match="There is no body") as caught:
        load_body(name)
    assert "human31" in caught.value.hint


def test_a_missing_file_is_named() -> None:
    with pytest.raises(BodyError, match=r"nowhere\.toml' cannot be read"):
        load_body("nowhere.toml")
