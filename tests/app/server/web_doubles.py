"""Stand-ins for the tracking process and the scene that keep their contracts, and a server in a thread."""

import socket
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import httpx
import numpy as np
import uvicorn
from api_driver import ApiDriver
from fastapi import FastAPI

from studio.app.scene.model import LayerPlayback, LiveSearch, Selection
from studio.app.scene.scene_pictures import Film, Report, UnseenSceneError
from studio.body.model import BodyModel
from studio.foundations.arrays import Bytes
from studio.operations.jobs.commands import ChangeSettings, Command
from studio.operations.jobs.events import Event, RunState, StateChanged
from studio.operations.jobs.process import ProcessDiedError
from studio.operations.jobs.watchers import Subscription, Watchers
from studio.sessions.workspace import Workspace

NAN = float("nan")
TOKEN = "a-token-that-only-this-test-knows_0123456789"
VIEWERS_TOKEN = "of-those-who-may-only-look"


def state_of(session: str = "", run: str = "", state: str = "idle") -> StateChanged:
    """A state with nothing measured."""
    return StateChanged(session, run, RunState(state), 0, 0, 0, 4, 0, NAN, NAN)


class RecordingControl:
    """A tracking process that does nothing but note what it was told."""

    def __init__(self) -> None:
        self.watchers = Watchers()
        self.state = state_of()
        self.commands: list[Command] = []
        self.changes: list[dict[str, object]] = []
        self.calls: list[str] = []

    def start(self) -> None:
        self.calls.append("start")

    def send(self, command: Command) -> None:
        if self.state.state == "lost":
            if not command.run:
                raise ProcessDiedError("The tracking process has died.", "Resume.")
            self.restart(resume=False)
        self.commands.append(command)

    def request(self, command: Command) -> None:
        self.send(command)
        if isinstance(command, ChangeSettings):
            self.changes.append(dict(command.changes))

    def subscribe(self, wanted: Callable[[Event], bool] = lambda _: True) -> Subscription:
        return self.watchers.subscribe(wanted)

    def restart(self, resume: bool = True) -> None:
        self.calls.append(f"restart resume={resume}")
        self.state = state_of()

    def close(self) -> None:
        self.calls.append("close")

    def say(self, event: Event) -> None:
        """Let the process say something."""
        if isinstance(event, StateChanged):
            self.state = event
        self.watchers.publish(event)


class UnseenPictures:
    """Pictures of a scene that no browser shows."""

    def take(self, scale: float = 2.0, *, transparent: bool = False) -> Bytes:
        raise UnseenSceneError("No browser shows this scene.", "Open the studio, then try again.")

    def film(self, film: Film, place: Path, report: Report) -> int:
        raise UnseenSceneError("No browser shows this scene.", "Open the studio, then try again.")


@dataclass
class RecordingStage:
    """A window's scene that notes what it is asked to show; `port` may be that of any WebSocket server."""

    port: int = 0
    headers: Mapping[str, str] = field(default_factory=dict)
    calls: list[tuple[object, ...]] = field(default_factory=list)
    editing: SimpleNamespace | None = None
    shown: Selection = field(default_factory=Selection)

    def relay_headers(self) -> Mapping[str, str]:
        return self.headers

    layers: LayerPlayback = field(default_factory=LayerPlayback)

    def show_run(
        self,
        session: str,
        run: str = "",
        frame: int | None = None,
        layer: int | None = None,
        *,
        is_scrubbed: bool = True,
    ) -> None:
        self.calls.append(("run", session, run, frame, layer, *(() if is_scrubbed else ("goes on",))))

    @property
    def poses(self) -> "RecordingPoses":
        return RecordingPoses(self)

    def show_frame(self, frame: int) -> None:
        self.calls.append(("frame", frame))

    def show_layer(self, layer: int | None) -> None:
        self.calls.append(("layer", layer))

    def follow(self, following: bool) -> None:
        self.calls.append(("follow", following))

    def look_through(self, camera: str | None) -> None:
        self.calls.append(("look_through", camera))

    def select(self, **changes: object) -> None:
        self.calls.append(("select", changes))

    def look_from(self, eye: Sequence[float] | None) -> None:
        self.calls.append(("eye", eye))

    def discard_what_if(self) -> None:
        self.calls.append(("discard",))

    def show_ghosts(self, ghosts: Sequence[tuple[str, Sequence[float]]]) -> None:
        self.calls.append(("ghosts", [colour for colour, _ in ghosts]))

    def show_trial(self, trial: LiveSearch | None) -> None:
        self.calls.append(("trial", None, 0) if trial is None else ("trial", trial.frame, len(trial.records)))

    def try_body(self, session: str, body: BodyModel | None) -> None:
        self.calls.append(("try_body", session, body and (body.name, dict(body.dimensions))))

    def set_options(self, **changes: object) -> None:
        self.calls.append(("options", changes))

    def point(self, at: tuple[float, float] | None, choose: bool = False) -> None:
        self.calls.append(("point", at, choose))

    @property
    def pictures(self) -> "UnseenPictures":
        return UnseenPictures()

    def play(
        self, playing: bool | None = None, *, speed: float | None = None, loop: bool | None = None
    ) -> None:
        self.calls.append(("play", playing))

    def play_layers(
        self, playing: bool | None = None, *, rate: float | None = None, mode: str | None = None
    ) -> None:
        self.calls.append(("play layers", playing, rate, mode))


