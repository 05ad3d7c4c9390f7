"""What the routes need of the storeys beside and below: the tracking process, the scene, and where things
lie.

`WindowScene` is a protocol because the scene is a room on the same storey, which this one may not see; `launch`
brings them together.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Protocol

from fastapi import Depends, Request

from studio.body.model import BodyModel
from studio.export.task import Writer
from studio.inspection.likelihoods import forget_evaluations
from studio.jobs.camera_service import CameraService
from studio.jobs.commands import Close, Command
from studio.jobs.events import Event, StateChanged
from studio.jobs.job_runner import JobRunner
from studio.jobs.watchers import Subscription
from studio.runs.overlay_pictures import forget_composers
from studio.server.access import VIEWING
from studio.server.calibration_proposals import Proposals
from studio.server.event_stream import EventStream
from studio.server.windows import Window
from studio.sessions.session import RUNS_NAME
from studio.sessions.workspace import Workspace

Value = bool | int | float | str

STATE_NAME = ".studio"


class Control(Protocol):
    """The tracking process as its owner sees it (`worker.control.StudioControl`)."""

    @property
    def state(self) -> StateChanged:
        """Where the search stands, or stood when the process was last heard of."""
        ...

    def start(self) -> None:
        """Start the process ahead of the first command."""
        ...

    def send(self, command: Command) -> None:
        """Post a command; an `Acknowledged` event follows. Raises RunError if the process has died."""
        ...

    def request(self, command: Command) -> object:
        """Post a command and wait until it is acknowledged. Raises what it was refused with."""
        ...

    def subscribe(self, wanted: Callable[[Event], bool] = ...) -> Subscription[Event]:
        """All events from now on that are wanted."""
        ...

    def restart(self, resume: bool = True) -> None:
        """Start the process again after it died; resume : track on if it was tracking."""
        ...

    def close(self) -> None:
        """End the process."""
        ...


class SceneFrame(Protocol):
    """A frame of a run, or a session without any."""

    @property
    def session(self) -> str: ...

    @property
    def run(self) -> str: ...

    @property
    def frame(self) -> int | None: ...


class Shown(SceneFrame, Protocol):
    """What the scene shows, when its own controls moved it (`scene.model.Selection`)."""

    @property
    def layer(self) -> int | None: ...

    @property
    def limb(self) -> str | None: ...

    @property
    def parameter(self) -> str | None: ...

    @property
    def particle(self) -> int | None: ...

    @property
    def camera(self) -> str | None: ...

    @property
    def look_through(self) -> str | None: ...

    @property
    def eye(self) -> tuple[float, ...] | None: ...

    @property
    def follow(self) -> bool: ...

    @property
    def editing(self) -> bool: ...

    @property
    def request_number(self) -> int: ...


class EditedPose(SceneFrame, Protocol):
    """What is being edited in the scene (`scene.scene_server.Editing`)."""

    @property
    def pose(self) -> Iterable[float]: ...

    @property
    def moved(self) -> bool: ...


class ScenePoses(Protocol):
    """Poses laid before the scene's viewers (`scene.scene_server.ScenePoses`)."""

    @property
    def editing(self) -> EditedPose | None:
        """What is being edited, None while nothing is."""
        ...

    def propose(self, session: str, pose: Sequence[float], text: str, frame: int | None = None) -> None:
        """Show a start pose that was found for a session, and what is said of it."""
        ...

    def edit(
        self, session: str, run: str = "", frame: int | None = None, pose: Sequence[float] | None = None
    ) -> None:
        """Let a session's start pose be edited, or the right pose of a run's frame."""
        ...

    def leave(self) -> None:
        """Leave off editing."""
        ...


