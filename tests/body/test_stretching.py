"""Limbs of changing length: where their ends, cones and what hangs on them are, and files that are refused."""

import math

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.definition import BodyDefinition
from studio.body.dimensions import with_dimensions
from studio.body.editing import edited
from studio.body.forward_kinematics import limb_ends, limb_frames, marker_points
from studio.body.model import BodyModel, extremities
from studio.body.reader import parse_body
from studio.body.shape_space import untaped_lengths
from studio.body.upright import limb_drawings
from studio.body.writing import body_text
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.operations.body_details import edited_detail
from studio.operations.own_bodies import EditedBody
from studio.results.export.skeleton import skeleton_of

SHOULDER, ELBOW = 0.4, 0.7
UPPER, LOWER = 100.0, 60.0

ARM = """
title = "An arm of two limbs that stretch"
parameters = [
    { name = "shoulder", kind = "angle", limb = "arm", lower = -60, upper = 60, max_step = 180 },
    { name = "elbow", kind = "angle", limb = "forearm", lower = 0, upper = 150, max_step = 180 },
    { name = "wrist", kind = "angle", limb = "forearm", lower = -90, upper = 90, max_step = 180 },
]
joints = [
    { name = "upper", parent = "world", type = "hinge", sequence = [ { turn = "y", by = "shoulder" } ] },
    { name = "lower", parent = "upper", type = "hinge", sequence = [
        { move = "z", by = "upper_length" }, { turn = "y", by = "elbow" },
    ] },
    { name = "hand", parent = "lower", type = "hinge", sequence = [
        { move = "z", by = "-lower_length" }, { turn = "y", by = "wrist" },
    ] },
]
markers = [
    { name = "Bead", joint = "upper", at = [12, "-upper_length", "upper_length"] },
    { name = "Elbow", joint = "lower", at = [0, 0, 0] },
    { name = "Wrist", joint = "lower", at = [0, 0, "-lower_length"] },
]
[[limbs]]
name = "upper arm"
joint = "upper"
length = "upper_length"
radius_start = 20
radius_end = "upper_end"
scale_y = 0.7
stretch = [0.8, 1.25]
[[limbs]]
name = "lower arm"
joint = "lower"
length = "-lower_length"
radius_start = 6
radius_end = 9
stretch = [0.7, 1.4]
stretch_step = 30
[[limbs]]
name = "palm"
joint = "hand"
length = -10
radius_start = 9
radius_end = 5
[dimensions]
upper_length = { mm = 100 }
lower_length = { mm = 60 }
upper_end = { mm = 12 }
"""


def arm() -> BodyModel:
    return parse_body(ARM, "arm", "arm.toml")


def definition_of(body: BodyModel) -> BodyDefinition:
    assert body.definition is not None
    return body.definition


def pose_of(body: BodyModel, **values: float) -> Array:
    pose = body.neutral.copy()
    names = [entry.name for entry in body.parameters]
    for name, value in values.items():
        pose[names.index(name)] = value
    return pose


def bent(body: BodyModel, upper: float, lower: float) -> Array:
    """Shoulder and elbow bent, the limbs of these lengths, mm."""
    return pose_of(
        body,
        shoulder=SHOULDER,
        elbow=ELBOW,
        upper_arm_stretch=upper - UPPER,
        lower_arm_stretch=lower - LOWER,
    )


def along(angle: float) -> Array:
    """The axis z turned about y."""
    return np.array([math.sin(angle), 0.0, math.cos(angle)])


def profile(body: BodyModel, pose: Array, name: str, axis: Array, start: Array, places: Array) -> Array:
    """The radius of what is drawn of a limb at places along it from its start, mm; 0 beyond it."""
    radii = np.zeros_like(places)
    for limb, frame in zip(body.drawn, limb_frames(body, pose)[0], strict=True):
        if limb.name in (name, f"{name} end"):
            assert abs(frame[:, 2] @ axis) == pytest.approx(1.0)
            share = (places - (frame[:, 3] - start) @ axis) / (limb.length * (frame[:, 2] @ axis))
            radius = limb.radius_start + share * (limb.radius_end - limb.radius_start)
            inside = (share >= -1e-9) & (share <= 1.0 + 1e-9)
            radii = np.where(inside, np.maximum(radii, radius), radii)
    return radii


def test_a_limb_that_stretches_has_a_parameter_of_mm_beyond_its_length() -> None:
    body = arm()
    assert [entry.name for entry in body.parameters] == [
        "shoulder", "upper_arm_stretch", "elbow", "wrist", "lower_arm_stretch",
    ]  # fmt: skip
    upper, lower = body.parameters[1], body.parameters[4]
    assert (upper.kind, lower.kind) == ("length", "length")
    assert (upper.lower, upper.upper, upper.neutral) == pytest.approx((-20.0, 25.0, 0.0))
    assert (lower.lower, lower.upper, lower.neutral) == pytest.approx((-18.0, 24.0, 0.0))
    assert upper.max_step == pytest.approx(4.0 * 45.0)
    assert lower.max_step == 30.0
    assert lower.limb == "forearm"


