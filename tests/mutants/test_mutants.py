"""What `make mutants` makes of a small package whose tests see one of its two functions."""

import ast
import math
from pathlib import Path

import pytest

from mutants.campaign import Campaign, drawn, table
from mutants.changes import changes
from mutants.rooms import ROOMS, Room

ROOT = Path(__file__).resolve().parents[2]
SOURCE = '''"""Two functions."""

LIMIT = 3


def seen(value: int = 1) -> bool:
    """Whether 2 values are few."""
    return value < LIMIT


def unseen(value: float) -> float:
    if not value:
        raise ValueError(f"{1 + 1}")
    return max(
        value,
        -value,
    )
'''
TEST = """import subprocess
import sys

from toy.room.one import LIMIT


def test_few_are_seen_by_a_process():
    line = "from toy.room.one import seen; print([seen(value) for value in (2, 3, 4)], seen.__defaults__)"
    done = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert done.stdout == "[True, False, False] (1,)\\n"
    assert LIMIT == 3
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for path, text in {
        "pytest.ini": "[pytest]\naddopts = -p no:schemathesis -p no:hypothesispytest\n",
        "toy/__init__.py": "",
        "toy/room/__init__.py": "",
        "toy/room/one.py": SOURCE,
        "toy/room/two.py": "from toy.room.one import LIMIT\n\nTWICE = 2 * LIMIT\n",
        "tests/room/test_one.py": TEST,
        "tests/room/built.py": "from toy.room.one import seen\n\nMADE = seen()\n",
        "tests/room/test_made.py": "from built import MADE\n\n\ndef test_made():\n    assert MADE\n",
        "tests/room/test_both.py": "from toy.room.two import TWICE\n\n\ndef test_twice():\n    assert TWICE\n",
    }.items():
        file = tmp_path / "checkout" / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (tmp_path / "kept").mkdir()
    return tmp_path / "checkout"


def test_what_its_tests_see_is_killed_and_the_rest_survives(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    equivalent = checkout / "equivalent.toml"
    equivalent.write_text(
        '[[equivalent]]\nfile = "toy/room/one.py"\nline = "-value,"\nchange = "-value -> (value)"\nwhy = "it is"\n'
    )
    room = Room(checkout, "room", "toy")
    options = {"count": 20, "seed": 0, "again": False, "whole": False}
    campaign = Campaign(checkout, checkout.parent / "kept", "toy", equivalent)
    tally = campaign.run(room, until=math.inf, **options)
    assert tally.equivalent == 1
    assert {one.words for one in tally.survived} == {
        "2 * LIMIT -> (2 + LIMIT)",
        "2 -> 3",
        "not value -> value",
        "max( value, -value, ) -> min(value, -value)",
    }
    assert tally.possible == tally.drawn == tally.killed + 1 + len(tally.survived)
    assert (checkout / "toy/room/one.py").read_text() == SOURCE
    assert "toy/room/one.py:12: not value -> value" in table({"room": tally})
    capsys.readouterr()
    # What became of each is kept: nothing is tried in a second go.
    later = Campaign(checkout, checkout.parent / "kept", "toy", equivalent).run(
        room, until=-math.inf, **options
    )
    assert later == tally
    assert capsys.readouterr().err == ""


def test_changes_are_one_at_a_time_and_can_be_read() -> None:
    found = {one.words: one for one in changes("one.py", SOURCE)}
    assert set(found) == {
        "3 -> 4",
        "1 -> 2",
        "value < LIMIT -> value <= LIMIT",
        "value < LIMIT -> value > LIMIT",
        "not value -> value",
        "max( value, -value, ) -> min(value, -value)",
        "-value -> (value)",
    }
    for one in found.values():
        ast.parse(one.applied(SOURCE))
    assert "value <= LIMIT" in found["value < LIMIT -> value <= LIMIT"].applied(SOURCE)


def test_the_order_of_drawing_outlives_changes_elsewhere() -> None:
    every = changes("one.py", SOURCE)
    longer = changes("one.py", SOURCE.replace("LIMIT = 3", "LIMIT = 3\nOTHER = 7\n"))
    words = [one.words for one in drawn(every, 0)]
    assert words == [one.words for one in drawn(longer, 0) if one.words != "7 -> 8"]
    assert words != [one.words for one in drawn(every, 1)]


def test_a_change_is_shown_to_the_tests_that_import_its_file(checkout: Path) -> None:
    room = Room(checkout, "room", "toy")
    nearest = ["tests/room/test_one.py", "tests/room/test_made.py"]
    assert room.tests_of("toy/room/one.py") == nearest
    assert room.tests_of("toy/room/one.py", whole=True) == [*nearest, "tests/room/test_both.py"]
    assert room.tests_of("toy/room/two.py") == ["tests/room/test_both.py"]


def test_every_science_room_has_changes_that_its_tests_reach() -> None:
    for name in ROOMS:
        room = Room(ROOT, name)
        assert any(room.tests_of(source) for source in room.sources()), name