class WindowScene(Protocol):
    """A window's 3-D scene (`scene.scene_server.SceneServer`)."""

    @property
    def port(self) -> int:
        """The loopback port that it listens on."""
        ...

    def relay_headers(self) -> Mapping[str, str]:
        """The secret that whoever connects has to send."""
        ...

    @property
    def shown(self) -> Shown:
        """What is shown now."""
        ...

    def show_run(
        self, session: str, run: str = "", frame: int | None = None, layer: int | None = None
    ) -> None:
        """Show a session, a run of it, a frame, a layer's cloud."""
        ...

    @property
    def poses(self) -> ScenePoses:
        """Start poses that were found, and poses under a person's hands."""
        ...

    def show_frame(self, frame: int) -> None:
        """Show a stored frame."""
        ...

    def show_layer(self, layer: int | None) -> None:
        """Show one layer's cloud, or all."""
        ...

    def follow(self, following: bool) -> None:
        """Show each frame as it is tracked, or stay."""
        ...

    def look_through(self, camera: str | None) -> None:
        """Put the viewers into a camera's place, or back."""
        ...

    def select(self, **changes: object) -> None:
        """Choose a limb, parameter, particle or camera; None: none."""
        ...

    def look_from(self, eye: Sequence[float] | None) -> None:
        """Put the viewers' eyes at a place, looking at another: (6,) metres; None: the usual place."""
        ...

    def discard_what_if(self) -> None:
        """Forget the frame that was annealed again."""
        ...

    def show_ghosts(self, ghosts: Sequence[tuple[str, Sequence[float]]]) -> None:
        """Draw bodies beside the answer until another frame is shown."""
        ...

    def try_body(self, session: str, body: BodyModel | None) -> None:
        """Show a body that is being made in place of a session's own, or ("") alone; None: no longer."""
        ...

    def set_options(self, **changes: object) -> None:
        """Change what is drawn. Raises SettingsError for a name that is none."""
        ...

    def play(
        self, playing: bool | None = None, *, speed: float | None = None, loop: bool | None = None
    ) -> None:
        """Play stored frames, or stop, and how; None leaves it."""
        ...


class Scenes(Protocol):
    """The scenes of all windows (`scene.window_scenes.WindowScenes`)."""

    record_scene: Writer
    """Writes a run's scene as a recording, beside those that are shown."""

    def scene(self, window: str, bare: bool = False) -> WindowScene:
        """The scene of a window, built where there is none yet. bare : without controls. Raises TooManyScenesError
        (503).
        """
        ...

    def open_scenes(self) -> Mapping[str, WindowScene]:
        """The scenes that there are, by window."""
        ...

    def watch(self, moved: Callable[[str, Shown], None]) -> None:
        """Call `moved` with the window and what it shows whenever a scene's own controls move it."""
        ...

    def close_unused(self, windows: Collection[str]) -> None:
        """Close the scenes whose window is gone. windows : those that are known to be there."""
        ...

    def stop(self) -> None:
        """Close all scenes."""
        ...


@dataclass(slots=True)
class AppState:
    """Everything a route may use, kept in `app.state.studio`.

    scenes : of all windows. footage_roots : folders that may be imported from. log_path :
    the server's log file. proposals : calibrations not in use yet. uploads : those under way, by their identifiers.
    jobs : work in the background. cameras : where live ones are looked at and recorded.
    """

    workspace: Workspace
    control: Control
    scenes: Scenes
    events: EventStream
    footage_roots: tuple[Path, ...] = ()
    log_path: Path | None = None
    proposals: Proposals = field(default_factory=Proposals)
    uploads: dict[str, dict[str, int]] = field(default_factory=dict[str, dict[str, int]])
    jobs: JobRunner = field(init=False)
    cameras: CameraService = field(init=False)

    def __post_init__(self) -> None:
        """Give all work beside the routes its place, which reports its progress to all watchers."""
        self.jobs = JobRunner(self.events.publish, self.log_path)
        self.cameras = CameraService(self.jobs)

    @property
    def state_folder(self) -> Path:
        """Where the server keeps what is its own: preferences, presets, unfinished uploads."""
        return self.workspace.root / STATE_NAME


def app_state(request: Request) -> AppState:
    """What routes use, as their dependency."""
    return request.app.state.studio


App = Annotated[AppState, Depends(app_state)]


def scene_of(app: App, window: Window = "") -> WindowScene:
    """The scene of the requesting window, as a dependency of routes."""
    return app.scenes.scene(window, VIEWING.get())


Scene = Annotated[WindowScene, Depends(scene_of)]


def release(app: AppState, session: str, run: str = "") -> None:
    """Free a session (or only a run of it) for renaming or deleting: footage, results and scene are closed.

    Raises RunError while the run is being tracked, or trackers are being compared on the session.
    """
    if not run:
        app.jobs.check_movable(session)
    state, folder = app.control.state, app.workspace.root / session
    # Else the process itself knows whether that is what it has open; a search elsewhere is not waited for.
    if state.state != "lost" and (state.session == session or state.state not in ("tracking", "compiling")):
        app.control.request(Close(session=str(folder), run=str(folder / RUNS_NAME / run) if run else ""))
    for scene in app.scenes.open_scenes().values():
        if scene.shown.session == session and (not run or scene.shown.run == run):
            scene.show_run(session if run else "")
    forget_composers()
    forget_evaluations()
