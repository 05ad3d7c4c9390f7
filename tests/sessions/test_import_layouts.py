"""Other tools' folders, recognised without being told."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import tomli_w
from sources import FRAMES, video_source, write_pose2sim
from toy_footage import number_of, numbered_frame, rig, write_pictures, write_video

from studio.capture.calibration_files import export_calibration
from studio.errors import CalibrationError, FootageError, StudioError
from studio.sessions.importers.catalogue import import_source

CAMERAS = rig(2, "cam_")


def videos(
    folder: Path, names: tuple[str, ...] = ("cam_1.mp4", "cam_2.mp4"), frames: int = FRAMES, first: int = 0
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for index, name in enumerate(names):
        write_video(folder / name, [numbered_frame(first + k, index) for k in range(frames)], fps=60)


def pose2sim(folder: Path) -> Path:
    videos(folder / "videos")
    write_pose2sim(folder / "calibration" / "Calib_scene.toml", CAMERAS)
    (folder / "Config.toml").write_text(tomli_w.dumps({"project": {"frame_rate": "auto"}}))
    for name in ("pose", "pose-3d", "kinematics"):
        (folder / name).mkdir()
    write_pictures(folder / "pose" / "cam_1_img", [numbered_frame(0)])
    return folder


def freemocap(folder: Path) -> Path:
    videos(folder / "videos" / "synchronized", ("cam_1.mp4", "cam_2.mp4"))
    videos(folder / "videos" / "annotated", ("cam_1_annotated.mp4", "cam_2_annotated.mp4"))
    (folder / "output").mkdir()
    (folder / f"{folder.name}_recording_info.json").write_text("{}")
    export_calibration(CAMERAS, folder / f"{folder.name}_calibration.toml", "aniposelib")
    return folder


def old_freemocap(folder: Path) -> Path:
    videos(folder / "synchronized_videos", ("Camera_1_synchronized.mp4", "Camera_2_synchronized.mp4"))
    videos(folder / "annotated_videos", ("Camera_1_annotated.mp4", "Camera_2_annotated.mp4"))
    (folder / "output_data").mkdir()
    export_calibration(CAMERAS, folder / f"{folder.name}_camera_calibration.toml", "aniposelib")
    return folder


def camera_array(path: Path) -> None:
    """Caliscope's own file: metres, 3x3 rotations, cameras by number."""
    path.parent.mkdir(parents=True, exist_ok=True)
    tables = {
        str(k): {
            "cam_id": k, "rotation_count": 0, "error": 0.2, "size": [camera.width, camera.height],
            "matrix": camera.matrix.tolist(), "distortions": camera.distortion.tolist(),
            "translation": (camera.translation / 1000.0).tolist(), "rotation": camera.rotation.tolist(),
        }
        for k, camera in enumerate(CAMERAS, 1)
    }  # fmt: skip
    path.write_text(tomli_w.dumps({"cameras": tables}))


def caliscope(folder: Path) -> Path:
    videos(folder / "calibration" / "intrinsic", frames=2)
    videos(folder / "calibration" / "extrinsic", frames=2)
    camera_array(folder / "calibration" / "extrinsic" / "capture_volume" / "camera_array.toml")
    videos(folder / "recordings" / "walk")
    videos(folder / "recordings" / "walk" / "ONNX_pose", ("cam_1_ONNX.mp4", "cam_2_ONNX.mp4"), frames=2)
    return folder


def caliscope_take(folder: Path) -> Path:
    videos(folder)
    camera_array(folder / "HOLISTIC" / "camera_array.toml")
    return folder


def anipose(folder: Path) -> Path:
    videos(folder / "videos-raw", ("walk-cam_1.avi.mp4", "walk-cam_2.avi.mp4"))
    (folder / "calibration").mkdir()
    export_calibration(CAMERAS, folder / "calibration" / "calibration.toml", "aniposelib")
    return folder


def easymocap(folder: Path) -> Path:
    for index in (1, 2):
        write_pictures(folder / "images" / f"cam_{index}", [numbered_frame(k) for k in range(FRAMES)])
        mask = np.full((96, 128, 3), 255, np.uint8)
        write_pictures(folder / "mask" / f"cam_{index}", [mask] * FRAMES)
    (folder / "annots").mkdir()
    for name in ("intri", "extri"):
        storage = cv2.FileStorage(str(folder / f"{name}.yml"), cv2.FILE_STORAGE_WRITE)
        for camera in CAMERAS:
            if name == "intri":
                storage.write(f"K_{camera.name}", camera.matrix)
                storage.write(f"dist_{camera.name}", camera.distortion[None])
            else:
                storage.write(f"R_{camera.name}", cv2.Rodrigues(camera.rotation)[0])
                storage.write(f"T_{camera.name}", camera.translation[:, None] / 1000.0)
        storage.release()
    return folder


