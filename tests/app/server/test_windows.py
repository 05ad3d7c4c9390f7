"""Every window of the page is a viewer of its own: ten windows on ten runs each show their own, and are freed."""

import gc
import json
import weakref
from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest
import viser
from api_driver import ApiDriver
from scene_messages import PanelReader
from waiting import until
from web_doubles import TOKEN, RecordingControl, cookie_header, let_in, serving, state_of
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from studio.app.scene.model import select
from studio.app.scene.scene_server import SceneServer
from studio.app.scene.window_scenes import TooManyScenesError, WindowScenes
from studio.app.server import app as web_app
from studio.app.server.access import Tokens
from studio.app.server.app import build_app
from studio.operations.jobs.events import SettingsApplied
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

SURVIVAL = "survival rate"
VISER = f"viser-v{viser.__version__}"


def survival_of(number: int) -> float:
    """What run number `number` was made with; each has another one."""
    return round(0.31 + 0.04 * number, 2)


@pytest.fixture
def runs(session: Session) -> list[str]:
    """Ten runs of 'take1' that differ in a knob."""
    for number in range(10):
        prepare_run(session, name=f"run-{number}", knobs={"survival": survival_of(number)})
    return [f"run-{number}" for number in range(10)]


class Windows(ApiDriver):
    """The real scenes behind the real application, and the windows that a test opens on them."""

    def __init__(
        self, base: str, client: httpx.Client, scenes: WindowScenes, control: RecordingControl
    ) -> None:
        super().__init__(client)
        self.base, self.scenes, self.control = base, scenes, control

    def socket(self, path: str, *protocols: str) -> ClientConnection:
        return connect(
            self.base.replace("http", "ws") + path,
            origin=self.base,  # pyright: ignore[reportArgumentType]
            additional_headers={"cookie": cookie_header(self.client)},
            subprotocols=protocols or None,  # pyright: ignore[reportArgumentType]
            max_size=None,
            proxy=None,
        )

    def viewer(self, window: str) -> PanelReader:
        """The frame of a window in which its scene is seen."""
        return PanelReader(self.socket(f"/scene/{window}", VISER))

    def show(self, window: str, **sent: object) -> None:
        answer = self.client.post("/api/scene/show", json=sent, headers={"x-studio-window": window})
        assert answer.status_code == 204, answer.text


@pytest.fixture
def control() -> RecordingControl:
    return RecordingControl()


@pytest.fixture
def windows(
    workspace: Workspace, control: RecordingControl, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Windows]:
    monkeypatch.setattr(web_app, "SWEEP_SECONDS", 0.05)
    scenes = WindowScenes(workspace, control)
    with serving(build_app(workspace, control, scenes, Tokens(TOKEN))) as base, let_in(base, TOKEN) as client:
        yield Windows(base, client, scenes, control)


@pytest.mark.slow
def test_ten_windows_on_ten_runs_each_show_their_own(windows: Windows, runs: list[str]) -> None:
    with ExitStack() as stack:
        viewers = {}
        for name in runs:
            windows.show(f"window-of-{name}", session="take1", run=name)
            viewers[name] = windows.viewer(f"window-of-{name}")
            stack.enter_context(viewers[name].socket)
        for number, name in enumerate(runs):
            seen = viewers[name]
            seen.until(lambda seen, name=name: f"take1 / {name}" in seen.words)
            seen.until(lambda seen, number=number: seen.knob(SURVIVAL) == survival_of(number))
        shown = {window: scene.shown for window, scene in windows.scenes.open_scenes().items()}
        assert {window: one.run for window, one in shown.items()} == {
            f"window-of-{name}": name for name in runs
        }
        # One window moves on; the others stay.
        windows.show("window-of-run-3", session="take1", run="run-8", layer=2)
        viewers["run-3"].until(lambda seen: "take1 / run-8" in seen.words)
        viewers["run-3"].until(lambda seen: seen.knob(SURVIVAL) == survival_of(8))
        for number, name in enumerate(runs):
            if name != "run-3":
                viewers[name].read()
                assert f"take1 / {name}" in viewers[name].words
                assert viewers[name].knob(SURVIVAL) == survival_of(number)
                assert windows.scenes.scene(f"window-of-{name}").shown == shown[f"window-of-{name}"]


