"""The load, and what a server in a process of its own makes of it: its memory and handles are read from outside."""

import contextlib
import json
import os
import random
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil
from faults.process_kinds import Served, server, until
from faults.stage import TOY, Place
from store_records import layer_of, record_of, result_of
from toy_session import make_session
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import RUNS_NAME, Session
from studio.sessions.stored_run import StoredRun

FAST, SLOW = 20, 5
"""Viewers that read, and viewers that do not."""
LAYERS, PARTICLES = 3, 400
TOGETHER = 50
"""Frames stored in one transaction."""
MOST_GROWTH = 150e6
"""Bytes that scrubbing may leave behind."""
MOST_HANDLES = 8
"""Open files and sockets that may stay open for a while after the viewers left: pooled connections to stores."""
MOST_LAG = 5.0
"""Seconds from a change to the event of it, at every viewer that reads."""
LONG_RUN, LARGE_RUN, MANY = "hours", "large", "many"


@dataclass(frozen=True, slots=True)
class Load:
    """hours_frames : stored frames of the run over hours. scrubs : looks at frames of the large run, at random.
    store_bytes : of the large run. runs : of the session with many. pings : changes that all viewers hear of.
    """

    hours_frames: int
    scrubs: int
    runs: int
    store_bytes: float
    pings: int


LONG = Load(8 * 3600 * 25, 2000, 10_000, 86e6, 100)
SHORT = Load(1500, 120, 200, 6e6, 5)


@dataclass
class Figures:
    """Memory in bytes of the server process. wrong : what does not hold, in sentences."""

    lines: list[tuple[str, str]] = field(default_factory=list)
    memory: dict[str, int] = field(default_factory=dict)
    handles: dict[str, int] = field(default_factory=dict)
    lags: list[float] = field(default_factory=list)
    missed: int = 0
    wrong: list[str] = field(default_factory=list)


def soak(folder: Path, load: Load) -> Figures:
    """Put the load on a server in `folder`."""
    place, found = Place(folder), Figures()
    place.workspace.root.mkdir(parents=True)
    session = make_session(place.workspace.place_for(TOY))
    _store(session, LARGE_RUN, load.store_bytes)
    _store(session, LONG_RUN, frames=load.hours_frames, layers=1, particles=3)
    _many(place.workspace.place_for(MANY), load.runs)
    with server(place) as studio:
        process = psutil.Process(studio.process.pid)

        def measure(name: str) -> None:
            found.memory[name], found.handles[name] = process.memory_info().rss, process.num_fds()

        _look_once(studio)
        measure("start")
        _watched(studio, load.pings, found, measure)
        measure("viewers gone")
        _scrub(studio, session.run(LARGE_RUN), load.scrubs, found)
        measure("scrubbed")
        _timed(
            found,
            f"{load.hours_frames} frames in a run",
            lambda: _get(studio, TOY, f"/runs/{LONG_RUN}/frames"),
        )
        measure("hours seen")
        _timed(found, f"{load.runs} runs listed", lambda: _get(studio, MANY, "/runs"))
        _timed(found, f"{load.runs} runs listed again", lambda: _get(studio, MANY, "/runs"))
        measure("runs listed")
    _judge(found)
    return found


def _judge(found: Figures) -> None:
    growth = found.memory["scrubbed"] - found.memory["start"]
    if growth > MOST_GROWTH:
        found.wrong.append(f"scrubbing left {growth / 1e6:.0f} MB behind, more than {MOST_GROWTH / 1e6:.0f}")
    for name in ("viewers gone", "scrubbed", "runs listed"):
        if found.handles[name] > found.handles["start"] + MOST_HANDLES:
            found.wrong.append(
                f"{found.handles[name] - found.handles['start']} handles more than at the start: {name}"
            )
    if found.missed:
        found.wrong.append(f"{found.missed} events did not reach a viewer that reads")
    if found.lags and max(found.lags) > MOST_LAG:
        found.wrong.append(f"an event took {max(found.lags):.1f} s")


def table(found: Figures) -> str:
    """The figures, a line each."""
    lines = [f"{'':28}{'memory, MB':>12}{'handles':>10}"]
    lines += [f"{name:28}{found.memory[name] / 1e6:12.0f}{found.handles[name]:10}" for name in found.memory]
    if found.lags:
        lags = np.array(found.lags) * 1e3
        lines.append(
            f"events at {FAST} viewers beside {SLOW} that do not read: median {np.median(lags):.0f} ms, "
            f"95 % {np.quantile(lags, 0.95):.0f} ms, worst {lags.max():.0f} ms, {found.missed} missed"
        )
    lines += [f"{name}: {text}" for name, text in found.lines]
    return "\n".join([*lines, *(f"WRONG {text}" for text in found.wrong)])


# ---------------------------------------------------------------------- what lies on the disk


