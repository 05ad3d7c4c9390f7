"""Events to all who watch: what is in them, and that a slow watcher costs nothing."""

import asyncio
import json
import math
import queue
import re
import sys
import threading

import numpy as np
import pytest
from fastapi import WebSocketDisconnect
from web_doubles import RecordingControl, RecordingStage, Studio, cookie_header, state_of
from websockets.sync.client import ClientConnection, connect

from studio.app.scene.model import Selection
from studio.app.server.api_document import api_document
from studio.app.server.app import JOBS
from studio.app.server.event_encoding import key_of, message_of
from studio.app.server.event_stream import LIMIT, EventStream, Watcher, _send_all
from studio.app.server.subject_routes import SUBJECT
from studio.operations.jobs.events import Acknowledged, FrameFinished, LayerFinished, LogLine, SettingsApplied
from studio.operations.jobs.job_runner import Job, JobKind
from studio.operations.stored_frames import effective_share, layer_summary
from studio.search.trackers.tracker import Estimate, FilterState, FrameResult, LayerRecord

NAN = float("nan")
DOCUMENT = api_document()


def layer(number: int = 0, particles: int = 2000) -> LayerRecord:
    """A layer with many particles."""
    poses = np.arange(particles * 3, dtype=float).reshape(-1, 3)
    three = np.array([1.0, NAN, 3.0])
    weights = np.linspace(-2.0, 0.0, particles)
    return LayerRecord(
        frame=4,
        layer=number,
        settings_version=2,
        beta=1.5,
        alpha_wanted=NAN,
        alpha_reached=0.4,
        variance_weighed=three,
        variance_resampled=three / 2,
        variance_diffused=three / 4,
        best=poses[-1],
        best_log_weight=0.0,
        mean=poses[0],
        poses=poses,
        log_weights=weights,
        milliseconds=7.0,
    )


def watching(studio: Studio) -> ClientConnection:
    """A watcher's socket."""
    return connect(
        studio.base.replace("http", "ws") + "/api/events",
        origin=studio.base,  # pyright: ignore[reportArgumentType]
        additional_headers={"cookie": cookie_header(studio.client)},
    )


def next_of(socket: ClientConnection, kind: str) -> dict:
    """The next message of a kind."""
    while True:
        message = json.loads(socket.recv(timeout=60))
        if message["type"] == kind:
            return message


def test_a_layers_message_has_everything_but_its_particles() -> None:
    message = message_of(LayerFinished("s", "r", layer(), True, requested_at=10.0, left_at=10.05))
    text = json.dumps(message, default=lambda value: value.tolist())
    assert len(text) < 1500
    assert message["type"] == "layer"
    assert message["particles"] == 2000
    assert message["reannealed"] is True
    assert math.isclose(message["waited_milliseconds"], 50.0)
    assert message["log_weight_quantiles"] == [-2.0, -1.5, -1.0, -0.5, 0.0]
    assert np.array_equal(message["variance_diffused"], [0.25, NAN, 0.75], equal_nan=True)
    assert "poses" not in message
    assert "log_weights" not in message


def test_effective_share_is_one_for_equal_weights_and_one_in_n_for_a_single_winner() -> None:
    assert math.isclose(effective_share(np.full(50, -3.0), 2.0), 1.0)
    one = np.full(50, -1e4)
    one[7] = 0.0
    assert math.isclose(effective_share(one, 1.0), 1 / 50)
    assert math.isnan(effective_share(np.zeros(0), 1.0))
    # Two equal winners of four at infinite contrast share the weight: (1 + 1)² / (4 · 2).
    assert math.isclose(effective_share(np.array([0.0, 0.0, -1e5, -1e5]), 1.0), 0.5)


def entries_of(schema: dict) -> dict:
    """By name the schemas of what a message has."""
    if "$ref" in schema:
        return entries_of(DOCUMENT["components"]["schemas"][schema["$ref"].rpartition("/")[2]])
    parts = [entries_of(part) for part in schema.get("allOf", ())]
    return {name: entry for part in parts for name, entry in part.items()} | schema.get("properties", {})


def check_described(message: dict) -> None:
    """That the API's document has a message's entries, no more and no fewer, and says which may be null."""
    kinds = map(entries_of, DOCUMENT["components"]["schemas"]["EventMessage"]["oneOf"])
    entries = next(kind for kind in kinds if kind["type"]["const"] == message["type"])
    assert set(message) == set(entries)
    nulls = {name for name, value in message.items() if value is None}
    assert nulls <= {name for name, entry in entries.items() if {"type": "null"} in entry.get("anyOf", ())}


