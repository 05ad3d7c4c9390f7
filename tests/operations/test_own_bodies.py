"""A body of one's own: made of another by a verb or a command, saved, and used at once."""

from pathlib import Path

import pytest
from command_line import call, refusal_of
from toy_session import make_session

import studio
from studio.body.catalogue import load_body
from studio.foundations.errors import BodyError
from studio.operations.own_bodies import discard_body
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@pytest.fixture(autouse=True)
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path))
    return tmp_path


def test_a_body_is_changed_saved_and_chosen_for_a_session(workspace: Path) -> None:
    session = make_session(workspace / "toy")
    made = studio.edit_body("mouse", sizes={"loin_length": 30.0, "rump.radius_start": 25.0}, save_as="rat")
    assert made.file == workspace / "bodies" / "rat.toml"
    assert studio.subject("toy", body="rat").dimensions["loin_length"] == 30.0
    opened = Session(session.path if isinstance(session, Session) else workspace / "toy")
    assert opened.manifest.body == "rat"
    assert opened.body().dimensions["rump_radius_start"] == 25.0


def test_a_sessions_own_body_begins_in_the_size_of_its_subject(workspace: Path) -> None:
    make_session(workspace / "toy")
    studio.subject("toy", 1900.0, body="human29")
    sized = studio.open_session("toy").body()
    made = studio.edit_body("human29", session="toy", save_as="tall")
    assert made.file == workspace / "toy" / "bodies" / "tall.toml"
    assert made.body.dimensions == pytest.approx(sized.dimensions)
    assert made.body.dimensions != load_body("human29").dimensions
    chosen = studio.subject("toy", body="tall")
    assert chosen.name == "tall"


def test_a_body_alone_is_as_large_as_its_file_says_and_the_measures_before_are_kept(workspace: Path) -> None:
    make_session(workspace / "toy")
    studio.subject("toy", 1900.0, body="human31", lengths_mm={"LHip_LKnee": 480.0})
    before = (workspace / "toy" / "subject.toml").read_text()
    made = studio.edit_body("human31", session="toy", sizes={"left thigh.length": 450.0}, save_as="walker")
    assert studio.subject("toy", body="walker").dimensions == made.body.dimensions
    assert studio.open_session("toy").body().dimensions == made.body.dimensions
    assert (workspace / "toy" / "subject-before.toml").read_text() == before


def test_names_that_are_taken_are_refused_until_they_are_replaced() -> None:
    studio.edit_body("mouse", save_as="rat")
    with pytest.raises(BodyError, match="already"):
        studio.edit_body("mouse", save_as="rat")
    again = studio.edit_body("mouse", title="A rat", save_as="rat", replace=True)
    assert again.body.title == "A rat"
    with pytest.raises(BodyError, match="shipped"):
        studio.edit_body("mouse", save_as="mouse", replace=True)
    with pytest.raises(studio.StudioError, match="name"):
        studio.edit_body("mouse", save_as="../rat")


def test_a_body_in_use_is_not_thrown_away(workspace: Path) -> None:
    make_session(workspace / "toy")
    studio.edit_body("mouse", save_as="rat")
    studio.subject("toy", body="rat")
    with pytest.raises(BodyError, match="toy"):
        discard_body(Workspace(), None, "rat")
    studio.subject("toy", body="mouse")
    place = discard_body(Workspace(), None, "rat")
    assert place.is_file()
    assert not (workspace / "bodies" / "rat.toml").exists()


def test_the_command_does_what_the_verb_does(workspace: Path) -> None:
    size = ("--size", "left haunch.radius_start=13")
    call("edit-body mouse --limit left_haunch_swing.upper=90 --mirror left --as rat", *size)
    rat = load_body("rat", (workspace / "bodies",))
    assert rat.dimensions["haunch_radius_start"] == 13.0
    assert "right_haunch_swing" in (workspace / "bodies" / "rat.toml").read_text()
    shown = call("edit-body", workspace / "bodies" / "rat.toml")
    assert shown.output.strip() == (workspace / "bodies" / "rat.toml").read_text().strip()
    assert "loin_length" in refusal_of("edit-body mouse --size loin_length=-3")
