"""Interlaced footage drawn here: a disc and stripes that move, a moment a field, of which the truth is known."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from sources import video_source

from studio.footage.capture.interlacing import FieldMotion, times_of_fields, whole_picture
from studio.footage.capture.timestamps import read_timestamps
from studio.footage.capture.video import VideoReader, measure_video
from studio.sessions.importers.importing import ImportOptions, ImportReport, import_source
from studio.sessions.session import Session

HEIGHT, WIDTH, RATE = 96, 128, 25
MOMENTS = 40


def moment(number: int) -> np.ndarray:
    """(96, 128, 3) a red disc on a blue slope, 2.5 px to the right and 0.7 px down a field."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    far = np.hypot(x - centre(number)[0], y - centre(number)[1])
    inside = np.clip(14.5 - far, 0.0, 1.0)[..., None]
    ground = np.stack([90.0 + 0.3 * x, 60.0 + 0.0 * x, 40.0 + 0.2 * y], axis=2)
    return np.round(ground + inside * (np.array([30.0, 40.0, 230.0]) - ground)).astype(np.uint8)


def centre(number: int) -> tuple[float, float]:
    return 16.0 + 2.5 * number, 30.0 + 0.7 * number


def seen_centre(picture: np.ndarray) -> tuple[float, float]:
    red = np.clip(picture[..., 2].astype(np.float64) - 110.0, 0.0, None)
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
    return float((red * x).sum() / red.sum()), float((red * y).sum() / red.sum())


def woven(first: np.ndarray, second: np.ndarray, order: str) -> np.ndarray:
    """Two moments in the lines of one picture, the first in the top or the bottom field."""
    picture = first.copy()
    picture[(1 if order == "top" else 0) :: 2] = second[(1 if order == "top" else 0) :: 2]
    return picture


