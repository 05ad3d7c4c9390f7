from pathlib import Path

import pytest

from studio.body.dimensions import with_dimensions
from studio.body.model import MOVE, TURN, Step
from studio.body.reader import parse_body, read_body
from studio.foundations.errors import BodyError

CRANE = """
title = "Crane"
parameters = [
    { name = "swing", kind = "angle", limb = "base", lower = -90, upper = 90, max_step = 30 },
    { name = "lift", kind = "angle", limb = "arm", max_step = 30 },
]
joints = [
    { name = "base", parent = "world", type = "hinge", sequence = [{ turn = "z", by = "swing" }] },
    { name = "arm", parent = "base", type = "hinge", sequence = [
        { move = "z", by = "boom" }, { turn = "x", by = 90 }, { turn = "y", by = "-lift" },
    ] },
    { name = "hook", parent = "arm", type = "fixed", sequence = [{ move = "z", by = -20 }] },
]
limbs = [
    { name = "arm", joint = "arm", length = "-boom", radius_start = "fat", radius_end = 20, scale_x = "s" },
]
markers = [{ name = "Hook", joint = "hook", at = [0, "-boom", 5] }]

[dimensions]
boom = { mm = 300 }
fat = { mm = 40 }
s = { ratio = 0.5 }
"""

# The same crane on rails: its base is free, and its rest place depends on the boom.
RAILS = CRANE.replace(
    'type = "hinge", sequence = [{ turn = "z", by = "swing" }]',
    """type = "free", sequence = [
        { move = "x", by = "reach" }, { move = "y", by = "my" }, { move = "z", by = "mz" },
        { turn = "z", by = "swing" }, { turn = "x", by = "tx" }, { turn = "y", by = "ty" },
    ]""",
).replace(
    "parameters = [",
    """parameters = [
    { name = "reach", kind = "length", limb = "base", upper = 900, neutral = [100, "boom"], max_step = 50 },
    { name = "my", kind = "length", limb = "base", max_step = 1 },
    { name = "mz", kind = "length", limb = "base", max_step = 1 },
    { name = "tx", kind = "angle", limb = "base", max_step = 1 },
    { name = "ty", kind = "angle", limb = "base", max_step = 1 },""",
)


def test_steps_limbs_and_markers_are_looked_up() -> None:
    body = parse_body(CRANE, "crane", "crane.toml")
    assert [joint.parent for joint in body.joints] == [-1, 0, 1]
    assert body.joints[1].steps == (
        Step(MOVE, 2, -1, 300.0),
        Step(TURN, 0, -1, pytest.approx(1.5707963267948966)),
        Step(TURN, 1, 1, -1.0),
    )
    limb = body.limbs[0]
    assert (limb.length, limb.radius_start, limb.radius_end, limb.scale_x, limb.scale_y) == (
        -300,
        40,
        20,
        0.5,
        1,
    )
    assert body.markers[0].offset.tolist() == [0.0, -300.0, 5.0]
    assert body.parameters[0].upper == pytest.approx(1.5707963267948966)
    assert body.parameters[1].upper == float("inf")


def test_other_dimensions_rebuild_everything_that_names_them() -> None:
    body = parse_body(CRANE, "crane", "crane.toml")
    longer = with_dimensions(body, {"boom": 500.0, "s": 0.25})
    assert longer.limbs[0].length == -500.0
    assert longer.limbs[0].scale_x == 0.25
    assert longer.joints[1].steps[0].value == 500.0
    assert longer.markers[0].offset[1] == -500.0
    assert longer.limbs[0].radius_start == 40.0
    assert body.limbs[0].length == -300.0


@pytest.mark.parametrize(("changes", "words"), [
    ({"mast": 3.0}, "no dimension 'mast'"),
    ({"boom": float("nan")}, "'boom' cannot be nan"),
    ({"boom": -1.0}, "'boom' cannot be -1"),
])  # fmt: skip
def test_wrong_dimensions_are_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(BodyError, match=words):
        with_dimensions(parse_body(CRANE, "crane", "crane.toml"), changes)


