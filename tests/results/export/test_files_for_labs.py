"""Points for the tools of behaviour labs: NWB read by pynwb, SLEAP's file by h5py, DeepLabCut's table by pandas."""

import csv
import json
import sys

import h5py
import numpy as np
import pandas
import pynwb
import pytest
from export_runs import FRAMES, LOST, moving_poses

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.truth_files import read_truth
from studio.foundations.errors import ExportError, StudioError
from studio.results.export.naming import points_of

LEAST_MM = 0.1
CAMERAS = 1


def wanted() -> tuple[list[str], np.ndarray]:
    """Names, and places (K, M, 3) mm with gaps."""
    body = load_body("human29")
    places = marker_points(body, moving_poses(body))
    places[list(LOST)] = np.nan
    return [marker.name for marker in body.markers], places


def test_nwb_holds_points_skeleton_confidence_and_pose(exported) -> None:
    names, places = wanted()
    with pynwb.NWBHDF5IO(str(exported("nwb", unit="m")), "r") as stream:
        behaviour = stream.read().processing["behavior"]
        pose = behaviour["PoseEstimation"]
        series = pose.pose_estimation_series
        assert set(series) == set(names)
        for at, name in enumerate(names):
            np.testing.assert_allclose(
                np.asarray(series[name].data) * 1000.0, places[:, at], atol=LEAST_MM, equal_nan=True
            )
        assert {(entry.rate, entry.unit, entry.starting_time) for entry in series.values()} == {
            (60.0, "m", 0.0)
        }
        np.testing.assert_allclose(
            np.asarray(series["LAnkle"].confidence)[:3], np.linspace(0.5, 0.99, FRAMES)[:3]
        )
        nodes = list(pose.skeleton.nodes[:])
        edges = {(nodes[one], nodes[other]) for one, other in pose.skeleton.edges[:]}
        assert {("LHip", "LKnee"), ("LKnee", "LAnkle"), ("Neck", "Head"), ("Hip", "Neck")} <= edges
        assert len(edges) == len(names) - 1
        stored = np.asarray(behaviour["pose"].data)
        np.testing.assert_allclose(stored[0], moving_poses(load_body("human29"))[0])
        assert np.isnan(stored[LOST.start]).all()


def test_sleap_s_file_has_its_axes_and_names(exported) -> None:
    names, places = wanted()
    with h5py.File(exported("h5"), "r") as file:
        # As movement and keypoint-moseq read it: transposed, frames first.
        tracks = file["tracks"][:].T
        assert tracks.shape == (FRAMES, len(names), 3, 1)
        np.testing.assert_allclose(tracks[..., 0], places, atol=LEAST_MM, equal_nan=True)
        assert [name.decode() for name in file["node_names"][:]] == names
        scores = file["point_scores"][:].T
        assert scores.shape == (FRAMES, len(names), 1)
        np.testing.assert_allclose(scores[:3, 2, 0], np.linspace(0.5, 0.99, FRAMES)[:3])
        assert file["track_occupancy"][:, 0].tolist() == [int(frame not in LOST) for frame in range(FRAMES)]
        assert file["edge_names"].shape == (len(names) - 1, 2)
        assert json.loads(file["provenance"][()])["unit"] == "mm"


def test_pandas_reads_the_layout_of_deeplabcut(exported) -> None:
    names, places = wanted()
    table = pandas.read_csv(exported("csv", layout="deeplabcut"), header=[0, 1, 2], index_col=0)
    assert table.columns.names == ["scorer", "bodyparts", "coords"]
    assert list(table.index) == list(range(FRAMES))
    by_point = table["capture studio"]
    got = np.stack([by_point[name][["x", "y", "z"]].to_numpy() for name in names], axis=1)
    np.testing.assert_allclose(got, places, atol=LEAST_MM, equal_nan=True)


def test_pandas_reads_the_h5_of_deeplabcut(exported) -> None:
    names, places = wanted()
    path = exported("h5", layout="deeplabcut", unit="cm")
    table = pandas.read_hdf(path)
    assert table.columns.names == ["scorer", "bodyparts", "coords"]
    assert list(table.index) == list(range(FRAMES))
    got = np.stack([table["capture studio"][name].to_numpy() for name in names], axis=1)
    np.testing.assert_allclose(got * 10.0, places, atol=LEAST_MM, equal_nan=True)
    with pytest.raises(ExportError, match="anipose"):
        exported("h5", layout="anipose")


@pytest.mark.parametrize(
    ("name", "requested"),
    [("h5", {}), ("h5", {"layout": "deeplabcut"}), ("nwb", {}), ("csv", {"layout": "deeplabcut"})],
)
def test_what_is_written_for_labs_is_read_as_truth(exported, name: str, requested: dict[str, str]) -> None:
    names, places = wanted()
    motion = read_truth(exported(name, **requested), 60.0)
    assert set(motion.names) == set(names)
    got = motion.positions[:, [motion.names.index(one) for one in names]]
    np.testing.assert_allclose(got, places[: len(got)], atol=LEAST_MM, equal_nan=True)
    assert len(got) == FRAMES


def test_the_layout_of_anipose_has_its_columns(exported) -> None:
    names, places = wanted()
    table = pandas.read_csv(exported("csv", layout="anipose", unit="cm"))
    assert [name.removesuffix("_error") for name in table.columns if name.endswith("_error")] == names
    got = np.stack([table[[f"{name}_{axis}" for axis in "xyz"]].to_numpy() for name in names], axis=1)
    np.testing.assert_allclose(got * 10.0, places, atol=LEAST_MM, equal_nan=True)
    assert table["fnum"].tolist() == list(range(FRAMES))
    # movement refuses a table without them.
    assert np.array_equal(table[[f"M_{i}{j}" for i in range(3) for j in range(3)]].iloc[0], np.eye(3).ravel())
    assert not table[[f"center_{axis}" for axis in range(3)]].to_numpy().any()
    assert set(table["LAnkle_ncams"]) == {CAMERAS}


def test_gaps_and_other_rates_are_kept_between_frames(exported) -> None:
    path = exported("csv", layout="deeplabcut", fps=90.0)
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))[3:]
    assert [row[0] for row in rows[:3]] == ["0", "0.666666666667", "1.33333333333"]


def test_without_the_extra_the_remedy_names_it(exported, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ndx_pose", None)
    with pytest.raises(StudioError, match="ndx_pose is not installed") as refused:
        exported("nwb")
    assert "capture-studio[labs]" in str(refused.value)


@pytest.mark.parametrize("name", ["human31", "human34", "mouse", "branched_arms6"])
def test_every_body_s_points_are_one_tree(name: str) -> None:
    body = load_body(name)
    points = points_of(body, "own")
    edges = points.edges(body)
    assert len(edges) == len(points.names) - 1
    reached = {0}
    for _ in edges:
        reached |= {point for edge in edges if reached & set(edge) for point in edge}
    assert reached == set(range(len(points.names)))