def test_frames_layers_options_and_edits_are_a_window_s_own(windows: Windows, runs: list[str]) -> None:
    for window, name in zip("abc", runs, strict=False):
        windows.show(window, session="take1", run=name)
    windows.show("a", frame=1, layer=2, follow=False, options={"trails": False}, dark=False)
    windows.show("b", layer=0, look_through="cam2")
    edit = {"session": "take1", "run": runs[2], "frame": 3}
    own = {name: {"x-studio-window": name} for name in "abc"}
    windows.post("/api/scene/edit", edit, headers=own["c"], code=202)
    a, b, c = (windows.scenes.scene(name) for name in "abc")
    until(lambda: (a.shown.run, a.shown.layer, a.shown.follow) == ("run-0", 2, False))
    until(lambda: (b.shown.run, b.shown.layer, b.shown.look_through) == ("run-1", 0, "cam2"))
    until(lambda: c.shown.editing)
    response = {name: windows.get("/api/scene/edit", headers=own[name]) for name in "abc"}
    assert [response[name]["editing"] for name in "abc"] == [False, False, True]
    assert (a.shown.look_through, c.shown.layer, c.shown.run) == (None, None, "run-2")
    until(lambda: not a._controller.model.options.dark)
    assert b._controller.model.options.dark
    assert b._controller.model.options.trails
    windows.delete("/api/scene/edit", headers=own["a"])
    assert windows.get("/api/scene/edit", headers=own["c"])["editing"]


def test_knobs_that_come_into_use_are_seen_where_their_run_is_shown(
    windows: Windows, runs: list[str]
) -> None:
    seen = {}
    with ExitStack() as stack:
        for window, name in (("a", runs[1]), ("b", runs[2]), ("c", runs[1])):
            windows.show(window, session="take1", run=name)
            seen[window] = windows.viewer(window)
            stack.enter_context(seen[window].socket)
            seen[window].until(lambda one: one.knob(SURVIVAL) is not None)
        windows.control.say(state_of("take1", runs[1], "paused"))
        windows.control.say(SettingsApplied("take1", runs[1], 2, 0, 0, {"survival": 0.88}, ("survival",)))
        for window in "ac":
            seen[window].until(lambda one: one.knob(SURVIVAL) == 0.88)
        windows.show("b", layer=1)
        until(lambda: windows.scenes.scene("b").shown.layer == 1)
        seen["b"].read()
        assert seen["b"].knob(SURVIVAL) == survival_of(2)


def test_a_scene_reports_its_moves_to_its_own_window_only(windows: Windows, runs: list[str]) -> None:
    with windows.socket("/api/events?window=a") as mine, windows.socket("/api/events?window=b") as other:
        for window, name in (("a", runs[0]), ("b", runs[1])):
            windows.show(window, session="take1", run=name)
        until(lambda: all(windows.scenes.scene(window).shown.run for window in "ab"))
        windows.scenes.scene("a")._controller.post(lambda model: select(model, layer=3))
        # The same for all, after it: what comes to the other window before this is all that it was sent.
        until(lambda: windows.scenes.scene("a").shown.layer == 3)
        windows.post("/api/sessions/take1/duplicate", {"name": "end"})

        def before_the_end(socket: ClientConnection) -> list[dict]:
            heard = []
            while not heard or heard[-1]["type"] != "sessions":
                heard.append(json.loads(socket.recv(timeout=60)))
            return [event for event in heard if event["type"] == "scene"]

        assert [(event["run"], event["layer"]) for event in before_the_end(mine)] == [("run-0", 3)]
        assert before_the_end(other) == []


