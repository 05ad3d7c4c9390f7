"""CSV read as plain text, Parquet by DuckDB, NPZ by numpy without pickles."""

import csv
import json

import duckdb
import numpy as np
import pytest
from export_runs import FRAMES, LOST, MADE, moving_poses

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames, marker_points

LEAST_MM = 0.1


@pytest.mark.parametrize(
    ("angles", "sign", "scale"), [("degrees", "deg", 180.0 / np.pi), ("radians", "rad", 1.0)]
)
def test_csv_heads_name_the_units(exported, angles: str, sign: str, scale: float) -> None:
    path = exported("csv", angles=angles, unit="cm")
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    body, poses = load_body("human29"), moving_poses(load_body("human29"))
    assert len(rows) == FRAMES
    known = [row for at, row in enumerate(rows) if at not in LOST]
    knee = [entry.name for entry in body.parameters].index("left_knee")
    got = np.array([float(row[f"left_knee [{sign}]"]) for row in known])
    wanted = np.delete(poses[:, knee], LOST) * scale
    np.testing.assert_allclose(got, wanted, atol=1e-9)
    np.testing.assert_allclose(
        [float(row["pelvis_x [cm]"]) for row in known], np.delete(poses[:, 0], LOST) / 10.0, atol=1e-9
    )
    points = marker_points(body, poses)
    wrist = [marker.name for marker in body.markers].index("RWrist")
    got = np.array([[float(row[f"RWrist {axis} [cm]"]) for axis in "xyz"] for row in known])
    assert np.linalg.norm(10.0 * got - np.delete(points[:, wrist], LOST, axis=0), axis=1).max() < LEAST_MM
    assert all(rows[at]["RWrist x [cm]"] == rows[at][f"left_knee [{sign}]"] == "" for at in LOST)
    assert {rows[at]["state"] for at in LOST} == {"no evidence"}
    assert float(rows[0]["confidence"]) == pytest.approx(0.5)


def test_duckdb_reads_the_parquet(exported) -> None:
    path = exported("parquet", unit="m", up="y")
    body = load_body("human29")
    markers = [marker.name for marker in body.markers]
    with duckdb.connect() as base:
        columns = [row[0] for row in base.execute(f"DESCRIBE SELECT * FROM '{path}'").fetchall()]
        assert columns == ["frame", "time", "name", "x", "y", "z", "conf"]
        rows = base.execute(
            f"SELECT frame, time, x, y, z, conf FROM '{path}' WHERE name = 'LAnkle' ORDER BY frame"
        ).fetchall()
        (missing,) = base.execute(f"SELECT count(*) FROM '{path}' WHERE x IS NULL").fetchone()
        metadata = dict(
            base.execute(f"SELECT decode(key), decode(value) FROM parquet_kv_metadata('{path}')").fetchall()
        )
    assert missing == len(LOST) * len(markers)
    assert [row[0] for row in rows] == list(range(FRAMES))
    assert isinstance(rows[0][0], int)
    assert (metadata["unit"], metadata["up"], metadata["fps"], metadata["track"], metadata["body"]) == (
        "m",
        "y",
        "60",
        MADE,
        "human29",
    )
    table = np.array([[np.nan if cell is None else cell for cell in row] for row in rows])
    assert len(table) == FRAMES
    np.testing.assert_allclose(table[:, 1], np.arange(FRAMES) / 60.0, atol=1e-9)
    seen = 1000.0 * table[:, [4, 2, 3]]
    wanted = marker_points(body, moving_poses(body))[:, markers.index("LAnkle")]
    apart = np.linalg.norm(seen - wanted, axis=1)
    assert np.flatnonzero(np.isnan(apart)).tolist() == list(LOST)
    assert np.nanmax(apart) < LEAST_MM
    np.testing.assert_allclose(table[:, 5], np.linspace(0.5, 0.99, FRAMES), atol=1e-12)


def test_npz_opens_without_pickles(exported) -> None:
    with np.load(exported("npz"), allow_pickle=False) as read:
        arrays = dict(read)
    about = json.loads(str(arrays["about"]))
    assert (about["unit"], about["up"], about["fps"]) == ("mm", "z", 60.0)
    body, poses = load_body("human29"), moving_poses(load_body("human29"))
    known = np.delete(np.arange(FRAMES), LOST)
    np.testing.assert_array_equal(arrays["poses"][known], poses[known])
    assert np.isnan(arrays["poses"][LOST.start : LOST.stop]).all()
    np.testing.assert_allclose(arrays["markers"][known], marker_points(body, poses)[known], atol=1e-9)
    frames = joint_frames(body, poses)
    np.testing.assert_allclose(arrays["joints"][known], frames[known, :, :, 3], atol=1e-9)
    np.testing.assert_allclose(arrays["joint_rotations"][known], frames[known, :, :, :3], atol=1e-12)
    assert arrays["joint_names"].tolist() == [joint.name for joint in body.joints]
    assert arrays["parameters"].tolist() == [entry.name for entry in body.parameters]
    assert arrays["states"][LOST.start] == "no evidence"


def test_npz_turned_y_up(exported) -> None:
    with np.load(exported("npz", up="y", unit="m"), allow_pickle=False) as read:
        joints, turns = read["joints"][0], read["joint_rotations"][0]
    frames = joint_frames(load_body("human29"), moving_poses(load_body("human29"))[0])[0]
    np.testing.assert_allclose(1000.0 * joints, frames[:, [1, 2, 0], 3], atol=1e-9)
    np.testing.assert_allclose(turns, frames[:, [1, 2, 0], :3], atol=1e-12)
