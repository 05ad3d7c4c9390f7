"""From a pose to the packet in another process: what sending poses on (`--send`) adds to a live run.

`python -m studio.garden.benchmarks.live_out` sends poses of human31 sixty times a second and prints the median and
the 95th percentile of the wall time from handing a pose over to its arrival, over OSC and over a WebSocket. The
receivers are processes of their own on this machine; both sides read the same monotonic clock.
"""

import argparse
import json
import multiprocessing
import socket
import sys
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from types import SimpleNamespace
from typing import Any

import numpy as np
from websockets.sync.client import connect

from studio.body.catalogue import load_body
from studio.foundations.extras import load_extra
from studio.garden.benchmarks.results_table import this_machine
from studio.operations.jobs.pose_sending import PoseSender
from studio.operations.jobs.send_addresses import SendAddress

FPS, WARMING = 60.0, 30
PATIENCE = 20.0


def main() -> None:
    """Measure both ways and print them."""
    parser = argparse.ArgumentParser(description="Latency of poses that are sent on.")
    parser.add_argument("--frames", type=int, default=1200, help="how many poses are sent")
    count = parser.parse_args().frames
    machine = this_machine()
    sys.stdout.write(f"{machine.processor}, {machine.cores} cores, load {machine.load}\n")
    for kind, receive in RECEIVERS.items():
        milliseconds = measure(kind, receive, count)
        median, most = np.percentile(milliseconds, [50.0, 95.0])
        sys.stdout.write(
            f"{kind}: {median:.2f} ms in the median, {most:.2f} ms at 95 %, {len(milliseconds)} of {count} poses came\n"
        )


def measure(kind: str, receive: Callable[[Connection, int], None], count: int) -> list[float]:
    """Milliseconds from handing a pose over to its arrival, of those that came; the first poses do not count."""
    body = load_body("human31")
    rng = np.random.default_rng(0)
    poses = body.neutral + np.where(
        body.angles, rng.uniform(-0.5, 0.5, (count + WARMING, len(body.neutral))), 0.0
    )
    here, there = multiprocessing.get_context("spawn").Pipe()
    port = _free_port(socket.SOCK_DGRAM if kind == "osc" else socket.SOCK_STREAM)
    process = multiprocessing.get_context("spawn").Process(target=receive, args=(there, port), daemon=True)
    record: Any = SimpleNamespace(fps=FPS, session="benchmark", name="run")
    sent: dict[int, float] = {}
    sender: PoseSender | None = None
    try:
        if kind == "ws":
            sender = PoseSender([SendAddress(kind, "127.0.0.1", port)], record, body)
        process.start()
        if not here.poll(PATIENCE):
            raise SystemExit("The receiver did not begin.")
        here.recv()
        if sender is None:
            sender = PoseSender([SendAddress("osc", "127.0.0.1", port)], record, body)
        begun = time.monotonic()
        for frame, pose in enumerate(poses):
            time.sleep(max(0.0, begun + frame / FPS - time.monotonic()))
            result: Any = SimpleNamespace(
                frame=frame,
                estimate=SimpleNamespace(pose=pose),
                tracking="tracked",
                overlap=0.9,
                limbs_lost=(),
            )
            sent[frame] = time.monotonic()
            sender.send(result)
        time.sleep(0.5)
        here.send("end")
        came: dict[int, float] = here.recv() if here.poll(PATIENCE) else {}
    finally:
        if sender is not None:
            sender.close()
        process.join(PATIENCE)
    return [1000.0 * (moment - sent[frame]) for frame, moment in came.items() if frame >= WARMING]


def _free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as trial:
        trial.bind(("127.0.0.1", 0))
        return trial.getsockname()[1]


def _receive_osc(pipe: Connection, port: int) -> None:
    """Note when each bundle comes, by the time that it names."""
    bundles = load_extra("pythonosc.osc_bundle", "osc").OscBundle
    came: list[tuple[float, bytes]] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", port))
        receiver.settimeout(0.2)
        pipe.send("ready")
        while not pipe.poll():
            try:
                datagram = receiver.recv(65535)
            except TimeoutError:
                continue
            came.append((time.monotonic(), datagram))
    # Taken apart afterwards: what comes meanwhile would wait.
    named = [
        (moment, next(one for one in bundles(datagram) if one.address == "/VMC/Ext/T").params[0])
        for moment, datagram in came
    ]
    pipe.send({round(seconds * FPS): moment for moment, seconds in named})


def _receive_socket(pipe: Connection, port: int) -> None:
    """Note when each message comes, by its frame."""
    came: list[tuple[float, str | bytes]] = []
    with connect(f"ws://127.0.0.1:{port}") as connection:
        connection.recv(PATIENCE)
        pipe.send("ready")
        while not pipe.poll():
            try:
                text = connection.recv(0.2)
            except TimeoutError:
                continue
            came.append((time.monotonic(), text))
    pipe.send({json.loads(text)["frame"]: moment for moment, text in came})


RECEIVERS: Mapping[str, Callable[[Connection, int], None]] = {"osc": _receive_osc, "ws": _receive_socket}


if __name__ == "__main__":
    main()