def _store(
    session: Session, name: str, size: float = float("inf"), *, frames: int = 10**9, layers: int = LAYERS,
    particles: int = PARTICLES,
) -> None:  # fmt: skip
    """A run of so many frames, or of so many bytes."""
    run = session.new_run(record_of(session, name))
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, run.record.settings)
        for first in range(0, frames, TOGETHER):
            with writer.together():
                for frame in range(first, min(first + TOGETHER, frames)):
                    records = [layer_of(frame, layer, count=particles) for layer in range(layers)]
                    writer.write_frame(result_of(frame, count=particles, layers=layers), records)
            if _bytes(run) > size:
                return


def _bytes(run: StoredRun) -> int:
    return sum(path.stat().st_size for path in run.folder.glob("results.sqlite*"))


def _many(place: Path, count: int) -> None:
    """A session with so many runs of one frame each: one run's files under so many names."""
    session = make_session(place)
    _store(session, "run-0", frames=1, layers=1, particles=3)
    first = session.run("run-0").folder
    for number in range(1, count):
        folder = session.path / RUNS_NAME / f"run-{number}"
        shutil.copytree(first, folder, copy_function=os.link)


# ---------------------------------------------------------------------- what is done


def _get(studio: Served, session: str, path: str) -> None:
    answer = studio.client.get(f"/api/sessions/{session}{path}")
    assert answer.status_code == 200, answer.text


def _timed(found: Figures, name: str, do: Callable[[], None]) -> None:
    began = time.monotonic()
    do()
    found.lines.append((name, f"{time.monotonic() - began:.2f} s"))


def _look_once(studio: Served) -> None:
    """Everything is loaded that the first look loads."""
    for path in (
        f"/runs/{LARGE_RUN}/frames",
        f"/runs/{LARGE_RUN}/frames/0",
        f"/runs/{LARGE_RUN}/frames/0/views/front.jpg?show=overlay",
    ):
        studio.client.get(f"/api/sessions/{TOY}{path}")
    _get(studio, TOY, f"/runs/{LARGE_RUN}/frames/0/layers/0/particles?format=float32")


def _scrub(studio: Served, run: StoredRun, times: int, found: Figures) -> None:
    """Frames in any order, with a layer's particles of each."""
    with run.results() as results:
        frames = results.frames()
    choose = random.Random(0)
    began = time.monotonic()
    for _ in range(times):
        at = f"/runs/{run.name}/frames/{choose.choice(frames)}"
        _get(studio, TOY, at)
        _get(studio, TOY, f"{at}/layers/{choose.randrange(LAYERS)}/particles?format=float32")
    each = 1e3 * (time.monotonic() - began) / times
    found.lines.append((f"{times} looks at a store of {_bytes(run) / 1e6:.0f} MB", f"{each:.0f} ms each"))


class Viewer:
    """The event socket of a page that reads. heard : changes of the session. newest : when the last came."""

    def __init__(self, studio: Served, number: int) -> None:
        base = str(studio.client.base_url).rstrip("/")
        cookies = "; ".join(f"{name}={value}" for name, value in studio.client.cookies.items())
        address = f"{base.replace('http', 'ws')}/api/events?window=viewer{number}"
        origin = studio.client.headers["origin"]
        self.socket = connect(address, origin=origin, additional_headers={"cookie": cookies}, proxy=None)  # pyright: ignore
        self.heard = 0
        self.newest = 0.0
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                event = json.loads(self.socket.recv())
                if event["type"] == "sessions" and event["session"] == TOY:
                    self.newest = time.monotonic()
                    self.heard += 1

    def close(self) -> None:
        self.socket.close()
        self._thread.join()


@contextlib.contextmanager
def _viewers(studio: Served) -> Iterator[list[Viewer]]:
    with contextlib.ExitStack() as stack:
        for _ in range(SLOW):
            stack.enter_context(studio.deaf_page())
        found = [Viewer(studio, number) for number in range(FAST)]
        try:
            yield found
        finally:
            for viewer in found:
                viewer.close()


def _watched(studio: Served, pings: int, found: Figures, measure: Callable[[str], None]) -> None:
    """All viewers watch a run being tracked, and hear of every change of the session."""
    studio.post(f"/api/sessions/{TOY}/runs", {"name": "watched", "settings": {"particles": 20, "layers": 2}})
    studio.post(f"/api/sessions/{TOY}/runs/watched/start")
    with _viewers(studio) as viewers:
        until(lambda: studio.client.get("/api/worker").json()["state"] == "finished")
        for number in range(pings):
            before = [viewer.heard for viewer in viewers]
            began = time.monotonic()
            answer = studio.client.patch(f"/api/sessions/{TOY}", json={"title": f"Toy {number}"})
            assert answer.status_code == 200, answer.text
            deadline = time.monotonic() + 60.0
            while any(viewer.heard == count for viewer, count in zip(viewers, before, strict=True)):
                if time.monotonic() > deadline:
                    break
                time.sleep(0.002)
            found.missed += sum(viewer.heard == count for viewer, count in zip(viewers, before, strict=True))
            found.lags += [viewer.newest - began for viewer in viewers if viewer.newest > began]
        measure("25 viewers")
    # A viewer that left is noticed when its socket is next written to, or answers no ping.
    until(lambda: not studio.client.get("/api/worker").is_error)
