"""Running experiments: every trial once, stored, resumed; failures are reported and stop nothing else."""

import csv
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from toy_experiments import toy

from studio.foundations.errors import RunError, SessionError
from studio.garden.reproduction.findings_files import read_findings
from studio.garden.reproduction.runner import LOCK, Reproduction, reproduce
from studio.results.comparison.trials import Scale
from studio.sessions.process_lock import ProcessLock
from studio.sessions.workspace import Workspace

# Each process that is started loads the kernels' compiler; a busy machine takes a minute for one.
pytestmark = pytest.mark.timeout(900)
ROOT = Path(__file__).resolve().parents[3]
TWO = Scale((0, 1))


def run(
    experiments, out: Path, scale: Scale = TWO, processes: int = 1, report=lambda *_: None
) -> Reproduction:
    return reproduce(tuple(experiments), out, scale, report, processes=processes)


def lines(log: Path) -> list[str]:
    return log.read_text().splitlines() if log.exists() else []


def test_everything_is_written_and_nothing_is_run_twice(tmp_path: Path) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    steps = []
    first = run([toy("toy", log)], out, processes=2, report=lambda *words: steps.append(words))
    assert (first.measured, first.kept, first.failed) == (4, 0, 0)
    assert len({line.split()[0] for line in lines(log)}) == 2
    assert steps[-1] == ("toy: " + steps[-1][0].removeprefix("toy: "), 4, 4)
    document = first.documents[0]
    assert document["verdict"] == "undecided"
    assert document["firm"] is False
    assert "not firm: 2 seeds" in document["notes"][0]
    assert [number["verdict"] for number in document["numbers"]] == ["undecided", "better", "answered"]
    assert document["numbers"][2]["ours"] is None
    assert read_findings(out, "toy") == document
    assert json.loads((out / "results.json").read_text())["experiments"] == [document]
    rows = list(csv.DictReader((out / "toy" / "numbers.csv").read_text().splitlines()))
    assert rows[1]["paper"] == "38.0"
    assert rows[2]["ours"] == ""
    assert sorted(path.name for path in (out / "toy").glob("*-*.csv")) == [
        "chart-1-error-over-frames.csv",
        "chart-2-error-by-setting.csv",
        "chart-3-scaling.csv",
        "chart-4-damage.csv",
        "table-1-by-setting.csv",
    ]
    assert (out / "toy" / "chart-4-damage.csv").read_text().splitlines()[1] == "plain,1.0,"
    again = run([toy("toy", log)], out)
    assert (again.measured, again.kept) == (0, 4)
    assert len(lines(log)) == 4
    assert {**again.documents[0], "date": ""} == {**document, "date": ""}


@pytest.mark.slow
def test_more_seeds_run_only_the_new_trials(tmp_path: Path) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    run([toy("toy", log)], out)
    found = run([toy("toy", log)], out, Scale((0, 1, 2)))
    assert (found.measured, found.kept) == (2, 4)
    assert found.documents[0]["seeds"] == 3


@pytest.mark.slow
def test_experiments_share_the_trials_that_are_the_same(tmp_path: Path) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    found = run([toy("one", log), toy("two", log)], out)
    assert found.measured == 4
    assert [document["name"] for document in found.documents] == ["one", "two"]
    assert found.documents[0]["numbers"] == found.documents[1]["numbers"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deed", "reason", "failed"),
    [
        ("refuse", "The toy refuses. Ask another.", ["plain, seed 1", "clever, seed 1"]),
        ("break", "ZeroDivisionError: toy (toy_experiments.py, line", ["plain, seed 1", "clever, seed 1"]),
        ("die", "The process that ran it ended by signal 9, SIGKILL.", ["plain, seed 1"]),
    ],
)
def test_a_failing_trial_fails_its_experiment_only(
    tmp_path: Path, deed: str, reason: str, failed: list[str]
) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    found = run([toy("bad", log, seed1=deed), toy("good", tmp_path / "log2")], out)
    bad, good = found.documents
    assert (bad["verdict"], good["verdict"]) == ("failed", "undecided")
    assert found.failed == len(failed)
    assert [failure["label"] for failure in bad["failures"]] == failed
    assert reason in bad["failures"][0]["reason"]
    assert reason in bad["words"]


@pytest.mark.slow
def test_failed_trials_run_again_and_outcomes_are_kept(tmp_path: Path) -> None:
    log, out = tmp_path / "log", tmp_path / "out"
    run([toy("bad", log, seed1="once refused")], out)
    found = run([toy("bad", log, seed1="once refused")], out)
    assert (found.measured, found.kept, found.failed) == (2, 2, 0)
    assert found.documents[0]["verdict"] == "undecided"


@pytest.mark.slow
def test_a_process_that_dies_once_is_replaced(tmp_path: Path) -> None:
    log = tmp_path / "log"
    found = run([toy("toy", log, seed1="die once")], tmp_path / "out")
    assert found.documents[0]["verdict"] == "undecided"
    assert len(lines(log)) == 5


@pytest.mark.slow
def test_a_failing_conclusion_is_reported(tmp_path: Path) -> None:
    log = tmp_path / "log"
    wrong = toy("toy", log)
    wrong = dataclasses.replace(wrong, shown=lambda outcomes: outcomes[0].measured["nothing"])
    found = run([wrong], tmp_path / "out")
    assert found.documents[0]["verdict"] == "failed"
    assert "The conclusion: KeyError: 'nothing'" in found.documents[0]["words"]