@dataclass
class RecordingScenes:
    """The scenes of all windows; that of no window in particular is `plain`."""

    plain: RecordingStage = field(default_factory=RecordingStage)
    by_window: dict[str, RecordingStage] = field(default_factory=dict)
    moved: Callable[[str, Selection, LayerPlayback], None] | None = None
    unused: list[set[str]] = field(default_factory=list)

    def scene(self, window: str, bare: bool = False) -> RecordingStage:
        return self.by_window.setdefault(window, RecordingStage() if window else self.plain)

    def twin(self, window: str) -> RecordingStage | None:
        return self.by_window.get(f"{window}-tried")

    def split(self, window: str, is_split: bool) -> None:
        self.scene(window).calls.append(("split", is_split))
        if is_split:
            self.scene(f"{window}-tried")
        else:
            self.by_window.pop(f"{window}-tried", None)

    def open_scenes(self) -> Mapping[str, RecordingStage]:
        return self.by_window

    def watch(self, moved: Callable[[str, Selection, LayerPlayback], None]) -> None:
        self.moved = moved

    def close_unused(self, windows: Collection[str]) -> None:
        self.unused.append(set(windows))

    def stop(self) -> None:
        self.by_window.clear()


@dataclass
class RecordingPoses:
    """Poses that are laid before nobody."""

    stage: RecordingStage

    @property
    def editing(self) -> SimpleNamespace | None:
        return self.stage.editing

    def propose(self, session: str, pose: Sequence[float], said: str, frame: int | None = None) -> None:
        self.stage.calls.append(("pose", session, tuple(pose), said, frame))

    def edit(
        self, session: str, run: str = "", frame: int | None = None, pose: Sequence[float] | None = None
    ) -> None:
        given = np.zeros(4) if pose is None else np.array(pose)
        self.stage.editing = SimpleNamespace(
            session=session,
            run=run,
            frame=frame,
            pose=given,
            moved=pose is not None,
            steps=int(pose is not None),
        )

    def undo(self) -> None:
        self.stage.calls.append(("undo",))

    def leave(self) -> None:
        self.stage.editing = None


@dataclass
class Studio(ApiDriver):
    """A served application with everything that stands behind it."""

    base: str
    control: RecordingControl
    scenes: RecordingScenes
    workspace: Workspace
    app: FastAPI
    log_path: Path

    @property
    def stage(self) -> RecordingStage:
        """The scene of callers that name no window."""
        return self.scenes.plain


@contextmanager
def serving(app: FastAPI) -> Iterator[str]:
    """The application behind a real server on a free loopback port; yields its address."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(32)
    started = threading.Event()

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            started.set()

    config = uvicorn.Config(app, log_config=None, access_log=False, ws="auto", timeout_graceful_shutdown=2)
    server = Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        assert started.wait(120.0), "the server did not start"
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(30.0)
        listener.close()
        assert not thread.is_alive(), "the server did not stop"


@contextmanager
def let_in(base: str, token: str) -> Iterator[httpx.Client]:
    """A browser's client that opened the printed address: it has the cookie and names its origin."""
    with httpx.Client(base_url=base, headers={"origin": base}, timeout=120.0) as client:
        answer = client.get("/", params={"token": token})
        assert answer.status_code == 303, answer.text
        yield client


def cookie_header(client: httpx.Client) -> str:
    """The client's cookies, for a WebSocket."""
    return "; ".join(f"{name}={value}" for name, value in client.cookies.items())
