"""Folders that older versions of the studio wrote open in this one, and newer ones are refused by their version.

`before-checksums.zip` is of a version without checksums, tracking states and behaviours; `before-versions.zip` of the
last one whose checksums and exports had no version. Both hold a run of three frames, tracked and read by that version.
"""

import contextlib
import json
import sqlite3
import tomllib
import zipfile
from pathlib import Path

import msgspec
import numpy as np
import pytest

from studio.footage.capture.calibration_files import read_calibration, write_calibration
from studio.foundations.errors import CalibrationError, NotFoundError, SessionError
from studio.operations.exports import kept_exports
from studio.sessions.file_checksums import NAME, check_files
from studio.sessions.record_files import RecordFile, renamed
from studio.sessions.results_store import FILE_NAME, ResultsWriter
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

OLD = Path(__file__).parent.parent / "old_sessions"


@pytest.fixture(params=["before-checksums", "before-versions"])
def old(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    with zipfile.ZipFile(OLD / f"{request.param}.zip") as packed:
        packed.extractall(tmp_path)
    return tmp_path


def test_a_session_opens_as_it_was(old: Path) -> None:
    expected = json.loads((old / "expected.json").read_text())
    (listed,) = Workspace(old).sessions()
    assert (listed.problem, listed.frames, listed.body) == ("", 4, "planar_arm4")
    assert [(run.status, run.done, run.damaged) for run in listed.runs] == [("finished", 3, ())]
    run = Session(old / "toy").run("run-1")
    with run.results() as results:
        frames, poses = results.poses()
        assert frames.tolist() == expected["frames"]
        assert poses.tolist() == expected["poses"]
        assert results.layer(1, 0).poses[:3].tolist() == expected["particles"]
        assert results.result(2).tracking == "tracked"
        assert len(results.settings_history()) == 1
    assert np.allclose(run.cameras()[0].centre, Session(old / "toy").cameras()[0].centre)


def test_a_run_can_be_written_on(old: Path) -> None:
    run = Session(old / "toy").run("run-1")
    with run.results() as results:
        last, layers = results.result(2), results.layers(2)
    with ResultsWriter(run.folder) as writer:
        writer.write_frame(last, layers)
    with run.results() as results:
        assert 2 not in results.unchecked()
        assert results.frames() == [0, 1, 2]
        again = results.layers(2)
        assert [layer.poses.tolist() for layer in again] == [layer.poses.tolist() for layer in layers]
        assert len(results.layers(1)) == len(again), "older frames are read as before"
    with contextlib.closing(sqlite3.connect(run.folder / FILE_NAME)) as connection:
        assert connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone() == ("2",)


def test_checksums_and_exports_without_a_version_are_understood(tmp_path: Path) -> None:
    with zipfile.ZipFile(OLD / "before-versions.zip") as packed:
        packed.extractall(tmp_path)
    folder = tmp_path / "toy"
    assert "schema" not in json.loads((folder / NAME).read_text())
    picture = folder / "pictures" / "front" / "0001.png"
    picture.write_bytes(picture.read_bytes()[:-1] + b"!")
    checked = check_files(folder)
    assert list(checked.damaged) == ["pictures/front/0001.png"]
    assert json.loads((folder / NAME).read_text())["schema"] == 2
    assert list(check_files(folder).damaged) == ["pictures/front/0001.png"]
    (export,) = kept_exports(Session(folder).run("run-1"))
    assert (export.file, export.frames) == ("toy-run-1.trc", 3)


def test_stores_and_calibrations_of_newer_versions_are_refused(
    session_on_disk: Session, tmp_path: Path
) -> None:
    with zipfile.ZipFile(OLD / "before-versions.zip") as packed:
        packed.extractall(tmp_path)
    run = Session(tmp_path / "toy").run("run-1")
    connection = sqlite3.connect(run.folder / FILE_NAME)
    connection.execute("UPDATE meta SET value = '3' WHERE key = 'schema'")
    connection.commit()
    connection.close()
    with pytest.raises(SessionError, match="schema version 3"):
        run.summary()
    with pytest.raises(SessionError, match="schema version 3"):
        ResultsWriter(run.folder)
    path = tmp_path / "cameras.toml"
    write_calibration(session_on_disk.cameras(), path)
    assert tomllib.loads(path.read_text())["metadata"]["version"] == 1
    path.write_text(path.read_text().replace("version = 1", "version = 2"))
    with pytest.raises(CalibrationError, match="version 2"):
        read_calibration(path)


class Shoe(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    size: float
    colour: str = "black"
    schema: int = 3


SHOES = RecordFile(
    Shoe,
    "a shoe",
    "Buy another.",
    ("There is no shoe in '{name}'.", "Buy one."),
    version=3,
    migrations={1: renamed(length="size"), 2: lambda entries: entries | {"size": 10.0 * entries["size"]}},
)


@pytest.mark.parametrize(
    "content",
    [
        '{"length": 4.1}',
        '{"schema": 1, "length": 4.1}',
        '{"schema": 2, "size": 4.1}',
        '{"schema": 3, "size": 41}',
    ],
)
def test_a_record_is_brought_to_today_version_by_version(tmp_path: Path, content: str) -> None:
    path = tmp_path / "shoe.json"
    path.write_text(content)
    shoe = SHOES.read(path)
    assert shoe == Shoe(41.0)
    SHOES.write(path, shoe)
    assert json.loads(path.read_text()) == {"size": 41.0, "colour": "black", "schema": 3}


@pytest.mark.parametrize(
    "content", ['{"schema": 4, "size": 41}', '{"schema": 2, "length": 4.1}', '{"width": 2}', "[]"]
)
def test_what_cannot_be_brought_to_today_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "shoe.json"
    path.write_text(content)
    with pytest.raises(SessionError):
        SHOES.read(path)
    path.unlink()
    with pytest.raises(NotFoundError, match=f"no shoe in '{tmp_path.name}'"):
        SHOES.read(path)
    assert SHOES.read(path, Shoe(1.0)) == Shoe(1.0)
