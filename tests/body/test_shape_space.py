"""A body's size as a few numbers."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.model import BodyModel, extremities
from studio.body.reader import parse_body
from studio.body.shape_space import (
    OFFSET_SIGMA,
    ShapeGroup,
    dimension_kinds,
    levelled,
    mean_sides,
    shape_space,
    untaped_lengths,
)
from studio.foundations.errors import BodyError


def test_sides_are_one_group_by_default() -> None:
    body = load_body("human31")
    both, each = shape_space(body), shape_space(body, symmetric=False)
    thigh = next(group for group in both.groups if group.name == "thigh_length")
    assert set(thigh.dimensions) == {"left_thigh_length", "right_thigh_length"}
    assert {"left_thigh_length", "right_thigh_length"} <= set(each.names)
    radius = next(group for group in both.groups if group.name == "thigh_radius_end")
    assert radius.kind == "radius"
    assert set(radius.dimensions) == {"left_thigh_radius_end", "right_thigh_radius_end"}
    assert {group.kind for group in shape_space(body, radii=False).groups} == {"length"}


def test_zero_is_the_body_and_a_factor_is_one() -> None:
    space = levelled(shape_space(load_body("human31")))
    shape = np.zeros(len(space.groups))
    assert dict(space.body_of(shape).dimensions) == pytest.approx(dict(space.body.dimensions))
    number = space.names.index("shin_length")
    shape[number] = np.log(1.1)
    changed = space.body_of(shape).dimensions
    assert changed["left_shin_length"] == pytest.approx(1.1 * space.body.dimensions["left_shin_length"])
    assert changed["left_shin_length"] == pytest.approx(changed["right_shin_length"])
    assert space.sizes(shape)[number] == pytest.approx(changed["left_shin_length"])
    ends = limb_ends(space.body_of(shape), space.body.neutral)
    assert ends.shape == limb_ends(space.body, space.body.neutral).shape


def test_a_dog_has_a_shape_too() -> None:
    space = shape_space(load_body("dog"))
    assert {"femur_length", "chest_radius_start"} <= set(space.names)


def test_flesh_may_lie_either_side_of_the_bone() -> None:
    space = shape_space(load_body("human35"), lengths=False, radii=False, flesh=True)
    kinds = {group.name: group.kind for group in space.groups}
    assert (kinds["thorax_forward"], kinds["thorax_depth"]) == ("offset", "ratio")
    shape = np.full(len(space.groups), -OFFSET_SIGMA)
    thinner = space.body_of(shape)
    assert thinner.dimensions["thorax_forward"] == pytest.approx(-20.0)
    assert thinner.dimensions["thorax_depth"] == pytest.approx(0.8 * np.exp(-OFFSET_SIGMA))
    number = [limb.name for limb in thinner.drawn].index("thorax")
    moved = limb_ends(thinner, thinner.neutral) - limb_ends(space.body, space.body.neutral)
    np.testing.assert_allclose(moved[0, number], [[-20.0, 0.0, 0.0]] * 2, atol=1e-9)
    joints = joint_frames(thinner, thinner.neutral) - joint_frames(space.body, space.body.neutral)
    flesh = [joint.name.endswith("_flesh") for joint in thinner.joints]
    assert np.abs(joints[0, ~np.array(flesh)]).max() == 0.0


@pytest.mark.parametrize(
    ("body", "inner"),
    [("human35", {"thorax_length", "pelvis_length"}), ("dog", {"chest_length", "loin_length"})],
)
def test_a_trunk_whose_flesh_lies_beside_the_bone_is_no_end(body: str, inner: set[str]) -> None:
    model = load_body(body)
    untaped = untaped_lengths(model)
    assert "head_length" in untaped
    assert not untaped & inner
    assert not {"thorax", "pelvis", "chest", "loin"} & {
        model.drawn[index].name for index in extremities(model)
    }


def test_no_tape_measures_an_animals_trunk() -> None:
    trunk = {"rump_length", "seat_length", "loin_length", "chest_length"}
    assert trunk | {"head_length", "ear_length"} <= untaped_lengths(load_body("mouse"))
    assert not {"tail_length", "tail_2_length"} & untaped_lengths(load_body("mouse"))


FLESHY = """
title = "A body of every kind of dimension"
parameters = [{ name = "a", kind = "angle", limb = "x", max_step = 1 }]
joints = [
    { name = "hub", parent = "world", type = "hinge", sequence = [{ turn = "z", by = "a" }, { move = "y", by = 4 }] },
    { name = "left_arm", parent = "hub", type = "fixed", sequence = [{ move = "x", by = "left_way" }] },
    { name = "right_arm", parent = "hub", type = "fixed", sequence = [{ move = "x", by = "-right_way" }] },
    { name = "left_flesh", parent = "left_arm", type = "fixed", sequence = [{ move = "z", by = "left_belly_out" }] },
]
limbs = [
    { name = "trunk", joint = "hub", length = "-trunk", radius_start = "girth", radius_end = 4, part = "trunk" },
    { name = "left", joint = "left_flesh", length = "arm_left", radius_start = "thick", radius_end = "left_thin" },
    { name = "right", joint = "right_arm", length = "arm_right", radius_start = "thick", radius_end = "right_thin",
      scale_x = "depth" },
]
[dimensions]
arm_left = { mm = 30, of_height = 0.1 }
arm_right = { mm = 40, of_height = 0.1 }
trunk = { mm = 50 }
left_way = { mm = 10 }
right_way = { mm = 12 }
girth = { mm = 9 }
thick = { mm = 3 }
left_thin = { mm = 2 }
right_thin = { mm = 4 }
depth = { ratio = 0.8, spread = 0.2 }
left_belly_out = { mm = -6, spread = 3 }
width = { ratio = 1.5 }
foot_drop = { mm = 5, spread = 1 }
unused = { mm = 5 }
none_length = { mm = 0 }
""".replace("\n      scale_x", " scale_x")


def fleshy() -> BodyModel:
    return parse_body(FLESHY, "fleshy", "fleshy.toml")


def test_a_dimension_is_what_its_body_uses_it_for() -> None:
    body = fleshy()
    assert dimension_kinds(body.definition) == {
        **dict.fromkeys(("arm_left", "arm_right", "trunk", "left_way", "right_way"), "length"),
        **dict.fromkeys(("girth", "thick", "left_thin", "right_thin"), "radius"),
        "depth": "ratio", "left_belly_out": "offset", "foot_drop": "offset",
    }  # fmt: skip


def test_groups_are_of_one_kind_and_named_without_their_side() -> None:
    space = shape_space(fleshy(), flesh=True)
    assert [(group.name, group.kind, group.dimensions, group.spread) for group in space.groups] == [
        ("arm_", "length", ("arm_left", "arm_right"), 0.0),
        ("trunk", "length", ("trunk",), 0.0),
        ("way", "length", ("left_way", "right_way"), 0.0),
        ("girth", "radius", ("girth",), 0.0),
        ("thick", "radius", ("thick",), 0.0),
        ("thin", "radius", ("left_thin", "right_thin"), 0.0),
        ("depth", "ratio", ("depth",), pytest.approx(0.25)),
        ("belly_out", "offset", ("left_belly_out",), 3.0),
    ]
    each = shape_space(fleshy(), symmetric=False, radii=False)
    assert each.names == ("arm_left", "arm_right", "trunk", "left_way", "right_way")
    assert shape_space(fleshy(), lengths=False).names == ("girth", "thick", "thin")
    assert shape_space(fleshy(), lengths=False, radii=False, flesh=True).names == ("depth", "belly_out")
    untaped = shape_space(fleshy(), lengths="untaped", radii=False)
    assert untaped.names == ("arm_", "trunk")
    assert untaped_lengths(fleshy()) == {"arm_left", "arm_right", "trunk"}


def test_a_shape_multiplies_sizes_and_moves_offsets() -> None:
    space = shape_space(fleshy(), flesh=True)
    shape = np.linspace(-0.2, 0.3, 8)
    sized = space.dimensions(shape)
    factor = dict(zip(space.names, np.exp(shape), strict=True))
    assert sized == pytest.approx({
        "arm_left": 30 * factor["arm_"], "arm_right": 40 * factor["arm_"], "trunk": 50 * factor["trunk"],
        "left_way": 10 * factor["way"], "right_way": 12 * factor["way"], "girth": 9 * factor["girth"],
        "thick": 3 * factor["thick"], "left_thin": 2 * factor["thin"], "right_thin": 4 * factor["thin"],
        "depth": 0.8 * factor["depth"], "left_belly_out": -6 + 3 * 0.3 / 0.15,
    })  # fmt: skip
    assert dict(space.body_of(shape).dimensions) == {**fleshy().dimensions, **sized}
    sizes = dict(zip(space.names, space.sizes(np.zeros(8)), strict=True))
    assert sizes == pytest.approx(
        {"arm_": 35, "trunk": 50, "way": 11, "girth": 9, "thick": 3, "thin": 3, "depth": 0.8, "belly_out": -6}
    )


def test_levelled_sides_have_their_mean_and_all_else_its_own() -> None:
    space = shape_space(fleshy(), radii=False)
    wanted = {**fleshy().dimensions, "arm_left": 35.0, "arm_right": 35.0, "left_way": 11.0, "right_way": 11.0}
    assert mean_sides(space, fleshy().dimensions) == wanted
    assert dict(levelled(space).body.dimensions) == wanted
    assert levelled(space).groups == space.groups


def test_absent_limbs_stay_absent() -> None:
    body = load_body("human31")
    assert body.dimensions["left_foot_length"] == 0.0
    assert "foot_length" not in shape_space(body).names


def test_nothing_to_fit_is_refused() -> None:
    with pytest.raises(BodyError, match="no dimensions"):
        shape_space(load_body("human31"), lengths=False, radii=False)


def test_a_standard_deviation_of_an_offset_is_as_large_a_step_as_one_of_a_radius() -> None:
    group = ShapeGroup("chest_out", "offset", ("chest_out",), spread=12.0)
    assert group.resized(30.0, 0.15) == pytest.approx(42.0)
