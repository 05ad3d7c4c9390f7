"""A body's size as a few numbers."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.model import extremities
from studio.body.shape_space import OFFSET_SIGMA, ShapeGroup, levelled, shape_space, untaped_lengths
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
