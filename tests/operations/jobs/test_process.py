"""The process's own loop and its two pipes."""

import multiprocessing
import threading

from store_records import layer_of

from studio.operations.jobs.commands import Pause, Stop
from studio.operations.jobs.events import Acknowledged, LayerFinished, nothing_open
from studio.operations.jobs.process import Heartbeat, _loop, _send_all
from studio.operations.jobs.tracking_job import TrackingJob
from studio.operations.jobs.watchers import Subscription


def test_a_server_that_reads_nothing_holds_nothing_up() -> None:
    """Far more is said than the pipe holds; saying it never waits, and what is read at last is the newest."""
    reading, writing = multiprocessing.Pipe(duplex=False)
    events = Subscription()
    sender = threading.Thread(target=_send_all, args=(events, writing), daemon=True)
    sender.start()
    for frame in range(400):
        for layer in range(3):
            event = LayerFinished("s", "r", layer_of(frame, layer, count=200))
            events.put(event, event.key)
    events.close()
    received: list[LayerFinished] = []
    while sender.is_alive() or reading.poll(0.0):
        if reading.poll(0.1):
            received.append(reading.recv())
    sender.join()
    assert len(received) < 400
    assert [(event.record.frame, event.record.layer) for event in received[-3:]] == [
        (399, 0),
        (399, 1),
        (399, 2),
    ]
    assert all(event.left_at > 0.0 for event in received)


def test_a_server_that_is_gone_ends_the_sending() -> None:
    reading, writing = multiprocessing.Pipe(duplex=False)
    reading.close()
    events = Subscription()
    events.put(nothing_open())
    _send_all(events, writing)


def test_commands_are_served_in_turn_until_the_stop() -> None:
    reading, writing = multiprocessing.Pipe(duplex=False)
    said: list[Acknowledged] = []
    job = TrackingJob(said.append)
    for command in (
        Pause(identifier="a"),
        Pause(identifier="b"),
        Stop(identifier="c"),
        Pause(identifier="d"),
    ):
        writing.send(command)
    _loop(job, reading)
    assert [(event.identifier, event.ok) for event in said] == [("a", False), ("b", False), ("c", True)]


def test_the_end_of_the_pipe_ends_the_loop() -> None:
    reading, writing = multiprocessing.Pipe(duplex=False)
    writing.close()
    _loop(TrackingJob(lambda _: None), reading)


def test_heartbeats_fill_the_silence() -> None:
    reading, writing = multiprocessing.Pipe(duplex=False)
    events = Subscription()
    sender = threading.Thread(target=_send_all, args=(events, writing), daemon=True)
    sender.start()
    assert isinstance(reading.recv(), Heartbeat)
    events.close()
    sender.join()
