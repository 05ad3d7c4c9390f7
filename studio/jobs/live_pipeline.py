"""One thread that makes frames ready while another searches them; the newest that is ready wins.

Two cores, two stages: decoding and evidence of the newest set (with whatever the weighting makes of them, hull or edge
maps) here, the search in the caller's thread. Both spend their time where Python's lock is free. A frame that is made
ready before the one before it was taken takes its place, so a search that is too slow tracks the newest there is, and
nothing queues up.
"""

import threading
from collections.abc import Callable

from studio.capture.frame_clock import Arrival, LiveSource
from studio.numba_in_threads import numba
from studio.runs.live_problems import Ready


class LivePipeline:
    """source : of sets. make_ready : decodes a set and makes of it what is searched; called in the pipeline's thread.

    `start` once, `take` from one thread, `stop` when done.
    """

    def __init__(self, source: LiveSource, make_ready: Callable[[Arrival], Ready]) -> None:
        self._source, self._make_ready = source, make_ready
        self._changed = threading.Condition()
        self._newest: Ready | None = None
        self._problem: Exception | None = None
        self._ended = False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live-frames", daemon=True)
        self._first = 0

    def start(self, frame: int) -> None:
        """Let pictures come, the first of them of `frame`."""
        self._first = frame
        self._source.begin(frame)
        self._thread.start()

    def stop(self) -> None:
        """Make no further frame ready; returns when the thread has ended."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    def take(self, patience: float) -> Ready | None:
        """The newest frame that is ready and was not taken, None after so many seconds without one.

        Raises what a frame could not be made ready for.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not None or self._ended, patience)
            if self._newest is None and self._problem is not None:
                raise self._problem
            ready, self._newest = self._newest, None
            return ready

    @property
    def over(self) -> bool:
        """Whether no frame will be ready any more."""
        with self._changed:
            return self._ended and self._newest is None

    def _run(self) -> None:
        # The other core is the search's.
        numba.set_num_threads(1)
        try:
            self._make_all_ready()
        except Exception as problem:
            self._problem = problem
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _make_all_ready(self) -> None:
        after = self._first - 1
        while not self._stopping.is_set() and not self._source.over(after):
            arrival = self._source.newest(after)
            if arrival is None:
                self._source.wait(after)
                continue
            ready = self._make_ready(arrival)
            after = arrival.frame
            with self._changed:
                self._newest = ready
                self._changed.notify_all()
