"""Points in arrays, as DeepLabCut, SLEAP, FreeMoCap, label3d and DANNCE keep them, written by the libraries that these
use.
"""

import os
import pickle
from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest
import scipy.io

from studio.body.motion_files.points_arrays import MEDIAPIPE
from studio.body.motion_files.truth_files import read_truth
from studio.foundations.errors import TruthError

FPS, FRAMES = 50.0, 6
NAMES = ("nose", "tail base")
PLACES = np.random.default_rng(4).uniform(-500.0, 500.0, (FRAMES, 2, 3))
PLACES[3, 1] = np.nan


def deeplabcut(
    path: Path, kind: str = "table", individuals: int = 0, coords: tuple[str, ...] = ("x", "y", "z")
) -> Path:
    levels = [
        ["DLC_3D"],
        *([[f"mouse{k}" for k in range(individuals)]] if individuals else []),
        NAMES,
        coords,
    ]
    heads = ["scorer", *(["individuals"] if individuals else []), "bodyparts", "coords"]
    values = np.tile(PLACES[..., : len(coords)].reshape(FRAMES, -1), max(1, individuals))
    table = pandas.DataFrame(values, columns=pandas.MultiIndex.from_product(levels, names=heads))
    table.to_hdf(path, key="df_with_missing", format=kind, mode="w")
    return path


def same(path: Path, names: tuple[str, ...] = NAMES, places: np.ndarray = PLACES) -> None:
    motion = read_truth(path, FPS)
    assert motion.names == names
    np.testing.assert_allclose(motion.positions, places, equal_nan=True)
    np.testing.assert_allclose(motion.times, np.arange(len(places)) / FPS)


@pytest.mark.parametrize("kind", ["table", "fixed"])
@pytest.mark.parametrize("individuals", [0, 1])
def test_deeplabcut(tmp_path: Path, kind: str, individuals: int) -> None:
    same(deeplabcut(tmp_path / "a.h5", kind, individuals))


@pytest.mark.parametrize(
    ("given", "cause"),
    [({"individuals": 2}, "several individuals"), ({"coords": ("x", "y")}, "holds pixels")],
)
def test_what_is_no_one_s_place_in_space_is_named(
    tmp_path: Path, given: dict[str, object], cause: str
) -> None:
    with pytest.raises(TruthError, match=cause):
        read_truth(deeplabcut(tmp_path / "a.h5", **given), FPS)


def test_sleap(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["tracks"] = PLACES.transpose(2, 1, 0)[None]
        file["node_names"] = np.array(NAMES, dtype=object)
    same(tmp_path / "a.h5")
    with h5py.File(tmp_path / "twice.h5", "w") as file:
        file["tracks"] = PLACES.transpose(2, 1, 0)[None]
        file["node_names"] = np.array(["nose", "nose"], dtype=object)
    with pytest.raises(TruthError, match="names a point twice"):
        read_truth(tmp_path / "twice.h5", FPS)
    with h5py.File(tmp_path / "pixels.h5", "w") as file:
        file["tracks"] = PLACES[..., :2].transpose(2, 1, 0)[None]
        file["node_names"] = np.array(NAMES, dtype=object)
    with pytest.raises(TruthError, match="pixels or several bodies"):
        read_truth(tmp_path / "pixels.h5", FPS)


def test_numbers_in_other_files_are_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "there.h5", "w") as file:
        file["tracks"] = PLACES.transpose(2, 1, 0)[None]
    with h5py.File(tmp_path / "linked.h5", "w") as file:
        file["tracks"] = h5py.ExternalLink("there.h5", "tracks")
        file["node_names"] = np.array(NAMES, dtype=object)
    (tmp_path / "raw").write_bytes(bytes(8 * FRAMES * 6))
    with h5py.File(tmp_path / "outside.h5", "w") as file:
        file.create_dataset(
            "tracks", (1, 3, 2, FRAMES), "f8", external=[(str(tmp_path / "raw"), 0, 8 * FRAMES * 6)]
        )
        file["node_names"] = np.array(NAMES, dtype=object)
    for name in ("linked", "outside"):
        with pytest.raises(TruthError):
            read_truth(tmp_path / f"{name}.h5", FPS)


class Harmful:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, ("ran",)


