"""TRC read by pandas, as Pose2Sim reads it, C3D by py-c3d."""

import warnings
from pathlib import Path

import c3d
import numpy as np
import pandas
import pytest
from export_runs import FRAMES, MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.foundations.errors import ExportError
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.marker_files import MOST_C3D_FRAMES

LEAST_MM = 0.1
LOST = range(100, 120)
STATES = tuple("lost" if frame in LOST else "tracked" for frame in range(FRAMES))


def read_trc_as_pose2sim(path: Path) -> tuple[list[str], dict[str, str], np.ndarray, np.ndarray]:
    """Names, header, times and points (F, M, 3) as they stand; blank cells NaN."""
    head = pandas.read_csv(path, sep="\t", skiprows=1, nrows=1, dtype=str)
    names = [name for name in path.read_text().splitlines()[3].split("\t")[2::3] if name]
    table = pandas.read_csv(path, sep="\t", skiprows=4)
    points = table.drop(columns=table.columns[[0, 1]]).to_numpy()
    return names, head.iloc[0].to_dict(), table.iloc[:, 1].to_numpy(), points.reshape(len(table), -1, 3)


def read_c3d_by_hand(path: Path) -> tuple[list[str], float, str, np.ndarray, np.ndarray]:
    """Labels, rate, unit, points (F, M, 3) and residuals (F, M) as py-c3d sees them."""
    with path.open("rb") as handle, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No analog data found")
        reader = c3d.Reader(handle)
        labels = [label.strip() for label in reader.point_labels]
        unit = reader.get("POINT:UNITS").string_value.strip()
        frames = [points.copy() for _, points, _ in reader.read_frames()]
        rate = reader.point_rate
    table = np.array(frames)
    return labels, rate, unit, table[..., :3], table[..., 3]


def test_trc_in_metres_y_up(make_run, tmp_path: Path) -> None:
    session, run = make_run("human29", lambda body: track_of(moving_poses(body), states=STATES))
    report = export_run(session, run, FORMATS["trc"], {"track": MADE}, tmp_path / "walk.trc")
    body = load_body("human29")
    wanted = marker_points(body, moving_poses(body))
    names, header, times, points = read_trc_as_pose2sim(report.files[0])
    assert names == [marker.name for marker in body.markers]
    assert (header["Units"], header["NumFrames"], header["DataRate"]) == ("m", "450", "60")
    np.testing.assert_allclose(times, np.arange(FRAMES) / 60.0, atol=1e-7)
    seen = 1000.0 * points[..., [2, 0, 1]]
    missing = np.isnan(seen).all(axis=(1, 2))
    assert np.flatnonzero(missing).tolist() == list(LOST)
    assert np.linalg.norm(seen - wanted, axis=-1)[~missing].max() < LEAST_MM
    assert any("20 frames are missing" in note for note in report.notes)


def test_trc_z_up_in_millimetres(make_run, tmp_path: Path) -> None:
    session, run = make_run("dog", lambda body: track_of(moving_poses(body, 50)))
    requested = {"track": MADE, "up": "z", "unit": "mm"}
    report = export_run(session, run, FORMATS["trc"], requested, tmp_path / "dog.trc")
    body = load_body("dog")
    _, header, _, points = read_trc_as_pose2sim(report.files[0])
    assert header["Units"] == "mm"
    assert np.linalg.norm(points - marker_points(body, moving_poses(body, 50)), axis=-1).max() < LEAST_MM


def test_c3d_is_what_py_c3d_reads(make_run, tmp_path: Path) -> None:
    session, run = make_run("human29", lambda body: track_of(moving_poses(body), states=STATES))
    report = export_run(session, run, FORMATS["c3d"], {"track": MADE}, tmp_path / "walk.c3d")
    body = load_body("human29")
    labels, rate, unit, points, residuals = read_c3d_by_hand(report.files[0])
    assert labels == [marker.name for marker in body.markers]
    assert (rate, unit, len(points)) == (60.0, "mm", FRAMES)
    missing = residuals == -1.0
    assert np.flatnonzero(missing.all(axis=1)).tolist() == list(LOST)
    assert missing.any(axis=1).sum() == len(LOST)
    wanted = marker_points(body, moving_poses(body))
    assert np.linalg.norm(points - wanted, axis=-1)[~missing].max() < LEAST_MM


def test_c3d_y_up_in_metres(make_run, tmp_path: Path) -> None:
    session, run = make_run("human25", lambda body: track_of(moving_poses(body, 30)))
    requested = {"track": MADE, "up": "y", "unit": "m"}
    report = export_run(session, run, FORMATS["c3d"], requested, tmp_path / "walk.c3d")
    body = load_body("human25")
    _, _, unit, points, _ = read_c3d_by_hand(report.files[0])
    assert unit == "m"
    wanted = marker_points(body, moving_poses(body, 30))
    assert np.linalg.norm(1000.0 * points[..., [2, 0, 1]] - wanted, axis=-1).max() < LEAST_MM


def test_more_frames_than_c3d_counts(make_run, tmp_path: Path) -> None:
    """Refused with the remedy; split, nothing is lost between the files."""
    count = MOST_C3D_FRAMES + 40
    session, run = make_run("planar_arm4", lambda body: track_of(moving_poses(body, count)))
    with pytest.raises(ExportError, match="at most 65535 frames and this motion has 65575") as refused:
        export_run(session, run, FORMATS["c3d"], {"track": MADE}, tmp_path / "long.c3d")
    assert "split" in refused.value.hint
    assert not list(tmp_path.glob("long*"))
    requested = {"track": MADE, "split": True}
    report = export_run(session, run, FORMATS["c3d"], requested, tmp_path / "long.c3d")
    assert [path.name for path in report.files] == ["long-1.c3d", "long-2.c3d"]
    body = load_body("planar_arm4")
    wanted = marker_points(body, moving_poses(body, count)[MOST_C3D_FRAMES:])
    points = read_c3d_by_hand(report.files[1])[3]
    assert np.linalg.norm(points - wanted, axis=-1).max() < LEAST_MM


def test_names_of_halpe_and_what_is_missing(make_run, tmp_path: Path) -> None:
    session, run = make_run("human29", lambda body: track_of(moving_poses(body, 30)))
    requested = {"track": MADE, "names": "halpe26"}
    report = export_run(session, run, FORMATS["trc"], requested, tmp_path / "walk.trc")
    names, _, _, points = read_trc_as_pose2sim(report.files[0])
    assert {"RBigToe", "LHeel", "Neck", "RWrist"} <= set(names)
    note = next(note for note in report.notes if "left out" in note)
    assert "no RSmallToe, LSmallToe, Nose" in note
    body = load_body("human29")
    foot = next(at for at, limb in enumerate(body.drawn) if limb.name == "right foot")
    ends = limb_ends(body, moving_poses(body, 30))[:, foot]
    seen = 1000.0 * points[..., [2, 0, 1]]
    np.testing.assert_allclose(seen[:, names.index("RHeel")], ends[:, 0], atol=LEAST_MM)
    np.testing.assert_allclose(seen[:, names.index("RBigToe")], ends[:, 1], atol=LEAST_MM)


def test_a_body_without_any_of_the_points_is_refused(make_run, tmp_path: Path) -> None:
    session, run = make_run("planar_arm4", lambda body: track_of(moving_poses(body, 30)))
    with pytest.raises(ExportError, match="none of the points of 'opensim'"):
        export_run(session, run, FORMATS["c3d"], {"track": MADE, "names": "opensim"}, tmp_path / "arm.c3d")
