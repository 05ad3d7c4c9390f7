"""Comparable timings of tasks on a machine that other programs use, too, how much of it was idle meanwhile, and what
memory they take.
"""

import contextlib
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from studio.foundations.numba_in_threads import numba

K = TypeVar("K")


def quickest(
    works: Mapping[K, Callable[[], object]],
    rounds: int,
    threads: Mapping[K, int] | None = None,
    on_round: Callable[[int], None] = lambda done: None,
) -> dict[K, float]:
    """Seconds of each task in its quickest round; tasks take turns, so that other load disturbs all alike.

    A first round, which compiles and warms up, does not count. threads : Numba's for each task, unchanged for the
    rest; restored at the end. on_round : called with the rounds done, 0 after the first.
    """
    before, best = numba.get_num_threads(), dict[K, float]()
    try:
        for done in range(rounds + 1):
            for key, work in works.items():
                numba.set_num_threads((threads or {}).get(key, before))
                began = time.perf_counter()
                work()
                if done:
                    best[key] = min(best.get(key, float("inf")), time.perf_counter() - began)
            on_round(done)
    finally:
        numba.set_num_threads(before)
    return best


class IdleShare:
    """The share of all cores' time since this was made in which nothing ran, whatever else the machine does; NaN where
    the system does not say (Linux does).
    """

    def __init__(self) -> None:
        self._began, self._idle = time.monotonic(), _idle_seconds()

    def so_far(self) -> float:
        """0 to 1."""
        spent = (time.monotonic() - self._began) * (os.cpu_count() or 1)
        return min(1.0, max(0.0, (_idle_seconds() - self._idle) / spent))


def resident_megabytes(*processes: int) -> float:
    """Memory that some processes have in use, NaN where the system does not say (Linux does) or one is gone."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        pages = [int(Path(f"/proc/{one}/statm").read_text(encoding="ascii").split()[1]) for one in processes]
        return sum(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return float("nan")


def _idle_seconds() -> float:
    """Seconds that all cores together were idle or waited for a disk since the system began."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        fields = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()
        return (int(fields[4]) + int(fields[5])) / os.sysconf("SC_CLK_TCK")
    return float("nan")
