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
