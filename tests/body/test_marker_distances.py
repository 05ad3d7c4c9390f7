"""Distances between a body's markers: how dimensions and poses change them."""

import math

import numpy as np
import pytest

from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import marker_points
from studio.body.marker_distances import MarkerDistances
from studio.body.reader import parse_body

LEG = """
title = "A leg with a toe that stands in its ankle"
parameters = [
    { name = "far", kind = "length", limb = "leg", max_step = 1 },
    { name = "hip", kind = "angle", limb = "thigh", max_step = 1 },
    { name = "knee", kind = "angle", limb = "thigh", max_step = 1, lower = -100, upper = 100, neutral = 90 },
    { name = "ankle", kind = "angle", limb = "foot", max_step = 1 },
]
joints = [
    { name = "base", parent = "world", type = "slide", sequence = [{ move = "x", by = "far" }] },
    { name = "thigh", parent = "base", type = "hinge", sequence = [{ turn = "y", by = "hip" }] },
    { name = "shin", parent = "thigh", type = "hinge", sequence = [
        { move = "z", by = "-thigh" }, { turn = "y", by = "knee" },
    ] },
    { name = "foot", parent = "shin", type = "hinge", sequence = [
        { move = "z", by = "-shin" }, { turn = "z", by = "ankle" },
    ] },
]
limbs = [
    { name = "thigh", joint = "thigh", length = "-thigh", radius_start = "wide", radius_end = 20, scale_x = "flat" },
]
markers = [
    { name = "Hip", joint = "thigh", at = [0, 0, 0] },
    { name = "Knee", joint = "shin", at = [0, 0, 0] },
    { name = "Knee_L", joint = "shin", at = [0, "cap", 0] },
    { name = "Ankle", joint = "foot", at = [0, 0, 0] },
    { name = "Toe", joint = "foot", at = [0, 0, 0] },
    { name = "Heel", joint = "foot", at = [-3, 0, "-heel"] },
    { name = "Fixed", joint = "shin", at = [0, 5, 0] },
]
[dimensions]
thigh = { mm = 400 }
shin = { mm = 300 }
wide = { mm = 60 }
heel = { mm = 0 }
cap = { mm = 40 }
flat = { ratio = 0.8 }
"""
LEGGED = parse_body(LEG, "leg", "leg.toml")


def test_dimensions_in_mm_that_are_not_zero_count() -> None:
    distances = MarkerDistances(LEGGED)
    assert distances.names == ["thigh", "shin", "wide", "cap"]
    assert distances.start.tolist() == [400.0, 300.0, 60.0, 40.0]
    assert distances.index == {"thigh": 0, "shin": 1, "wide": 2, "cap": 3}


def test_distances_and_their_slopes_are_those_of_resized_bodies() -> None:
    distances = MarkerDistances(LEGGED)
    pairs = ["Hip_Knee", "Hip_Ankle", "Knee_Knee_L", "Hip_Knee_L", "Ankle_Toe", "Knee_Ankle"]
    values = np.array([410.0, 280.0, 70.0, 45.0])
    body = with_dimensions(LEGGED, dict(zip(distances.names, values, strict=True)))
    points = dict(
        zip([marker.name for marker in body.markers], marker_points(body, body.neutral)[0], strict=True)
    )
    ends = [
        ("Hip", "Knee"),
        ("Hip", "Ankle"),
        ("Knee", "Knee_L"),
        ("Hip", "Knee_L"),
        ("Ankle", "Toe"),
        ("Knee", "Ankle"),
    ]
    wanted = [np.linalg.norm(points[one] - points[two]) for one, two in ends]
    np.testing.assert_allclose(distances.distances(pairs, values), wanted, atol=1e-9)
    slopes = distances.slopes(pairs, values)
    for at in range(4):
        step = 1e-3 * (np.arange(4) == at)
        ahead, behind = (distances.distances(pairs, values + sign * step) for sign in (1.0, -1.0))
        np.testing.assert_allclose(slopes[:, at], (ahead - behind) / 2e-3, atol=1e-6)
    # The knee is bent by a right angle: exact zeros where a dimension does nothing.
    np.testing.assert_allclose(slopes[1], [410.0 / wanted[1], 280.0 / wanted[1], 0.0, 0.0])
    assert (slopes[[0, 2, 4]] == [[1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]]).all()


