"""What viewers who compute cost the owner: a run tracked alone, and beside viewers who measure masks all the time.

Both are compared within minutes of each other and in both orders, so that what else the machine does weighs on both.
"""

import contextlib
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
from faults.process_kinds import Served, server, until
from faults.stage import Place
from sample_walk import copy_of_walk

VIEWERS = 16
LEAST = 0.85
"""Of its speed alone a run has at least so much beside the viewers."""
NAME, ALONE, WATCHED = "walk", "alone", "watched"


@dataclass(frozen=True, slots=True)
class Speeds:
    """Frames a second. measured : answers that the viewers got meanwhile."""

    alone: float
    watched: float
    measured: int

    @property
    def share(self) -> float:
        """Of the speed alone."""
        return self.watched / self.alone

    def in_words(self) -> str:
        """A line of the table."""
        return (
            f"{self.alone:.1f} frames a second alone, {self.watched:.1f} beside {VIEWERS} viewers who measure masks"
            f" ({self.measured} measures): {self.share:.2f}"
        )


def speeds(folder: Path, frames: int, rounds: int) -> Speeds:
    """Track the bundled walk's first frames, alone and watched by turns. rounds : of two runs of each."""
    place = Place(folder)
    place.workspace.root.mkdir(parents=True)
    copy_of_walk(place.workspace.place_for(NAME))
    seconds, measured = {ALONE: 0.0, WATCHED: 0.0}, 0
    with server(place) as studio:
        _tracked(studio, "first", frames)  # loads all that is loaded once
        for number, how in enumerate((ALONE, WATCHED, WATCHED, ALONE) * rounds):
            with contextlib.ExitStack() as stack:
                answers = stack.enter_context(_measuring(studio)) if how == WATCHED else []
                seconds[how] += _tracked(studio, f"{how}-{number}", frames)
                measured += len(answers)
    tracked = 2 * rounds * frames
    return Speeds(tracked / seconds[ALONE], tracked / seconds[WATCHED], measured)


def _tracked(studio: Served, name: str, frames: int) -> float:
    """The seconds that a run takes."""
    at = f"/api/sessions/{NAME}/runs"
    studio.post(at, {"name": name, "last": frames, "fit_shape": False})
    began = time.monotonic()
    studio.post(f"{at}/{name}/start")

    def finished() -> bool:
        now = studio.client.get("/api/worker").json()
        return (now["run"], now["state"]) == (name, "finished")

    until(finished)
    return time.monotonic() - began


@contextlib.contextmanager
def _measuring(studio: Served) -> Iterator[list[int]]:
    """Viewers who measure the masks again and again; yields the states of the answers."""
    done, answers = threading.Event(), list[int]()

    def look() -> None:
        with httpx.Client(base_url=studio.client.base_url, timeout=120.0) as client:
            client.get("/", params={"token": studio.viewers_token})
            while not done.is_set():
                answers.append(client.get(f"/api/sessions/{NAME}/masks/quality").status_code)

    threads = [threading.Thread(target=look) for _ in range(VIEWERS)]
    for thread in threads:
        thread.start()
    try:
        yield answers
    finally:
        done.set()
        for thread in threads:
            thread.join()
