"""Faults of processes, and of what is at the other end of a wire, as a table like that of `kinds`."""

import contextlib
import functools
import json
import multiprocessing
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.context import ForkServerProcess
from pathlib import Path

import httpx
import numpy as np
import psutil
import waiting
from mjpeg_streams import Streams, jpeg, served
from toy_session import facing_camera
from websockets.sync.client import ClientConnection, connect

from faults.seams import ALL, STORE, WRITE, Touch, watched
from faults.stage import DEEDS, NEW, TOY, Place, frames_of, track
from faults.trial import Trial
from studio.cli.launch import served_at
from studio.cli.output import termination_as_interrupt
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.camera_addresses import camera_address
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.errors import RunError, StudioError
from studio.operations.jobs.camera_readers import CameraReaders
from studio.operations.jobs.set_recording import SetRecording
from studio.sessions.live_recordings import begin_recording, read_sets, start_sets
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

PATIENCE = 600.0
until = functools.partial(waiting.until, patience=PATIENCE)
REFUSED = 3
"""The exit code of a child whose deed was refused in words."""


# ---------------------------------------------------------------------- a process that does a deed


def _kill(_: Touch) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _tear(touch: Touch) -> None:
    touch.half()
    _kill(touch)


def _stop(_: Touch) -> None:
    os.kill(os.getpid(), signal.SIGSTOP)


def _terminate(_: Touch) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def _live(
    folder: Path, deed: str, kinds: Collection[str], number: int, strike: Callable[[Touch], None]
) -> None:
    """In the child."""
    seen = 0

    def act(touch: Touch) -> None:
        nonlocal seen
        seen += touch.kind in kinds
        if touch.kind in kinds and seen - 1 == number:
            strike(touch)

    try:
        with watched(folder, act), termination_as_interrupt():
            DEEDS[deed].do(Place(folder))
    except KeyboardInterrupt:
        os._exit(128 + signal.SIGTERM)
    except StudioError:
        os._exit(REFUSED)


def _child(
    trial: Trial, strike: Callable[[Touch], None], kinds: Collection[str] = ALL, number: int | None = None
) -> ForkServerProcess:
    """A process that does the trial's deed and is struck at one of its touches."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["faults.stage"])
    at = trial.number_of(kinds) if number is None else number
    process = context.Process(target=_live, args=(trial.at.folder, trial.deed, kinds, at, strike))
    process.start()
    return process


def _ended(trial: Trial, process: ForkServerProcess, *wanted: int) -> None:
    process.join(PATIENCE)
    if process.exitcode not in (0, *wanted):
        trial.wrong.append(f"the process ended with {process.exitcode}")
    trial.struck |= process.exitcode in wanted
    if process.is_alive():
        process.kill()


def killed(trial: Trial) -> None:
    """kill -9 at any touch of any deed."""
    trial.a_deed()
    _ended(trial, _child(trial, _kill), -signal.SIGKILL)


def killed_in_a_write(trial: Trial) -> None:
    """kill -9 when half of what is being written has arrived."""
    trial.a_deed([name for name in DEEDS if WRITE in trial.stage.touches[name]])
    _ended(trial, _child(trial, _tear, [WRITE]), -signal.SIGKILL)


def killed_again_and_again(trial: Trial) -> None:
    """kill -9 of each of several processes that resume the same run."""
    for _ in range(3):
        _ended(trial, _child(trial, _kill, [STORE]), -signal.SIGKILL)
        trial.look()


def terminated(trial: Trial) -> None:
    """SIGTERM, as a system that shuts down sends it."""
    trial.a_deed()
    _ended(trial, _child(trial, _terminate), 128 + signal.SIGTERM, REFUSED)


def stopped(trial: Trial) -> None:
    """A process that tracks stands still: all can be read, a second one is refused, and it goes on."""
    process = _child(trial, _stop)
    known = psutil.Process(process.pid)
    until(lambda: process.exitcode is not None or known.status() == psutil.STATUS_STOPPED)
    trial.struck = process.exitcode is None
    run = trial.at.run(NEW)

    def look() -> None:
        for one in trial.at.session.runs():
            if any(trial.stage.frames[frame] != digest for frame, digest in frames_of(one).items()):
                trial.wrong.append(f"run {one.name} has a frame that was never tracked so")
        status, held = run.summary().status, run.being_tracked()
        if held != (status == "tracking") and status != "finished":
            trial.wrong.append(f"the run is said to be {status}")
        if status == "tracking":
            with contextlib.suppress(RunError):
                track(trial.at.session, run)
                if run.being_tracked():
                    trial.wrong.append("a second tracker was let in")

    if trial.struck:
        trial.attempt(look)
        process_held = run.being_tracked()
        os.kill(known.pid, signal.SIGCONT)
        # Where the other had not taken the run yet, this one was free to.
        _ended(trial, process, *([] if process_held else [REFUSED]))
    else:
        _ended(trial, process)


def two_at_once(trial: Trial) -> None:
    """Two processes do the same at the same time: each is done or refused in words."""
    trial.a_deed(["track", "make a run", "import", "repair", "set a start pose"])
    both = [_child(trial, _stop, number=-1) for _ in range(2)]
    for process in both:
        _ended(trial, process, REFUSED)
    trial.struck = True


# ---------------------------------------------------------------------- a server and its tracking process

SERVE = """
import sys
from pathlib import Path
from studio.cli.launch import Listening, serve
if __name__ == "__main__":
    serve(Path(sys.argv[1]), Listening(port=0), announce=lambda text: print(text, flush=True))
