"""Overlay videos decoded by OpenCV: as many pictures as frames, the footage with the body over it."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from export_runs import MADE, track_of
from toy_session import FRAMES, HEIGHT, WIDTH, true_poses

from studio.foundations.errors import NotFoundError
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.overlay_video import even_sized
from studio.results.overlay_pictures import compose_view, forget_composers

MP4 = FORMATS["mp4"]


def decoded(path: Path) -> list[np.ndarray]:
    reader = cv2.VideoCapture(str(path))
    pictures = []
    while True:
        good, picture = reader.read()
        if not good:
            break
        pictures.append(picture)
    assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(60.0)
    reader.release()
    return pictures


@pytest.fixture(autouse=True)
def _closed():
    yield
    forget_composers()


def test_opencv_sees_the_body_over_the_footage(make_run, tmp_path: Path) -> None:
    states = tuple("lost" if frame == 3 else "tracked" for frame in range(FRAMES))
    session, run = make_run("planar_arm4", lambda _: track_of(true_poses(), states=states))
    report = export_run(session, run, MP4, {"track": MADE}, tmp_path / "arm.mp4")
    assert [path.name for path in report.files] == ["arm.mp4"]
    pictures = decoded(report.files[0])
    assert len(pictures) == FRAMES
    assert pictures[0].shape == (HEIGHT, WIDTH, 3)
    for frame, picture in enumerate(pictures):
        plain = compose_view(session, None, frame, "front", ())
        drawn = compose_view(session, run, frame, "front", pose=true_poses()[frame])
        wanted, other = (plain, drawn) if frame == 3 else (drawn, plain)
        lines = np.abs(plain.astype(float) - drawn).max(axis=2) > 60.0
        assert lines.sum() > 50
        near, far = (np.abs(picture.astype(float) - each)[lines].mean() for each in (wanted, other))
        assert near < 0.5 * far, frame
    assert any("The picture stands alone in 1 frame:" in note for note in report.notes)


def test_a_camera_that_there_is_not_is_named(make_run, tmp_path: Path) -> None:
    session, run = make_run("planar_arm4", lambda _: track_of(true_poses()))
    with pytest.raises(NotFoundError, match="no camera 'left'") as refused:
        export_run(session, run, MP4, {"track": MADE, "camera": "left"}, tmp_path / "arm.mp4")
    assert "front" in refused.value.hint
    assert not list(tmp_path.glob("*arm.mp4*"))


def test_a_height_that_makes_odd_sides(make_run, tmp_path: Path) -> None:
    session, run = make_run("planar_arm4", lambda _: track_of(true_poses()))
    report = export_run(session, run, MP4, {"track": MADE, "height": 91, "last": 2}, tmp_path / "arm.mp4")
    pictures = decoded(report.files[0])
    assert len(pictures) == 2
    assert pictures[0].shape[0] == 92
    assert pictures[0].shape[1] % 2 == 0


def test_odd_sides_are_made_even() -> None:
    picture = np.arange(5 * 7 * 3, dtype=np.uint8).reshape(5, 7, 3)
    grown = even_sized(picture)
    assert grown.shape == (6, 8, 3)
    np.testing.assert_array_equal(grown[:5, :7], picture)
    np.testing.assert_array_equal(grown[5, :7], picture[4])
