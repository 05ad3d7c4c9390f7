"""Videos looked at before they are decoded, and odd ones decoded."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from toy_footage import HEIGHT, WIDTH, number_of, numbered_frame, write_video

from studio.footage.capture import video
from studio.footage.capture.video import VideoReader, measure_video, probe_video
from studio.foundations.errors import FootageError
from studio.foundations.isolated import silent

COUNT = 12
FRAMES = [numbered_frame(number) for number in range(COUNT)]


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    return write_video(tmp_path / "plain.mp4", FRAMES)


def with_matrix(path: Path, *numbers: int) -> Path:
    """The mp4 with another display matrix (a b u, c d v, x y w) in its track header."""
    content = path.read_bytes()
    place = content.index(b"tkhd") + 4 + 40
    matrix = b"".join(int(number).to_bytes(4, "big", signed=True) for number in numbers)
    target = path.with_name("turned.mp4")
    target.write_bytes(content[:place] + matrix + content[place + len(matrix) :])
    return target


ONE, LAST = 1 << 16, 1 << 30


def test_what_a_file_announces(plain: Path) -> None:
    found = probe_video(plain)
    assert (found.codec, found.width, found.height, found.turned) == ("h264", WIDTH, HEIGHT, 0)
    assert (found.frame_count, found.fps) == (COUNT, 30.0)
    assert found.seconds == pytest.approx(COUNT / 30.0)
    assert found.steady
    uneven = write_video(plain.with_name("vfr.mp4"), FRAMES, pts=[*range(6), *range(12, 18)])
    assert not probe_video(uneven).steady


@pytest.mark.parametrize(
    ("matrix", "turned"),
    [
        ((0, ONE, 0, -ONE, 0, 0, HEIGHT << 16, 0, LAST), 90),
        ((-ONE, 0, 0, 0, -ONE, 0, WIDTH << 16, HEIGHT << 16, LAST), 180),
        ((0, -ONE, 0, ONE, 0, 0, 0, WIDTH << 16, LAST), 270),
    ],
)
def test_the_rotation_of_a_file(plain: Path, matrix: tuple[int, ...], turned: int) -> None:
    path = with_matrix(plain, *matrix)
    found = probe_video(path)
    assert found.turned == turned
    assert (found.width, found.height) == ((WIDTH, HEIGHT) if turned == 180 else (HEIGHT, WIDTH))
    picture = VideoReader(path, COUNT).read(5)
    code = {90: cv2.ROTATE_90_COUNTERCLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_CLOCKWISE}[turned]
    assert number_of(cv2.rotate(picture, code)) == 5


@pytest.mark.parametrize(
    "matrix",
    [
        (-ONE, 0, 0, 0, ONE, 0, WIDTH << 16, 0, LAST),
        (ONE, 0, 0, 0, -ONE, 0, 0, HEIGHT << 16, LAST),
        (0, ONE, 0, ONE, 0, 0, 0, 0, LAST),
    ],
)
def test_mirroring_is_refused(plain: Path, matrix: tuple[int, ...]) -> None:
    path = with_matrix(plain, *matrix)
    for look in (probe_video, measure_video, VideoReader(path, COUNT).read):
        with pytest.raises(FootageError, match="shown mirrored") as caught:
            look(0 if look not in (probe_video, measure_video) else path)  # pyright: ignore[reportArgumentType]
        assert "mirroring" in caught.value.hint


def _measured_here(path: Path) -> object:
    """In this process, where the limits are patched."""
    return video._measure(path, silent)


def test_limits_hold_before_anything_is_decoded(plain: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, limit, message in (
        ("MAX_PIXELS", WIDTH * HEIGHT - 1, f"is {WIDTH}x{HEIGHT} pixels, more than"),
        ("MAX_FRAMES", COUNT - 1, f"announces {COUNT} frames"),
        ("MAX_SECONDS", 0.2, "announces"),
        ("CODECS", frozenset(("vp9",)), "is encoded with 'h264', which is not decoded here"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(video, name, limit)
            for look in (video._probed, _measured_here):
                with pytest.raises(FootageError, match=message):
                    look(plain)
    assert probe_video(plain).frame_count == COUNT


def test_a_codec_of_games_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.flv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("flashsv", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "bgr24"
        for _ in range(3):
            container.mux(
                stream.encode(av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="bgr24"))
            )
        container.mux(stream.encode())
    with pytest.raises(FootageError, match="encoded with 'flashsv'"):
        probe_video(path)


@pytest.mark.parametrize(
    ("codec", "pixel_format"), [("ffv1", "bgr0"), ("mjpeg", "yuvj420p"), ("libx264", "yuv444p")]
)
def test_odd_sizes_keep_their_last_row_and_column(tmp_path: Path, codec: str, pixel_format: str) -> None:
    picture = np.full((47, 63, 3), 40, np.uint8)
    picture[-1], picture[:, -1] = (200, 200, 200), (200, 200, 200)
    path = tmp_path / "odd.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 63, 47, pixel_format
        for _ in range(4):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode())
    found = measure_video(path)
    assert (found.width, found.height, found.frame_count) == (63, 47, 4)
    seen = VideoReader(path, 4).read(3)
    assert seen.shape == (47, 63, 3)
    assert seen[-1, 30].min() > 120
    assert seen[20, -1].min() > 120
    assert seen[20, 20].max() < 90


def test_a_cut_file_and_one_that_is_none(plain: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(plain.read_bytes()[: plain.stat().st_size * 6 // 10])
    with pytest.raises(FootageError, match="cannot be opened as a video"):
        probe_video(cut)
    sound = tmp_path / "sound.wav"
    with av.open(str(sound), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(FootageError, match="has no pictures in it"):
        probe_video(sound)
