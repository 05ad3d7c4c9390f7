"""Bodies that are changed: what is written reads back, sides are mirrored, what is wrong is said with its remedy."""

import math

import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.body.definition import BodyDefinition
from studio.body.editing import SIDES, edited, other_side
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.writing import body_text
from studio.foundations.errors import BodyError

ALIKE = ("mouse", "mouse31", "dog", "fly48", "human25", "human29", "human34", "human35", "branched_arms6")
"""Bodies whose sides are alike as they are shipped; human31 has the sides of its person."""


def definition_of(body: BodyModel) -> BodyDefinition:
    assert body.definition is not None
    return body.definition


def limits_of(body: BodyModel, name: str) -> tuple[float, float, float]:
    entry = next(one for one in body.parameters if one.name == name)
    lower, upper, neutral = (
        round(math.degrees(value), 9) for value in (entry.lower, entry.upper, entry.neutral)
    )
    return lower, upper, neutral


@pytest.mark.parametrize("name", list_bodies())
def test_a_body_that_is_written_reads_back_as_it_was(name: str) -> None:
    body = load_body(name)
    again = parse_body(body_text(body), name, f"{name}.toml")
    assert definition_of(again) == definition_of(body)


def test_what_a_title_may_hold_survives_its_file() -> None:
    title = 'He said "no" \\ ümläut \t\x7f\n#[x]'
    again = edited(load_body("mouse"), title=title).body
    assert parse_body(body_text(again), "m", "m.toml").title == title


@pytest.mark.parametrize("name", ALIKE)
@pytest.mark.parametrize("side", SIDES)
def test_mirroring_a_body_whose_sides_are_alike_changes_nothing(name: str, side: str) -> None:
    body = load_body(name)
    change = edited(body, mirror=side)
    assert definition_of(change.body) == definition_of(body)
    assert change.notes == ()


@pytest.mark.parametrize("side", SIDES)
def test_mirroring_a_persons_uneven_sides_makes_their_lengths_equal(side: str) -> None:
    body = load_body("human31")
    mirrored = edited(body, mirror=side).body
    for name, value in body.dimensions.items():
        wanted = body.dimensions[name.replace("right", side).replace("left", side)]
        assert mirrored.dimensions[name] == (wanted if "left" in name or "right" in name else value)
    assert definition_of(mirrored).markers == definition_of(body).markers


def test_sizes_limits_and_markers_of_one_side_go_to_the_other() -> None:
    body = load_body("dog")
    parameter = "left_shoulder_swing" if any(p.name == "left_shoulder_swing" for p in body.parameters) else ""
    own = next(p for p in body.parameters if "left" in p.name and p.kind == "angle")
    parameter = parameter or own.name
    lower, upper, neutral = limits_of(body, parameter)
    limb = next(one for one in definition_of(body).limbs if one.side == "left")
    change = edited(
        body,
        sizes={f"{limb.name}.radius_start": 77.5, f"{limb.name}.length": 123.0},
        limits={f"{parameter}.upper": upper + 7.0},
        markers=[f"Spot_L={limb.joint},1,2,3"],
        mirror="left",
    )
    twin = limb.name.replace("left", "right")
    right = next(one for one in change.body.limbs if one.name == twin)
    assert right.radius_start == 77.5
    assert abs(right.length) == 123.0
    left_limits = limits_of(change.body, parameter)
    right_limits = limits_of(change.body, parameter.replace("left", "right"))
    assert left_limits == (lower, upper + 7.0, neutral)
    assert {abs(value) for value in right_limits} == {abs(value) for value in left_limits}
    spot = next(one for one in change.body.markers if one.name == "Spot_R")
    np.testing.assert_allclose(np.abs(spot.offset), [1.0, 2.0, 3.0], atol=2e-3)
    assert change.body.joints[spot.joint].name == limb.joint.replace("left", "right")
    assert any("Spot_R" in note for note in change.notes)


