"""Readers that do what native parsers do with hostile files."""

import ctypes
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from studio.foundations.errors import FootageError


def crash(path: Path) -> None:
    ctypes.string_at(0)


def killed(path: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def hang(path: Path) -> None:
    time.sleep(600.0)


def swallow(path: Path) -> int:
    return np.ones(1 << 34, np.uint8).size


def refuse(path: Path) -> None:
    raise FootageError(f"'{path.name}' is odd.", "Give another.")


def chatter(path: Path) -> str:
    os.write(1, b"a library says something")
    return path.name


def count(path: Path, on_frame: Callable[[int, int], None]) -> int:
    for number in range(5):
        on_frame(number, 5)
        time.sleep(0.15)
    return os.getpid()
