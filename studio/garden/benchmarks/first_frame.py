"""From the command `studio demo` to its first tracked frame: on a new machine, where every kernel is compiled, and on
one that has them.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress
from studio.sessions.workspace import Workspace

COMMAND = (
    "import sys; from studio.cli.main import main; main(['demo', '--port', '0', '--workspace', sys.argv[1]])"
)
STARTS = 3
"""Of each kind; a start takes seconds, so other work disturbs one that it meets."""
PATIENCE_S, LOOK_S, STEP = 300.0, 0.05, "starts"


def measure_starts(progress: Progress, starts: int = STARTS) -> dict[str, object]:
    """Seconds of each start, and their medians. Raises StudioError where none tracks a frame in five minutes.

    progress : called with (step, done, total).
    """
    cold, warm = list[float](), list[float]()
    for _ in range(starts):
        with tempfile.TemporaryDirectory(prefix="studio-bench-") as folder:
            for times in (cold, warm):
                progress(STEP, len(cold) + len(warm), 2 * starts)
                times.append(_seconds(Path(folder), "first" if times is cold else "second"))
    progress(STEP, 2 * starts, 2 * starts)
    medians = {"cold_s": statistics.median(cold), "warm_s": statistics.median(warm)}
    return {**medians, "cold": cold, "warm": warm}


def _seconds(folder: Path, name: str) -> float:
    """Of one start in a workspace of its own, with the kernels that are kept in the folder."""
    workspace = Workspace(folder / name)
    began = time.monotonic()
    demo = subprocess.Popen(
        [sys.executable, "-c", COMMAND, str(workspace.root)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "kernels")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        while time.monotonic() - began < PATIENCE_S and demo.poll() is None:
            if _has_tracked(workspace):
                return round(time.monotonic() - began, 2)
            time.sleep(LOOK_S)
    finally:
        demo.terminate()
        demo.wait()
    raise StudioError("The demo tracked no frame.", "Run `studio demo` and look at what it says.")


def _has_tracked(workspace: Workspace) -> bool:
    """Whether a frame of the walk is stored; a session or a run may be about to be written."""
    with suppress(StudioError, OSError):
        for run in workspace.session("walk").runs():
            with run.results() as results:
                if results.frames():
                    return True
    return False
