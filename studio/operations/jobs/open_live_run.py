"""A live run in hand: the pipeline that makes its frames ready, and the thread that stores its results."""

import gc
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from studio.footage.capture.frame_clock import Arrival, LiveSource, ReplayClock
from studio.foundations.numba_in_threads import numba
from studio.operations.jobs.open_run import OpenRun
from studio.operations.jobs.pose_sending import PoseSender
from studio.operations.jobs.send_addresses import SendAddress, addresses_from_environment
from studio.runs.live.live_problems import LiveProblems, Ready
from studio.runs.live.live_run import LiveRun
from studio.runs.live.set_following import SetFollower
from studio.runs.problem_source import ProblemSource
from studio.runs.tracking_run import Stepped, TrackingRun
from studio.sessions.live_recordings import is_being_recorded
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


class LivePipeline:
    """One thread that makes frames ready while another searches them; the newest that is ready wins.

    Two cores, two stages: decoding and evidence of the newest set (with whatever the weighting makes of them, hull or
    edge maps) here, the search in the caller's thread. Both spend their time where Python's lock is free. A frame that
    is made ready before the one before it was taken takes its place, so a search that is too slow tracks the newest
    there is, and nothing queues up.

    source : of sets. make_ready : decodes a set and makes of it what is searched; called in the pipeline's thread.

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


PATIENCE_SECONDS = 0.05
"""How long a search waits for a frame before commands are looked at."""

# The source of a run's sets, for the rate, last frame and cameras of its record.
MakeSource = Callable[[StoredRun, int], LiveSource]


class OpenLiveRun(OpenRun):
    """One live run, opened for tracking. Its clock runs from one `step_layer` to `rest`.

    make_source : of its sets, for (run, number of cameras); by default those of a recording in progress, else its
    footage is replayed at its own rate. send_to : where its poses are sent; None: as the environment says.
    """

    makes_ahead = False

    def __init__(
        self,
        session_folder: str,
        run_folder: str,
        make_source: MakeSource | None = None,
        send_to: Sequence[SendAddress] | None = None,
    ) -> None:
        self._make_source = make_source or source_of
        self._pipeline: LivePipeline | None = None
        self._sender: PoseSender | None = None
        addresses = addresses_from_environment() if send_to is None else send_to
        super().__init__(session_folder, run_folder)
        try:
            if addresses:
                self._sender = PoseSender(addresses, self.stored.record, self.stored.body())
        except BaseException:
            self.close()
            raise

    @property
    def warmed_as(self) -> str:
        """Each live run by itself: it has no time for backgrounds and files either."""
        return str(self.stored.folder)

    def warm_up(self) -> None:
        """Learn the backgrounds, compile and load everything, so that the first frames do not wait for it."""
        self.live.rehearse()
        # What is there by now stays; a collection that walks through all of it would cost a frame or two.
        gc.collect()
        gc.freeze()

    def step_layer(self) -> Stepped | None:
        """Do the next layer of the frame at hand, else of the newest that is ready; None where none is."""
        if self.live.between_frames and not self._take():
            return None
        stepped = self.live.step_layer()
        if self._sender is not None and stepped.result is not None:
            self._sender.send(stepped.result)
        return stepped

    def rest(self) -> None:
        """Let no pictures come."""
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            pipeline.stop()

    def close(self) -> None:
        """Save the search where it stands and release files, pictures and threads."""
        self.rest()
        if self._sender is not None:
            self._sender.close()
        try:
            super().close()
        finally:
            gc.unfreeze()

    def _take(self) -> bool:
        """Make the newest frame the one at hand; the run is over where none will come."""
        if self._pipeline is None:
            source = self._make_source(self.stored, len(self.live_problems.cameras))
            self._pipeline = LivePipeline(
                source, lambda arrival: self.live_problems.ready(arrival, self.mailbox.latest()[1])
            )
            self._pipeline.start(self.live.next_frame)
        ready = self._pipeline.take(PATIENCE_SECONDS)
        if ready is not None:
            self.live.take(ready)
        elif self._pipeline.over:
            self.live.end()
        return ready is not None

    def _tracking_run(self, problems: ProblemSource) -> TrackingRun:
        self.live_problems = LiveProblems(problems)
        self.live = LiveRun(self.stored, self.live_problems, self._storing)
        return self.live


def source_of(run: StoredRun, cameras: int) -> LiveSource:
    """The sets of a run: live cameras' where its session is a recording in progress, else its footage's."""
    session = run.folder.parents[1]
    if is_being_recorded(session):
        return SetFollower(session)
    return ReplayClock(run.record.fps, run.record.last, cameras)


def opened(session_folder: str, run_folder: str) -> OpenRun:
    """A run in hand, live or not. Raises StudioError."""
    run = Session(Path(session_folder)).run(Path(run_folder).name)
    return (OpenLiveRun if run.record.live else OpenRun)(session_folder, run_folder)
