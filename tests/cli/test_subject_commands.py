"""`studio subjects`, `studio together`, `studio background --subject-at`."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from two_people import TwoPeople, two_people

from studio.cli.main import main


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments), catch_exceptions=False)


@pytest.fixture
def people(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> TwoPeople:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path))
    return two_people(tmp_path / "two", 2)


def test_who_is_in_view_is_listed_and_each_gets_a_session(people: TwoPeople) -> None:
    seen = json.loads(run("subjects", "two", "--json").stdout)["seen"]
    assert len(seen) == 2
    places = [f"{x},{y}" for x, y in people.places()]
    made = run(
        "subjects", "two", "--at", places[0], "--at", places[1], "--into", "ann", "--into", "bob", "--json"
    )
    assert made.exit_code == 0, made.stderr
    assert json.loads(made.stdout)["sessions"] == ["ann", "bob"]
    again = run("subjects", "two", "--at", places[0], "--into", "ann")
    assert again.exit_code == 2
    assert "ann" in again.stderr
    done = run("together", "ann", "--beside", "bob", "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["bodies"] == 2


@pytest.mark.slow
def test_masks_of_several_are_said_to_be_so_and_cut(people: TwoPeople) -> None:
    said = run("background", "two")
    assert "2 subjects are in view" in said.stdout
    x, y = people.places()[0]
    cut = run("background", "two", "--subject-at", f"{x},{y}", "--json")
    assert cut.exit_code == 0, cut.stderr
    assert json.loads(cut.stdout)["subjects"] == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("background", "two", "--subject-at", "here"), "Write x and y"),
        (("background", "two", "--subject-at", "1,2,3"), "Write x and y"),
        (("background", "two", "--source", "subject"), "Nobody was chosen"),
        (("subjects", "two", "--at", "0.4"), "Write x and y"),
        (("subjects", "two", "--at", "9,9"), "Nobody stands at 9,9"),
        (("together", "two"), "--beside"),
        (("together", "two", "--beside", "two"), "named twice"),
        (("together", "two", "--beside", "nowhere"), "no session 'nowhere'"),
    ],
)
def test_what_cannot_be_is_said(people: TwoPeople, arguments: tuple[str, ...], words: str) -> None:
    refused = run(*arguments)
    assert refused.exit_code == 2
    assert words in refused.stderr
