"""Bodies that are changed: what is written reads back, sides are mirrored, what is wrong is said with its remedy."""

import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.body.definition import BodyDefinition, MeshEntry
from studio.body.editing import SIDES, BodyEdit, edited, other_side
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.subject import Subject
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


PINCERS = """
title = "Pincers"
parameters = [
    { name = "left_open", kind = "angle", limb = "left", lower = 0, upper = 60, neutral = 10, max_step = 90 },
    { name = "left_out", kind = "length", limb = "left", lower = 0, upper = 9, neutral = [2, "gap"], max_step = 5 },
    { name = "right_open", kind = "angle", limb = "right", lower = -60, upper = 0, neutral = -10, max_step = 90 },
    { name = "right_out", kind = "length", limb = "right", lower = 0, upper = 9, neutral = [2, "gap"], max_step = 5 },
]
joints = [
    { name = "stand", parent = "world", type = "fixed", sequence = [{ move = "x", by = 50 }] },
    { name = "left_arm", parent = "stand", type = "hinge", sequence = [
        { move = "y", by = 30 }, { turn = "z", by = "left_open" }] },
    { name = "right_arm", parent = "stand", type = "hinge", sequence = [
        { move = "y", by = -30 }, { turn = "z", by = "right_open" }] },
    { name = "left_jaw", parent = "left_arm", type = "slide", sequence = [
        { move = "x", by = "left_reach" }, { move = "x", by = "left_out" }] },
    { name = "right_jaw", parent = "right_arm", type = "slide", sequence = [
        { move = "x", by = "right_reach" }, { move = "x", by = "right_out" }] },
]
markers = [
    { name = "Jaw_L", joint = "left_jaw", at = [1, 2, 3] },
    { name = "Jaw_R", joint = "right_jaw", at = [1, -2, 3] },
    { name = "LBack", joint = "stand", at = [0, 4, 0] },
    { name = "Top", joint = "stand", at = [0, 0, 7] },
]
[dimensions]
left_reach = { mm = 70 }
right_reach = { mm = 70 }
left_girth = { mm = 6 }
right_girth = { mm = 6 }
left_flat = { ratio = 0.5 }
right_flat = { ratio = 0.5 }
gap = { mm = 1 }

[[limbs]]
name = "stand"
joint = "stand"
length = 12
radius_start = 5
radius_end = 5

[[limbs]]
name = "left jaw"
joint = "left_jaw"
length = -8
radius_start = "left_girth"
radius_end = 3
scale_x = "left_flat"
scale_y = 1.5
side = "left"

[[limbs]]
name = "right jaw"
joint = "right_jaw"
length = -8
radius_start = "right_girth"
radius_end = 3
scale_x = "right_flat"
scale_y = 1.5
side = "right"
"""


def pincers(**changes: Any) -> BodyEdit:  # noqa: ANN401 - of `edited`
    return edited(parse_body(PINCERS, "pincers", "pincers.toml"), **changes)