"""
RUN = f"/api/sessions/{TOY}/runs/{NEW}"


@dataclass
class Served:
    """A server in a process of its own, and a browser that was let in. viewers_token : of those who only look."""

    process: subprocess.Popen[str]
    client: httpx.Client
    viewers_token: str

    def state(self) -> str:
        return self.client.get("/api/worker").json()["state"]

    def post(self, path: str, body: object = None) -> httpx.Response:
        answer = self.client.post(path, json=body)
        assert answer.is_success, answer.text
        return answer

    def begin(self) -> None:
        """Track slowly enough to be disturbed: some seconds."""
        self.post("/api/worker/pace", {"seconds_a_layer": 0.15})
        self.post(f"{RUN}/start")

    def finish(self) -> None:
        """To the end, as fast as it goes."""
        self.post(f"{RUN}/start")
        self.post("/api/worker/pace", {"seconds_a_layer": 0})
        until(lambda: self.state() == "finished")

    def tracker(self) -> psutil.Process:
        """The tracking process."""
        found = [
            one for one in psutil.Process(self.process.pid).children() if "studio-tracking" in one.cmdline()
        ]
        assert len(found) == 1, found
        return found[0]

    def deaf_page(self) -> ClientConnection:
        """The event socket of a browser's page that reads one message and no more."""
        base = str(self.client.base_url).rstrip("/")
        cookies = "; ".join(f"{name}={value}" for name, value in self.client.cookies.items())
        origin = self.client.headers["origin"]
        address = base.replace("http", "ws") + "/api/events"
        headers = {"cookie": cookies}
        return connect(address, origin=origin, additional_headers=headers, max_queue=1, close_timeout=0.1)  # pyright: ignore