def test_every_event_reaches_every_watcher_in_order(studio: Studio) -> None:
    with watching(studio) as one, watching(studio) as two:
        for socket in (one, two):
            assert next_of(socket, "state")["state"] == "idle"
        studio.control.say(state_of("take1", "first", "tracking"))
        studio.control.say(LogLine("take1", "first", "info", 12.5, "begun"))
        studio.control.say(LayerFinished("take1", "first", layer(3)))
        pose = np.array([1.0, 2.0, 3.0])
        result = FrameResult(4, Estimate(pose, pose, pose, -0.5), 10, 2000, 2, 40.0, FilterState(None))
        studio.control.say(FrameFinished("take1", "first", result))
        studio.control.say(SettingsApplied("take1", "first", 3, 4, 5, {"survival": 0.4}, ("survival",)))
        studio.control.say(Acknowledged("take1", "first", "id-1", "Start", False, "No.", "Wait.", "run"))
        for socket in (one, two):
            state = next_of(socket, "state")
            check_described(state)
            assert (state["session"], state["run"], state["state"]) == ("take1", "first", "tracking")
            assert state["seconds_left"] is None
            line = next_of(socket, "log")
            assert line["text"] == "begun"
            got = next_of(socket, "layer")
            assert (got["frame"], got["layer"], got["alpha_wanted"]) == (4, 3, None)
            assert got["variance_weighed"] == [1.0, None, 3.0]
            frame = next_of(socket, "frame")
            assert frame["pose"] == [1.0, 2.0, 3.0]
            settings = next_of(socket, "settings")
            assert settings["changed"] == ["survival"]
            refusal = next_of(socket, "acknowledged")
            assert (refusal["identifier"], refusal["ok"], refusal["hint"]) == ("id-1", False, "Wait.")
            for message in (line, got, frame, settings, refusal):
                check_described(message)


def test_who_comes_later_is_reported_state_and_settings(studio: Studio) -> None:
    with watching(studio) as first:
        studio.control.say(state_of("take1", "first", "paused"))
        studio.control.say(SettingsApplied("take1", "first", 3, 4, 5, {"survival": 0.4}, ()))
        next_of(first, "settings")
        with watching(studio) as late:
            assert next_of(late, "state")["state"] == "paused"
            assert next_of(late, "settings")["values"] == {"survival": 0.4}


def test_who_comes_later_is_told_of_jobs_under_way(studio: Studio) -> None:
    go = threading.Event()
    jobs = studio.app.state.studio.jobs

    def work(job: Job) -> dict[str, object]:
        job.report("reading", 1, 4)
        assert go.wait(60)
        return {}

    begun = jobs.begin(SUBJECT, SUBJECT.states(session="take1"), work)
    at = f"/api/subject-fits/{begun.identifier}"
    with watching(studio) as socket:
        greeting = next_of(socket, "subject")
        check_described(greeting)
        assert (greeting["at"], greeting["key"]) == (at, begun.identifier)
        go.set()
        while (message := next_of(socket, "subject"))["state"] != "done":
            pass
    answer = studio.client.get(at).json()
    assert {name: message[name] for name in answer} == answer, "what is heard is what is asked for"


def test_every_kind_of_job_is_asked_for_where_it_says() -> None:
    """By its address a page tells its events from others', so it has to be one, letter by letter."""
    for kind in JOBS:
        if kind.at:
            path = re.sub(r"\{\w+\}", "{}", kind.at)
            known = [re.sub(r"\{\w+\}", "{}", one) for one in DOCUMENT["paths"]]
            assert path in known, kind.event


def test_pages_hear_of_every_kind_of_job_that_is_in_the_background() -> None:
    modules = [module for name, module in sys.modules.items() if name.startswith("studio.")]
    every = {id(one): one for module in modules for one in vars(module).values() if isinstance(one, JobKind)}
    assert {one.event for one in every.values()} == {kind.event for kind in JOBS}


def test_changes_of_the_workspace_and_moves_of_the_scene_are_reported(studio: Studio) -> None:
    with watching(studio) as socket:
        next_of(socket, "state")
        studio.post("/api/sessions/take1/duplicate", {"name": "take2"})
        changed = next_of(socket, "sessions")
        assert changed["session"] == "take2"
        check_described(changed)
        assert studio.scenes.moved is not None
        studio.scenes.moved("", studio.stage.shown, studio.stage.layers)
        moved = next_of(socket, "scene")
        check_described(moved)
        assert moved["frame"] is None
        assert moved["layers"] == {"playing": False, "rate": 3.0, "mode": "loop"}


