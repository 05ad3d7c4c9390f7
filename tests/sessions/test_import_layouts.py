"""Other tools' folders, recognised automatically."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from other_layouts import (
    CAMERAS,
    anipose,
    caliscope,
    caliscope_take,
    easymocap,
    freemocap,
    old_freemocap,
    pose2sim,
    videos,
)
from sources import video_source, write_pose2sim
from toy_footage import number_of

from studio.foundations.errors import CalibrationError, FootageError
from studio.sessions.importers.importing import ImportOptions, import_source


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
    report = import_source(source, tmp_path / "made", ImportOptions(fps=60.0))
    assert report.layout == title
    assert any(f" {title}: '" in note for note in report.notes)
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
    ("write", "named", "wanted", "first"),
    [
        (batch, "Trial_1, Trial_2, Trial_10", "Trial_2", 20),
        (takes, "run, walk", "run", 20),
        (anipose_takes, "run, walk", "run", 20),
        (recordings, "session_a, session_b", "session_b", 0),
    ],
)
def test_several_trials_are_named_and_one_is_chosen(
    tmp_path: Path, write: Callable[[Path], Path], named: str, wanted: str, first: int
) -> None:
    source = write(tmp_path / "source")
    with pytest.raises(FootageError, match=f"trials: .*{named}") as caught:
        import_source(source, tmp_path / "made")
    assert "--trial" in caught.value.hint
    with pytest.raises(FootageError, match="There is no trial 'dance'"):
        import_source(source, tmp_path / "made", ImportOptions(trial="dance"))
    session = import_source(source, tmp_path / "made", ImportOptions(trial=wanted)).session
    assert number_of(session.footage().picture("cam_1", 3)) == first + 3
    assert len(session.cameras()) == 2


def test_a_trial_alone_says_where_its_calibration_may_be(tmp_path: Path) -> None:
    source = batch(tmp_path / "source") / "Trial_1"
    with pytest.raises(CalibrationError, match="no calibration") as caught:
        import_source(source, tmp_path / "made")
    assert "Where the folder above has it, import that one, with --trial NAME" in caught.value.hint
    assert "--calibration FILE" in caught.value.hint
    with pytest.raises(FootageError, match="holds none named 'x'"):
        import_source(video_source(tmp_path / "one"), tmp_path / "made", ImportOptions(trial="x"))


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
    session = import_source(source, tmp_path / "made", ImportOptions(fps=30.0)).session
    for name in ("intri.yml", "extri.yml"):
        assert (session.path / "calibration" / "original" / name).read_bytes() == (source / name).read_bytes()
    again = import_source(session.path, tmp_path / "again").session
    assert (again.path / "calibration" / "original" / "intri.yml").read_bytes() == (
        source / "intri.yml"
    ).read_bytes()


@pytest.mark.slow
@pytest.mark.real_data
def test_the_balancing_man_is_a_folder_whose_toml_goes_before_the_qualisys_file(
    real_data: Path, tmp_path: Path
) -> None:
    report = import_source(real_data / "pose2sim-balance", tmp_path / "made", ImportOptions(copy=False))
    assert "Calib_qualisys.toml" in report.notes[1] + "".join(report.notes)
    other = import_source(
        real_data / "pose2sim-balance",
        tmp_path / "other",
        ImportOptions(copy=False, calibration="Calib.qca.txt"),
    )
    kept = (other.session.path / "calibration" / "original.qca.txt").read_bytes()
    assert kept == (real_data / "pose2sim-balance" / "calibration" / "Calib.qca.txt").read_bytes()
    for a, b in zip(report.session.cameras(), other.session.cameras(), strict=True):
        np.testing.assert_allclose(a.centre, b.centre, atol=0.01)
