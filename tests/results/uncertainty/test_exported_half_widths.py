"""Half widths go with the exported points: a column, an array, a second TRC; none where they do not hold."""

import csv
import json
from pathlib import Path

import duckdb
import msgspec
import numpy as np
import pytest

from studio.body.motion_files.trc import read_trc
from studio.results.export.exporting import ExportReport, export_run
from studio.results.export.formats import FORMATS
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.shared_page import shared_page
from studio.results.uncertainty.half_widths import FILE_NAME, Uncertainty
from studio.runs.tracks import Track, read_track, write_track
from studio.sessions.results_store import ResultsWriter

FRAMES = 10


@pytest.fixture
def known(own: InspectedRun) -> InspectedRun:
    """The run with half widths of 10, 11, 12, … mm at 95 %, in the order of its points."""
    path = own.run.folder / FILE_NAME
    kept = msgspec.json.decode(path.read_bytes(), type=Uncertainty)
    points = tuple(
        msgspec.structs.replace(one, half_widths_mm=(1.0, 2.0, 10.0 + at))
        for at, one in enumerate(kept.points)
    )
    path.write_bytes(msgspec.json.encode(msgspec.structs.replace(kept, points=points)))
    return own


def export(run: InspectedRun, place: Path, **options: object) -> ExportReport:
    return export_run(run.session, run.run, FORMATS[place.suffix[1:]], options, place)


def test_csv_has_a_column_a_point(known: InspectedRun, tmp_path: Path) -> None:
    report = export(known, tmp_path / "walk.csv", unit="cm")
    with report.files[0].open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    names = [marker.name for marker in known.body.markers]
    widths = [float(rows[3][f"{name} within 95 % [cm]"]) for name in names]
    assert widths == pytest.approx([(10.0 + at) / 10.0 for at in range(len(names))])
    assert any("In 95 % of frames a true point is no farther" in note for note in report.notes)


def test_parquet_has_a_column_and_says_what_it_is(known: InspectedRun, tmp_path: Path) -> None:
    path = export(known, tmp_path / "walk.parquet", unit="m").files[0]
    with duckdb.connect() as base:
        rows = base.execute(f"SELECT half_width FROM '{path}' WHERE name = 'Neck'").fetchall()
        said = dict(
            base.execute(f"SELECT decode(key), decode(value) FROM parquet_kv_metadata('{path}')").fetchall()
        )
    at = [marker.name for marker in known.body.markers].index("Neck")
    assert [row[0] for row in rows] == pytest.approx([(10.0 + at) / 1000.0] * FRAMES)
    assert said["half_width"].startswith("In 95 % of frames")


def test_npz_has_an_array(known: InspectedRun, tmp_path: Path) -> None:
    path = export(known, tmp_path / "walk.npz").files[0]
    with np.load(path, allow_pickle=False) as read:
        widths, about = read["half_widths"], json.loads(str(read["about"]))
    assert widths == pytest.approx(np.tile(10.0 + np.arange(widths.shape[1]), (FRAMES, 1)))
    assert about["half_widths"].startswith("In 95 % of frames")


def test_trc_has_them_in_a_second_file(known: InspectedRun, tmp_path: Path) -> None:
    report = export(known, tmp_path / "walk.trc")
    assert [path.name for path in report.files] == ["walk.trc", "walk-half-widths.trc"]
    read = read_trc(report.files[1])
    assert read.names == tuple(marker.name for marker in known.body.markers)
    wanted = np.tile(10.0 + np.arange(len(read.names)), (FRAMES, 1))
    for axis in range(3):
        assert read.positions[..., axis] == pytest.approx(wanted, abs=0.01)
    assert any("walk-half-widths.trc" in note for note in report.notes)


def test_points_under_other_names_have_those_of_the_same_place(known: InspectedRun, tmp_path: Path) -> None:
    path = export(known, tmp_path / "walk.npz", names="halpe26").files[0]
    with np.load(path, allow_pickle=False) as read:
        widths, names = read["half_widths"], read["marker_names"].tolist()
    own = [marker.name for marker in known.body.markers]
    assert widths[0, names.index("LWrist")] == 10.0 + own.index("LWrist")


def test_other_rates_keep_them_and_gaps_have_none(known: InspectedRun, tmp_path: Path) -> None:
    path = export(known, tmp_path / "walk.npz", fps=120.0).files[0]
    with np.load(path, allow_pickle=False) as read:
        assert np.isfinite(read["half_widths"]).all()
        assert len(read["half_widths"]) > FRAMES
    with_gap = tmp_path / "gap.npz"
    track = read_track(known.run, "raw")
    states = ("tracked", "lost", *["tracked"] * (FRAMES - 2))
    write_track(
        known.run, Track("holed", track.frames, track.poses, track.confidence, states, {"from": "raw"})
    )
    report = export(known, with_gap, track="holed")
    with np.load(report.files[0], allow_pickle=False) as read:
        assert "half_widths" not in read
    assert "Half widths are known of track 'raw', not of 'holed'." in report.notes


def test_levels_that_are_not_promised_are_not_exported(own: InspectedRun, tmp_path: Path) -> None:
    report = export(own, tmp_path / "walk.csv")
    assert "within" not in report.files[0].read_text().splitlines()[0]
    assert any("cannot be promised: that takes" in note for note in report.notes)


def test_half_widths_of_a_run_that_has_changed_are_not_exported(known: InspectedRun, tmp_path: Path) -> None:
    with ResultsWriter(known.run.folder) as writer:
        writer.forget_from(FRAMES - 1)
    report = export(known, tmp_path / "walk.trc")
    assert [path.name for path in report.files] == ["walk.trc"]
    assert any("no longer hold" in note for note in report.notes)


def test_a_file_that_cannot_be_read_spoils_no_export(known: InspectedRun, tmp_path: Path) -> None:
    (known.run.folder / FILE_NAME).write_text("{")
    report = export(known, tmp_path / "walk.csv")
    assert "within" not in report.files[0].read_text().splitlines()[0]
    assert any("cannot be read" in note for note in report.notes)
    assert '"view":"uncertainty"' not in shared_page(known, 2).replace(" ", "")
