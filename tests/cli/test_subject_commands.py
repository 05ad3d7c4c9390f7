"""`studio subjects`, `studio together`, `studio landmarks`, `studio background --subject-at`."""

from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from two_people import TwoPeople, two_people

from studio.sessions.session import Session


@pytest.fixture
def people(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> TwoPeople:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path))
    return two_people(tmp_path / "two", 2)


def test_who_is_in_view_is_listed_and_each_gets_a_session(people: TwoPeople) -> None:
    seen = answer_of("subjects two")["seen"]
    assert len(seen) == 2
    places = [f"{x},{y}" for x, y in people.places()]
    made = answer_of("subjects two --at", places[0], "--at", places[1], "--into", "ann", "--into", "bob")
    assert made["sessions"] == ["ann", "bob"]
    assert "ann" in refusal_of("subjects two --at", places[0], "--into", "ann")
    done = answer_of("together ann --beside bob")
    assert done["bodies"] == 2


@pytest.mark.parametrize(
    ("height", "meant"),
    [
        ("164.5", "looks like centimetres: write 1645."),
        ("1.7", "looks like metres: write 1700."),
        ("20", "mm."),
    ],
)
def test_a_height_of_another_unit_is_named(session_on_disk: Session, height: str, meant: str) -> None:
    said = refusal_of("subject toy --height", height)
    assert f"{height} mm is not from 300 to 3000 mm" in said
    assert meant in said
    assert "is not a valid float" in refusal_of("subject toy --height tall")


@pytest.mark.slow
def test_masks_of_several_are_said_to_be_so_and_cut(people: TwoPeople) -> None:
    said = call("background two")
    assert "2 subjects are in view" in said.stdout
    x, y = people.places()[0]
    cut = answer_of("background two --subject-at", f"{x},{y}")
    assert cut["subjects"] == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("background", "two", "--subject-at", "here"), "Write x and y"),
        (("background", "two", "--subject-at", "1,2,3"), "Write x and y"),
        (("background", "two", "--source", "subject"), "Nobody was chosen"),
        (("subjects", "two", "--at", "0.4"), "Write x and y"),
        (("subjects", "two", "--at", "9,9"), "Nobody stands at 9,9"),
        (("landmarks", "two", "joints.csv"), "Call it 'joints.trc'"),
        (("together", "two"), "--beside"),
        (("together", "two", "--beside", "two"), "named twice"),
        (("together", "two", "--beside", "nowhere"), "no session 'nowhere'"),
    ],
)
def test_what_cannot_be_is_said(people: TwoPeople, arguments: tuple[str, ...], words: str) -> None:
    assert words in refusal_of(*arguments)