@pytest.mark.parametrize(("upper", "lower"), [(80.0, 84.0), (100.0, 60.0), (117.5, 42.0), (125.0, 71.0)])
def test_ends_and_what_hangs_on_them_are_where_the_lengths_put_them(upper: float, lower: float) -> None:
    body = arm()
    pose = bent(body, upper, lower)
    elbow = upper * along(SHOULDER)
    wrist = elbow - lower * along(SHOULDER + ELBOW)
    bead = upper * along(SHOULDER) + 12.0 * along(SHOULDER + math.pi / 2) - [0.0, upper, 0.0]
    np.testing.assert_allclose(marker_points(body, pose)[0], [bead, elbow, wrist], atol=1e-9)
    ends = dict(zip([limb.name for limb in body.drawn], limb_ends(body, pose)[0], strict=True))
    np.testing.assert_allclose(ends["upper arm"][0], 0.0, atol=1e-9)
    np.testing.assert_allclose(ends["upper arm end"][1], elbow, atol=1e-9)
    np.testing.assert_allclose(ends["lower arm"][0], elbow, atol=1e-9)
    np.testing.assert_allclose(ends["lower arm end"][1], wrist, atol=1e-9)
    np.testing.assert_allclose(ends["palm"][0], wrist, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.62, 1.0])
@pytest.mark.parametrize("name", ["upper arm", "lower arm"])
def test_the_radius_has_no_step_at_any_length(name: str, share: float) -> None:
    body = arm()
    least, most = (80.0, 125.0) if name == "upper arm" else (42.0, 84.0)
    length = least + share * (most - least)
    pose = bent(body, *((length, LOWER) if name == "upper arm" else (UPPER, length)))
    start = np.zeros(3) if name == "upper arm" else UPPER * along(SHOULDER)
    axis = along(SHOULDER) if name == "upper arm" else -along(SHOULDER + ELBOW)
    places = np.linspace(0.0, length, 2001)
    radii = profile(body, pose, name, axis, start, places)
    first, last = (20.0, 12.0) if name == "upper arm" else (6.0, 9.0)
    assert (radii[0], radii[-1]) == pytest.approx((first, last))
    steepest = abs(last - first) / least
    assert np.abs(np.diff(radii)).max() <= steepest * (places[1] - places[0]) + 1e-9
    beyond = profile(body, pose, name, axis, start, np.array([-0.01, length + 0.01]))
    assert beyond.max() == 0.0


def test_bounds_follow_the_size_of_the_body() -> None:
    body = with_dimensions(arm(), {"upper_length": 200.0})
    entry = next(one for one in body.parameters if one.name == "upper_arm_stretch")
    assert (entry.lower, entry.upper) == pytest.approx((-40.0, 50.0))
    elbow = marker_points(body, pose_of(body, upper_arm_stretch=-15.0))[0, 1]
    np.testing.assert_allclose(elbow, [0.0, 0.0, 185.0], atol=1e-9)


def test_a_body_that_stretches_is_written_as_it_was_read() -> None:
    body = arm()
    text = body_text(body)
    again = parse_body(text, "arm", "arm.toml")
    assert definition_of(again) == definition_of(body)
    assert "upper_arm_stretch" not in text
    assert "arm end" not in text
    sized = parse_body(body_text(with_dimensions(body, {"lower_length": 50.0})), "arm", "arm.toml")
    assert [entry.stretch for entry in definition_of(sized).limbs] == [(0.8, 1.25), (0.7, 1.4), None]
    assert sized.parameters[4].upper == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (("[0.8, 1.25]", "[1.1, 1.25]"), "upper arm"),
        (("[0.8, 1.25]", "[0.8, 0.9]"), "upper arm"),
        (("[0.8, 1.25]", "[1.25, 0.8]"), "upper arm"),
        (("[0.8, 1.25]", "[1, 1]"), "upper arm"),
        (("[0.8, 1.25]", "[0, 1.25]"), "upper arm"),
        (("[0.8, 1.25]", "[nan, 1.25]"), "upper arm"),
        (("[0.8, 1.25]", "[0.8, inf]"), "upper arm"),
        (("[0.7, 1.4]", "[0.6, 1.3]"), "lower arm"),
        (("stretch_step = 30", "stretch_step = 0"), "lower arm"),
        (("stretch = [0.7, 1.4]\nstretch_step", "stretch_step"), "lower arm"),
        (('length = "upper_length"', "length = 100"), "upper arm"),
        (('length = "-lower_length"', 'length = "-upper_length"'), "upper arm"),
        (("upper_length = { mm = 100 }", "upper_length = { mm = 0 }"), "upper arm"),
        (("upper_end = { mm = 12 }", "upper_end = { mm = 12 }\nupper_arm_stretch = { mm = 1 }"), "upper_arm"),
        (('name = "palm"', 'name = "upper arm end"'), "upper arm end"),
        (('name = "wrist", kind', 'name = "lower_arm_stretch", kind'), "lower_arm_stretch"),
    ],
)
def test_what_cannot_stretch_is_refused_by_name(change: tuple[str, str], named: str) -> None:
    text = ARM.replace(*change, 1)
    assert text != ARM
    if "lower_arm_stretch" in change[1]:
        text = text.replace('by = "wrist"', 'by = "lower_arm_stretch"')
    with pytest.raises(BodyError) as refused:
        parse_body(text, "arm", "arm.toml")
    assert named in str(refused.value)


