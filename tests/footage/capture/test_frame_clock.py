"""The clock that replays footage as if it were live."""

import numpy as np
import pytest

from studio.footage.capture.footage import PingPong, folded
from studio.footage.capture.frame_clock import PATIENCE_SECONDS, ReplayClock
from studio.foundations.errors import NotFoundError
from studio.sessions.session import Session


class Hours:
    """Seconds that pass when somebody sleeps."""

    def __init__(self) -> None:
        self.now = 5.0
        self.slept: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


@pytest.fixture
def hours() -> Hours:
    return Hours()


def clock_of(hours: Hours, fps: float = 20.0, last: int = 10) -> ReplayClock:
    return ReplayClock(fps, last, 3, clock=hours, sleep=hours.sleep)


def test_frames_come_at_their_times_and_the_newest_is_given(hours: Hours) -> None:
    clock = clock_of(hours)
    assert clock.newest(-1) is None, "nothing comes before it begins"
    clock.begin(2)
    first = clock.newest(1)
    assert (first.frame, first.times, first.complete) == (2, (5.0, 5.0, 5.0), 5.0)
    assert clock.newest(2) is None
    hours.now += 0.26
    newest = clock.newest(2)
    assert newest.frame == 7, "five frames of 50 ms passed"
    assert newest.complete == pytest.approx(5.25)


def test_waiting_sleeps_until_the_next_frame_is_due_but_never_long(hours: Hours) -> None:
    clock = clock_of(hours)
    clock.wait(-1)
    assert hours.slept == [PATIENCE_SECONDS]
    clock.begin(0)
    clock.newest(-1)
    hours.now += 0.02
    clock.wait(0)
    assert hours.slept[1:] == [pytest.approx(0.03)]
    found = clock.newest(0)
    assert found.frame == 1, "it is there at its very moment"
    clock.wait(0)
    assert len(hours.slept) == 2, "what is there is not waited for"


def test_it_is_over_after_the_last_frame(hours: Hours) -> None:
    clock = clock_of(hours, last=4)
    clock.begin(0)
    hours.now += 60.0
    newest = clock.newest(-1)
    assert newest.frame == 3
    assert not clock.over(2)
    assert clock.over(3)


def test_forth_and_back_passes_every_frame_and_never_jumps() -> None:
    places = [folded(frame, 4) for frame in range(13)]
    assert places == [0, 1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0]
    assert [folded(frame, 1) for frame in range(3)] == [0, 0, 0]


def test_footage_that_repeats_has_the_same_pictures(session_on_disk: Session) -> None:
    once = session_on_disk.footage()
    again = PingPong(once.source, once.folder)
    count = once.frame_count
    for frame in range(3 * count):
        expected = once.picture("front", folded(frame, count))
        assert np.array_equal(again.picture("front", frame), expected), frame
    assert again.pictures(count).frame == count
    assert np.array_equal(again.pictures(count).pictures[0], once.picture("front", count - 2))
    mask = again.mask("front", count + 1)
    assert mask is not None
    expected = once.mask("front", count - 3)
    assert expected is not None
    assert np.array_equal(mask, expected)
    with pytest.raises(NotFoundError):
        again.picture("front", -1)
    once.close()
    again.close()