@contextmanager
def server(place: Place) -> Iterator[Served]:
    """A server on the trial's workspace; killed at the end, as nobody says goodbye to it."""
    script = place.folder / "serving.py"
    script.write_text(SERVE)
    process = subprocess.Popen(
        [sys.executable, str(script), str(place.workspace.root)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    try:
        printed = process.stdout.readline() + process.stdout.readline()
        found = re.findall(r"(http://\S+)/\?token=(\S+)", printed)
        assert len(found) == 2, f"the server did not start: {printed}"
        (base, token), (_, viewers_token) = found
        with httpx.Client(base_url=base, headers={"origin": base}, timeout=PATIENCE) as client:
            assert client.get("/", params={"token": token}).status_code == 303
            yield Served(process, client, viewers_token)
    finally:
        children = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        process.kill()
        process.wait()
        process.stdout.close()
        # A tracking process that is left ends by itself.
        psutil.wait_procs(children, PATIENCE)


def _pause(trial: Trial) -> None:
    time.sleep(float(trial.rng.uniform(0.0, 0.8)))


def tracker_killed(trial: Trial) -> None:
    """kill -9 of a server's tracking process: it is said to be lost, and the next start goes on."""
    with server(trial.at) as studio:
        studio.begin()
        _pause(trial)
        studio.tracker().kill()
        until(lambda: studio.state() == "lost")
        trial.struck = True
        if studio.client.get("/health").status_code != 503:
            trial.wrong.append("a server without its tracking process says that it is well")
        studio.finish()


def tracker_stopped(trial: Trial) -> None:
    """The tracking process stands still: every page answers, and it goes on."""
    with server(trial.at) as studio:
        studio.begin()
        _pause(trial)
        tracker = studio.tracker()
        tracker.suspend()
        trial.struck = True
        for path in ("/health", "/api/worker", "/api/sessions", RUN, f"{RUN}/frames", f"{RUN}/log"):
            answer = studio.client.get(path)
            if answer.status_code != 200:
                trial.wrong.append(
                    f"{path} answers {answer.status_code} while the tracking process stands still"
                )
        tracker.resume()
        studio.finish()


def server_killed(trial: Trial) -> None:
    """kill -9 of the server: its tracking process ends too, the workspace is free, and the next server (in half of the
    tries the command line) goes on.
    """
    by_server = trial.rng.random() < 0.5
    with server(trial.at) as studio:
        studio.begin()
        _pause(trial)
        children = psutil.Process(studio.process.pid).children()
        studio.process.kill()
        trial.struck = True
        _, alive = psutil.wait_procs(children, PATIENCE)
        trial.wrong += [f"process {one.pid} is left behind" for one in alive]
    trial.look()
    if served_at(trial.at.workspace.root):
        trial.wrong.append("the workspace is said to be served, and nobody does")
    if by_server:
        with server(trial.at) as studio:
            studio.finish()


def second_server(trial: Trial) -> None:
    """A second server on the workspace is refused, and the first goes on."""
    with server(trial.at) as studio:
        studio.begin()
        _pause(trial)
        with contextlib.suppress(AssertionError), server(trial.at):
            trial.wrong.append("a second server was let in")
        trial.struck = True
        studio.finish()


def browser_stops_reading(trial: Trial) -> None:
    """Pages that open their socket and never read from it: the others are served, and the run is tracked."""
    with server(trial.at) as studio, contextlib.ExitStack() as pages:
        for _ in range(int(trial.rng.integers(1, 6))):
            page = pages.enter_context(studio.deaf_page())
            page.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        studio.begin()
        trial.struck = True
        _pause(trial)
        if studio.client.get(f"{RUN}/frames").status_code != 200:
            trial.wrong.append("the server does not answer while a browser does not read")
        studio.finish()


def browser_hangs_up(trial: Trial) -> None:
    """Requests that end in their middle: nothing is left of them, and the server serves on."""
    with server(trial.at) as studio:
        studio.begin()
        url = studio.client.base_url
        cookies = "; ".join(f"{name}={value}" for name, value in studio.client.cookies.items())
        body = json.dumps({"name": "half", "settings": {"particles": 20}}) + " " * 5000
        for path, kind in (
            (f"/api/sessions/{TOY}/runs", "application/json"),
            ("/api/imports", "multipart/form-data"),
        ):
            head = (
                f"POST {path} HTTP/1.1\r\nHost: {url.host}:{url.port}\r\nOrigin: http://{url.host}:{url.port}\r\n"
                f"Cookie: {cookies}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n{body}"
            ).encode()
            for _ in range(3):
                with socket.create_connection((url.host, url.port)) as wire:
                    wire.sendall(head[: int(trial.rng.integers(1, len(head) - 1))])
        trial.struck = True
        studio.finish()
        names = {run["name"] for run in studio.client.get(f"/api/sessions/{TOY}/runs").json()["runs"]}
        if "half" in names:
            trial.wrong.append("half a request was taken for a whole one")


# ---------------------------------------------------------------------- cameras

CAMERAS = ("left", "right")


def camera_gone(trial: Trial) -> None:
    """A camera's connection is cut while it records, or it says nothing more: the others go on."""
    rng = trial.rng
    pictures = {
        name: [jpeg(rng.integers(0, 255, (120, 160, 3), dtype=np.uint8)) for _ in range(4)]
        for name in CAMERAS
    }
    base = _rig(trial.at.folder / "rig", pictures)
    gone, stays = CAMERAS if rng.random() < 0.5 else CAMERAS[::-1]
    into = trial.at.folder / "take"
    with (
        served(pictures, 60.0) as streams,
        CameraReaders(
            [camera_address(name, streams.address(name)) for name in CAMERAS], silence=0.4
        ) as readers,
    ):
        readers.await_pictures()
        recording = SetRecording(readers, begin_recording(base, into, CAMERAS, 30.0, 1000))
        recording.await_first()
        streams.going.set()
        start_sets(into)
        until(lambda: recording.standing.sets > int(rng.integers(2, 8)))
        _cut(streams, gone, silent=rng.random() < 0.5)
        until(lambda: recording.standing.stopped)
        trial.struck = True
        sets = recording.standing.sets
        until(lambda: recording.standing.sets > sets + 3)
        session = recording.close()
    for one in read_sets(into).sets:
        for name in one.times:
            content = (into / "pictures" / name / f"{one.frame:06d}.jpg").read_bytes()
            if content not in pictures[name]:
                trial.lost += 1
    words = " ".join(session.manifest.notes)
    if f"Camera {gone}" not in words or f"Camera {stays}" in words:
        trial.wrong.append(f"the recording says: {words}")


def _cut(streams: Streams, camera: str, *, silent: bool) -> None:
    (streams.silent if silent else streams.cut).add(camera)


def _rig(folder: Path, pictures: Mapping[str, list[bytes]]) -> Session:
    (folder / "calibration").mkdir(parents=True)
    (folder / "background").mkdir()
    write_calibration(
        tuple(facing_camera(name) for name in pictures), folder / "calibration" / "cameras.toml"
    )
    sources = []
    for name, found in pictures.items():
        (folder / "background" / f"{name}.jpg").write_bytes(found[0])
        sources.append(
            CameraSource(
                name, "video", f"videos/{name}.mp4", 160, 120, 8, background=f"background/{name}.jpg"
            )
        )
    footage = FootageSource(25.0, 8, tuple(sources))
    manifest = SessionManifest(name="rig", title="Rig", created=now(), body="planar_arm4", footage=footage)
    write_manifest(folder, manifest)
    return Session(folder)


PROCESS_KINDS: Mapping[str, Callable[[Trial], None]] = {
    "killed": killed,
    "killed in a write": killed_in_a_write,
    "killed again and again": killed_again_and_again,
    "terminated": terminated,
    "stopped process": stopped,
    "two at once": two_at_once,
}
SERVER_KINDS: Mapping[str, Callable[[Trial], None]] = {
    "tracking process killed": tracker_killed,
    "tracking process stopped": tracker_stopped,
    "server killed": server_killed,
    "second server": second_server,
    "browser stops reading": browser_stops_reading,
    "browser hangs up": browser_hangs_up,
    "camera gone": camera_gone,
}
"""Kinds that start a server or cameras for each fault: some seconds each."""
