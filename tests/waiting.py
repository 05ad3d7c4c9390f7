"""Waiting for a state, not for a time."""

import threading
import time
from collections.abc import Callable

PATIENCE = 120.0
EXPECTED_MILLISECONDS = 60_000
"""So long a page may take to look as expected: the machine does much else."""
"""Seconds: many times what a quiet machine takes, for one that does much else."""


def until(condition: Callable[[], object], patience: float = PATIENCE) -> None:
    """Return when the condition holds; fails when it never does."""
    moment = threading.Event()
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, "it never came about"
        moment.wait(0.01)
