from pathlib import Path

import numpy as np
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
    ("boom = { mm = 300 }", "boom = { mm = 300, of_height = 1.2 }", ("dimension 'boom'", "of_height 1.2")),
    ("boom = { mm = 300 }", "boom = { }", ("dimension 'boom'", "exactly one of mm and ratio")),
    ("boom = { mm = 300 }", "boom = { mm = 300, spread = 0 }", ("dimension 'boom'", "spread 0")),
    ("boom = { mm = 300 }", "boom = { mm = 300, spread = inf }", ("dimension 'boom'", "spread inf")),
    ("boom = { mm = 300 }", "boom = { mm = inf, spread = 1 }", ("dimension 'boom'", "is inf")),
    ("boom = { mm = 300 }", "boom = { mm = 300, of_height = -0.1 }", ("dimension 'boom'", "of_height -0.1")),
    ("boom = { mm = 300 }", "boom = { mm = 300, of_height = nan }", ("dimension 'boom'", "of_height nan")),
    (
        "s = { ratio = 0.5 }",
        "s = { ratio = 0.5, of_height = 0.1 }",
        ("dimension 's'", "a ratio with of_height"),
    ),
    ("s = { ratio = 0.5 }", "s = { ratio = -0.5, spread = 1 }", ("dimension 's'", "is -0.5")),
    ("s = { ratio = 0.5 }", "s = { ratio = 0 }", ("limb 'arm'", "scale_x 0")),
    ('scale_x = "s"', 'scale_x = "thin"', ("limb 'arm'", "scale_x 'thin'")),
    ('scale_x = "s"', "scale_y = -1", ("limb 'arm'", "scale_y -1")),
    ('radius_start = "fat"', 'radius_start = "-fat"', ("limb 'arm'", "negative radius_start")),
    ('radius_start = "fat"', 'radius_start = "s"', ("limb 'arm'", "'s', a ratio")),
    ("lower = -90", "lower = 90", ("parameter 'swing'", "lower 90 not below upper 90")),
    ("upper = 90", "upper = nan", ("parameter 'swing'", "upper nan")),
    ("upper = 90", "neutral = nan", ("parameter 'swing'", "neutral nan")),
    ("upper = 90", "neutral = inf", ("parameter 'swing'", "neutral inf outside")),
    ("upper = 90", "upper = 90, neutral = 91", ("parameter 'swing'", "neutral 91 outside")),
    ("upper = 90", 'neutral = [0, "mast"]', ("parameter 'swing'", "unknown dimension")),
    ("upper = 90", "spread = 0", ("parameter 'swing'", "spread 0")),
    ("upper = 90", "spread = nan", ("parameter 'swing'", "spread nan")),
    ('limb = "arm", max_step = 30', 'limb = "arm", max_step = inf', ("parameter 'lift'", "max_step inf")),
    (
        'turn = "x", by = 90',
        'turn = "x", move = "x", by = 90',
        ("arm', step 2", "exactly one of move and turn"),
    ),
    ('turn = "x", by = 90', 'turn = "x", by = "boom"', ("arm', step 2", "unknown parameter 'boom'")),
    (
        'turn = "y", by = "-lift"',
        'move = "y", by = "-lift"',
        ("arm', step 3", "needs a parameter of kind 'length'"),
    ),
    ('at = [0, "-boom", 5]', 'at = [0, 5, "-mast"]', ("marker 'Hook'", "'-mast', an unknown dimension")),
    ('at = [0, "-boom", 5]', "at = [0, inf, 5]", ("marker 'Hook'", "at inf")),
    ('name = "hook", parent', "parent", ("joint 'number 3'", "missing required field 'name'")),
    ('name = "swing"', 'name = "2swing"', ("parameter '2swing'", "is no name")),
    ('name = "Hook"', 'name = "Ho-ok"', ("marker 'Ho-ok'", "is no name")),
    ('name = "hook", parent', 'name = "world", parent', ("joint 'world'", "the fixed frame")),
    (
        "[dimensions]",
        'meshes = [{ joint = "leg", points = "", triangles = "" }]\n[dimensions]',
        ("mesh 1", "'leg'"),
    ),
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
    ("old", "new", "names"),
    [
        ('turn = "y", by = "-lift"', 'turn = "y", by = "-lfit"', "swing, lift"),
        ('by = "boom" }', 'by = "mast" }', "boom, fat, s"),
        ('parent = "base"', 'parent = "mast"', "world, base"),
        ('joint = "arm", length', 'joint = "leg", length', "base, arm, hook"),
        ("radius_end = 20", 'radius_end = "thin"', "boom, fat, s"),
    ],
)
def test_beside_an_unknown_name_stand_those_that_may_be_meant(old: str, new: str, names: str) -> None:
    with pytest.raises(BodyError) as caught:
        parse_body(CRANE.replace(old, new), "crane", "crane.toml")
    assert caught.value.hint == f"Name one of: {names}."


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("boom = { mm = 300 }", "boom = { mm = 0, of_height = 0 }"),
        ("boom = { mm = 300 }", "boom = { mm = 300, of_height = 1 }"),
        ("boom = { mm = 300 }", "boom = { mm = -300, spread = 10 }"),
        ("radius_end = 20", "radius_end = 0"),
        ("lower = -90", "lower = -90, neutral = -90"),
        ("lower = -90", "lower = -90, neutral = 90"),
    ],
)
def test_what_lies_on_the_limit_of_what_may_be_is_read(old: str, new: str) -> None:
    parse_body(CRANE.replace(old, new), "crane", "crane.toml")


