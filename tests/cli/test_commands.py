"""Every command as a stranger calls it: one JSON object, or a cause, a remedy and exit code 2."""

import csv
import errno
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import click
import numpy as np
import pytest
from command_line import answer_of, call, refusal_of
from sample_walk import WALK, copy_of_walk

from studio.cli import output
from studio.cli.main import COMMANDS, load, summary
from studio.cli.output import progress_lines
from studio.operations.jobs.open_run import OpenRun
from studio.runs.new_run import prepare_run
from studio.runs.tracking_run import Stepped
from studio.sessions.session import Session


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str) -> None:
    command = load(name)
    parts = [[name, part] for part in command.commands] if isinstance(command, click.Group) else [[name]]
    for words in parts:
        assert "--json" in call(*words, "--help").output


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_each_ones_help_begins_with(name: str) -> None:
    about = " ".join((load(name).help or "").split())
    assert about.startswith(summary(name).removesuffix("."))
    assert len(summary(name)) > 10


def leaves() -> list[tuple[list[str], click.Command]]:
    """All commands, those of groups too, with the words that call them."""
    found: list[tuple[list[str], click.Command]] = []
    for name in COMMANDS:
        one = load(name)
        parts = one.commands.items() if isinstance(one, click.Group) else ()
        found += [([name, part], below) for part, below in parts] or [([name], one)]
    return found


def test_every_required_option_that_is_left_out_is_named() -> None:
    left_out: list[str] = []
    for words, one in leaves():
        required = [entry for entry in one.params if entry.required]
        given = {entry: [*entry.opts[:1], "1"] for entry in required if isinstance(entry, click.Option)}
        arguments = ["x" for entry in required if isinstance(entry, click.Argument)]
        for option in given:
            others = [word for other, pair in given.items() if other is not option for word in pair]
            said = refusal_of("", *words, *arguments, *others)
            assert f"Missing option '{option.opts[0]}'" in said, words
            left_out.append(f"{' '.join(words)} {option.opts[0]}")
    assert {"import --into", "correct --at", "sweep --vary", "arena export --frames"} <= {*left_out}


def test_an_option_that_is_not_required_has_no_value_where_it_is_left_out() -> None:
    values = load("track").make_context("track", ["toy"]).params
    assert values["start_pose"] is None
    assert values["seed"] == 0


def test_bodies_lists_parameters_and_limbs() -> None:
    bodies = {entry["name"]: entry for entry in answer_of("bodies")["bodies"]}
    assert bodies["human31"]["parameters"] == 31
    assert bodies["human31"]["limbs"] == 10
    assert {"Hip", "Neck", "Head", "RWrist"} <= set(bodies["human31"]["markers"])


