"""Progress, cancellation and time left of long work."""

import itertools
import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

Progress = Callable[[str, int, int], None]
"""Called often, with the name of a step, the number of parts done and of all (0: unknown). Its exception ends the work,
such as WorkCancelledError when the work is cancelled; nothing half done is kept then."""

LEAST_TAKEN = 5
"""Measured stretches of work before an estimate is given."""
LEAST_SHARE, ENOUGH_PARTS = 0.05, 30
"""Parts that must be measured: a share of what is left, or so many."""
UNLIKE_THE_REST = 2.0
"""A first stretch that took more times the rest's time a part is getting ready (compiling, opening), not work."""
ASSUMED_SPREAD = 0.5
"""Parts differ by this share of their mean until enough of them have shown that they differ less."""
FACTOR = 2.0
"""An estimate is given when the true time is likely to lie within this factor of it."""
KEPT = 64


_listener: ContextVar[Callable[..., None] | None] = ContextVar("listener", default=None)


def report(*words: object) -> None:
    """Called by a task in its own thread: passed on to what runs it, an executor of processes or of a cluster, whose
    exception ends the task. Elsewhere nothing happens.
    """
    listener = _listener.get()
    if listener is not None:
        listener(*words)


@contextmanager
def heard_by(listener: Callable[..., None]) -> Generator[None]:
    """While a task runs in this thread: what its `report` calls."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


def no_progress(_step: str, _done: int, _total: int) -> None:
    """Progress that is not shown."""


def counting(progress: Progress, step: str, total: int) -> Callable[[], None]:
    """To be called after each of a step's parts: reports how many of them are done."""
    done = itertools.count(1)
    return lambda: progress(step, next(done), total)


def time_left(taken: Sequence[tuple[float, float]], left: float) -> float | None:
    """Seconds that `left` further parts will take, None while that is not known to a factor of two.

    taken : (seconds, parts) of each stretch of work so far, in order. What is left may go on at the mean pace or follow
    the trend from the older to the newer half of what was measured: the estimate is between the two, and is given only
    if both, with two standard errors, lie within the factor of it.
    """
    if left <= 0:
        return 0.0
    if len(taken) > LEAST_TAKEN:
        seconds, parts = taken[0]
        if seconds > UNLIKE_THE_REST * parts * _pace(taken[1:])[0]:
            taken = taken[1:]
    count, half = len(taken), len(taken) // 2
    parts = sum(n for _, n in taken)
    if count < LEAST_TAKEN or parts < min(LEAST_SHARE * left, ENOUGH_PARTS):
        return None
    (older, older_error), (newer, newer_error) = _pace(taken[:half]), _pace(taken[half:])
    if min(older, newer) <= 0.0:
        return None
    mean, error = _pace(taken)
    # A trend counts as far as it goes beyond what chance makes of parts that differ.
    beyond = abs(newer - older) - math.hypot(older * older_error, newer * newer_error)
    trend = math.copysign(max(0.0, beyond), newer - older)
    steady = newer if trend else mean
    # The halves' middles are `parts / 2` apart, the middle of what is left lies this far from the newer one's.
    following = steady + trend * (sum(n for _, n in taken[half:]) + left) / parts
    if following <= 0.0:
        return None
    unsure = math.hypot(
        max(error, ASSUMED_SPREAD / math.sqrt(count)),
        # What is left is a sample, too, and a small one towards the end.
        error * math.sqrt(parts / max(left, parts / count)),
    )
    if abs(math.log(following / steady)) + 4.0 * unsure > 2.0 * math.log(FACTOR):
        return None
    return left * math.sqrt(steady * following)


class TimeLeft:
    """The time that work will still take, from its reports. clock : seconds, rising.

    Measuring begins again when the total changes, when the work begins again at 0, or falls back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._work: tuple[str, int] | None = None
        self._seen = 0
        self._since = 0.0
        self._taken: list[tuple[float, float]] = []

    def after(self, step: str, done: int, total: int) -> float | None:
        """Seconds left when so much is done of a step, None while unknown."""
        now, work = self._clock(), (step, total)
        if (
            self._work is None
            or total != self._work[1]
            or done < self._seen
            or (work != self._work and not done)
        ):
            self._seen, self._since, self._taken = done, now, []
        elif done > self._seen:
            self._taken.append((now - self._since, done - self._seen))
            self._seen, self._since = done, now
            if len(self._taken) > KEPT:
                # The first stands alone: it may have been getting ready.
                pairs = zip(self._taken[1::2], self._taken[2::2], strict=False)
                self._taken = [self._taken[0], *((a + c, b + d) for (a, b), (c, d) in pairs)]
        self._work = work
        return time_left(self._taken, total - done) if total > 0 else None


def left_in_words(seconds: float | None) -> str:
    """An estimate no finer than it is: "about 40 s left", "about 3 min left", "about 2.5 h left"; "" for none."""
    if seconds is None or not math.isfinite(seconds) or seconds <= 0.0:
        return ""
    return f"{duration_in_words(seconds)} left"


def duration_in_words(seconds: float) -> str:
    """An expected duration no finer than it is: "about 40 s", "about 3 min", "about 2.5 h"."""
    if seconds < 100.0:
        return f"about {max(seconds, 1.0):.0f} s"
    return f"about {seconds / 60.0:.0f} min" if seconds < 5400.0 else f"about {seconds / 3600.0:.1f} h"


def _pace(taken: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Seconds a part, and the relative standard error of that (ratio estimator)."""
    seconds, parts, count = sum(t for t, _ in taken), sum(n for _, n in taken), len(taken)
    if seconds <= 0.0:
        return 0.0, math.inf
    pace = seconds / parts
    residuals = sum((t - pace * n) ** 2 for t, n in taken)
    return pace, math.sqrt(count / max(count - 1, 1) * residuals) / seconds
