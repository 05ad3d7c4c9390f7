"""`studio refine`, `studio smooth` and `studio evaluate --track`."""

import pytest
from command_line import answer_of, call, refusal_of

from studio.body.subject import Subject, write_subject
from studio.sessions.session import SUBJECT_NAME, Session


@pytest.fixture
def tracked(session_on_disk: Session) -> None:
    call("track toy --particles 20 --layers 3 --set constraints=clamp --name one")


@pytest.mark.usefixtures("tracked")
def test_refine_then_smooth() -> None:
    refined = answer_of("refine toy one --refinement-steps 5")
    assert (refined["track"], refined["frames"]) == ("refined", 8)
    assert refined["made_by"]["refinement_steps"] == 5
    assert 0 <= refined["moved"] <= 8
    printed = answer_of("smooth toy one --smoothing-frequency 4")
    assert printed["made_by"]["from"] == "refined"
    assert printed["jitter_after_mm"] <= printed["jitter_before_mm"]
    assert printed["filled"] == []
    assert "already" in refusal_of("smooth toy one")
    call("smooth toy one --replace")


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        ("refine toy none", "no run 'none'"),
        ("refine toy one --refinement-steps 0", "'refinement_steps' cannot be"),
        ("smooth toy one --from nothing", "no track 'nothing'"),
        ("evaluate toy one --track refined", "has no truth"),
    ],
)
@pytest.mark.usefixtures("tracked")
def test_refusals(line: str, cause: str) -> None:
    assert cause in refusal_of(line)


def test_a_note_on_the_body_is_said_once_of_a_session_not_at_every_command(session_on_disk: Session) -> None:
    write_subject(
        Subject(body="planar_arm4", lengths_mm={"Root_Nose": 420.0}), session_on_disk.path / SUBJECT_NAME
    )
    first, second = (call("track toy --particles 20 --layers 2 --frames 0:1 --json") for _ in range(2))
    assert first.stderr.count("'Root_Nose' was ignored") == 1
    assert "'Root_Nose' was ignored" not in second.stderr
    assert all("'Root_Nose' was ignored" in run.record.notes[0] for run in session_on_disk.runs())
    asked = call("subject toy --json")
    assert "'Root_Nose' was ignored" in asked.stderr