def test_what_pandas_pickles_does_not_run(tmp_path: Path) -> None:
    with h5py.File(deeplabcut(tmp_path / "a.h5"), "a") as file:
        file["df_with_missing/table"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps([Harmful()], 0))
    with pytest.raises(TruthError, match="asks for"):
        read_truth(tmp_path / "a.h5", FPS)


def test_freemocap(tmp_path: Path) -> None:
    values = np.random.default_rng(0).uniform(1.0, 900.0, (FRAMES, 553, 3))
    np.save(tmp_path / "a.npy", values)
    same(tmp_path / "a.npy", MEDIAPIPE, values[:, :33])
    np.save(tmp_path / "c.npy", values[:, :33])
    same(tmp_path / "c.npy", MEDIAPIPE, values[:, :33])
    np.save(tmp_path / "b.npy", values[:, :21])
    with pytest.raises(TruthError, match="21 points"):
        read_truth(tmp_path / "b.npy", FPS)


def test_label3d_and_dannce(tmp_path: Path) -> None:
    frames = np.array([[1], [4]])
    cells = np.empty((2, 1), dtype=object)
    cells[:, 0] = [
        {"data_3d": PLACES[[1, 4]].reshape(2, 6), "data_frame": frames, "data_2d": np.zeros((2, 4))}
    ] * 2
    names = np.array(NAMES, dtype=object)
    scipy.io.savemat(tmp_path / "a.mat", {"labelData": cells, "skeleton": {"joint_names": names}})
    expected = np.full((5, 2, 3), np.nan)
    expected[[1, 4]] = PLACES[[1, 4]]
    same(tmp_path / "a.mat", NAMES, expected)
    scipy.io.savemat(
        tmp_path / "b.mat", {"data_3D": PLACES[[1, 4]].reshape(2, 6), "framesToLabel": frames.T + 1}
    )
    same(tmp_path / "b.mat", ("point1", "point2"), expected)
    scipy.io.savemat(tmp_path / "c.mat", {"pred": PLACES.transpose(0, 2, 1)})
    same(tmp_path / "c.mat", ("point1", "point2"))
    scipy.io.savemat(tmp_path / "d.mat", {"params": 1.0})
    with pytest.raises(TruthError, match="no points of label3d"):
        read_truth(tmp_path / "d.mat", FPS)


def stored(path: Path, **entries: object) -> Path:
    """An HDF5 file of entries by their paths."""
    with h5py.File(path, "w") as file:
        for name, values in entries.items():
            file[name] = values
    return path


def names_of(*names: str) -> np.ndarray:
    return np.array(names, dtype=object)


def refused(path: Path, words: str) -> None:
    with pytest.raises(TruthError, match=words):
        read_truth(path, FPS)


def test_what_sleap_may_lack_or_have_too_much_of(tmp_path: Path) -> None:
    tracks = PLACES.transpose(2, 1, 0)[None]
    refused(stored(tmp_path / "a.h5", tracks=tracks), "no names")
    refused(stored(tmp_path / "b.h5", node_names=names_of(*NAMES)), "no HDF5 file of points that is known")
    two = np.concatenate([tracks, tracks])
    refused(stored(tmp_path / "c.h5", tracks=two, node_names=names_of(*NAMES)), "pixels or several bodies")
    refused(
        stored(tmp_path / "d.h5", tracks=tracks[0], node_names=names_of(*NAMES)), "pixels or several bodies"
    )
    refused(stored(tmp_path / "e.h5", tracks=tracks, node_names=names_of("nose")), "pixels or several bodies")
    with h5py.File(tmp_path / "f.h5", "w") as file:
        file.create_dataset("tracks", (1, 3, 100, 600_000), "f4", chunks=(1, 3, 100, 100))
        file["node_names"] = names_of(*NAMES)
    refused(tmp_path / "f.h5", "'tracks' has")


