"""OpenSim motion files, read by pandas below their heads."""

from pathlib import Path

import numpy as np
import pandas
import pytest
from export_runs import FRAMES, MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.foundations.errors import ExportError
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.mot_file import read_mot

LOST = range(100, 120)
STATES = tuple("lost" if frame in LOST else "tracked" for frame in range(FRAMES))


def test_joint_angles_are_degrees_over_time(make_run, tmp_path: Path) -> None:
    session, run = make_run("human31", lambda body: track_of(moving_poses(body), states=STATES))
    place = tmp_path / "walk.mot"
    report = export_run(session, run, FORMATS["mot"], {"track": MADE}, place)
    assert report.track == MADE
    assert report.checked.startswith("read back within")
    assert any("20 frames have no pose of their own" in note for note in report.notes)

    lines = place.read_text().splitlines()
    end = lines.index("endheader")
    head = dict(line.split("=") for line in lines[1:end] if line)
    body = load_body("human31")
    count = len(body.parameters) + 1
    assert head == {"version": "1", "nRows": str(FRAMES), "nColumns": str(count), "inDegrees": "yes"}
    read = pandas.read_csv(place, sep="\t", skiprows=end + 1)
    assert list(read.columns) == ["time", *(entry.name for entry in body.parameters)]
    table = read.to_numpy()
    assert table[:, 0] == pytest.approx(np.arange(FRAMES) / run.record.fps, abs=1e-8)
    poses = moving_poses(body)
    seen = np.array([state == "tracked" for state in STATES])
    for at, entry in enumerate(body.parameters):
        there = np.radians(table[:, at + 1]) if entry.kind == "angle" else 1000.0 * table[:, at + 1]
        assert there[seen] == pytest.approx(poses[seen, at], abs=1e-5), entry.name
    assert np.isfinite(table).all()


def test_angles_go_on_past_half_a_turn(make_run, tmp_path: Path) -> None:
    """A body that turns twice, its heading kept within ± 180 degrees as a search may."""

    def turning(body):
        poses = np.tile(body.neutral, (90, 1))
        at = next(number for number, entry in enumerate(body.parameters) if entry.name == "pelvis_rz")
        poses[:, at] = (np.linspace(0.0, 4.0 * np.pi, 90) + np.pi) % (2.0 * np.pi) - np.pi
        return track_of(poses)

    session, run = make_run("human31", turning)
    place = tmp_path / "turn.mot"
    export_run(session, run, FORMATS["mot"], {"track": MADE}, place)
    read = read_mot(place)
    heading = read.values[:, read.columns.index("pelvis_rz")]
    assert heading[-1] - heading[0] == pytest.approx(720.0, abs=1e-5)
    assert np.abs(np.diff(heading)).max() < 10.0


@pytest.mark.parametrize("spoilt", ["inDegrees=no", "nRows=3", "no head"])
def test_what_is_no_motion_file_is_refused(tmp_path: Path, spoilt: str) -> None:
    place = tmp_path / "one.mot"
    head = ["one", "version=1", "nRows=1", "nColumns=2", "inDegrees=yes", "endheader", "time\tknee", "0\t1"]
    place.write_text("\n".join(head))
    assert read_mot(place).values.tolist() == [[1.0]]
    changed = [spoilt if line.split("=")[0] == spoilt.split("=")[0] else line for line in head]
    place.write_text("\n".join(changed if spoilt != "no head" else head[6:]))
    with pytest.raises(ExportError, match="no OpenSim motion file"):
        read_mot(place)
