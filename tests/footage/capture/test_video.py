"""Videos: exact frames, and damage that is reported."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import HEIGHT, WIDTH, number_of, numbered_frame, write_video

from studio.footage.capture.video import VideoReader, measure_video
from studio.foundations.errors import FootageError

COUNT = 60
FRAMES = [numbered_frame(number) for number in range(COUNT)]


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same frames in several containers and codecs, with B-frames and without."""
    folder = tmp_path_factory.mktemp("videos")
    write_video(folder / "plain.mp4", FRAMES)
    write_video(folder / "index_first.mp4", FRAMES, options={"movflags": "faststart"})
    write_video(folder / "fragmented.mp4", FRAMES, options={"movflags": "frag_keyframe+empty_moov"})
    write_video(folder / "one_keyframe.mkv", FRAMES, gop=250)
    write_video(folder / "mpeg4.avi", FRAMES, codec="mpeg4")
    return folder


NAMES = ["plain.mp4", "index_first.mp4", "fragmented.mp4", "one_keyframe.mkv", "mpeg4.avi"]


@pytest.mark.parametrize("name", NAMES)
def test_measured_by_decoding(videos: Path, name: str) -> None:
    seen: list[int] = []
    found = measure_video(videos / name, lambda done, total: seen.append(done))
    assert (found.width, found.height, found.frame_count) == (WIDTH, HEIGHT, COUNT)
    assert found.fps == pytest.approx(30.0)
    assert found.uneven_frame == -1
    assert seen == list(range(1, COUNT + 1))


@pytest.mark.parametrize("name", NAMES)
def test_every_frame_at_random_is_the_requested_one(videos: Path, name: str) -> None:
    reader = VideoReader(videos / name, COUNT)
    order = [
        0,
        1,
        2,
        59,
        58,
        30,
        31,
        29,
        5,
        47,
        11,
        12,
        13,
        0,
        59,
        *np.random.default_rng(1).permutation(COUNT),
    ]
    for number in order:
        assert number_of(reader.read(int(number))) == number
    reader.close()
    assert number_of(reader.read(17)) == 17


def test_random_access_and_reading_onwards_give_the_same_pixels(videos: Path) -> None:
    onwards, random = VideoReader(videos / "plain.mp4", COUNT), VideoReader(videos / "plain.mp4", COUNT)
    pictures = [onwards.read(number) for number in range(COUNT)]
    for number in np.random.default_rng(2).permutation(COUNT):
        np.testing.assert_array_equal(random.read(int(number)), pictures[number])


def test_pictures_are_those_of_opencv(videos: Path) -> None:
    other = cv2.VideoCapture(str(videos / "plain.mp4"))
    reader = VideoReader(videos / "plain.mp4", COUNT)
    for number in range(5):
        _, expected = other.read()
        picture = reader.read(number)
        assert picture.flags.c_contiguous
        assert np.abs(picture.astype(int) - expected).mean() < 1.5
    other.release()


@pytest.mark.parametrize("name", NAMES)
def test_a_video_cut_short_is_refused_at_its_last_frame(videos: Path, tmp_path: Path, name: str) -> None:
    content = (videos / name).read_bytes()
    path = tmp_path / name
    path.write_bytes(content[: int(0.6 * len(content))])
    with pytest.raises(FootageError) as caught:
        measure_video(path)
    assert name in caught.value.message
    assert "frame" in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize("name", ["index_first.mp4", "mpeg4.avi"])
def test_damaged_bytes_are_noticed(videos: Path, tmp_path: Path, name: str) -> None:
    content = bytearray((videos / name).read_bytes())
    middle = int(0.55 * len(content))
    for place in range(middle, middle + 6000, 3):
        content[place] ^= 0xFF
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FootageError, match="damaged"):
        measure_video(tmp_path / name)


def test_what_is_no_video(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"nothing of the kind" * 100)
    with pytest.raises(FootageError, match="cannot be opened as a video"):
        measure_video(tmp_path / "a.mp4")
    (tmp_path / "b.mp4").write_text("#EXTM3U\n#EXTINF:10,\nhttp://127.0.0.1:9/x.ts\n#EXT-X-ENDLIST\n")
    with pytest.raises(FootageError):
        measure_video(tmp_path / "b.mp4")


def test_a_variable_frame_rate_is_found(tmp_path: Path) -> None:
    times = [*range(20), *range(21, 61, 2)]
    found = measure_video(write_video(tmp_path / "vfr.mp4", FRAMES[:40], pts=times))
    assert found.frame_count == 40
    assert found.uneven_frame >= 0


def turned(content: bytes, matrix: tuple[int, ...]) -> bytes:
    """An mp4 whose track header asks to be shown through a 3x3 matrix (16.16 and 2.30 fixed point)."""
    place = content.index(b"tkhd") + 4 + 40
    numbers = b"".join(int(value).to_bytes(4, "big", signed=True) for value in matrix)
    return content[:place] + numbers + content[place + len(numbers) :]


@pytest.mark.parametrize(
    "matrix",
    [
        (0, 65536, 0, -65536, 0, 0, HEIGHT << 16, 0, 1 << 30),
        (0, -65536, 0, 65536, 0, 0, 0, WIDTH << 16, 1 << 30),
        (-65536, 0, 0, 0, -65536, 0, WIDTH << 16, HEIGHT << 16, 1 << 30),
    ],
)
def test_the_files_rotation_is_applied_as_opencv_does(
    videos: Path, tmp_path: Path, matrix: tuple[int, ...]
) -> None:
    path = tmp_path / "turned.mp4"
    path.write_bytes(turned((videos / "plain.mp4").read_bytes(), matrix))
    other = cv2.VideoCapture(str(path))
    _, expected = other.read()
    other.release()
    picture = VideoReader(path, COUNT).read(0)
    assert picture.shape == expected.shape
    assert np.abs(picture.astype(int) - expected).mean() < 1.5
    found = measure_video(path)
    assert (found.height, found.width) == expected.shape[:2]


def test_a_file_that_became_shorter_is_noticed(videos: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "short.mp4", FRAMES[:10])
    with pytest.raises(FootageError, match="ends at frame 10"):
        VideoReader(tmp_path / "short.mp4", COUNT).read(12)
