"""Folders as other tools leave them, with the points that they found: footage, calibration and truth in one import."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from other_layouts import CAMERAS, anipose, caliscope, freemocap, old_freemocap, pose2sim, videos
from sources import FRAMES
from toy_footage import numbered_frame, write_video

from studio.body.motion_files.points_arrays import MEDIAPIPE
from studio.body.motion_files.trc import MarkerMotion, read_trc, write_trc
from studio.foundations.errors import CalibrationError
from studio.sessions.importers.importing import ImportOptions, ImportReport, import_source

MIDDLE = np.mean([camera.centre + 3000.0 * camera.rotation[2] for camera in CAMERAS], axis=0)


def points(count: int) -> np.ndarray:
    """(FRAMES, count, 3) mm, in view of both cameras."""
    return MIDDLE + np.random.default_rng(0).uniform(-100.0, 100.0, (FRAMES, count, 3))


def table(path: Path, names: tuple[str, ...], places: np.ndarray, first: str, scale: float = 1.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    head = ",".join([first, *(f"{name}_{axis}" for name in names for axis in "xyz")])
    rows = [",".join(map(repr, [k, *map(float, place.ravel() / scale)])) for k, place in enumerate(places)]
    path.write_text("\n".join([head, *rows]) + "\n")


def with_pose2sim(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    pose2sim(folder)
    places = points(2)
    motion = MarkerMotion(("Hip", "Neck"), np.arange(FRAMES) / 60.0, places)
    write_trc(folder / "pose-3d" / "walk_0-12_filt_butterworth.trc", motion)
    noisy = MarkerMotion(("Hip", "Neck"), np.arange(FRAMES) / 60.0, places + 9.0)
    write_trc(folder / "pose-3d" / "walk_0-12.trc", noisy)
    return folder, ("Hip", "Neck"), places


def with_anipose(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    anipose(folder)
    table(folder / "pose-3d" / "walk.csv", ("nose", "tail"), points(2), "fnum")
    return folder, ("nose", "tail"), points(2)


def with_caliscope(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    caliscope(folder)
    place = folder / "recordings" / "walk" / "HOLISTIC" / "xyz_HOLISTIC_labelled.csv"
    table(place, ("nose", "left_hip"), points(2), "sync_index", 1000.0)
    return folder, ("nose", "left_hip"), points(2)


def with_freemocap(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    freemocap(folder)
    return raw_data(folder)


def with_old_freemocap(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    old_freemocap(folder)
    return raw_data(folder)


def raw_data(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    place = folder / "output_data" / "raw_data"
    place.mkdir(parents=True)
    np.save(place / "mediapipe3dData_numFrames_numTrackedPoints_spatialXYZ.npy", points(553))
    return folder, MEDIAPIPE, points(553)[:, :33]


def with_dannce(folder: Path) -> tuple[Path, tuple[str, ...], np.ndarray]:
    cells, labels = np.empty((2, 1), dtype=object), np.empty((2, 1), dtype=object)
    for number, camera in enumerate(CAMERAS):
        place = folder / "videos" / f"Camera{number + 1}"
        place.mkdir(parents=True)
        write_video(place / "0.mp4", [numbered_frame(k, number) for k in range(FRAMES)], fps=60)
        matrix = camera.matrix.copy()
        matrix[:2, 2] += 1.0
        k1, k2, p1, p2, k3 = camera.distortion
        lens = {"K": matrix.T, "RDistort": np.array([k1, k2, k3]), "TDistort": np.array([p1, p2])}
        cells[number, 0] = {**lens, "r": camera.rotation.T, "t": camera.translation.reshape(1, 3)}
        labels[number, 0] = {
            "data_3d": points(2).reshape(FRAMES, 6),
            "data_frame": np.arange(FRAMES)[:, None],
            "data_2d": np.zeros((FRAMES, 4)),
        }
    names = np.array(["Camera1", "Camera2"], dtype=object)
    skeleton = {"joint_names": np.array(["snout", "tail"], dtype=object)}
    found = {"params": cells, "camnames": names, "labelData": labels, "skeleton": skeleton}
    scipy.io.savemat(folder / "20260101_Label3D_dannce.mat", found)
    scipy.io.savemat(folder / "older_Label3D_dannce.mat", {**found, "skeleton": {}})
    (folder / "io.yaml").write_text(
        "com_train_dir: './COM/train_results/'\nexp:\n  - label3d_file: './20260101_Label3D_dannce.mat'\n"
    )
    return folder, ("snout", "tail"), points(2)


def truth_of(report: ImportReport) -> MarkerMotion:
    assert report.session.truth_path is not None, report.notes
    return read_trc(report.session.truth_path)


@pytest.mark.parametrize(
    "write", [with_pose2sim, with_anipose, with_caliscope, with_freemocap, with_old_freemocap, with_dannce]
)
def test_footage_calibration_and_points_come_in_one_import(
    tmp_path: Path, write: Callable[[Path], tuple[Path, tuple[str, ...], np.ndarray]]
) -> None:
    source, names, places = write(tmp_path / "source")
    report = import_source(source, tmp_path / "made")
    assert len(report.session.cameras()) == 2
    assert report.session.manifest.frame_count == FRAMES
    motion = truth_of(report)
    assert motion.names == names
    np.testing.assert_allclose(motion.positions, places, atol=0.1)
    assert any("taken for the truth" in note for note in report.notes)


def opencap(folder: Path) -> Path:
    """Two trials and the board's, each camera's pickle in its folder."""
    for number, camera in enumerate(CAMERAS):
        place = folder / "Videos" / f"Cam{number}"
        for trial in ("calibration", "walk", "squats"):
            (place / "InputMedia" / trial).mkdir(parents=True)
            frames = [numbered_frame(k, number) for k in range(FRAMES)]
            write_video(place / "InputMedia" / trial / f"{trial}.mov", frames, fps=60)
            write_video(place / "InputMedia" / trial / f"{trial}_sync.mp4", frames, fps=60)
        content = {
            "intrinsicMat": camera.matrix,
            "distortion": camera.distortion[None],
            "imageSize": np.array([[camera.height], [camera.width]]),
            "rotation": camera.rotation,
            "translation": camera.translation[:, None],
        }
        (place / "cameraIntrinsicsExtrinsics.pickle").write_bytes(pickle.dumps(content))
    for trial in ("walk", "squats"):
        (folder / "MarkerData").mkdir(exist_ok=True)
        motion = MarkerMotion((f"{trial}_knee", "r_ankle"), np.arange(FRAMES) / 60.0, points(2))
        write_trc(folder / "MarkerData" / f"{trial}.trc", motion)
    return folder


def test_an_opencap_session_s_trial(tmp_path: Path) -> None:
    source = opencap(tmp_path / "source")
    report = import_source(source, tmp_path / "made", ImportOptions(trial="squats"))
    assert report.layout == "OpenCap session"
    for found, wanted in zip(report.session.cameras(), CAMERAS, strict=True):
        np.testing.assert_allclose(found.matrix, wanted.matrix)
        np.testing.assert_allclose(found.rotation, wanted.rotation, atol=1e-9)
        np.testing.assert_allclose(found.translation, wanted.translation)
        assert (found.width, found.height) == (wanted.width, wanted.height)
    assert [camera.name for camera in report.session.cameras()] == ["Cam0", "Cam1"]
    assert truth_of(report).names == ("squats_knee", "r_ankle")
    assert any("--align rigid" in note for note in report.notes)
    kept = sorted(path.name for path in (report.session.path / "calibration" / "original").iterdir())
    assert kept == [f"Cam{k}-cameraIntrinsicsExtrinsics.pickle" for k in (0, 1)]


def test_an_opencap_pickle_that_is_none_is_refused(tmp_path: Path) -> None:
    source = opencap(tmp_path / "source")
    place = source / "Videos" / "Cam0" / "cameraIntrinsicsExtrinsics.pickle"
    for content in (pickle.dumps(print), b"\x80\x04.", pickle.dumps({"intrinsicMat": np.eye(2)})):
        place.write_bytes(content)
        with pytest.raises(CalibrationError):
            import_source(source, tmp_path / "made", ImportOptions(trial="walk"))


def test_points_that_no_camera_sees_are_left_out_and_said(tmp_path: Path) -> None:
    source = anipose(tmp_path / "source")
    table(source / "pose-3d" / "walk.csv", ("nose", "tail"), points(2) + 1e5, "fnum")
    report = import_source(source, tmp_path / "made")
    assert report.session.truth_path is None
    assert any("not taken for the truth" in note for note in report.notes)


def test_points_of_several_takes_are_none_of_them(tmp_path: Path) -> None:
    source = pose2sim(tmp_path / "source")
    for name in ("one.trc", "two.trc"):
        motion = MarkerMotion(("Hip",), np.arange(FRAMES) / 60.0, points(1))
        write_trc(source / "pose-3d" / name, motion)
    report = import_source(source, tmp_path / "made")
    assert report.session.truth_path is None
    assert any("several takes" in note for note in report.notes)


def test_the_points_of_the_take_that_is_chosen(tmp_path: Path) -> None:
    source = anipose(tmp_path / "source")
    videos(source / "videos-raw", ("run-cam_1.mp4", "run-cam_2.mp4"))
    for take in ("walk", "run"):
        table(source / "pose-3d" / f"{take}.csv", (f"{take}_nose", "tail"), points(2), "fnum")
    report = import_source(source, tmp_path / "made", ImportOptions(trial="run"))
    assert truth_of(report).names == ("run_nose", "tail")


def test_a_table_without_a_unit_beside_a_calibration_in_metres(tmp_path: Path) -> None:
    source = pose2sim(tmp_path / "source")
    table(source / "truth" / "points.csv", ("Hip", "Neck"), points(2), "frame", 1000.0)
    report = import_source(source, tmp_path / "made")
    np.testing.assert_allclose(truth_of(report).positions, points(2), atol=0.1)
    assert any("name no unit" in note for note in report.notes)