def test_a_change_by_pose_is_the_largest_of_any_joint_bent_by_fifteen_degrees() -> None:
    distances = MarkerDistances(LEGGED)
    assert distances.change_by_pose("Hip_Knee") == pytest.approx(0.0, abs=1e-12)
    bends = [math.radians(90.0 + bend) for bend in (-15.0, 15.0)]
    lengths = [math.sqrt(400.0**2 + 300.0**2 + 2.0 * 400.0 * 300.0 * math.cos(bend)) for bend in bends]
    assert distances.change_by_pose("Hip_Ankle") == pytest.approx(
        max(abs(one / 500.0 - 1.0) for one in lengths)
    )
    assert distances.change_by_pose("Ankle_Toe") == 0.0


def test_pairs_that_no_pose_changes_are_listed_once() -> None:
    lengths = MarkerDistances(LEGGED).rigid()
    assert lengths == {
        "Hip_Knee": pytest.approx(400.0),
        "Knee_Knee_L": pytest.approx(40.0),
        "Knee_Ankle": pytest.approx(300.0),
        "Knee_Toe": pytest.approx(300.0),
        "Knee_Heel": pytest.approx(math.hypot(300.0, 3.0)),
        "Knee_L_Ankle": pytest.approx(math.hypot(40.0, 300.0)),
        "Knee_L_Toe": pytest.approx(math.hypot(40.0, 300.0)),
        "Ankle_Heel": pytest.approx(3.0),
        "Toe_Heel": pytest.approx(3.0),
        "Hip_Knee_L": pytest.approx(math.hypot(400.0, 40.0)),
        "Hip_Fixed": pytest.approx(math.hypot(400.0, 5.0)),
        "Knee_Fixed": pytest.approx(5.0),
        "Knee_L_Fixed": pytest.approx(35.0),
        "Ankle_Fixed": pytest.approx(math.hypot(300.0, 5.0)),
        "Toe_Fixed": pytest.approx(math.hypot(300.0, 5.0)),
    }


def test_which_lengths_are_usable_and_why_others_are_not() -> None:
    lengths = {
        "Hip_Knee": 410.0,
        "Hip_Ankle": 500.0,
        "Ankle_Toe": 3.0,
        "Hip_Nose": 9.0,
        "Knee_Ankle": 290.0,
        "Hip_Hip": 1.0,
    }
    distances = MarkerDistances(LEGGED)
    measured, notes = distances.usable(lengths, frozenset({"shin"}))
    assert measured == {"Hip_Knee": (410.0, True)}
    assert [note.split("'")[1] for note in notes] == [
        "Hip_Ankle",
        "Ankle_Toe",
        "Hip_Nose",
        "Knee_Ankle",
        "Hip_Hip",
    ]
    assert "changes with the pose" in notes[0]
    assert "no dimension sets it" in notes[1]
    assert "names no two markers of 'leg' (Hip, Knee, Knee_L" in notes[2]
    assert "no dimension sets it" in notes[3]
    assert "Knee_Ankle" in distances.usable(lengths, frozenset())[0]


@pytest.mark.parametrize(("neutral", "is_read"), [(35.5, True), (36.5, False)])
def test_a_length_that_changes_by_a_twentieth_is_read_as_measured_standing(
    neutral: float, is_read: bool
) -> None:
    """Fifteen degrees more change the way from hip to ankle by 4.9 and by 5.04 %."""
    text = LEG.replace("neutral = 90", f"neutral = {neutral}")
    body = parse_body(text, "leg", "leg.toml")
    change = MarkerDistances(body).change_by_pose("Hip_Ankle")
    assert (change < 0.05) is is_read
    measured, notes = MarkerDistances(body).usable({"Hip_Ankle": 600.0}, frozenset())
    assert measured == ({"Hip_Ankle": (600.0, False)} if is_read else {})
    assert ("read as measured standing" in notes[0]) is is_read
