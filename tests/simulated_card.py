"""Numba's simulator of a graphics card, in a process of its own."""

import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import studio

TESTS = Path(__file__).parent
FOLDERS = (TESTS / "search/likelihood", TESTS, Path(studio.__file__).parents[1])
# Words of 64 bits wrap around where masks are packed, on purpose.
WRAPPING = "ignore:overflow encountered in scalar:RuntimeWarning"


def run_simulated(script: Path, place: Path) -> Path:
    """Run a script that writes what a card gives into the file `place`; returns the file."""
    simulator = {
        "NUMBA_ENABLE_CUDASIM": "1",
        "NUMBA_DISABLE_JIT": "1",
        "PYTHONPATH": os.pathsep.join(map(str, (script.parent, *FOLDERS))),
    }
    words = [sys.executable, "-W", "error", "-W", WRAPPING, str(script), str(place)]
    done = subprocess.run(words, env={**os.environ, **simulator}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return place


def found_simulated(script: Path, folders: pytest.TempPathFactory) -> Any:  # noqa: ANN401
    """What a script that pickles what a card gives has found."""
    return pickle.loads(run_simulated(script, folders.mktemp(script.stem) / "found.pickle").read_bytes())
