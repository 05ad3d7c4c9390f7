"""`studio view`, from a terminal."""

import csv
import io
import json
from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from toy_session import facing_camera, make_session, side_camera

from studio.cli.inspection_commands import MOST_ROWS
from studio.operations.inspecting import tables_csv
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@pytest.fixture(autouse=True)
def _tracked(session_on_disk: Session) -> None:
    call("track toy --particles 20 --layers 3 --set constraints=clamp --name one --frames 0:2")


def test_the_tables_are_drawn_row_by_row(tmp_path: Path) -> None:
    file, line = tmp_path / "variance.csv", "view toy one --view variance --frame 1"
    call(line, "--csv", file)
    drawn = [[cell.strip() for cell in line.split("│")] for line in call(line).output.splitlines()]
    tables = [list(csv.reader(io.StringIO(part)))[2:] for part in file.read_text().split("# ")[2:]]
    assert sum(map(len, tables)) > 3
    for row in (row for rows in tables for row in rows[:MOST_ROWS]):
        assert any(all(map(same, row, cells[1:])) for cells in drawn if len(cells) == len(row) + 2), row


def same(written: str, drawn: str) -> bool:
    """Whether a cell of a file and one of a terminal, which rounds, say the same."""
    try:
        return written == drawn or f"{float(written):.4g}" == drawn
    except ValueError:
        return False


def test_a_layer_is_named_as_the_tables_count_it(tmp_path: Path) -> None:
    words = ["view", "toy", "one", "--view", "weights", "--frame", "1"]
    file = tmp_path / "weights.csv"
    call(*words, "--layer", "3", "--csv", file)
    found = answer_of(*words, "--layer", "3")["tables"]
    indices = {table: [row["layer"] for row in rows] for table, rows in found.items() if "layer" in rows[0]}
    read = {}
    for part in file.read_text().split("# ")[2:]:
        title, *lines = csv.reader(io.StringIO(part))
        if "layer" in lines[0]:
            at = lines[0].index("layer")
            read[title[0].split(":")[0]] = [int(line[at]) for line in lines[1:]]
    assert read
    assert read == {table: [index + 1 for index in numbers] for table, numbers in indices.items()}
    last = call(*words, "--json").stdout
    assert json.loads(last)["tables"] == found
    refused = refusal_of(*words, "--layer", "4")
    assert "no layer 4" in refused
    assert "layers 1 to 3" in refused


def test_whose_fault_the_errors_are(tmp_path: Path) -> None:
    words = ["split-error", "toy", "one", "--count", "1", "--evaluations", "1000"]
    told = answer_of(*words)
    [row] = told["tables"]["parts"]
    assert row["frame"] == 1
    said = call(*words).output
    assert told["notes"][0] in " ".join(said.split())
    assert f"{row['known']:.4g}" in said
    call(*words, "--csv", tmp_path / "parts.csv")
    assert "known [nats]" in (tmp_path / "parts.csv").read_text()
    assert "frame 7" in refusal_of("split-error", "toy", "one", "--frame", "7")


def test_how_far_off_joints_may_be(tmp_path: Path) -> None:
    assert "it has 2 finished frames, and 8 are needed" in refusal_of("uncertainty", "toy", "one")
    call("track toy --particles 20 --layers 3 --set constraints=clamp --name whole")
    told = answer_of("uncertainty", "toy", "whole")
    joints = told["tables"]["joints"]
    assert [row["point"] for row in joints] == ["Root", "Joint1", "Joint2", "Joint3", "Tip"]
    assert told["notes"][0].startswith("Measured on 8 frames of the run drawn again")
    said = call("uncertainty", "toy", "whole").output
    assert told["notes"][0] in " ".join(said.split())
    call("uncertainty", "toy", "whole", "--csv", tmp_path / "half_widths.csv")
    assert "within_50 [mm]" in (tmp_path / "half_widths.csv").read_text()
    assert answer_of("view", "toy", "whole", "--view", "uncertainty")["tables"] == told["tables"]


def test_where_cameras_should_stand(tmp_path: Path) -> None:
    refused = refusal_of("rig", "toy", "one")
    assert "it has one camera, and a rig of one tells nothing of depth" in refused
    make_session(Workspace().place_for("pair"), cameras=(facing_camera(), side_camera()))
    call("track pair --particles 20 --layers 3 --set constraints=clamp --name whole")
    words = ["rig", "pair", "whole"]
    told = answer_of(*words, "--add", "-2500,-1500,0", "--best", "1", "--height", "0")
    rigs = {row["rig"]: row for row in told["tables"]["rigs"]}
    assert [*rigs] == [
        "as it is",
        "one more at (-2.50, -1.50, 0.00) m",
        "best 1 place beside the present cameras",
    ]
    assert rigs["as it is"]["tracked"] == pytest.approx(rigs["as it is"]["predicted"])
    assert rigs["best 1 place beside the present cameras"]["tracked"] is None
    assert told["notes"][0].startswith("Present rig, 2 cameras: ")
    assert "(predicted)" in told["notes"][2]
    said = " ".join(call(*words).output.split())
    assert told["notes"][0] in said
    assert "Places of the grid" in said
    call(*words, "--csv", tmp_path / "rigs.csv")
    assert "predicted [mm]" in (tmp_path / "rigs.csv").read_text()
    assert "Camera 'cam9' is none of run 'whole'" in refusal_of(*words, "--move", "cam9=0,0,0")
    assert "is no place" in refusal_of(*words, "--add", "0,0")
    assert "'--height high' is no number" in refusal_of(*words, "--best", "1", "--height", "high")


def test_a_line_break_in_a_run_s_record_begins_no_cell() -> None:
    text = tables_csv([], "variance of toy / one (studio 1\r\n=cmd|' /C calc'!A0)")
    assert text.splitlines() == ["# variance of toy / one (studio 1 =cmd|' /C calc'!A0)"]