# What is replaced in the crane, by what, and what the message must say.
FAULTS = [
    ('parent = "base"', 'parent = "mast"', ("joint 'arm'", "unknown parent 'mast'")),
    ('parent = "base"', 'parent = "hook"', ("joint 'arm'", "comes before its parent 'hook'")),
    ('parent = "base"', 'parent = "arm"', ("joint 'arm'", "comes before its parent 'arm'")),
    ('by = "-lift"', 'by = "-lfit"', ("joint 'arm', step 3", "unknown parameter 'lfit'")),
    ('by = "boom" }', 'by = "mast" }', ("joint 'arm', step 1", "unknown parameter or dimension 'mast'")),
    ('by = "boom" }', 'by = "s" }', ("joint 'arm', step 1", "a ratio")),
    ('by = "boom" }', 'by = "lift" }', ("joint 'arm', step 1", "kind 'length'")),
    ("by = 90 }", "by = inf }", ("joint 'arm', step 2", "goes by inf")),
    ('turn = "x", by = 90', "by = 90", ("joint 'arm', step 2", "exactly one of move and turn")),
    ('turn = "x", by = 90', 'turn = "w", by = 90', ("joint 'arm'", "Invalid enum value 'w'")),
    (
        '"arm", parent = "base", type = "hinge"',
        '"arm", parent = "base", type = "ball"',
        ("joint 'arm'", "is 'ball'"),
    ),
    ('name = "hook", parent', 'name = "arm", parent', ("joint 'arm'", "declared 2 times")),
    ('name = "lift"', 'name = "swing"', ("parameter 'swing'", "declared 2 times")),
    ('name = "lift"', 'name = "boom"', ("'boom'", "both a parameter and a dimension")),
    (
        "lower = -90, upper = 90",
        "lower = 90, upper = -90",
        ("parameter 'swing'", "lower 90 not below upper -90"),
    ),
    ("lower = -90", "lower = nan", ("parameter 'swing'", "lower nan")),
    ("lower = -90", "lower = 10", ("parameter 'swing'", "neutral 0 outside its limits 10 to 90")),
    ('limb = "arm", max_step = 30', 'limb = "arm", max_step = 0', ("parameter 'lift'", "max_step 0")),
    (', by = "-lift"', ", by = 3", ("joint 'arm'", "is 'hinge'")),
    (
        'kind = "angle", limb = "arm"',
        'kind = "turn", limb = "arm"',
        ("parameter 'lift'", "Invalid enum value 'turn'"),
    ),
    (
        'kind = "angle", limb = "arm", ',
        'limb = "arm", ',
        ("parameter 'lift'", "missing required field 'kind'"),
    ),
    ("radius_end = 20", 'radius_end = "thin"', ("limb 'arm'", "unknown dimension")),
    ("radius_end = 20", "radius_end = -2", ("limb 'arm'", "negative radius_end")),
    ("radius_end = 20", "radius_end = nan", ("limb 'arm'", "radius_end nan")),
    ("radius_end = 20", "radius = 20", ("limb 'arm'", "unknown field 'radius'")),
    ('scale_x = "s"', "scale_x = 0", ("limb 'arm'", "scale_x 0")),
    ('scale_x = "s"', 'scale_x = "fat"', ("limb 'arm'", "a length")),
    ('joint = "arm", length', 'joint = "leg", length', ("limb 'arm'", "unknown joint 'leg'")),
    ('joint = "hook", at', 'joint = "hok", at', ("marker 'Hook'", "unknown joint 'hok'")),
    ('at = [0, "-boom", 5]', "at = [0, 5]", ("marker 'Hook'", "length 3")),
    ("boom = { mm = 300 }", "boom = { mm = nan }", ("dimension 'boom'", "is nan")),
    ("boom = { mm = 300 }", "boom = { mm = -1 }", ("dimension 'boom'", "is -1")),
    (
        "boom = { mm = 300 }",
        "boom = { mm = 300, ratio = 1 }",
        ("dimension 'boom'", "exactly one of mm and ratio"),
    ),
    ("boom = { mm = 300 }", "boom = { mm = 300, of_height = 3 }", ("dimension 'boom'", "of_height 3")),
    ('title = "Crane"', "title = Crane", ("is not valid TOML",)),
    ('title = "Crane"', 'colour = "red"', ("unknown field 'colour'",)),
    (
        'title = "Crane"',
        'shape_order = ["mast"]\ntitle = "Crane"',
        ("shape_order", "unknown dimension 'mast'"),
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), FAULTS)
def test_a_fault_is_named_with_file_entry_and_remedy(old: str, new: str, words: tuple[str, ...]) -> None:
    text = CRANE
    assert old in text
    with pytest.raises(BodyError) as caught:
        parse_body(text.replace(old, new), "crane", "crane.toml")
    assert "crane.toml" in caught.value.message
    for word in words:
        assert word in caught.value.message
    assert caught.value.hint.endswith((".", "}."))


@pytest.mark.parametrize(
    "word",
    ["max_step = 30 }", 'type = "fixed", ', '{ turn = "x", by = 90 }', "radius_end = 20, ", "at = [0,"],
)
def test_a_word_that_no_table_has_is_named(word: str) -> None:
    assert word in CRANE
    start = "{ " if word.startswith("{ ") else ""
    with pytest.raises(BodyError, match="colour"):
        parse_body(
            CRANE.replace(word, f'{start}colour = "red", {word.removeprefix(start)}', 1),
            "crane",
            "crane.toml",
        )


def test_a_joint_has_each_of_its_parameters_once() -> None:
    text = CRANE.replace(
        '{ turn = "z", by = "swing" }', '{ turn = "z", by = "swing" }, { turn = "z", by = "swing" }'
    )
    with pytest.raises(BodyError, match="each once"):
        parse_body(text, "crane", "crane.toml")


def test_a_mesh_that_cannot_be_read_is_refused() -> None:
    text = CRANE.replace(
        "markers =", 'meshes = [{ joint = "arm", points = "eJw=", triangles = "eJw=" }]\nmarkers ='
    )
    with pytest.raises(BodyError, match="mesh 1 cannot be read"):
        parse_body(text, "crane", "crane.toml")


def test_parameters_of_one_limb_must_be_neighbours() -> None:
    text = RAILS.replace(
        'name = "mz", kind = "length", limb = "base"', 'name = "mz", kind = "length", limb = "mast"'
    )
    with pytest.raises(BodyError, match="parameter 'tx' is apart from the other parameters of limb 'base'"):
        parse_body(text, "crane", "crane.toml")


def test_a_parameter_that_moves_nothing_is_refused() -> None:
    text = CRANE.replace(
        "parameters = [", RAILS[RAILS.index("parameters = [") : RAILS.index('    { name = "my"')]
    )
    with pytest.raises(BodyError, match="parameter 'reach' moves no joint"):
        parse_body(text, "crane", "crane.toml")


def test_a_rest_value_is_a_sum_of_numbers_and_dimensions() -> None:
    body = parse_body(RAILS, "crane", "crane.toml")
    assert body.neutral[0] == 400.0
    assert with_dimensions(body, {"boom": 350.0}).neutral[0] == 450.0


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "crane.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BodyError, match="is not a body file"):
        read_body(path)