def test_a_sleeping_browser_is_reported_how_much_it_lost() -> None:
    """Of states it gets the newest; of what cannot be replaced the newest that its queue holds."""

    class Sleeper:
        def __init__(self) -> None:
            self.sent: list[dict] = []

        async def send_text(self, text: str) -> None:
            self.sent.append(json.loads(text))
            if len(self.sent) == LIMIT + 1:
                raise WebSocketDisconnect

    stream = EventStream(RecordingControl())
    watcher, other = stream.watch("mine"), stream.watch("other")
    for number in range(100):
        stream.publish({"type": "state", "session": "", "run": "", "frame": number})
        stream.publish({"type": "scene", "session": "", "run": "", "frame": number}, "other")
    for number in range(LIMIT + 2):
        stream.publish({"type": "log", "session": "", "run": "", "text": str(number)}, "mine")
    sleeper = Sleeper()
    asyncio.run(_send_all(sleeper, watcher))  # pyright: ignore[reportArgumentType]
    assert sleeper.sent[0] == {"type": "dropped", "session": "", "run": "", "count": 3}
    check_described(sleeper.sent[0])
    assert [said["text"] for said in sleeper.sent[1:]] == [str(number) for number in range(2, LIMIT + 2)]
    assert [json.loads(other.get_nowait())["frame"] for _ in range(2)] == [99, 99]
    with pytest.raises(queue.Empty):
        other.get_nowait()


def test_layers_go_to_the_windows_that_show_their_run_and_to_who_has_no_scene() -> None:
    scenes = {name: RecordingStage() for name in ("own", "other")}
    scenes["own"].shown, scenes["other"].shown = Selection("s", "r"), Selection("s", "another")
    stream = EventStream(RecordingControl(), lambda: scenes)
    windows = {name: stream.watch(name) for name in ("own", "other", "new", "")}
    for watcher in windows.values():
        watcher.get_nowait()
    stream.publish({"type": "layer", "session": "s", "run": "r", "reannealed": False, "frame": 0, "layer": 0})
    assert {name for name, watcher in windows.items() if watcher._waiting} == {"own", "new", ""}
    stream.publish({"type": "frame", "session": "s", "run": "r", "reannealed": False, "frame": 0})
    assert all(watcher._waiting for watcher in windows.values())


def test_a_watcher_that_sleeps_holds_a_bounded_number_of_messages() -> None:
    watcher = Watcher(LIMIT)
    for frame in range(200):
        for number in range(10):
            message = {"type": "layer", "session": "s", "run": "r", "reannealed": False}
            message |= layer_summary(layer(number, 5)) | {"frame": frame}
            watcher.put("x", key_of(message))
    assert len(watcher._waiting) <= LIMIT
    assert watcher.dropped == 200 * 10 - LIMIT


@pytest.mark.parametrize("kind", ["import", "track", "comparison", "learning", "recording"])
def test_of_each_job_the_newest_state_stands(kind: str) -> None:
    response = {"type": kind, "session": "s", "run": "", "step": "reading", "key": "1"}
    assert key_of(response) == key_of({**response, "step": "writing"})
    assert key_of(response) != key_of({**response, "key": "2"})


def test_a_flood_of_events_does_not_hold_up_requests(studio: Studio) -> None:
    """Ten thousand layers while a browser sleeps: the server still answers, and the last one arrives."""
    with watching(studio) as sleeper:
        record = layer(9, 50)
        for number in range(10_000):
            studio.control.say(LayerFinished("take1", "first", record))
            if number % 2500 == 0:
                studio.get("/api/worker")
        studio.control.say(LogLine("take1", "first", "info", 1.0, "the end"))
        assert next_of(sleeper, "log")["text"] == "the end"


def test_what_a_browser_sends_is_ignored(studio: Studio) -> None:
    with watching(studio) as socket:
        socket.send("{}")
        socket.send(b"\x00\xff")
        studio.control.say(LogLine("", "", "info", 1.0, "still here"))
        assert next_of(socket, "log")["text"] == "still here"


def test_watchers_that_left_are_forgotten(studio: Studio) -> None:
    stream: EventStream = studio.app.state.studio.events
    with watching(studio) as socket:
        next_of(socket, "state")
        assert len(stream._watchers) == 1
    with watching(studio) as socket:
        next_of(socket, "state")
        assert len(stream._watchers) <= 2
        studio.control.say(LogLine("", "", "info", 1.0, "x"))
        next_of(socket, "log")