@pytest.mark.parametrize("side", SIDES)
def test_everything_of_a_side_goes_to_the_other_by_its_own_directions(side: str) -> None:
    sign = 1.0 if side == "left" else -1.0
    open_lower, open_upper = sorted((5.0 * sign, 50.0 * sign))
    letter = side[0].upper()
    change = pincers(
        sizes={f"{side}_reach": 80.0, f"{side} jaw.radius_start": 7.0, f"{side}_flat": 0.75, f"{side} jaw.scale_y": 2.0,
               f"{side} jaw.length": 11.0, f"{side} jaw.radius_end": 4.0},
        limits={f"{side}_open.lower": open_lower, f"{side}_open.upper": open_upper, f"{side}_open.neutral": 20.0 * sign,
                f"{side}_open.max_step": 45.0, f"{side}_out.upper": 30.0},
        markers=[f"Jaw_{letter}={side}_jaw,4,{5 * sign},6"],
        mirror=side,
    )  # fmt: skip
    body = change.body
    assert body.dimensions == {
        "left_reach": 80.0, "right_reach": 80.0, "left_girth": 7.0, "right_girth": 7.0, "left_flat": 0.75,
        "right_flat": 0.75, "gap": 1.0,
    }  # fmt: skip
    left, right = body.limbs[1:]
    assert (left.length, right.length) == (-11.0, -11.0)
    for limb in (left, right):
        assert (limb.radius_start, limb.radius_end, limb.scale_x, limb.scale_y) == (7.0, 4.0, 0.75, 2.0)
    assert limits_of(body, "left_open") == (5.0, 50.0, 20.0)
    assert limits_of(body, "right_open") == (-50.0, -5.0, -20.0)
    steps = [round(math.degrees(one.max_step), 9) for one in body.parameters[::2]]
    assert steps == [45.0, 45.0]
    assert [(one.lower, one.upper, one.neutral, one.max_step) for one in body.parameters[1::2]] == [
        (0, 30, 3, 5)
    ] * 2
    places = {one.name: one.offset.tolist() for one in body.markers}
    assert places == {
        "Jaw_L": [4.0, 5.0, 6.0],
        "Jaw_R": [4.0, -5.0, 6.0],
        "LBack": [0.0, 4.0, 0.0],
        "Top": [0, 0, 7],
    }
    assert change.notes == (
        f"The length of '{side} jaw' is a number of its own: what hangs on it stays in place.",
    )


def test_an_angle_a_quarter_turn_apart_stays_a_quarter_apart() -> None:
    change = edited(
        parse_body(
            PINCERS.replace("lower = -60, upper = 0, neutral = -10", "lower = 30, upper = 90, neutral = 80"),
            "p",
            "p.toml",
        ),
        limits={"left_open.neutral": 12.0},
        mirror="left",
    )
    assert limits_of(change.body, "right_open") == (30.0, 90.0, 78.0)


@pytest.mark.parametrize("side", SIDES)
def test_a_rest_value_that_is_a_sum_on_one_side_alone_stays(side: str) -> None:
    head, end = PINCERS.split('name = "right_out"')
    body = parse_body(head + 'name = "right_out"' + end.replace('[2, "gap"]', "4", 1), "p", "p.toml")
    left, right = edited(body, mirror=side).body.parameters[1::2]
    assert (left.neutral, right.neutral) == (3.0, 4.0)


def test_a_marker_of_one_side_alone_is_added_to_the_other() -> None:
    text = PINCERS.replace('    { name = "Jaw_R", joint = "right_jaw", at = [1, -2, 3] },\n', "")
    change = edited(parse_body(text, "p", "p.toml"), mirror="left")
    jaw = change.body.markers[-1]
    assert (jaw.name, change.body.joints[jaw.joint].name, jaw.offset.tolist()) == (
        "Jaw_R",
        "right_jaw",
        [1, -2, 3],
    )
    assert change.notes == ("Marker 'Jaw_R' was added, the mirror image of 'Jaw_L'.",)


def test_a_mirrored_marker_is_written_to_a_micrometre() -> None:
    change = edited(
        load_body("human31"), markers=["Spot_L=left_thigh,12.3456789,-3.3333333,1.2345678"], mirror="left"
    )
    spot = next(one for one in change.body.markers if one.name == "Spot_R").offset
    np.testing.assert_array_equal(spot, np.round(spot, 3))
    assert np.abs(spot - np.round(spot, 2)).max() > 1e-4


@pytest.mark.parametrize(
    "sizes",
    [
        {"left_reach": 10_000.0},
        {"gap": 0.0},
        {"left_flat": 20.0},
        {"left jaw.scale_y": 20.0},
        {"left jaw.radius_end": 0.0},
    ],
)
def test_the_least_and_the_largest_size_are_taken(sizes: dict[str, float]) -> None:
    pincers(sizes=sizes)


