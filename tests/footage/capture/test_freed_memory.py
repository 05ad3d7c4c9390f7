"""What a decoder lets go of goes back to the system."""

import itertools
import subprocess
import sys
from pathlib import Path

import pytest
from toy_session import make_session

from studio.footage.capture import footage
from studio.foundations.memory import give_back_freed_memory
from studio.results.overlay_pictures import compose_view, forget_composers, let_composers_rest

MEASURED = """
import sys
from pathlib import Path
from studio.footage.capture.video import measure_video

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

before = resident_mb()
measure_video(Path(sys.argv[1]))
print(resident_mb() - before)
"""


def test_it_may_be_called_at_any_time() -> None:
    give_back_freed_memory()
    give_back_freed_memory()


@pytest.mark.real_data
@pytest.mark.skipif(sys.platform != "linux", reason="Only glibc keeps what was freed.")
def test_a_measured_video_leaves_little_behind(real_data: Path) -> None:
    """Full HD, a hundred frames: 330 MB stayed."""
    video = real_data / "pose2sim-balance" / "videos" / "cam01.mp4"
    calls = subprocess.run(
        [sys.executable, "-c", MEASURED, str(video)], capture_output=True, text=True, check=True
    )
    assert float(calls.stdout) < 60.0


@pytest.mark.parametrize(("pictures", "given_back"), [(1, 0), (4, 1)])
def test_only_footage_that_was_read_much_makes_others_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pictures: int, given_back: int
) -> None:
    calls: list[int] = []
    monkeypatch.setattr(footage, "MANY_PICTURES", 4)
    monkeypatch.setattr(footage, "give_back_freed_memory", lambda: calls.append(1))
    opened = make_session(tmp_path / "toy").footage()
    names = list(opened.cameras)
    reads = ((name, frame) for frame in range(opened.frame_count) for name in names)
    for name, frame in itertools.islice(reads, pictures):
        opened.picture(name, frame)
    opened.close()
    assert len(calls) == given_back


def test_all_open_footage_keeps_no_more_than_so_many_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever scrubs has the footage open several times: for the page, for the scene, for hulls."""
    kept = footage._KeptPictures(10 * 160 * 120 * 3)
    monkeypatch.setattr(footage, "_PICTURES", kept)
    session = make_session(tmp_path / "toy")
    several = [session.footage() for _ in range(4)]
    (name,) = session.footage().cameras
    for frame in range(session.manifest.frame_count):
        for opened in several:
            wanted = session.footage().picture(name, frame)
            assert (opened.picture(name, frame) == wanted).all()
            assert kept.bytes <= kept.most
    assert kept.bytes > kept.most / 2
    several[0].close()
    several[1].release(name)
    del opened, several
    session.footage().picture(name, 0)
    assert kept.bytes == 160 * 120 * 3


def test_unused_memory_is_returned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = footage._KeptPictures(footage.KEPT_BYTES_IN_ALL)
    monkeypatch.setattr(footage, "_PICTURES", kept)
    session = make_session(tmp_path / "toy")
    first = compose_view(session, None, 0, "front", ("mask",))
    let_composers_rest(60.0)
    assert kept.bytes
    let_composers_rest(0.0)
    assert not kept.bytes
    assert (compose_view(session, None, 0, "front", ("mask",)) == first).all()
    forget_composers()