def test_an_angle_that_is_counted_from_elsewhere_on_the_other_side_stays_so() -> None:
    """The upper arm's twist of human31 rests at 0 on the left and at 180 degrees on the right."""
    change = edited(load_body("human31"), limits={"left_shoulder_rz.upper": 100.0}, mirror="left")
    assert limits_of(change.body, "left_shoulder_rz") == (-110.0, 100.0, 0.0)
    assert limits_of(change.body, "right_shoulder_rz") == (80.0, 290.0, 180.0)


def test_a_limb_that_shares_a_dimension_changes_it_for_both() -> None:
    change = edited(load_body("mouse"), sizes={"left ear.radius_end": 6.5})
    assert change.body.dimensions["ear_radius_end"] == 6.5


def test_a_limit_is_taken_away_and_a_rest_value_follows_its_limits() -> None:
    body = load_body("mouse")
    change = edited(body, limits={"head_nod.upper": 20.0, "tail_lift.lower": -math.inf})
    assert limits_of(change.body, "head_nod") == (-50.0, 20.0, 20.0)
    assert any("head_nod" in note for note in change.notes)
    assert limits_of(change.body, "tail_lift")[0] == -math.inf
    assert "lower" not in next(line for line in body_text(change.body).splitlines() if '"tail_lift"' in line)


def test_markers_are_moved_and_taken_away() -> None:
    change = edited(load_body("mouse"), markers=["Nose=head,0,0,30.5"], without_markers=["Trunk"])
    markers = {one.name: one.offset.tolist() for one in change.body.markers}
    assert markers["Nose"] == [0.0, 0.0, 30.5]
    assert "Trunk" not in markers
    assert next(iter(markers)) == "Nose"


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"sizes": {"loin_length": -1.0}}, "loin_length"),
        ({"sizes": {"loin_length": math.nan}}, "loin_length"),
        ({"sizes": {"loin_length": 1e9}}, "loin_length"),
        ({"sizes": {"head.radius": 3.0}}, "head.radius"),
        ({"sizes": {"wing.length": 3.0}}, "wing.length"),
        ({"sizes": {"left ear.scale_x": 0.0}}, "left ear"),
        ({"limits": {"head_nod.lower": 90.0}}, "head_nod"),
        ({"limits": {"head_nod.neutral": 900.0}}, "head_nod"),
        ({"limits": {"head_nod.max_step": 0.0}}, "head_nod"),
        ({"limits": {"head_nod.lower": math.nan}}, "head_nod"),
        ({"limits": {"head_nod": 3.0}}, "head_nod"),
        ({"limits": {"nod.lower": 3.0}}, "nod.lower"),
        ({"markers": ["A=nowhere,1,2,3"]}, "nowhere"),
        ({"markers": ["A=head,1,2"]}, "A=head,1,2"),
        ({"markers": ["A=head,1,2,x"]}, "A=head,1,2,x"),
        ({"markers": ["A=head,1,2,nan"]}, "'A'"),
        ({"markers": ["1=head,1,2,3"]}, "'1'"),
        ({"without_markers": ["Wing"]}, "Wing"),
        ({"mirror": "up"}, "up"),
    ],
)
def test_what_is_wrong_is_said_with_its_part_and_the_remedy(changes: dict, part: str) -> None:
    with pytest.raises(BodyError) as refusal:
        edited(load_body("mouse"), **changes)
    assert part in refusal.value.message
    assert refusal.value.hint


def test_a_body_without_sides_cannot_be_mirrored() -> None:
    with pytest.raises(BodyError, match="no left and right"):
        edited(load_body("planar_arm4"), mirror="left")


def test_names_of_the_other_side() -> None:
    known = {
        "Ear_L": "Ear_R",
        "LKnee": "RKnee",
        "Haunch_left": "Haunch_right",
        "Left toe": "Right toe",
        "L_toe": "R_toe",
        "left hand, left side": "right hand, left side",
    }
    assert {name: other_side(name, "left") for name in known} == known
    twice = known.pop("left hand, left side")
    assert other_side(twice, "right") == "left hand, left side"
    assert {other: other_side(other, "right") for other in known.values()} == {b: a for a, b in known.items()}
    assert [other_side(name, "left") for name in ("Loin", "Tail_0", "Nose", "Ear_R")] == [""] * 4
