"""Work that is only looked at leaves the cores to a search beside it, and the threads that ask for it as they were."""

import contextvars
import os
import threading

import pytest

from studio.foundations.low_priority import NICENESS, at_low_priority
from studio.foundations.numba_in_threads import numba

ASKED = contextvars.ContextVar("asked", default="nobody")


def _niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


@pytest.mark.skipif(not hasattr(os, "getpriority"), reason="this system knows no priorities of threads")
def test_work_steps_back_and_its_caller_does_not() -> None:
    before = _niceness()
    assert at_low_priority(_niceness).result(10) == min(19, max(before, NICENESS))
    assert _niceness() == before
    assert numba.get_num_threads() == numba.config.NUMBA_NUM_THREADS  # pyright: ignore[reportAttributeAccessIssue]


def test_work_has_one_core_and_its_callers_context() -> None:
    ASKED.set("a viewer")
    assert at_low_priority(ASKED.get).result(10) == "a viewer"
    assert at_low_priority(numba.get_num_threads).result(10) == 1


def test_what_goes_wrong_comes_back() -> None:
    def fail(reason: str) -> None:
        raise ValueError(reason)

    with pytest.raises(ValueError, match="this reason"):
        at_low_priority(fail, reason="this reason").result(10)