def test_track_writes_poses_in_the_bodys_order(session_on_disk: Session, tmp_path: Path) -> None:
    poses = tmp_path / "poses.csv"
    line = "track toy --frames 0:2 --particles 40 --layers 3 --seed 7"
    first = answer_of(line, "--poses", poses)
    assert first["frames"] == 2
    assert first["seed"] == 7
    assert first["evaluations_per_frame"] == 120
    rows = list(csv.reader(poses.read_text().splitlines()))
    body = session_on_disk.body()
    assert rows[0] == ["frame", *(parameter.name for parameter in body.parameters)]
    assert [row[0] for row in rows[1:]] == ["0", "1"]
    answer_of(line, "--poses", tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == poses.read_text()
    listed = answer_of("runs toy")["runs"]
    assert [entry["done"] for entry in listed] == [2, 2]


def test_condensation_prints_its_likelihood_scale(session_on_disk: Session) -> None:
    answer = answer_of("track toy --tracker condensation --frames 0:2 --particles 60")
    assert answer["likelihood_scale"] > 0.0


@pytest.mark.parametrize(
    ("extra", "word"),
    [
        (["--set", "survivall=0.4"], "survival"),
        (["--set", "survival=1.7"], "0.02"),
        (["--set", "survival"], "knob=value"),
        (["--particles", "many"], "particles"),
        (["--frames", "0:9999"], "0:"),
        (["--frames", "x"], "A:B"),
        (["--body", "centaur"], "centaur"),
        (["--start-pose", "nowhere.csv"], "nowhere.csv"),
        (["--seed", "-1"], "seed"),
        (["--poses", "nowhere/poses.csv"], "nowhere/poses.csv"),
    ],
)
def test_wrong_settings_leave_the_session_untouched(
    session_on_disk: Session, extra: list[str], word: str
) -> None:
    before = sorted(session_on_disk.path.rglob("*"))
    assert word in refusal_of("track toy", *extra)
    assert sorted(session_on_disk.path.rglob("*")) == before


def test_an_unknown_session_is_named_with_where_it_was_sought() -> None:
    assert "no session 'nobody'" in refusal_of("track nobody")


def test_an_unknown_session_is_answered_with_those_there_are(session_on_disk: Session) -> None:
    assert f"'{session_on_disk.name}'" in refusal_of("track nobody")


def test_ctrl_c_keeps_the_run_and_writes_its_poses(
    session_on_disk: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = OpenRun.step_layer

    def interrupted(opened: OpenRun) -> Stepped:
        if opened.tracking.done == 1:
            raise KeyboardInterrupt
        return step(opened)

    monkeypatch.setattr(OpenRun, "step_layer", interrupted)
    poses = tmp_path / "poses.csv"
    result = call("track toy --frames 0:3 --particles 20 --layers 2 --json --poses", poses, code=130)
    assert result.stdout == ""
    assert "1 of 3 frames" in result.stderr
    assert len(poses.read_text().splitlines()) == 2
    (listed,) = answer_of("runs toy")["runs"]
    assert (listed["done"], listed["status"]) == (1, "cancelled")


def test_a_folder_that_cannot_be_written_to_is_no_fault_of_the_studio(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(*arguments: object, **options: object) -> str:
        raise PermissionError(errno.EACCES, "Permission denied", "the-runs-folder")

    monkeypatch.setattr(tempfile, "mkdtemp", read_only)
    monkeypatch.setattr(os, "mkdir", read_only)
    assert (
        f"The folder '{session_on_disk.path / 'runs'}' cannot be written (Permission denied)."
        in refusal_of("track toy --frames 0:1")
    )


def test_evaluate_needs_a_truth(session_on_disk: Session) -> None:
    run_name = answer_of("track toy --frames 0:1 --particles 20 --layers 2")["run"]
    assert "--truth" in refusal_of("evaluate toy", run_name)


def test_start_pose_file_is_taken(session_on_disk: Session, tmp_path: Path) -> None:
    body = session_on_disk.body()
    pose = np.linspace(0.1, 0.4, len(body.parameters))
    path = tmp_path / "pose.csv"
    path.write_text(
        ",".join(parameter.name for parameter in body.parameters)
        + "\n"
        + ",".join(map(repr, pose.tolist()))
        + "\n"
    )
    answer = answer_of("track toy --frames 0:1 --particles 20 --start-pose", path)
    record = session_on_disk.run(answer["run"]).record
    assert record.start_pose == pytest.approx(tuple(pose))
    assert "pose.csv" in record.start_source


def test_import_refuses_a_folder_that_is_no_session_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "source" / "videos").mkdir(parents=True)
    (tmp_path / "source" / "videos" / "cam1.mp4").write_bytes(b"no video")
    said = refusal_of("import", tmp_path / "source", "--into", "made")
    assert "calibration" in said
    assert "remedy" in said
    assert "no session 'made'" in refusal_of("track made")


@pytest.mark.slow
def test_evaluate_prints_numbers_with_their_alignment(tmp_path: Path) -> None:
    session = str(copy_of_walk(tmp_path / "walk").path)
    tracked = answer_of("track", session, "--frames", "0:3", "--particles", "100", "--layers", "5")
    found = answer_of("evaluate", session, tracked["run"])
    assert found["mean_mm"] < 40.0
    assert found["worst_mm"] >= found["mean_mm"]
    assert found["lost_frames"] == 0
    assert found["alignment"] == "none"
    assert len(found["per_frame_mm"]) == 3
    assert set(found["per_marker_mm"]) >= {"Head", "RWrist", "LAnkle"}
    start = answer_of("track", session, "--frames", "1:2", "--start-pose", WALK / "truth" / "walk.trc")
    assert "markers of walk.trc" in start["start_pose"]


def test_a_cancelled_run_is_resumed_with_the_result_of_an_unbroken_one(session_on_disk: Session) -> None:
    arguments = ("track", "toy", "--particles", "30", "--layers", "3", "--frames", "0:4")
    whole = answer_of(*arguments, "--name", "whole")
    run_ = prepare_run(session_on_disk, last=4, knobs={"particles": 30, "layers": 3}, name="broken")
    opened = OpenRun(str(session_on_disk.path), str(run_.folder))
    for _ in range(8):
        opened.step_layer()
    opened.tracking.mark_cancelled()
    opened.close()
    assert run_.summary().status == "cancelled"
    assert answer_of("track toy --resume broken")["frames"] == 4
    poses = []
    for name in (whole["run"], "broken"):
        with session_on_disk.run(name).results() as results:
            poses.append(results.poses()[1])
    assert np.array_equal(*poses)
    assert run_.summary().status == "finished"


def test_a_log_file_gets_lines_now_and_then_with_the_time_that_is_left(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Compiling takes 211 s, each of 600 frames half a second: the first frame foretells nothing."""
    now = 0.0
    report = progress_lines("Tracking", clock=lambda: now)
    report("", 0, 600)
    now = 211.0
    report("", 1, 600)
    assert capsys.readouterr().err == "Tracking: 1 of 600\n"
    for done in range(2, 103):
        now += 0.5
        report("", done, 600)
    assert "Tracking: 101 of 600, about 250 s left".replace("250 s", "4 min") in capsys.readouterr().err


def test_control_characters_of_a_session_do_not_reach_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    title = "a\x1b]0;owned\x07\x1b[31m\x9bb\nline"
    output.print_result({"text": title}, as_json=False)
    assert capsys.readouterr().out == "a\\x1b]0;owned\\x07\\x1b[31m\\x9bb\nline\n"
    output.print_result({"title": title}, as_json=True)
    shown = capsys.readouterr().out
    assert json.loads(shown)["title"] == title
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", shown)
    output.note(title)
    assert "\x1b" not in capsys.readouterr().err


def test_too_little_memory_to_load_a_command_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(name: str) -> object:
        raise ImportError(f"{name}.so: failed to map segment from shared object")

    monkeypatch.setattr("importlib.import_module", load)
    assert "not enough memory to load the studio" in refusal_of("runs")


def test_too_little_memory_is_no_fault_of_the_studio(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended, output.errors_in_words():
        raise MemoryError
    assert ended.value.code == output.WRONG_INPUT
    said = capsys.readouterr().err
    assert "not enough memory" in said
    assert "fault" not in said


@pytest.mark.parametrize(("given", "expected"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_small_matrices_are_not_parted_among_threads(given: dict[str, str], expected: str) -> None:
    ask = "import os, sys, studio.cli.main; print('numpy' in sys.modules, os.environ['OPENBLAS_NUM_THREADS'])"
    environment = {
        name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"
    } | given
    done = subprocess.run(
        [sys.executable, "-c", ask], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", expected]