def test_a_table_of_deeplabcut_has_other_columns_and_entries_beside_it(tmp_path: Path) -> None:
    """Frames that were left out, a column of likelihoods, another entry before the table."""
    columns = pandas.MultiIndex.from_product([["D"], NAMES, ["likelihood", "z", "y", "x"]])
    values = np.concatenate([np.full((FRAMES, 2, 1), 0.9), PLACES[..., ::-1]], axis=2).reshape(FRAMES, -1)
    expected = np.full((9, 2, 3), np.nan)
    at = [1, 2, 4, 5, 7, 8]
    expected[at] = PLACES
    for kind in ("table", "fixed"):
        table = pandas.DataFrame(values, index=at, columns=columns)
        table.to_hdf(tmp_path / "a.h5", key="table", format=kind, mode="w")
        with h5py.File(tmp_path / "a.h5", "a") as file:
            file["a_number"] = 1.0
            file.create_group("a_group")
        same(tmp_path / "a.h5", NAMES, expected)
        table.index = [f"img{number}.png" for number in range(FRAMES)]
        table.to_hdf(tmp_path / "b.h5", key="table", format=kind, mode="w")
        same(tmp_path / "b.h5")


def estimate(file: h5py.File, name: str = "Pose", unit: str = "meters", **more: object) -> None:
    """A pose estimate of ndx-pose. more : entries of the first series, or `conversion` of its data."""
    group = file.create_group(f"processing/behavior/{name}")
    group.attrs["neurodata_type"] = "PoseEstimation"
    conversion = more.pop("conversion", None)
    for number, point in enumerate(NAMES):
        series = group.create_group(point)
        series["data"] = PLACES[:, number] / 1000.0
        series["data"].attrs["unit"] = unit
        if conversion is not None:
            series["data"].attrs["conversion"] = conversion
        for key, value in more.items():
            series[key] = value
        if "starting_time" in more:
            series["starting_time"].attrs["rate"] = 25.0
    group["description"] = "words"
    group.create_group("skeleton")


def test_pose_estimates_have_a_unit_a_factor_and_times_of_their_own(tmp_path: Path) -> None:
    expected = np.full((13, 2, 3), np.nan)
    expected[2::2] = PLACES
    cases = {
        "stamps": {"timestamps": np.arange(1, 7) / 25.0},
        "begun": {"starting_time": 1 / 25.0},
        "factor": {"timestamps": np.arange(1, 7) / 25.0, "unit": "", "conversion": 1000.0},
    }
    for name, given in cases.items():
        path = tmp_path / f"{name}.nwb"
        with h5py.File(path, "w") as file:
            file["processing/0 words"] = 1.0
            other = file.create_group("processing/1 other/thing")
            other.attrs["neurodata_type"] = "TimeSeries"
            file["processing/1 other/number"] = 1.0
            estimate(file, **given)
        same(path, NAMES, expected)
        assert read_truth(path, FPS).unit == ("" if name == "factor" else "m")


def test_pose_estimates_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for name, change in {"lengths": np.zeros((3, 3)), "none": None, "plane": "plane"}.items():
        with h5py.File(tmp_path / f"{name}.nwb", "w") as file:
            estimate(file, timestamps=np.arange(6) / 25.0)
            group = file["processing/behavior/Pose"]
            for point in NAMES if change is None or name == "plane" else NAMES[1:]:
                del group[point]["data"]
                if change is not None:
                    group[point]["data"] = np.zeros((6, 2)) if name == "plane" else change
                    group[point]["data"].attrs["unit"] = "mm"
        words = "pixels" if name == "plane" else "different lengths"
        refused(tmp_path / f"{name}.nwb", words)


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ([-1.0], "frames that no footage has"),
        ([np.nan], "no frames"),
        ([500_001.0], "no footage has"),
    ],
)
def test_frames_that_no_footage_has_are_refused(tmp_path: Path, frames: list[float], words: str) -> None:
    label = {"data_3d": np.ones((len(frames), 6)), "data_frame": np.array(frames)}
    scipy.io.savemat(tmp_path / "a.mat", {"labelData": label})
    refused(tmp_path / "a.mat", words)


def test_too_many_points_and_frames_are_refused(tmp_path: Path) -> None:
    label = {"data_3d": np.ones((1, 3 * 101)), "data_frame": 500_000.0}
    scipy.io.savemat(tmp_path / "a.mat", {"labelData": label})
    refused(tmp_path / "a.mat", "has 101 points and 500001 frames")