def write(path: Path, pictures: list[np.ndarray], marked: str = "", rate: int = RATE) -> Path:
    """marked : the field order that the file's stream says, "" for a progressive one."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.options = {"crf": "6"}
        if marked:
            stream.options |= {"flags": "+ildct+ilme", "x264-params": f"{marked[0]}ff=1"}
        stream.codec_context.thread_count = 1
        for number, picture in enumerate(pictures):
            if marked:
                frame = as_fields(picture)
            else:
                frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format="yuv420p")
            frame.pts, frame.time_base = number, Fraction(1, rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def as_fields(picture: np.ndarray) -> av.VideoFrame:
    """yuv420p whose colours are kept field by field, as interlaced cameras do."""
    planes = []
    for start in (0, 1):
        half = np.ascontiguousarray(picture[start::2])
        planes.append(
            av.VideoFrame.from_ndarray(half, format="bgr24").reformat(format="yuv420p").to_ndarray()
        )
    half, quarter = HEIGHT // 2, HEIGHT // 4
    whole = np.empty((HEIGHT * 3 // 2, WIDTH), np.uint8)
    luma, colours = whole[:HEIGHT], whole[HEIGHT:].reshape(2, half, WIDTH // 2)
    for start, plane in enumerate(planes):
        luma[start::2] = plane[:half]
        colours[:, start::2] = plane[half:].reshape(2, quarter, WIDTH // 2)
    return av.VideoFrame.from_ndarray(whole, format="yuv420p")


def interlaced(path: Path, order: str = "top", marked: str | None = None, moments: int = MOMENTS) -> Path:
    pictures = [woven(moment(k), moment(k + 1), order) for k in range(0, moments, 2)]
    return write(path, pictures, order if marked is None else marked)


def imported(source: Path, **options: object) -> ImportReport:
    made = source.parent / f"made-{len(list(source.parent.iterdir()))}"
    return import_source(source, made, ImportOptions(**options))


def centres(session: Session, camera: str) -> list[tuple[float, float]]:
    footage = session.footage()
    try:
        return [seen_centre(footage.picture(camera, frame)) for frame in range(footage.frame_count)]
    finally:
        footage.close()


@pytest.mark.parametrize("order", ["top", "bottom"])
@pytest.mark.parametrize("marked", ["right", "wrong", "not"])
def test_the_earlier_field_is_seen_by_what_moves(tmp_path: Path, order: str, marked: str) -> None:
    said = {"right": order, "wrong": "bottom" if order == "top" else "top", "not": ""}[marked]
    found = measure_video(interlaced(tmp_path / "a.mp4", order, said))
    assert found.interlaced
    assert found.first_field == order


def test_pictures_of_one_moment_are_not_interlaced_even_if_the_file_says_so(tmp_path: Path) -> None:
    pictures = [moment(k) for k in range(20)]
    for marked in ("", "top"):
        found = measure_video(write(tmp_path / f"{marked}.mp4", pictures, marked))
        assert (found.interlaced, found.first_field) == (False, "")


def test_where_nothing_moves_the_mark_counts_and_no_order_is_known(tmp_path: Path) -> None:
    found = measure_video(write(tmp_path / "still.mp4", [moment(3)] * 12, "top"))
    assert (found.interlaced, found.first_field) == (True, "")


@pytest.mark.parametrize("order", ["top", "bottom"])
def test_each_field_becomes_a_picture_of_its_moment(tmp_path: Path, order: str) -> None:
    reader = VideoReader(interlaced(tmp_path / "a.mp4", order), MOMENTS, order)
    for number in (0, 1, 2, 7, 8, 39, 12, 11):
        x, y = seen_centre(reader.read(number))
        assert np.hypot(x - centre(number)[0], y - centre(number)[1]) < 0.25
        off = np.abs(reader.read(number).astype(np.float64) - moment(number)).mean()
        other = np.abs(reader.read(number).astype(np.float64) - moment(number ^ 1)).mean()
        assert off + 0.3 < other
    reader.close()


def test_lines_between_are_means_and_the_field_stays_where_it_is() -> None:
    picture = np.repeat(np.arange(10, 20, dtype=np.uint8)[:, None, None] * 10, 3, axis=2)
    top, bottom = whole_picture(picture[0::2], False, 10), whole_picture(picture[1::2], True, 10)
    assert np.array_equal(top[:9], picture[:9])
    assert np.array_equal(bottom[1:], picture[1:])
    odd = whole_picture(picture[0:9:2], False, 9)
    assert np.array_equal(odd, picture[:9])


def test_times_of_fields_lie_between_those_of_pictures() -> None:
    assert np.allclose(times_of_fields(np.array([0.0, 0.04, 0.08]), 6), np.arange(6) * 0.02)
    lost = times_of_fields(np.array([0.0, 0.04, 0.12, 0.16]), 8)
    assert np.allclose(lost, [0.0, 0.02, 0.04, 0.06, 0.12, 0.14, 0.16, 0.18])
    assert np.array_equal(times_of_fields(np.arange(6.0), 6), np.arange(6.0))


def test_two_pictures_say_nothing_where_nothing_moves() -> None:
    motion = FieldMotion()
    for _ in range(5):
        motion.compare(moment(0)[..., 0], moment(0)[..., 0])
    assert motion.decide(True) == (True, "")
    assert motion.decide(False) == (False, "")


def mixed_source(folder: Path) -> Path:
    """Camera 1 interlaced at 25 pictures, camera 2 progressive at 50 a second, of the same moments."""
    source = video_source(folder)
    interlaced(source / "videos" / "cam01.mp4")
    write(source / "videos" / "cam02.mp4", [moment(k) for k in range(MOMENTS)], rate=2 * RATE)
    return source


def test_interlaced_footage_is_named_and_split_on_request(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    for name in ("cam01", "cam02"):
        interlaced(source / "videos" / f"{name}.mp4")
    named = imported(source)
    assert any("--fields auto" in warning for warning in named.warnings)
    assert (named.session.manifest.fps, named.session.manifest.frame_count) == (25.0, 20)
    split = imported(source, fields="auto")
    assert not any("interlaced" in warning for warning in split.warnings)
    assert any("top field first, 40 frames" in note for note in split.notes)
    assert (split.session.manifest.fps, split.session.manifest.frame_count) == (50.0, 40)
    seen = np.array(centres(split.session, "cam_1"))
    assert np.allclose(seen, [centre(k) for k in range(MOMENTS)], atol=0.25)


def test_interlaced_beside_progressive_footage_of_twice_the_rate(tmp_path: Path) -> None:
    session = imported(mixed_source(tmp_path / "source"), fields="auto").session
    assert (session.manifest.fps, session.manifest.frame_count) == (50.0, MOMENTS)
    assert [camera.fields for camera in session.manifest.footage.cameras] == ["top", ""]
    assert np.allclose(centres(session, "cam_1"), centres(session, "cam_2"), atol=0.25)
    again = imported(session.path)
    assert np.allclose(centres(again.session, "cam_1"), centres(session, "cam_1"))


def test_the_wrong_order_is_named(tmp_path: Path) -> None:
    found = imported(mixed_source(tmp_path / "source"), fields="bottom", fps=50.0)
    assert any("--fields top" in warning for warning in found.warnings)


def test_an_order_that_is_given_splits_what_does_not_seem_interlaced(tmp_path: Path) -> None:
    found = imported(video_source(tmp_path / "source"), fields="bottom")
    assert [camera.fields for camera in found.session.manifest.footage.cameras] == ["bottom", "bottom"]


def test_nothing_to_split_is_said(tmp_path: Path) -> None:
    found = imported(video_source(tmp_path / "source"), fields="auto")
    assert any("none was split" in note for note in found.notes)


def test_a_recorder_times_pictures_not_fields(tmp_path: Path) -> None:
    source = mixed_source(tmp_path / "source")
    lines = ["cam_id,frame_time"]
    lines += [f"1,{k / RATE:.6f}" for k in range(MOMENTS // 2)]
    lines += [f"2,{k / (2 * RATE):.6f}" for k in range(MOMENTS)]
    (source / "videos" / "timestamps.csv").write_text("\n".join(lines) + "\n")
    assert len(read_timestamps(source / "videos" / "timestamps.csv")) == 2
    session = imported(source, fields="auto").session
    assert [camera.offset for camera in session.manifest.footage.cameras] == [0, 0]
    assert session.manifest.frame_count == MOMENTS