@pytest.mark.parametrize(
    ("sizes", "part"),
    [
        ({"gap": 10_001.0}, "'gap'"),
        ({"left_flat": 0.0}, "'left_flat'"),
        ({"left_flat": 21.0}, "'left_flat'"),
        ({"left jaw.scale_y": 21.0}, "'left jaw', scale_y"),
        ({"left jaw.radius_end": -1.0}, "'left jaw', radius_end"),
        ({"left jaw.radius_end": 10_001.0}, "'left jaw', radius_end"),
        ({"left jaw": 3.0}, "'left jaw'"),
        ({"left jaw.scale_x": 0.0}, "'left_flat'"),
    ],
)
def test_sizes_beyond_these_are_refused(sizes: dict[str, float], part: str) -> None:
    with pytest.raises(BodyError, match=part):
        pincers(sizes=sizes)


def test_an_offset_may_be_negative_and_no_larger_than_other_lengths() -> None:
    body = parse_body(PINCERS.replace("gap = { mm = 1 }", "gap = { mm = 1, spread = 3 }"), "p", "p.toml")
    assert edited(body, sizes={"gap": -2.0}).body.dimensions["gap"] == -2.0
    with pytest.raises(BodyError, match="'gap'"):
        edited(body, sizes={"gap": -10_001.0})


def test_a_rest_value_is_moved_only_where_it_is_outside_and_was_not_given() -> None:
    change = pincers(limits={"left_open.lower": 20.0, "right_open.upper": -5.0})
    assert limits_of(change.body, "left_open") == (20.0, 60.0, 20.0)
    assert limits_of(change.body, "right_open") == (-60.0, -5.0, -10.0)
    assert change.notes == ("The rest value of 'left_open' is 20 now, for 10 is outside.",)
    both = pincers(limits={"left_open.lower": 20.0, "left_open.neutral": 30.0})
    assert limits_of(both.body, "left_open") == (20.0, 60.0, 30.0)
    assert both.notes == ()
    with pytest.raises(BodyError, match="lower 70 not below upper 60"):
        pincers(limits={"left_open.lower": 70.0})
    with pytest.raises(BodyError, match="has neutral 3 outside"):
        pincers(limits={"left_out.lower": 5.0})


def test_markers_lie_within_ten_metres() -> None:
    change = pincers(markers=[" Far = stand, 10000, -10000, 0.5 "])
    assert change.body.markers[-1].offset.tolist() == [10000.0, -10000.0, 0.5]
    with pytest.raises(BodyError, match="'Far'"):
        pincers(markers=["Far=stand,0,10001,0"])


def test_a_text_of_a_body_has_short_numbers_and_nothing_that_goes_without_saying() -> None:
    text = body_text(pincers(sizes={"gap": 1.25, "left_reach": 70.0}, title="New").body)
    assert text.startswith('title = "New"\n')
    assert "gap = { mm = 1.25 }" in text
    assert "left_reach = { mm = 70 }" in text
    assert 'sequence = [{ move = "x", by = 50 }]' in text
    assert "source" not in text
    assert "scale_x = 1" not in text
    line = next(line for line in text.splitlines() if '"left_open"' in line)
    assert line == (
        '    { name = "left_open", kind = "angle", max_step = 90, limb = "left", lower = 0, upper = 60, neutral = 10 },'
    )
    with pytest.raises(BodyError, match="not read from a file"):
        body_text(replace(pincers().body, definition=None))


def test_a_files_entries_are_what_they_are_and_hold_nothing_else() -> None:
    body = definition_of(load_body("mouse"))
    entries = [
        body,
        body.parameters[0],
        body.joints[1],
        body.joints[1].sequence[0],
        body.limbs[0],
        body.markers[0],
    ]
    entries += [next(iter(body.dimensions.values())), MeshEntry("arm", "", ""), Subject()]
    for entry in entries:
        table = msgspec.to_builtins(entry)
        assert msgspec.convert(table, type(entry)) == entry
        with pytest.raises(msgspec.ValidationError, match="colour"):
            msgspec.convert({**table, "colour": "red"}, type(entry))
        key = next(iter(table))
        with pytest.raises(AttributeError):
            setattr(entry, key, getattr(entry, key))


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
