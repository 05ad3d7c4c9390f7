"""Offsets by recorded times and by hand, and turned cameras, on import."""

from pathlib import Path

import cv2
import pytest
from other_layouts import caliscope
from sources import video_source
from toy_footage import number_of, numbered_frame, write_video

from studio.foundations.errors import CalibrationError, FootageError, StudioError
from studio.sessions.importers.importing import ImportOptions, import_source


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
    report = import_source(
        source, tmp_path / "made", ImportOptions(offsets={"cam_1": 4}, rotations={"cam02": 90})
    )
    footage = report.session.footage()
    assert footage.frame_count == 16
    for frame in (0, 15):
        assert [number_of(picture) for picture in footage.pictures(frame).pictures] == [frame + 4, frame + 4]
    assert report.session.manifest.footage.cameras[1].turned == 90
    assert (footage.source.cameras[1].width, footage.source.cameras[1].height) == (128, 96)
    assert any("cam_1: 4" in note for note in report.notes)


@pytest.mark.parametrize(
    ("offsets", "rotations", "message"),
    [
        ({"cam_9": 3}, {}, "There is no camera 'cam_9'"),
        ({"cam_1": 12}, {}, "no frame is left"),
        ({"cam_1": 10**9}, {}, "cannot be 1000000000 frames off"),
        ({}, {"cam_1": 45}, "cannot be turned by 45 degrees"),
    ],
)
def test_impossible_requests(
    tmp_path: Path, offsets: dict[str, int], rotations: dict[str, int], message: str
) -> None:
    source = video_source(tmp_path / "source")
    with pytest.raises(StudioError, match=message):
        import_source(source, tmp_path / "made", ImportOptions(offsets=offsets, rotations=rotations))
    assert not (tmp_path / "made").exists()
