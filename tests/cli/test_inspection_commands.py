"""`studio view`, from a terminal."""

import csv
import io
import json
from pathlib import Path

from click.testing import CliRunner

from studio.cli.inspection_commands import MOST_ROWS
from studio.cli.main import main
from studio.operations.inspecting import tables_csv
from studio.sessions.session import Session


def tracked(runner: CliRunner) -> CliRunner:
    """The runner after a run, "one", of two frames."""
    knobs = ["--particles", "20", "--layers", "3", "--set", "constraints=clamp"]
    assert runner.invoke(main, ["track", "toy", *knobs, "--name", "one", "--frames", "0:2"]).exit_code == 0
    return runner


def test_the_tables_are_drawn_row_by_row(session_on_disk: Session, tmp_path: Path) -> None:
    runner, file = tracked(CliRunner()), tmp_path / "variance.csv"
    words = ["view", "toy", "one", "--view", "variance", "--frame", "1"]
    assert runner.invoke(main, [*words, "--csv", str(file)]).exit_code == 0
    drawn = [
        [cell.strip() for cell in line.split("│")] for line in runner.invoke(main, words).output.splitlines()
    ]
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


def test_a_layer_is_named_as_the_tables_count_it(session_on_disk: Session, tmp_path: Path) -> None:
    runner = tracked(CliRunner())
    words = ["view", "toy", "one", "--view", "weights", "--frame", "1"]
    file = tmp_path / "weights.csv"
    printed = runner.invoke(main, [*words, "--layer", "3", "--csv", str(file)])
    assert printed.exit_code == 0, printed.output
    found = json.loads(runner.invoke(main, [*words, "--layer", "3", "--json"]).stdout)["tables"]
    indices = {table: [row["layer"] for row in rows] for table, rows in found.items() if "layer" in rows[0]}
    read = {}
    for part in file.read_text().split("# ")[2:]:
        title, *lines = csv.reader(io.StringIO(part))
        if "layer" in lines[0]:
            at = lines[0].index("layer")
            read[title[0].split(":")[0]] = [int(line[at]) for line in lines[1:]]
    assert read
    assert read == {table: [index + 1 for index in numbers] for table, numbers in indices.items()}
    last = runner.invoke(main, [*words, "--json"]).stdout
    assert json.loads(last)["tables"] == found
    refused = runner.invoke(main, [*words, "--layer", "4"])
    assert refused.exit_code == 2
    assert "no layer 4" in refused.stderr
    assert "layers 1 to 3" in refused.stderr


def test_a_line_break_in_a_run_s_record_begins_no_cell() -> None:
    text = tables_csv([], "variance of toy / one (studio 1\r\n=cmd|' /C calc'!A0)")
    assert text.splitlines() == ["# variance of toy / one (studio 1 =cmd|' /C calc'!A0)"]