def test_label3ds_files_have_one_camera_or_several_and_names_that_fit(tmp_path: Path) -> None:
    label = {"data_3d": PLACES[[1, 4]].reshape(2, 6), "data_frame": np.array([1, 4])}
    expected = np.full((5, 2, 3), np.nan)
    expected[[1, 4]] = PLACES[[1, 4]]
    names = {"joint_names": names_of("nose", "tail", "ear")}
    scipy.io.savemat(tmp_path / "a.mat", {"labelData": label, "skeleton": names})
    same(tmp_path / "a.mat", ("point1", "point2"), expected)
    for number, wrong in enumerate(({"data_3d": 1.0}, {"data_frame": 1.0}, 3.0)):
        scipy.io.savemat(tmp_path / f"{number}.mat", {"labelData": wrong})
        refused(tmp_path / f"{number}.mat", "without data_3d and data_frame")
    scipy.io.savemat(tmp_path / "b.mat", {"data_3D": PLACES.reshape(FRAMES, 6)})
    refused(tmp_path / "b.mat", "no points of label3d")
    for number, shape in enumerate([(FRAMES, 2, 3), (FRAMES, 3), (FRAMES, 3, 2, 2)]):
        scipy.io.savemat(tmp_path / f"p{number}.mat", {"pred": np.ones(shape)})
        refused(tmp_path / f"p{number}.mat", "pred of shape")
    scipy.io.savemat(tmp_path / "c.mat", {"pred": PLACES.transpose(0, 2, 1)})
    assert "counted from 0" in read_truth(tmp_path / "c.mat", FPS).notes[0]


@pytest.mark.parametrize(
    "values",
    [
        np.ones((0, 33, 3)),
        np.ones((6, 33)),
        np.ones((6, 33, 2)),
        np.full((6, 33, 3), True),
        np.ones((6, 32, 3)),
    ],
)
def test_arrays_that_are_no_points_of_a_body_are_refused(tmp_path: Path, values: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", values)
    refused(tmp_path / "a.npy", "a.npy")
    assert MEDIAPIPE[0] == "nose"


def test_part_of_a_place_is_none_and_zeros_are_said(tmp_path: Path) -> None:
    values = np.random.default_rng(1).uniform(1.0, 900.0, (FRAMES, 33, 3))
    values[2, 3, 1] = np.nan
    values[3, 4] = 0.0
    np.save(tmp_path / "a.npy", values)
    wanted = values.copy()
    wanted[2, 3] = wanted[3, 4] = np.nan
    same(tmp_path / "a.npy", MEDIAPIPE, wanted)
    assert "0 0 0 for a marker 1 times" in read_truth(tmp_path / "a.npy", FPS).notes[0]
    values[0, 0, 0] = 2e7
    np.save(tmp_path / "a.npy", values)
    refused(tmp_path / "a.npy", "marker 'nose' is at")
    whole = np.arange(1, 6 * 99 + 1).reshape(6, 33, 3)
    np.save(tmp_path / "b.npy", whole)
    same(tmp_path / "b.npy", MEDIAPIPE, whole)


def test_rows_without_numbers_are_counted(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("nose_x,nose_y,nose_z,extra\n1,2,3,9\n4,5,6,9\n")
    motion = read_truth(tmp_path / "a.csv", FPS)
    assert motion.positions[:, 0].tolist() == [[1, 2, 3], [4, 5, 6]]
    assert any("counted from 0" in note for note in motion.notes)


def test_pose_estimates_of_nwb_and_a_file_without_any(tmp_path: Path) -> None:
    places = {name: np.arange(6.0).reshape(2, 3) + at for at, name in enumerate(("nose", "tail"))}
    with h5py.File(tmp_path / "a.nwb", "w") as file:
        file.create_group("acquisition")
        estimate = file.create_group("processing/behavior/PoseEstimation")
        estimate.attrs["neurodata_type"] = "PoseEstimation"
        for name, values in places.items():
            series = estimate.create_group(name)
            series["data"], series["timestamps"] = values, np.array([0.0, 0.5])
            series["data"].attrs["unit"] = "millimeters"
    read = read_truth(tmp_path / "a.nwb", 2.0)
    assert read.names == ("nose", "tail")
    np.testing.assert_allclose(read.positions[:2], np.stack([places["nose"], places["tail"]], axis=1))
    with h5py.File(tmp_path / "b.nwb", "w") as file:
        file.create_group("acquisition")
    with pytest.raises(TruthError, match=r"b\.nwb"):
        read_truth(tmp_path / "b.nwb", 2.0)