@pytest.mark.parametrize(
    ("write", "title"),
    [
        (pose2sim, "Pose2Sim trial"),
        (freemocap, "FreeMoCap recording"),
        (old_freemocap, "FreeMoCap recording (older layout)"),
        (caliscope, "Caliscope recording"),
        (caliscope_take, "Caliscope recording"),
        (anipose, "anipose session"),
        (easymocap, "EasyMocap data set"),
    ],
)
def test_a_layout_is_recognised_and_read(tmp_path: Path, write: Callable[[Path], Path], title: str) -> None:
    source = write(tmp_path / "source")
    report = import_source(source, tmp_path / "made", fps=60.0)
    assert report.layout == title
    assert any(f"Taken for a {title}" in note for note in report.notes)
    session = report.session
    assert session.manifest.layout == title
    footage = session.footage()
    assert [number_of(picture) for picture in footage.pictures(9).pictures] == [9, 9]
    for found, wanted in zip(session.cameras(), CAMERAS, strict=True):
        np.testing.assert_allclose(found.translation, wanted.translation, atol=1e-6)
        np.testing.assert_allclose(found.rotation, wanted.rotation, atol=1e-9)
        np.testing.assert_allclose(found.matrix, wanted.matrix)
        assert (found.width, found.height) == (128, 96)
    assert footage.has_masks("cam_1") == (write is easymocap)
    kept = sorted(path.name for path in (session.path / "calibration").rglob("*.*"))
    assert kept == (
        ["cameras.toml", "extri.yml", "intri.yml"]
        if write is easymocap
        else ["cameras.toml", "original.toml"]
    )
    assert any("taken from the footage" in note for note in report.notes) == (write is easymocap)


def batch(folder: Path) -> Path:
    """Pose2Sim's batch: one calibration and Config above several trials."""
    write_pose2sim(folder / "Calibration" / "Calib.toml", CAMERAS)
    (folder / "Config.toml").write_text(tomli_w.dumps({"project": {"frame_rate": 60}}))
    for number, first in ((1, 0), (2, 20), (10, 40)):
        videos(folder / f"Trial_{number}" / "videos", first=first)
        (folder / f"Trial_{number}" / "Config.toml").write_text("")
    return folder


def takes(folder: Path) -> Path:
    """Caliscope's workspace with two takes."""
    caliscope(folder)
    videos(folder / "recordings" / "run", first=20)
    return folder


def anipose_takes(folder: Path) -> Path:
    """Two takes in one folder of videos."""
    anipose(folder)
    videos(folder / "videos-raw", ("run-cam_1.mp4", "run-cam_2.mp4"), first=20)
    return folder


def recordings(folder: Path) -> Path:
    """FreeMoCap's folder of recordings."""
    for name in ("a", "b"):
        freemocap(folder / f"session_{name}")
    return folder


@pytest.mark.parametrize(
    ("write", "named", "wish", "first"),
    [
        (batch, "Trial_1, Trial_2, Trial_10", "Trial_2", 20),
        (takes, "run, walk", "run", 20),
        (anipose_takes, "run, walk", "run", 20),
        (recordings, "session_a, session_b", "session_b", 0),
    ],
)
def test_several_trials_are_named_and_one_is_chosen(
    tmp_path: Path, write: Callable[[Path], Path], named: str, wish: str, first: int
) -> None:
    source = write(tmp_path / "source")
    with pytest.raises(FootageError, match=f"trials: .*{named}") as caught:
        import_source(source, tmp_path / "made")
    assert "--trial" in caught.value.hint
    with pytest.raises(FootageError, match="There is no trial 'dance'"):
        import_source(source, tmp_path / "made", trial="dance")
    session = import_source(source, tmp_path / "made", trial=wish).session
    assert number_of(session.footage().picture("cam_1", 3)) == first + 3
    assert len(session.cameras()) == 2


def test_a_trial_alone_says_where_its_calibration_may_be(tmp_path: Path) -> None:
    source = batch(tmp_path / "source") / "Trial_1"
    with pytest.raises(CalibrationError, match="no calibration") as caught:
        import_source(source, tmp_path / "made")
    assert "import the folder above with --trial" in caught.value.hint
    with pytest.raises(FootageError, match="holds none named 'x'"):
        import_source(video_source(tmp_path / "one"), tmp_path / "made", trial="x")


def test_nothing_above_the_source_is_read(tmp_path: Path) -> None:
    # A calibration beside the source is not the source's.
    source = video_source(tmp_path / "outer" / "inner")
    shutil.move(source / "calibration", tmp_path / "outer" / "calibration")
    with pytest.raises(CalibrationError):
        import_source(source, tmp_path / "made")