@pytest.mark.slow
def test_trials_have_one_core_unless_they_measure_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    out = tmp_path / "out"
    run(
        [toy("together", tmp_path / "a"), toy("timing", tmp_path / "a", alone=True)],
        out,
        Scale((0,)),
        processes=2,
    )
    threads = [
        json.loads(path.read_text())["measured"]["threads"] for path in (out / "trials").glob("*.json")
    ]
    assert sorted(threads) == ["", "", "1", "1"]
    assert "NUMBA_NUM_THREADS" not in os.environ


@pytest.mark.slow
def test_footage_is_rendered_once_and_again_when_its_recipe_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, recipe = tmp_path / "out", tmp_path / "arm.toml"
    shutil.copy(ROOT / "studio/results/drawing_footage/recipe_files/planar_arm.toml", recipe)
    text = recipe.read_text().replace("frames = 48", "frames = 2")
    recipe.write_text(text)
    found = lambda name: recipe  # noqa: E731
    monkeypatch.setattr("studio.garden.reproduction.plan.find_recipe", found)
    monkeypatch.setattr("studio.results.drawing_footage.recipes.find_recipe", found)
    experiment = toy("toy", tmp_path / "log", footage=("arm",))
    (out / "footage" / ".partial-killed" / "arm").mkdir(parents=True)
    assert run([experiment], out, Scale((0,))).measured == 2
    session = out / "footage" / "arm" / "session.json"
    made = session.stat().st_mtime_ns
    assert run([experiment], out, Scale((0,))).measured == 0
    assert run([experiment], out, Scale((0, 1))).measured == 2
    assert session.stat().st_mtime_ns == made
    recipe.write_text(text.replace("frames = 2", "frames = 3"))
    assert run([experiment], out, Scale((0,))).measured == 2
    assert session.stat().st_mtime_ns != made
    assert [path.name for path in (out / "footage").iterdir()] == ["arm"]


def test_an_unknown_recipe_fails_its_experiment_only(tmp_path: Path) -> None:
    found = run(
        [toy("bad", tmp_path / "log", footage=("nowhere",)), toy("good", tmp_path / "log")], tmp_path / "out"
    )
    assert [document["verdict"] for document in found.documents] == ["failed", "undecided"]
    assert "There is no recipe 'nowhere'." in found.documents[0]["words"]


@pytest.mark.slow
def test_outcomes_of_another_version_are_used_and_noted(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run([toy("toy", tmp_path / "log")], out)
    path = next((out / "trials").glob("*.json"))
    path.write_text(json.dumps(json.loads(path.read_text()) | {"software": "0.0.1+old"}))
    found = run([toy("toy", tmp_path / "log")], out)
    assert found.measured == 0
    assert "Some outcomes were measured by another version (0.0.1+old)." in found.documents[0]["notes"]


@pytest.mark.slow
def test_a_damaged_outcome_is_measured_again(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run([toy("toy", tmp_path / "log")], out)
    next((out / "trials").glob("*.json")).write_text("{")
    assert run([toy("toy", tmp_path / "log")], out).measured == 1


def test_folders_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "session.json").write_text("{}")
    (tmp_path / "file").write_text("")
    for name in ("session", "file"):
        with pytest.raises(SessionError, match=name):
            run([], tmp_path / name)
    (tmp_path / "busy").mkdir()
    lock = ProcessLock.take(tmp_path / "busy" / LOCK)
    with pytest.raises(RunError, match="Another process"):
        run([], tmp_path / "busy")
    lock.free()


@pytest.mark.slow
def test_the_workspace_does_not_take_the_folder_for_a_session(tmp_path: Path) -> None:
    workspace = Workspace()
    run([toy("toy", tmp_path / "log")], workspace.root / "reproduction", Scale((0,)))
    assert workspace.sessions() == ()


SCRIPT = """
import signal
import sys
from pathlib import Path
from toy_experiments import toy
from studio.garden.reproduction.experiment import Scale
from studio.garden.reproduction.runner import reproduce
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    log, out = map(Path, sys.argv[1:])
    reproduce((toy("toy", log, seed1="wait"),), out, Scale((0, 1)), lambda *_: None, processes=1)
"""


def start_waiting(tmp_path: Path) -> subprocess.Popen:
    """A reproduction in its own process that hangs in its second trial."""
    (tmp_path / "script.py").write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'tests'}{os.pathsep}{ROOT}"}
    process = subprocess.Popen(
        [sys.executable, tmp_path / "script.py", tmp_path / "log", tmp_path / "out"],
        env=environment,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 120
    while len(lines(tmp_path / "log")) < 2 or not any((tmp_path / "out" / "trials").glob("*.json")):
        assert time.monotonic() < deadline
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    return process


def has_ended(identifier: int) -> bool:
    try:
        os.kill(identifier, 0)
    except ProcessLookupError:
        return True
    return Path(f"/proc/{identifier}/stat").read_text().split()[2] == "Z"


@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_commands_finished_trials_are_kept(tmp_path: Path, sign: int) -> None:
    process = start_waiting(tmp_path)
    process.send_signal(sign)
    process.communicate(timeout=60)
    worker = int(lines(tmp_path / "log")[0].split()[0])
    deadline = time.monotonic() + 30
    while not has_ended(worker):
        assert time.monotonic() < deadline, "the trial's process outlived the command"
        time.sleep(0.05)
    (tmp_path / "log.gate").write_text("")
    found = run([toy("toy", tmp_path / "log", seed1="wait")], tmp_path / "out")
    assert (found.measured, found.kept) == (3, 1)
    # The interrupted trial ran twice, the finished one once.
    assert len(lines(tmp_path / "log")) == 5
