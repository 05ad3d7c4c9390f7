"""What each thread did when: spans of work, written as a Chrome trace (chrome://tracing, Perfetto).

Stages of a frame stand in `with span("decode"): …`. That costs a fraction of a microsecond while nothing is recorded,
so they stay in. Format: the Trace Event Format's complete events ("ph": "X"), times in microseconds.
"""

import json
import os
import threading
import time
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any


@dataclass(frozen=True, slots=True)
class Span:
    """A finished stage. began, wall, busy : seconds; busy is the processor time of its own thread. thread : identifier.
    frame : -1 where it belongs to none.
    """

    name: str
    thread: int
    began: float
    wall: float
    busy: float
    frame: int


@dataclass(slots=True)
class Trace:
    """Spans in the order in which they ended, and the names of their threads by identifier."""

    spans: list[Span] = field(default_factory=list[Span])
    threads: dict[int, str] = field(default_factory=dict[int, str])

    def add(self, span: Span) -> None:
        """Keep a span of the calling thread."""
        self.threads.setdefault(span.thread, threading.current_thread().name)
        self.spans.append(span)

    def document(self) -> dict[str, Any]:
        """The trace as JSON for a trace viewer; spans overlap on one thread only where one is inside the other."""
        process = os.getpid()
        origin = min((span.began for span in self.spans), default=0.0)
        events: list[dict[str, Any]] = [
            {"ph": "M", "name": "thread_name", "pid": process, "tid": thread, "args": {"name": name}}
            for thread, name in self.threads.items()
        ]
        events += [
            {
                "ph": "X",
                "name": span.name,
                "pid": process,
                "tid": span.thread,
                "ts": round(1e6 * (span.began - origin), 1),
                "dur": round(1e6 * span.wall, 1),
                "tdur": round(1e6 * span.busy, 1),
                "args": {"frame": span.frame} if span.frame >= 0 else {},
            }
            for span in sorted(self.spans, key=lambda span: span.began)
        ]
        return {"traceEvents": events, "displayTimeUnit": "ms"}

    def write(self, place: Path) -> None:
        """Write `document` into a file."""
        place.write_text(json.dumps(self.document()), encoding="utf-8")


class _Measured:
    """A span that is being recorded."""

    __slots__ = ("_began", "_busy", "_frame", "_name", "_trace")

    def __init__(self, trace: Trace, name: str, frame: int) -> None:
        self._trace, self._name, self._frame = trace, name, frame

    def __enter__(self) -> None:
        self._busy, self._began = time.thread_time(), time.perf_counter()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        wall, busy = time.perf_counter() - self._began, time.thread_time() - self._busy
        self._trace.add(Span(self._name, threading.get_ident(), self._began, wall, busy, self._frame))


_UNRECORDED = nullcontext()
_recording: Trace | None = None


def span(name: str, frame: int = -1) -> AbstractContextManager[None]:
    """Record what is done inside as a stage of a frame, if anything is recorded (`recorded`)."""
    trace = _recording
    return _UNRECORDED if trace is None else _Measured(trace, name, frame)


@contextmanager
def recorded() -> Generator[Trace]:
    """Record the spans of all threads of this process meanwhile; an outer recording rests."""
    global _recording
    before, trace = _recording, Trace()
    _recording = trace
    try:
        yield trace
    finally:
        _recording = before
