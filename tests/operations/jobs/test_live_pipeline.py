"""The thread that makes frames ready: the newest wins, what goes wrong comes out, it stops when told."""

import threading
from types import SimpleNamespace

import pytest
from waiting import PATIENCE

from studio.footage.capture.frame_clock import Arrival
from studio.foundations.errors import FootageError
from studio.operations.jobs.open_live_run import LivePipeline


class HandSource:
    """Sets that come when a test says so."""

    def __init__(self, last: int) -> None:
        self.last, self.came, self.first = last, -1, -1
        self._changed = threading.Condition()

    def begin(self, frame: int) -> None:
        self.first = frame

    def come(self, frame: int) -> None:
        with self._changed:
            self.came = frame
            self._changed.notify_all()

    def newest(self, after: int) -> Arrival | None:
        with self._changed:
            return Arrival(self.came, (float(self.came),)) if self.came > after else None

    def wait(self, after: int) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self.came > after, 0.01)

    def over(self, after: int) -> bool:
        return after >= self.last


class Maker:
    """Makes frames ready at once, and says when it has."""

    def __init__(self, wrong: int = -1) -> None:
        self.made: list[int] = []
        self.wrong = wrong
        self._changed = threading.Condition()

    def __call__(self, arrival: Arrival) -> object:
        if arrival.frame == self.wrong:
            raise FootageError("The file is cut.", "Copy it again.")
        with self._changed:
            self.made.append(arrival.frame)
            self._changed.notify_all()
        return SimpleNamespace(frame=arrival.frame, arrival=arrival)

    def wait_for(self, frame: int) -> None:
        with self._changed:
            assert self._changed.wait_for(lambda: frame in self.made, PATIENCE)


def pipeline_of(source: HandSource, maker: Maker, first: int = 0) -> LivePipeline:
    made = LivePipeline(source, maker)  # pyright: ignore[reportArgumentType]
    made.start(first)
    return made


def test_each_frame_is_given_once_and_the_end_is_reported() -> None:
    source, maker = HandSource(last=1), Maker()
    pipeline = pipeline_of(source, maker)
    assert source.first == 0
    for frame in range(2):
        source.come(frame)
        ready = pipeline.take(PATIENCE)
        assert ready.frame == frame
    assert pipeline.take(PATIENCE) is None
    assert pipeline.over
    pipeline.stop()


def test_a_frame_that_was_not_taken_gives_way_to_the_next() -> None:
    source, maker = HandSource(last=100), Maker()
    pipeline = pipeline_of(source, maker)
    source.come(3)
    maker.wait_for(3)
    source.come(4)
    maker.wait_for(4)
    source.come(9)
    maker.wait_for(9)
    # The maker has returned 9 or is about to; what is taken is never older than 4.
    taken = pipeline.take(PATIENCE)
    while taken is not None and taken.frame != 9:
        taken = pipeline.take(PATIENCE)
    assert taken is not None
    assert maker.made == [3, 4, 9], "nothing between is made ready"
    assert pipeline.take(0.0) is None
    assert not pipeline.over
    pipeline.stop()


def test_what_goes_wrong_comes_out_where_frames_are_taken() -> None:
    source = HandSource(last=100)
    pipeline = pipeline_of(source, Maker(wrong=5))
    source.come(5)
    with pytest.raises(FootageError, match="cut"):
        pipeline.take(PATIENCE)
    pipeline.stop()


def test_it_stops_while_it_waits() -> None:
    source = HandSource(last=100)
    pipeline = pipeline_of(source, Maker())
    pipeline.stop()
    assert pipeline.take(0.0) is None