def test_a_run_that_is_deleted_leaves_every_window_that_shows_it(windows: Windows, runs: list[str]) -> None:
    for window, name in (("a", "run-0"), ("b", "run-1"), ("c", "run-0")):
        windows.show(window, session="take1", run=name)
    scenes = windows.scenes.open_scenes()
    until(lambda: all(scenes[window].shown.run for window in "abc"))
    windows.delete("/api/sessions/take1/runs/run-0")
    until(lambda: [scenes[window].shown.run for window in "abc"] == ["", "run-1", ""])


@pytest.mark.slow
def test_a_window_that_is_gone_frees_its_scene_and_one_that_is_loaded_again_finds_it(
    windows: Windows, runs: list[str]
) -> None:
    freed, threads = [], []
    for number in range(3):
        with windows.socket(f"/api/events?window=w{number}"), windows.viewer(f"w{number}").socket:
            windows.show(f"w{number}", session="take1", run=runs[number])
            scene = windows.scenes.scene(f"w{number}")
            until(lambda scene=scene: scene.shown.run)
            freed += [weakref.ref(scene), weakref.ref(scene._controller), weakref.ref(scene._server)]
            threads += [scene._controller._thread, scene._server._websock_server._server_thread]
    assert all(thread.is_alive() for thread in threads)
    # Loaded again, it is as it was; without a view of the scene it is kept as long as the page hears events.
    with windows.socket("/api/events?window=w2") as events:
        events.recv(timeout=60)
        windows.scenes.grace = 0.0
        until(lambda: set(windows.scenes.open_scenes()) == {"w2"})
        assert windows.scenes.scene("w2") is scene
        assert scene.shown.run == runs[2]
    until(lambda: not windows.scenes.open_scenes())
    del scene
    until(lambda: not any(thread.is_alive() for thread in threads))
    threads.clear()
    until(lambda: gc.collect() >= 0 and not any(kept() for kept in freed))
    windows.control.say(state_of())
    assert len(windows.control.watchers._subscriptions) == 1, "the event stream's own"


def test_the_number_of_scenes_is_bounded(workspace: Workspace, control: RecordingControl) -> None:
    scenes = WindowScenes(workspace, control, most=3)
    with serving(build_app(workspace, control, scenes, Tokens(TOKEN))) as base, let_in(base, TOKEN) as client:
        made = Windows(base, client, scenes, control)
        for name in "abc":
            made.show(name, session="take1")
        made.show("a")
        made.show("d", session="take1")
        assert set(scenes.open_scenes()) == {"a", "c", "d"}, "what was used longest ago made room"
        with ExitStack() as stack:
            seen = [made.viewer(name) for name in "acd"]
            for one in seen:
                stack.enter_context(one.socket)
            until(lambda: all(scene.is_viewed for scene in scenes.open_scenes().values()))
            refused = client.post("/api/scene/show", json={}, headers={"x-studio-window": "e"})
            assert refused.status_code == 503
            assert refused.json()["message"].startswith("3 windows show a scene already")
            assert "Close a window" in refused.json()["hint"]
            with pytest.raises((ConnectionClosed, InvalidStatus)):
                made.viewer("e")
            with pytest.raises(TooManyScenesError):
                scenes.scene("e")
    assert not scenes.open_scenes()


def test_half_of_the_scenes_are_kept_for_the_owner(
    workspace: Workspace, control: RecordingControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever viewers show, trials beside a scene included."""
    monkeypatch.setattr(SceneServer, "is_viewed", True)
    scenes = WindowScenes(workspace, control, most=4)
    try:
        scenes.scene("v1", bare=True)
        scenes.split("v1", True)
        with pytest.raises(TooManyScenesError, match=r"2 windows show a scene already, .* to viewers"):
            scenes.scene("v2", bare=True)
        scenes.scene("a")
        scenes.split("a", True)
        with pytest.raises(TooManyScenesError, match="4 windows"):
            scenes.scene("b")
    finally:
        scenes.stop()


def test_a_window_is_named_by_letters_and_digits(windows: Windows) -> None:
    for name in ("a b", "ä", "../x", "x" * 65):
        windows.post("/api/scene/show", {}, headers={"x-studio-window": name.encode()}, code=422)
    assert not windows.scenes.open_scenes()
