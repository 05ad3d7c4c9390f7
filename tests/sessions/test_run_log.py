"""A run's log is read as far as it was written."""

from pathlib import Path

from studio.sessions.run_log import FILE_NAME, append_to_log, read_log


def test_lines_come_back_and_a_cut_one_is_left_out(tmp_path: Path) -> None:
    assert read_log(tmp_path) == ()
    for number in range(5):
        append_to_log(tmp_path, "info", f"line {number}\nand more")
    with (tmp_path / FILE_NAME).open("ab") as stream:
        stream.write(b'{"time": 1.0, "level": "info", "text": "\xff"}\n{"time": 1.0, "level": "er')
    assert [entry.text for entry in read_log(tmp_path)] == [f"line {number}\nand more" for number in range(5)]
    assert [entry.text[:6] for entry in read_log(tmp_path, last=4)] == ["line 3", "line 4"]