def test_an_opencap_pickle_is_named_as_the_reason(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    (source / "calibration" / "Calib.toml").unlink()
    (source / "calibration" / "cameraIntrinsicsExtrinsics.pickle").write_bytes(b"\x80\x04.")
    with pytest.raises(CalibrationError, match="Python pickle") as caught:
        import_source(source, tmp_path / "made")
    assert "TOML" in caught.value.hint


def test_originals_of_several_files_are_kept_byte_for_byte(tmp_path: Path) -> None:
    source = easymocap(tmp_path / "source")
    session = import_source(source, tmp_path / "made", fps=30.0).session
    for name in ("intri.yml", "extri.yml"):
        assert (session.path / "calibration" / "original" / name).read_bytes() == (source / name).read_bytes()
    again = import_source(session.path, tmp_path / "again").session
    assert (again.path / "calibration" / "original" / "intri.yml").read_bytes() == (
        source / "intri.yml"
    ).read_bytes()


def timed(folder: Path, offsets: dict[int, int], rates: tuple[float, float] = (60.0, 60.0)) -> Path:
    """A Caliscope take whose cameras began apart, with the times of the frames."""
    caliscope(folder)
    rows = ["cam_id,frame_time"]
    for index, late in offsets.items():
        begun = [numbered_frame(late + k, index) for k in range(20)]
        write_video(folder / "recordings" / "walk" / f"cam_{index}.mp4", begun, fps=60)
        rows += [f"{index},{50.0 + (late + k) / rates[index - 1]}" for k in range(20)]
    (folder / "recordings" / "walk" / "timestamps.csv").write_text("\n".join(rows))
    return folder


def test_recorded_times_put_cameras_in_step(tmp_path: Path) -> None:
    report = import_source(timed(tmp_path / "source", {1: 0, 2: 6}), tmp_path / "made")
    footage = report.session.footage()
    assert [camera.offset for camera in footage.source.cameras] == [6, 0]
    assert footage.frame_count == 14
    for frame in (0, 13):
        assert [number_of(picture) for picture in footage.pictures(frame).pictures] == [frame + 6, frame + 6]
    assert any("timestamps.csv" in note for note in report.notes)
    again = import_source(report.session.path, tmp_path / "again").session
    assert again.manifest.footage.frame_count == 14
    assert number_of(again.footage().picture("cam_1", 0)) == 6


def test_times_of_unlike_rates_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FootageError, match="different frame rates"):
        import_source(timed(tmp_path / "source", {1: 0, 2: 0}, (60.0, 30.0)), tmp_path / "made")


def test_offsets_and_turns_by_hand(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source", frames=20)
    lying = [cv2.rotate(numbered_frame(4 + k, 1), cv2.ROTATE_90_COUNTERCLOCKWISE) for k in range(20)]
    write_video(source / "videos" / "cam02.mp4", lying, fps=60)
    with pytest.raises(CalibrationError, match="one is upright"):
        import_source(source, tmp_path / "made")
    report = import_source(source, tmp_path / "made", offsets={"cam_1": 4}, rotations={"cam02": 90})
    footage = report.session.footage()
    assert footage.frame_count == 16
    for frame in (0, 15):
        assert [number_of(picture) for picture in footage.pictures(frame).pictures] == [frame + 4, frame + 4]
    assert report.session.manifest.footage.cameras[1].turned == 90
    assert (footage.source.cameras[1].width, footage.source.cameras[1].height) == (128, 96)
    assert any("cam_1: 4" in note for note in report.notes)


@pytest.mark.parametrize(
    ("offsets", "rotations", "said"),
    [
        ({"cam_9": 3}, {}, "There is no camera 'cam_9'"),
        ({"cam_1": 12}, {}, "no frame is left"),
        ({"cam_1": 10**9}, {}, "cannot be 1000000000 frames off"),
        ({}, {"cam_1": 45}, "cannot be turned by 45 degrees"),
    ],
)
def test_what_cannot_be_asked(
    tmp_path: Path, offsets: dict[str, int], rotations: dict[str, int], said: str
) -> None:
    source = video_source(tmp_path / "source")
    with pytest.raises(StudioError, match=said):
        import_source(source, tmp_path / "made", offsets=offsets, rotations=rotations)
    assert not (tmp_path / "made").exists()


@pytest.mark.real_data
def test_the_balancing_man_is_a_folder_whose_toml_goes_before_the_qualisys_file(
    real_data: Path, tmp_path: Path
) -> None:
    report = import_source(real_data / "pose2sim-balance", tmp_path / "made", copy=False)
    assert "Calib_qualisys.toml" in report.notes[1] + "".join(report.notes)
    other = import_source(
        real_data / "pose2sim-balance", tmp_path / "other", copy=False, calibration="Calib.qca.txt"
    )
    kept = (other.session.path / "calibration" / "original.qca.txt").read_bytes()
    assert kept == (real_data / "pose2sim-balance" / "calibration" / "Calib.qca.txt").read_bytes()
    for a, b in zip(report.session.cameras(), other.session.cameras(), strict=True):
        np.testing.assert_allclose(a.centre, b.centre, atol=0.01)
