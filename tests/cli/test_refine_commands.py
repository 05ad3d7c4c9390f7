"""`studio refine`, `studio smooth` and `studio evaluate --track`."""

import json

import pytest
from click.testing import CliRunner

from studio.body.subject import Subject, write_subject
from studio.cli.main import main
from studio.sessions.session import SUBJECT_NAME, Session


@pytest.fixture
def runner(session_on_disk: Session) -> CliRunner:
    runner = CliRunner()
    words = [
        "track",
        "toy",
        "--particles",
        "20",
        "--layers",
        "3",
        "--set",
        "constraints=clamp",
        "--name",
        "one",
    ]
    printed = runner.invoke(main, words)
    assert printed.exit_code == 0, printed.output
    return runner


def test_refine_then_smooth(runner: CliRunner) -> None:
    refined = json.loads(
        runner.invoke(main, ["refine", "toy", "one", "--refinement-steps", "5", "--json"]).stdout
    )
    assert (refined["track"], refined["frames"]) == ("refined", 8)
    assert refined["made_by"]["refinement_steps"] == 5
    assert 0 <= refined["moved"] <= 8
    smoothed = runner.invoke(main, ["smooth", "toy", "one", "--smoothing-frequency", "4", "--json"])
    printed = json.loads(smoothed.stdout)
    assert printed["made_by"]["from"] == "refined"
    assert printed["jitter_after_mm"] <= printed["jitter_before_mm"]
    assert printed["filled"] == []
    again = runner.invoke(main, ["smooth", "toy", "one"])
    assert again.exit_code == 2
    assert "already" in again.stderr
    assert runner.invoke(main, ["smooth", "toy", "one", "--replace"]).exit_code == 0


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (["refine", "toy", "none"], "no run 'none'"),
        (["refine", "toy", "one", "--refinement-steps", "0"], "'refinement_steps' cannot be"),
        (["smooth", "toy", "one", "--from", "nothing"], "no track 'nothing'"),
        (["evaluate", "toy", "one", "--track", "refined"], "has no truth"),
    ],
)
def test_refusals(runner: CliRunner, words: list[str], cause: str) -> None:
    printed = runner.invoke(main, words)
    assert printed.exit_code == 2
    assert cause in " ".join(printed.stderr.split())


def test_a_note_on_the_body_is_said_once_of_a_session_not_at_every_command(session_on_disk: Session) -> None:
    write_subject(
        Subject(body="planar_arm4", lengths_mm={"Root_Nose": 420.0}), session_on_disk.path / SUBJECT_NAME
    )
    words = ["track", "toy", "--particles", "20", "--layers", "2", "--frames", "0:1", "--json"]
    first, second = (CliRunner().invoke(main, words) for _ in range(2))
    assert (first.exit_code, second.exit_code) == (0, 0), first.output + second.output
    assert first.stderr.count("'Root_Nose' was ignored") == 1
    assert "'Root_Nose' was ignored" not in second.stderr
    assert all("'Root_Nose' was ignored" in run.record.notes[0] for run in session_on_disk.runs())
    asked = CliRunner().invoke(main, ["subject", "toy", "--json"])
    assert "'Root_Nose' was ignored" in asked.stderr
