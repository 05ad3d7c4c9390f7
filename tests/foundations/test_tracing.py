"""Spans are recorded while a recording is open, thread by thread, and written as a Chrome trace."""

import json
import threading
from pathlib import Path

import pytest

from studio.foundations.tracing import Trace, recorded, span


def test_nothing_is_kept_without_a_recording() -> None:
    with recorded() as trace:
        pass
    with span("outside"):
        pass
    assert trace.spans == []


def test_stages_inside_one_another_and_on_other_threads() -> None:
    def elsewhere() -> None:
        with span("prepare", 8):
            pass

    with recorded() as trace:
        with span("frame", 7), span("search", 7):
            pass
        thread = threading.Thread(target=elsewhere, name="next-frame")
        thread.start()
        thread.join()
    by_name = {entry.name: entry for entry in trace.spans}
    assert list(by_name) == ["search", "frame", "prepare"]
    inner, outer = by_name["search"], by_name["frame"]
    assert outer.began <= inner.began
    assert inner.began + inner.wall <= outer.began + outer.wall
    assert (inner.frame, by_name["prepare"].frame) == (7, 8)
    assert trace.threads[by_name["prepare"].thread] == "next-frame"
    assert inner.thread == outer.thread != by_name["prepare"].thread


def test_a_stage_that_fails_is_recorded_and_its_error_passed_on() -> None:
    with recorded() as trace, pytest.raises(ValueError, match="broken"), span("mask"):
        raise ValueError("broken")
    assert [entry.name for entry in trace.spans] == ["mask"]


def test_the_written_trace_is_what_viewers_read(tmp_path: Path) -> None:
    with recorded() as trace, span("decode", 3):
        pass
    trace.write(tmp_path / "trace.json")
    events = json.loads((tmp_path / "trace.json").read_text("utf-8"))["traceEvents"]
    names, spans = [e for e in events if e["ph"] == "M"], [e for e in events if e["ph"] == "X"]
    assert [e["args"]["name"] for e in names] == [threading.current_thread().name]
    assert [(e["name"], e["ts"], e["args"]) for e in spans] == [("decode", 0.0, {"frame": 3})]
    assert spans[0]["dur"] >= 0.0
    assert spans[0]["tid"] == names[0]["tid"]
    assert Trace().document()["traceEvents"] == []
