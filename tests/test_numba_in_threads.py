"""Two threads that call their first kernels at the same moment do not meet in Numba's table of types."""

import subprocess
import sys

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
