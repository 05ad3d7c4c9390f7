"""`studio reproduce` as it is typed."""

import json
import sys
from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from toy_experiments import toy

from studio.cli import reproduction_commands
from studio.garden.reproduction import catalogue
from studio.garden.reproduction import runner as reproduction
from studio.sessions.workspace import workspace_root


@pytest.fixture(autouse=True)
def _toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = {
        "toy-good": toy("toy-good", tmp_path / "log"),
        "toy-bad": toy("toy-bad", tmp_path / "log", seed0="refuse"),
    }
    monkeypatch.setattr(reproduction_commands, "EXPERIMENTS", known)
    monkeypatch.setattr(
        reproduction_commands, "find_experiments", lambda name: catalogue.find_experiments(name, known)
    )


@pytest.mark.slow
def test_a_stranger_sees_what_there_is_and_what_was_found(tmp_path: Path) -> None:
    assert "toy-good  (not run yet)" in call("reproduce list").stdout
    found = call("reproduce toy-good --seeds 2 --processes 1")
    assert "toy-good: undecided, not firm" in found.stdout
    assert "error, plain: 40." in found.stdout
    assert "4 trials run, 0 kept from before, 0 failed." in found.stdout
    report = workspace_root() / "reproduction" / "report.html"
    assert f"Report: {report}" in found.stdout
    assert report.is_file()
    assert "toy-good  (undecided, not firm)" in call("reproduce list").stdout
    listed = answer_of("reproduce list")["experiments"]
    assert [(line["name"], line["verdict"]) for line in listed] == [
        ("toy-good", "undecided"),
        ("toy-bad", None),
    ]


@pytest.mark.slow
def test_json_is_one_object_and_failures_have_an_exit_code(tmp_path: Path) -> None:
    found = call("reproduce all --quick --seeds 1 --processes 1 --out", tmp_path / "here", "--json", code=1)
    printed = json.loads(found.stdout)
    assert printed["out"] == str(tmp_path / "here")
    assert printed["trials"] == {"measured": 2, "kept": 0, "failed": 2}
    assert [document["verdict"] for document in printed["experiments"]] == ["better", "failed"]
    assert printed["experiments"][0]["quick"] is True


def test_wrong_calls_are_reported_a_remedy(tmp_path: Path) -> None:
    found = refusal_of("reproduce toy-goof")
    assert "There is no experiment 'toy-goof'." in found
    assert "Did you mean toy-good" in found
    refusal_of("reproduce toy-good --seeds 0")
    (tmp_path / "file").write_text("")
    refusal_of("reproduce toy-good --out", tmp_path / "file")


def test_after_ctrl_c_it_is_said_how_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(reproduction, "run_jobs", interrupted)
    monkeypatch.setattr(sys, "argv", ["studio", "reproduce", "toy-good", "--seeds", "2"])
    found = call("reproduce toy-good --seeds 2", code=130)
    assert "Go on with: studio reproduce toy-good --seeds 2" in found.stderr
    assert (workspace_root() / "reproduction" / "report.html").is_file()


@pytest.mark.slow
def test_findings_go_into_the_guide_with_commits_that_exist(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    guide = tmp_path / "guide"
    monkeypatch.setattr(reproduction_commands, "guide_folder", lambda: guide)
    monkeypatch.setattr(reproduction, "commit", lambda: "0123456789ab with changes")
    wanted = ("toy-good", "--seeds", "2", "--processes", "1", "--into-guide")
    assert "cite no commit that exists" in refusal_of("reproduce", *wanted)
    assert not guide.exists()
    monkeypatch.setattr(reproduction, "commit", lambda: "0123456789ab")
    call("reproduce", *wanted, "--out", tmp_path / "anew")
    written = json.loads((guide / "toy-good.json").read_text())
    assert written["commits"] == ["0123456789ab"]
    assert written["verdict"] == "undecided"
    assert any(line.startswith("error, plain: 40.") for line in written["lines"])
