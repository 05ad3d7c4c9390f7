"""Loaded once, by the process from which the others are forked: what their verbs load and compile is in memory then."""

import os
import tempfile
import threading
from pathlib import Path

import cv2
from faults.stage import DONE, TOY, Place

from races.verbs import PYTHON, Given, build
from studio.foundations.errors import StudioError
from studio.foundations.numba_in_threads import _helpers
from studio.sessions.workspace import VARIABLE

WITH_PROCESSES = {"add footage", "import", "import again", "compare", "sweep", "batch", "live", "record"}
"""Verbs that have processes or threads beside them, which a fork would share or miss."""


def _warm(folder: Path) -> None:
    at = Place(folder)
    build(at, DONE)
    (folder / "out").mkdir()
    os.environ[VARIABLE] = str(at.workspace.root)
    for verb in PYTHON.keys() - WITH_PROCESSES - {"rename", "delete", "rename the run", "delete the run"}:
        try:
            PYTHON[verb](Given(at.workspace.root, TOY, folder, folder / "out", 0))
        except StudioError:
            continue


# OpenCV's threads would be missing after a fork.
cv2.setNumThreads(0)
with tempfile.TemporaryDirectory(prefix="races-") as _folder:
    _warm(Path(_folder))
_helpers().shutdown()
_helpers.cache_clear()
assert threading.active_count() == 1, threading.enumerate()
