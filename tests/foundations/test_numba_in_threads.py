"""Kernels in several threads: first calls at the same moment, and blocks that are shared."""

import subprocess
import sys
import threading

import numpy as np
import pytest

from studio.foundations import numba_in_threads
from studio.foundations.numba_in_threads import numba, parallel_blocks

# One thread is stopped in the middle of that table while another calls a kernel: what this loads must not change it.
TWO_FIRST_CALLS = """
import functools, threading
import numpy as np
from studio.evidence.background import median_and_distance
from studio.evidence.edges import edge_pixels

looking, called = threading.Event(), threading.Event()
look_up = functools._find_impl

def slow_look_up(kind, table):
    if kind is np.float32:
        entries = iter(table)
        next(entries)
        looking.set()
        assert called.wait(60.0)
        list(entries)
    return look_up(kind, table)

functools._find_impl = slow_look_up
thread = threading.Thread(target=edge_pixels, args=(np.zeros((9, 9), np.uint8), np.float32(5.0)))
thread.start()
assert looking.wait(60.0)
median_and_distance(np.zeros((3, 9), np.uint8))
called.set()
thread.join()
print("both were called")
"""


def test_a_first_call_does_not_change_what_another_looks_through() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", TWO_FIRST_CALLS], capture_output=True, text=True, timeout=120.0, check=True
    )
    assert ended.stdout.split("\n")[0] == "both were called"
    assert not ended.stderr


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(numba, "get_num_threads", lambda: 3)
    return 3


@pytest.mark.parametrize("blocks", [0, 1, 63, 64, 65, 1000])
def test_every_block_is_done_once(blocks: int, threads: int) -> None:
    done = np.zeros(blocks, np.int64)

    def kernel(first: int, last: int, added: int) -> None:
        done[first:last] += added

    parallel_blocks(kernel, blocks, 16, 2)
    assert (done == 2).all()


def test_a_thread_that_comes_late_is_not_waited_for(threads: int) -> None:
    """All of the machine's cores are busy elsewhere: the caller does everything."""
    held = threading.Event()
    parallel_blocks(lambda first, last: None, 2, 1)
    pool = numba_in_threads._helpers()
    busy = [pool.submit(held.wait, 60.0) for _ in range(pool._max_workers)]
    done: list[range] = []
    parallel_blocks(lambda first, last: done.append(range(first, last)), 100, 10)
    held.set()
    assert sorted(block for part in done for block in part) == list(range(100))
    assert all(future.result(60.0) for future in busy)


def test_what_goes_wrong_in_a_thread_is_raised(threads: int) -> None:
    def kernel(first: int, last: int) -> None:
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("in a thread")
        helped.wait(60.0)

    helped = threading.Event()

    def spoilt(first: int, last: int) -> None:
        try:
            kernel(first, last)
        finally:
            helped.set()

    with pytest.raises(ValueError, match="in a thread"):
        parallel_blocks(spoilt, 100, 10)