@pytest.mark.parametrize("group", ["parameters", "joints", "limbs"])
def test_a_body_without_one_of_its_parts_is_refused(group: str) -> None:
    start = CRANE.index(f"{group} = [")
    end = CRANE.index("\n]", start) + 2
    with pytest.raises(BodyError, match="no parameters, joints or limbs"):
        parse_body(f"{CRANE[:start]}{group} = []{CRANE[end:]}", "crane", "crane.toml")


DRIVEN = {
    (0, 0): "fixed",
    (1, 0): "hinge",
    (2, 0): "two-axis",
    (3, 0): "ball",
    (0, 1): "slide",
    (3, 3): "free",
}


@pytest.mark.parametrize("kind", DRIVEN.values())
def test_a_joints_type_says_how_many_angles_and_lengths_drive_it(kind: str) -> None:
    for angles in range(5):
        for lengths in range(5):
            steps = [
                *(("turn", f"a{at}") for at in range(angles)),
                *(("move", f"l{at}") for at in range(lengths)),
            ]
            driven = ", ".join(f'{{ {word} = "x", by = "{name}" }}' for word, name in steps)
            kinds = {"turn": "angle", "move": "length"}
            more = "".join(
                f'{{ name = "{name}", kind = "{kinds[word]}", limb = "hook", max_step = 1 }},\n'
                for word, name in steps
            )
            text = CRANE.replace(
                '"hook", parent = "arm", type = "fixed"', f'"hook", parent = "arm", type = "{kind}"'
            )
            text = text.replace('{ move = "z", by = -20 }', driven).replace(
                "\n]\njoints", f"\n{more}]\njoints"
            )
            if DRIVEN.get((angles, lengths)) == kind:
                assert len(parse_body(text, "crane", "crane.toml").parameters) == 2 + angles + lengths
            else:
                with pytest.raises(BodyError, match=f"joint 'hook' is '{kind}'"):
                    parse_body(text, "crane", "crane.toml")


def test_angles_become_radians_and_lengths_stay() -> None:
    entry = 'label = "Reach", lower = -4, upper = 900, neutral = [100, "-fat"], spread = 7, max_step = 50'
    turned = "lower = -10, upper = 20, neutral = 5, spread = 4, max_step = 30"
    text = RAILS.replace('upper = 900, neutral = [100, "boom"], max_step = 50', entry)
    text = text.replace(
        'name = "lift", kind = "angle", limb = "arm", max_step = 30',
        f'name = "lift_it", kind = "angle", limb = "arm", {turned}',
    )
    text = text.replace('"-lift"', '"-lift_it"').replace(
        "scale_x", 'side = "left", part = "head", scale_y = 2, scale_x'
    )
    body = parse_body(text, "crane", "crane.toml")
    reach, lift = body.parameters[0], body.parameters[-1]
    assert (reach.label, reach.kind, reach.limb) == ("Reach", "length", "base")
    assert (reach.lower, reach.upper, reach.neutral, reach.spread, reach.max_step) == (-4, 900, 60, 7, 50)
    assert (lift.label, lift.kind, lift.limb) == ("lift it", "angle", "arm")
    found = (lift.lower, lift.upper, lift.neutral, lift.spread, lift.max_step)
    np.testing.assert_allclose(found, np.radians([-10.0, 20.0, 5.0, 4.0, 30.0]))
    assert (body.name, body.title, body.limbs[0].name, body.limbs[0].joint) == ("crane", "Crane", "arm", 1)
    assert (body.limbs[0].side, body.limbs[0].part, body.limbs[0].scale_y) == ("left", "head", 2.0)
    assert (body.markers[0].name, body.markers[0].joint) == ("Hook", 2)
    assert body.joints[0].steps[:4] == (
        Step(MOVE, 0, 0, 1),
        Step(MOVE, 1, 1, 1),
        Step(MOVE, 2, 2, 1),
        Step(TURN, 2, 5, 1),
    )


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