def test_only_the_last_limb_is_an_end_of_the_body() -> None:
    body = arm()
    assert [body.drawn[at].name for at in extremities(body)] == ["palm"]
    assert untaped_lengths(body) == frozenset()
    palm = ARM[ARM.rindex("[[limbs]]") : ARM.index("[dimensions]")]
    bare = parse_body(ARM.replace(palm, ""), "bare", "bare.toml")
    assert [bare.drawn[at].name for at in extremities(bare)] == ["lower arm end"]
    assert untaped_lengths(bare) == {"lower_length"}


def test_bounds_are_edited_as_limits_of_the_parameter() -> None:
    body = arm()
    change = edited(
        body, limits={"upper_arm_stretch.lower": -30.0, "upper_arm_stretch.max_step": 55.0}, title="Other"
    ).body
    limb = definition_of(change).limbs[0]
    assert limb.stretch == pytest.approx((0.7, 1.25))
    entry = next(one for one in change.parameters if one.name == "upper_arm_stretch")
    assert (entry.lower, entry.upper, entry.max_step) == pytest.approx((-30.0, 25.0, 55.0))
    for name, value in (("neutral", 3.0), ("upper", 80.0), ("lower", 1.0)):
        with pytest.raises(BodyError):
            edited(body, limits={f"upper_arm_stretch.{name}": value})


def test_an_animation_moves_what_hangs_on_the_limb() -> None:
    body = arm()
    poses = np.array([bent(body, 90.0, 60.0), bent(body, 125.0, 80.0)])
    skeleton = skeleton_of(body, "neutral")
    moves, turns = skeleton.animated(poses)
    places, rotations = moves.copy(), turns.copy()
    for joint, parent in enumerate(skeleton.tree.parents):
        if parent >= 0:
            places[:, joint] = places[:, parent] + (rotations[:, parent] @ moves[:, joint, :, None])[..., 0]
            rotations[:, joint] = rotations[:, parent] @ turns[:, joint]
    hand = skeleton.names.index("hand")
    np.testing.assert_allclose(places[:, hand], marker_points(body, poses)[:, 2], atol=1e-9)


def test_the_page_of_bodies_has_the_limb_once_and_its_bounds_among_the_limits() -> None:
    body = arm()
    detail = edited_detail(EditedBody(body, body_text(body)))
    assert [limb.name for limb in detail.limbs] == ["upper arm", "lower arm", "palm"]
    assert [limb.length.value for limb in detail.limbs] == [100.0, 60.0, 10.0]
    assert detail.limbs[0].radius_end.value == 12.0
    limits = {one.name: (one.kind, one.lower, one.upper) for one in detail.limits}
    assert limits["lower_arm_stretch"] == ("length", pytest.approx(-18.0), pytest.approx(24.0))
    assert [one.dimension for one in limb_drawings(body)] == ["upper_length"] * 2 + ["lower_length"] * 2 + [
        ""
    ]


def test_mirroring_copies_bounds_to_the_other_side() -> None:
    text = body_text(load_body("dog"))
    dog = load_body("dog")
    own = next(
        limb for limb in definition_of(dog).limbs
        if limb.side == "left" and isinstance(limb.length, str) and "left" in limb.length
    )  # fmt: skip
    name = own.name
    text = text.replace(f'name = "{name}", joint', f'name = "{name}", stretch = [0.9, 1.1], joint')
    body = parse_body(text, "dog", "dog.toml")
    other = name.replace("left", "right")
    mirrored = edited(body, mirror="left").body
    by_name = {limb.name: limb for limb in definition_of(mirrored).limbs}
    assert by_name[other].stretch == (0.9, 1.1)
    limits = {entry.name: (entry.lower, entry.upper) for entry in mirrored.parameters}
    for entry in body.parameters:
        # Nothing else has changed.
        assert limits[entry.name] == (entry.lower, entry.upper)
    again = edited(mirrored, mirror="right").body
    assert definition_of(again) == definition_of(mirrored)
