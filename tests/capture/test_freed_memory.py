"""What a decoder lets go of goes back to the system."""

import subprocess
import sys
from pathlib import Path

import pytest

from studio.capture.freed_memory import give_back_freed_memory

MEASURED = """
import sys
from pathlib import Path
from studio.capture.video import measure_video

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

before = resident_mb()
measure_video(Path(sys.argv[1]))
print(resident_mb() - before)
"""


def test_it_may_be_asked_at_any_time() -> None:
    give_back_freed_memory()
    give_back_freed_memory()


@pytest.mark.real_data
@pytest.mark.skipif(sys.platform != "linux", reason="Only glibc keeps what was freed.")
def test_a_measured_video_leaves_little_behind(real_data: Path) -> None:
    """Full HD, a hundred frames: 330 MB stayed."""
    video = real_data / "pose2sim-balance" / "videos" / "cam01.mp4"
    told = subprocess.run(
        [sys.executable, "-c", MEASURED, str(video)], capture_output=True, text=True, check=True
    )
    assert float(told.stdout) < 60.0
