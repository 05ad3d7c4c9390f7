"""Rates, latencies and dropped frames of live runs, in figures and in words."""

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from studio.runs.live.live_summary import LiveMeter, LiveStanding, LiveSummary, in_words, rate_of
from studio.runs.live.set_following import SetNumbers
from studio.runs.storing_behind import StoringBehind
from studio.sessions.live_recordings import LIVE, SETS_NAME


def test_the_meter_counts_what_came_and_was_not_tracked() -> None:
    meter = LiveMeter()
    nothing = meter.standing
    assert (nothing.dropped, nothing.dropped_share) == (0, 0.0)
    assert math.isnan(nothing.latency_ms)
    assert math.isnan(nothing.frames_per_second)
    for frame, came, ready in ((10, 0.0, 0.02), (11, 0.1, 0.13), (14, 0.4, 0.44)):
        meter.tracked(frame, came, ready)
    now = meter.standing
    assert now.dropped == 2
    assert now.dropped_share == pytest.approx(2 / 5)
    assert now.latency_ms == pytest.approx(30.0)
    assert now.frames_per_second == pytest.approx(2 / 0.42)
    meter.passed(15)
    assert meter.standing.dropped == 3
    meter.paused()
    assert meter.standing.dropped == 3
    assert math.isnan(meter.standing.latency_ms)


def test_a_meter_goes_on_where_a_run_stood() -> None:
    meter = LiveMeter([3, 4, 7])
    assert meter.standing.dropped == 2
    meter.tracked(9, 0.0, 0.01)
    assert meter.standing.dropped == 3


def test_incomplete_sets_are_not_dropped_frames(tmp_path: Path) -> None:
    """Numbers of a take give the time: of 0-9 there are sets 0, 3, 4, 6, 7 and 9."""
    (tmp_path / LIVE).mkdir()
    lines = tmp_path / LIVE / SETS_NAME
    lines.write_text("frame,moment\n0,0\n3,30\n4,40\n")
    meter = LiveMeter((), SetNumbers(tmp_path))
    meter.tracked(0, 0.0, 0.01)
    meter.tracked(3, 0.0, 0.01)
    assert (meter.standing.dropped, meter.standing.incomplete) == (0, 2)
    with lines.open("a") as file:
        file.write("6,60\n7,70\n9,90\n12")
    meter.tracked(7, 0.0, 0.01)
    assert (meter.standing.dropped, meter.standing.incomplete) == (2, 3)
    assert meter.standing.dropped_share == pytest.approx(2 / 5)
    meter.passed(299)
    assert (meter.standing.dropped, meter.standing.incomplete) == (3, 4)
    again = LiveMeter([0, 3, 7], SetNumbers(tmp_path))
    assert (again.standing.dropped, again.standing.incomplete) == (2, 3)
    assert meter.standing.in_words.endswith("3 dropped · 4 incomplete")


def test_rates_leave_pauses_out() -> None:
    assert rate_of(np.array([0.0, 0.1, 0.2, 60.0, 60.1])) == pytest.approx(10.0)
    assert math.isnan(rate_of(np.array([1.0])))


def test_latencies_are_quantiles() -> None:
    found = LiveSummary((0, 2), (1,), 30.0, np.array([10.0, 20.0]))
    assert (found.latency(0.0), found.latency(0.5), found.latency(1.0)) == (10.0, 15.0, 20.0)
    assert found.dropped_share == pytest.approx(1 / 3)
    assert math.isnan(LiveSummary((), (), math.nan, np.zeros(0)).latency(0.5))


def test_a_standing_in_words() -> None:
    assert LiveStanding(3, 0.1, 24.4, 29.83).in_words == "live · 29.8 fps · latency 24 ms · 3 dropped"
    assert LiveStanding(0, 0.0, math.nan, math.nan).in_words == "live · 0 dropped"


def test_dropped_frames_in_words() -> None:
    assert in_words([3]) == "3"
    assert in_words([3, 7, 8, 9, 12]) == "3, 7-9, 12"
    assert in_words(range(0, 40, 2), most=2) == "0, 2 and 18 more gaps"
    assert in_words([]) == ""


def test_storing_keeps_the_order_and_raises_errors() -> None:
    done: list[int] = []

    def fail() -> None:
        raise OSError("the disk is full")

    with ThreadPoolExecutor(1) as executor:
        behind = StoringBehind(executor)
        for number in range(200):
            behind.do(lambda number=number: done.append(number))
        behind.wait()
        assert done == list(range(200))
        behind.do(fail)
        with pytest.raises(OSError, match="full"):
            behind.wait()
    at_once = StoringBehind(None)
    at_once.do(lambda: done.append(-1))
    assert done[-1] == -1
