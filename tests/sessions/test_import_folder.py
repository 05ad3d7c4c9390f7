"""Importing folders of footage."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from sources import BODY, FRAMES, everything_below, full_source, video_source, write_pose2sim
from toy_footage import number_of, numbered_frame, rig, write_pictures, write_video

from studio.body.motion_files.trc import read_trc
from studio.foundations.errors import CalibrationError, FootageError, SessionError, WorkCancelledError
from studio.sessions.archives import ArchiveError
from studio.sessions.importers.importing import ImportOptions, import_source


def test_videos_become_a_session(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    before = everything_below(source)
    reports: list[tuple[str, int, int]] = []
    report = import_source(source, tmp_path / "made", progress=lambda *step: reports.append(step))
    session = report.session
    assert [(match.footage, match.camera) for match in report.matching] == [
        ("cam01", "cam_1"),
        ("cam02", "cam_2"),
    ]
    assert (session.manifest.fps, session.manifest.frame_count) == (60.0, FRAMES)
    assert report.warnings == ()
    for found, wanted in zip(session.cameras(), rig(2, "cam_"), strict=True):
        np.testing.assert_allclose(found.translation, wanted.translation, atol=1e-6)
        np.testing.assert_allclose(found.rotation, wanted.rotation, atol=1e-9)
    pictures = session.footage().pictures(7).pictures
    assert [number_of(picture) for picture in pictures] == [7, 7]
    kept = (session.path / "calibration" / "original.toml").read_bytes()
    assert kept == (source / "calibration" / "Calib.toml").read_bytes()
    assert everything_below(source) == before
    assert {step for step, _, _ in reports} >= {"reading cam01.mp4", "copying cam02.mp4 (kB)"}
    assert all(done <= total for _, done, total in reports if total)


def test_every_optional_part_arrives(tmp_path: Path) -> None:
    session = import_source(full_source(tmp_path / "source"), tmp_path / "made").session
    footage = session.footage()
    mask = footage.mask("cam_2", 3)
    assert mask[50, 50] == 255
    assert mask[5, 5] == 0
    assert footage.background_path("cam_1") == session.path / "background" / "cam_1.png"
    assert session.truth_path is not None
    assert read_trc(session.truth_path).names == ("Hip", "Neck")
    subject = session.subject()
    assert subject.lengths_mm == {"RHip_RKnee": 420}
    start = session.start_pose()
    assert start is not None
    np.testing.assert_allclose(start, BODY.neutral, atol=1e-4)


def test_a_camera_without_background_or_masks_is_named(tmp_path: Path) -> None:
    source = full_source(tmp_path / "source")
    for path in (source / "background").iterdir():
        if "2" in path.name:
            path.unlink()
    assert not import_source(source, tmp_path / "masked").session.manifest.warnings
    shutil.rmtree(source / "masks")
    (warning,) = import_source(source, tmp_path / "made").session.manifest.warnings
    assert "cam_2 has no background" in warning


def test_footage_can_be_referred_to(tmp_path: Path) -> None:
    source = full_source(tmp_path / "source")
    session = import_source(source, tmp_path / "made", ImportOptions(copy=False)).session
    assert not (session.path / "videos").exists()
    assert Path(session.manifest.footage.cameras[0].path) == source / "videos" / "cam01.mp4"
    assert number_of(session.footage().picture("cam_2", 11)) == 11
    assert (session.path / "calibration" / "original.toml").is_file()


@pytest.mark.parametrize("parent", ["", "pictures", "videos"])
def test_folders_of_pictures_need_a_frame_rate(tmp_path: Path, parent: str) -> None:
    source = tmp_path / "source"
    write_pose2sim(source / "calibration" / "c.toml", rig(2, "cam_"))
    for index in (1, 2):
        write_pictures(source / parent / f"CAM{index}", [numbered_frame(number) for number in range(5)])
    with pytest.raises(FootageError, match="The frame rate of the footage is unknown") as caught:
        import_source(source, tmp_path / "made")
    assert "--fps" in caught.value.hint
    session = import_source(source, tmp_path / "made", ImportOptions(fps=25.0)).session
    assert session.manifest.fps == 25.0
    assert number_of(session.footage().picture("cam_1", 4)) == 4
    assert len(list((session.path / "pictures" / "cam_1").iterdir())) == 5


def test_a_session_can_be_imported_again(tmp_path: Path) -> None:
    first = import_source(full_source(tmp_path / "source"), tmp_path / "first").session
    again = import_source(first.path, tmp_path / "again").session
    old, new = everything_below(first.path), everything_below(again.path)
    for name in ("session.json", ".checksums.json"):
        old.pop(name), new.pop(name)
    assert old == new
    assert again.manifest.footage == first.manifest.footage


def test_several_calibrations_need_a_choice(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    moved = rig(2, "cam_")[::-1]
    other = write_pose2sim(source / "calibration" / "Other.toml", moved)
    with pytest.raises(CalibrationError) as caught:
        import_source(source, tmp_path / "made")
    assert "Calib.toml, Other.toml" in caught.value.message
    assert "--calibration" in caught.value.hint
    for number, choice in enumerate(("Other.toml", other, str(other))):
        report = import_source(source, tmp_path / f"made{number}", ImportOptions(calibration=choice))
        assert report.session.manifest.calibration_source == "Other.toml"
    with pytest.raises(CalibrationError, match=r"no calibration 'None\.toml'"):
        import_source(source, tmp_path / "made", ImportOptions(calibration="None.toml"))


def test_a_calibrated_camera_without_footage_is_left_out_with_a_warning(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    write_pose2sim(source / "calibration" / "Calib.toml", rig(3, "cam_"))
    report = import_source(source, tmp_path / "made")
    assert "cam_3 has no footage" in report.warnings[0]
    assert [camera.name for camera in report.session.cameras()] == ["cam_1", "cam_2"]


def test_footage_without_a_calibrated_camera_is_refused(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source", count=3)
    write_pose2sim(source / "calibration" / "Calib.toml", rig(2, "cam_"))
    with pytest.raises(FootageError, match=r"cam01, cam02, cam03.*cam_1, cam_2"):
        import_source(source, tmp_path / "made")


def test_a_slightly_narrower_video_is_warned_of_and_the_crop_is_stored(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    narrow = [numbered_frame(number)[:, 1:-1] for number in range(FRAMES)]
    write_video(source / "videos" / "cam02.mp4", narrow, fps=60)
    report = import_source(source, tmp_path / "made")
    assert len(report.warnings) == 1
    assert "cam02.mp4 is 126x96, 2 pixels narrower" in report.warnings[0]
    assert "1 px at the left" in report.warnings[0]
    camera = report.session.cameras()[1]
    assert (camera.width, camera.matrix[0, 2]) == (126, rig(2)[1].matrix[0, 2] - 1.0)
    text = (report.session.path / "calibration" / "cameras.toml").read_text()
    assert "[cam_01.assumed_crop]" in text
    assert any("cam_2" in line for line in report.session.manifest.assumptions)
    again = import_source(report.session.path, tmp_path / "again").session
    assert again.cameras()[1].matrix[0, 2] == camera.matrix[0, 2]
    assert "assumed_crop" in (again.path / "calibration" / "cameras.toml").read_text()


def test_shorter_footage_trims_the_others_or_is_refused(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source", frames=20)
    write_video(source / "videos" / "cam02.mp4", [numbered_frame(k) for k in range(19)], fps=60)
    report = import_source(source, tmp_path / "made")
    assert report.session.manifest.frame_count == 19
    assert "only the first 19 frames" in report.warnings[0]
    write_video(source / "videos" / "cam02.mp4", [numbered_frame(k) for k in range(12)], fps=60)
    with pytest.raises(FootageError, match="frame counts differ"):
        import_source(source, tmp_path / "other")


def test_frame_rates_must_agree_unless_one_is_given(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    write_video(source / "videos" / "cam02.mp4", [numbered_frame(k) for k in range(FRAMES)], fps=30)
    with pytest.raises(FootageError, match="frame rates differ"):
        import_source(source, tmp_path / "made")
    report = import_source(source, tmp_path / "made", ImportOptions(fps=60.0))
    assert report.session.manifest.fps == 60.0
    assert "as requested" in report.warnings[0]


def test_a_variable_frame_rate_is_refused_unless_one_is_given(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    frames = [numbered_frame(number) for number in range(FRAMES)]
    write_video(source / "videos" / "cam02.mp4", frames, fps=60, pts=[*range(6), *range(10, 16)])
    with pytest.raises(FootageError, match="lost frames: 4 before frame 6"):
        import_source(source, tmp_path / "made")
    uneven = [0, 2, 3, 6, 7, 8, 13, 14, 15, 16, 18, 19]
    write_video(source / "videos" / "cam02.mp4", frames, fps=60, pts=uneven)
    with pytest.raises(FootageError, match="variable frame rate"):
        import_source(source, tmp_path / "made")
    assert import_source(source, tmp_path / "made", ImportOptions(fps=60.0)).warnings


def test_missing_pictures_are_reported(tmp_path: Path) -> None:
    source = tmp_path / "source"
    write_pose2sim(source / "calibration" / "c.toml", rig(2, "cam_"))
    for index in (1, 2):
        write_pictures(source / f"cam{index}", [numbered_frame(number) for number in range(8)])
        (source / f"cam{index}" / "frame0005.png").unlink()
    report = import_source(source, tmp_path / "made", ImportOptions(fps=30.0))
    assert "numbered 5 are missing" in report.warnings[0]
    cv2.imwrite(str(source / "cam1" / "frame0005.png"), numbered_frame(5))
    with pytest.raises(FootageError, match="lacks the pictures numbered 5"):
        import_source(source, tmp_path / "other", ImportOptions(fps=30.0))


def test_nothing_that_is_there_is_touched(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "mine.txt").write_text("mine")
    with pytest.raises(SessionError, match="something at"):
        import_source(source, tmp_path / "made")
    assert everything_below(tmp_path / "made") == {"mine.txt": b"mine"}


@pytest.mark.parametrize("step", ["reading cam02.mp4", "copying cam02.mp4 (kB)", "finishing"])
def test_a_cancelled_import_leaves_nothing(tmp_path: Path, step: str) -> None:
    source = video_source(tmp_path / "source")

    def stopped(reached: str, _done: int, _total: int) -> None:
        if reached == step:
            raise WorkCancelledError("Stopped.")

    with pytest.raises(WorkCancelledError):
        import_source(source, tmp_path / "made", progress=stopped)
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


@pytest.mark.parametrize("fps", [0.0, -5.0, float("nan"), 1e9])
def test_an_absurd_frame_rate(tmp_path: Path, fps: float) -> None:
    with pytest.raises(FootageError, match="no frame rate"):
        import_source(tmp_path, tmp_path / "made", ImportOptions(fps=fps))


@pytest.mark.slow
@pytest.mark.real_data
def test_the_balancing_man(real_data: Path, tmp_path: Path) -> None:
    report = import_source(real_data / "pose2sim-balance", tmp_path / "made")
    session = report.session
    assert [match.camera for match in report.matching] == ["cam_01", "cam_02", "cam_03", "cam_04"]
    narrower = [line for line in report.warnings if "8 pixels narrower" in line]
    assert [line[:5] for line in narrower] == ["cam01", "cam02"]
    assert all("crop" in line for line in narrower)
    assert len(report.warnings) == 2
    assert (session.manifest.fps, session.manifest.frame_count) == (60.0, 100)
    assert [(camera.width, camera.height) for camera in session.cameras()] == [(1080, 1920)] * 2 + [
        (1088, 1920)
    ] * 2
    assert [camera.quarter_turns for camera in session.cameras()] == [0, 0, 0, 0]
    assert "assumed_crop" in (session.path / "calibration" / "cameras.toml").read_text()
    footage = session.footage()
    for camera, path in (("cam_02", "cam02.mp4"), ("cam_04", "cam04.mp4")):
        other = cv2.VideoCapture(str(real_data / "pose2sim-balance" / "videos" / path))
        frames = [other.read()[1] for _ in range(71)]
        other.release()
        for number in (70, 3):
            assert np.abs(footage.picture(camera, number).astype(int) - frames[number]).mean() < 2.0


@pytest.mark.parametrize("kind", ["zip", "gztar"])
def test_an_archive_is_imported_like_its_folder(tmp_path: Path, kind: str) -> None:
    source = video_source(tmp_path / "source")
    packed = Path(shutil.make_archive(str(tmp_path / "take"), kind, source))
    plain = import_source(source, tmp_path / "plain").session
    made = import_source(packed, tmp_path / "sessions" / "made").session
    assert made.manifest.footage == plain.manifest.footage
    assert made.manifest.title == "take"
    assert [path.name for path in (tmp_path / "sessions").iterdir()] == ["made"]


def test_an_archive_cannot_stay_where_it_is_and_a_broken_one_leaves_nothing(tmp_path: Path) -> None:
    packed = tmp_path / "take.tar.gz"
    packed.write_bytes(b"no tar")
    with pytest.raises(FootageError, match=r"'take\.tar\.gz' cannot be used in place"):
        import_source(packed, tmp_path / "sessions" / "made", ImportOptions(copy=False))
    with pytest.raises(ArchiveError, match=r"take\.tar\.gz"):
        import_source(packed, tmp_path / "sessions" / "made")
    assert not list((tmp_path / "sessions").iterdir())
