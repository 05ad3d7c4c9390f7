"""Races that take turns, so that the poses that all of them ask for are weighed together.

A racer is a function that calls another one for weights. Each race has a thread, of which one runs at a time: until its
racer asks or ends. A race has the result that it has alone where a pose's weight does not depend on others.
"""

import threading
from collections.abc import Callable, Sequence

import numpy as np

from studio.foundations.arrays import Array

# (N,) log-weights of poses (N, D).
Weigh = Callable[[Array], Array]


class LeftOffError(BaseException):
    """Ends a race because another one failed; no `except Exception` of a racer keeps it."""


class _Race(threading.Thread):
    """asked : poses (N, D) that it waits for the weights of; None where it has ended, for `failure` if it raised."""

    def __init__(self, race: Callable[[Weigh], None]) -> None:
        super().__init__(daemon=True)
        self._race, self._going, self._waiting = race, threading.Semaphore(0), threading.Semaphore(0)
        self.asked: Array | None = None
        self.failure: BaseException | None = None
        self._answer: Array | None = None
        self.start()

    def run(self) -> None:
        self._going.acquire()
        try:
            self._race(self._weigh)
        except BaseException as error:
            self.failure = error
        self.asked = None
        self._waiting.release()

    def go_on(self, answer: Array | None) -> None:
        """Let it run until it asks again or ends. answer : weights of what it asked for; None before, and to end it."""
        self._answer = answer
        self._going.release()
        self._waiting.acquire()

    def _weigh(self, poses: Array) -> Array:
        self.asked = poses
        self._waiting.release()
        self._going.acquire()
        if self._answer is None:
            raise LeftOffError
        return self._answer


def race_in_turns(races: Sequence[Callable[[Weigh], None]], weigh: Weigh) -> None:
    """Run races to their ends, each a function that is given what weighs its poses. weigh : weighs those of all.

    Raises what weighing raises, and what the first race raises that fails.
    """
    turns = [_Race(race) for race in races]
    try:
        for one in turns:
            one.go_on(None)
        while going := [one for one in turns if one.asked is not None]:
            _check(turns)
            asked = [one.asked for one in going if one.asked is not None]
            ends = np.cumsum([len(poses) for poses in asked])
            weights = weigh(np.concatenate(asked))
            for one, own in zip(going, np.split(weights, ends[:-1]), strict=True):
                one.go_on(own)
        _check(turns)
    finally:
        for one in turns:
            if one.asked is not None:
                one.go_on(None)


def _check(turns: Sequence[_Race]) -> None:
    failure = next((one.failure for one in turns if one.failure is not None), None)
    if failure is not None:
        raise failure
