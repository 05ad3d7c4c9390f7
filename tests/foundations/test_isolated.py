"""Readers of unchecked files may crash, hang or ask for any memory: the process that asked lives and names the file."""

import os
import threading
from pathlib import Path

import crashing_readers
import cv2
import numpy as np
import pytest
from moving_bodies import write_c3d

from studio.body.motion_files.c3d import read_c3d
from studio.footage.capture.pictures import measure_pictures
from studio.footage.capture.video import measure_video
from studio.foundations import isolated as isolation
from studio.foundations.errors import FootageError
from studio.foundations.isolated import isolated
from studio.results.drawing_footage.clips import ClipWriter

PLACE = Path("odd.mp4")


@pytest.mark.parametrize("reader", [crashing_readers.crash, crashing_readers.killed])
def test_a_reader_that_crashes_is_named_with_its_file(reader: object) -> None:
    for _ in range(2):
        with pytest.raises(FootageError, match=r"'odd\.mp4' cannot be read: its reader crashed") as caught:
            isolated(FootageError, reader, PLACE)  # pyright: ignore[reportArgumentType]
        assert caught.value.hint
    assert isolated(FootageError, crashing_readers.chatter, PLACE) == "odd.mp4"


def test_a_reader_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(isolation, "SECONDS_OF_SILENCE", 3.0)
    with pytest.raises(FootageError, match="took more than 3 s"):
        isolated(FootageError, crashing_readers.hang, PLACE)


def test_memory_is_limited() -> None:
    with pytest.raises(FootageError, match=r"Unable to allocate 16\.0 GiB"):
        isolated(FootageError, crashing_readers.swallow, PLACE)


def test_errors_and_progress_come_through_and_one_process_serves_many() -> None:
    with pytest.raises(FootageError, match="is odd") as caught:
        isolated(FootageError, crashing_readers.refuse, PLACE)
    assert caught.value.hint == "Give another."
    reports: list[tuple[int, int]] = []
    readers = {
        isolated(
            FootageError, crashing_readers.count, PLACE, lambda done, total: reports.append((done, total))
        )
        for _ in range(2)
    }
    assert len(readers) == 1
    assert os.getpid() not in readers
    assert reports == [(number, 5) for number in range(5)] * 2


def test_who_asks_may_stop_it() -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        isolated(FootageError, crashing_readers.count, PLACE, stop)
    assert isolated(FootageError, crashing_readers.chatter, PLACE) == "odd.mp4"


def test_threads_do_not_wait_for_each_other() -> None:
    found: list[int] = []
    threads = [
        threading.Thread(
            target=lambda: found.append(
                isolated(FootageError, crashing_readers.count, PLACE, lambda done, total: None)
            )
        )
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert len(set(found)) == 2


def test_native_parsers_of_foreign_files_run_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """None of them is called in this process."""

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("read in this process")

    picture = np.full((32, 48, 3), 90, np.uint8)
    with ClipWriter(tmp_path / "a.mp4", (48, 32), 25.0, 18.0) as clip:
        for _ in range(5):
            clip.add(picture)
    (tmp_path / "pictures").mkdir()
    for number in range(3):
        cv2.imwrite(str(tmp_path / "pictures" / f"{number}.png"), picture)
    write_c3d(tmp_path / "a.c3d", ["A"], np.ones((5, 1, 3)), 60.0)
    for module, name in (
        ("studio.footage.capture.video.av", "open"),
        ("studio.footage.capture.pictures.cv2", "imdecode"),
        ("studio.body.motion_files.c3d.ezc3d", "c3d"),
    ):
        monkeypatch.setattr(f"{module}.{name}", refused)
    assert measure_video(tmp_path / "a.mp4").frame_count == 5
    assert measure_pictures(tmp_path / "pictures").frame_count == 3
    assert len(read_c3d(tmp_path / "a.c3d").times) == 5
