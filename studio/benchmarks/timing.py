"""Comparable timings of tasks on a machine that other programs use, too."""

import time
from collections.abc import Callable, Mapping
from typing import TypeVar

from studio.numba_in_threads import numba

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
